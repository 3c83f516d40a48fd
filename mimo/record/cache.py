"""Where compiled kernels are kept, once a machine, and the one line that says that they are being compiled.

A kernel's file is named by all that its compiled code comes from, as this process has it: the code of the function and
of the kernels that it calls, the constants in them, types, processor, releases. So neither an edit nor another place,
processor or process can bring in code that does not belong; numba's own index looks at the kernel's own file alone.
Whatever goes wrong with a file costs the compiling, and nothing else.
"""

import hashlib
import os
import pickle
import platform
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any

import llvmlite
import numba
import platformdirs
from numba.core import caching, compiler, event, serialize

from mimo.record import artifact
from mimo.record.runtime import KernelError

UNUSED = 90 * 86400  # s after which a file that no process has loaded is dropped


def _folder() -> Path | None:
    if own := os.environ.get("NUMBA_CACHE_DIR"):
        return Path(own)
    try:
        return Path(platformdirs.user_cache_dir("mimo-agency"), "kernels")
    except RuntimeError:  # a user without a home
        return None


FOLDER = _folder()


def keep(kernel: Any) -> None:
    """Have a kernel kept.

    Raises:
        KernelError: numba does not compile in this process, and Python would round otherwise.
    """
    if numba.config.DISABLE_JIT:  # type: ignore[attr-defined]
        raise KernelError("numba came before mimo, with NUMBA_DISABLE_JIT set; unset it.")
    kernel._cache = _Kept(kernel.py_func)


class _Kept(caching.NullCache):
    """Of one kernel, as numba asks for it: a file for each of its signatures."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        target_context.refresh()
        try:
            path = self._path(sig, target_context)
            if not _ours(path):
                return None
            # As numba itself does; compiled code is no safer in another form, and nobody else can have written it.
            held = pickle.loads(path.read_bytes())  # noqa: S301
            found = compiler.CompileResult._rebuild(target_context, *held)  # type: ignore[no-untyped-call]
        except Exception:  # not there, damaged, not for us to read: it is compiled
            return None
        with suppress(OSError):
            os.utime(path)
        return found

    def save_overload(self, sig: Any, cres: Any) -> None:
        if cres.lifted or cres.library.has_dynamic_globals:
            return
        with suppress(OSError, TypeError, artifact.ArtifactError):  # no room, no right, no folder
            path = self._path(sig, cres.target_context)
            _drop_unused(path.parent)
            artifact.publish(serialize.dumps(cres._reduce()), path)  # type: ignore[no-untyped-call]
            path.chmod(0o600)

    def _path(self, sig: Any, target_context: Any) -> Path:
        releases = (numba.__version__, llvmlite.__version__, platform.python_version())
        made = hashlib.sha256(repr((releases, target_context.codegen().magic_tuple(), sig)).encode())
        for part in _parts(self._function, set()):
            made.update(repr(part).encode())
        return FOLDER / f"{self._function.__name__}-{made.hexdigest()[:32]}.kernel"  # type: ignore[operator]


def _parts(function: Callable[..., Any], seen: set[object]) -> Iterator[object]:
    """Code of a function and of the kernels below it, and the values of the names that they use."""
    if function in seen:
        return
    seen.add(function)
    code: CodeType = function.__code__
    yield (function.__module__, function.__qualname__, code.co_code, code.co_names, code.co_varnames)
    yield [const for const in code.co_consts if not isinstance(const, CodeType)]
    for name in code.co_names:
        value: Any = function.__globals__.get(name)
        if hasattr(value, "py_func"):
            yield from _parts(value.py_func, seen)
        elif isinstance(value, ModuleType | type):
            yield (name, value.__name__)
        elif value is not None:
            yield (name, value)


def _ours(path: Path) -> bool:
    """Whether this user alone can have written a file."""
    held = path.stat()
    return held.st_uid == os.getuid() and not held.st_mode & 0o022


def _drop_unused(folder: Path) -> None:
    for path in folder.glob("*.kernel"):
        if time.time() - path.stat().st_mtime > UNUSED:
            path.unlink(missing_ok=True)


class _Announcer(event.Listener):
    """Says, once a process, that kernels are being compiled: it takes seconds in which nothing else is seen."""

    said = False

    def on_start(self, event: Any) -> None:
        if not self.said and isinstance(event.data["dispatcher"]._cache, _Kept):
            self.said = True
            print(f"Compiling kernels for this processor, to be kept in {FOLDER}.", file=sys.stderr, flush=True)

    def on_end(self, event: Any) -> None:
        pass


event.register("numba:compile", _Announcer())  # type: ignore[no-untyped-call]
