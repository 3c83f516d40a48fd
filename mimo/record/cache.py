"""Where compiled kernels are kept, once a machine, and the one line that says that they are being compiled.

A kernel is kept under a hash of the code that it is compiled from, its module and all that this imports. Wherever the
project lies, in a copy, another clone or on a node of a cluster, it is so compiled once, and anew when any of that
changes; numba by itself would look at the place and the text of the kernel's own file alone.
"""

import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
import platformdirs
from numba.core import caching, event

from mimo.record import identity
from mimo.record.runtime import KernelError

FOLDER = Path(os.environ.get("NUMBA_CACHE_DIR") or Path(platformdirs.user_cache_dir("mimo-agency"), "kernels"))


def keep(kernel: Any) -> None:
    """Have a kernel kept; where the folder takes no file, it is compiled each time, which costs that time alone."""
    before = numba.config.CACHE_LOCATOR_CLASSES  # type: ignore[attr-defined]
    numba.config.CACHE_LOCATOR_CLASSES = f"{__name__}.{_Place.__name__}"  # type: ignore[attr-defined]
    try:
        kernel.enable_caching()
    except AttributeError as fault:
        raise KernelError("numba came before mimo, with NUMBA_DISABLE_JIT set; unset it.") from fault
    except RuntimeError:
        _Announcer.kept = "as each time, since they cannot be kept"
    finally:
        numba.config.CACHE_LOCATOR_CLASSES = before  # type: ignore[attr-defined]


class _Place(caching._CacheLocator):
    """Of one kernel, as numba asks for it."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._stamp = identity.Digest({"code": identity.code(function.__module__)})

    def get_cache_path(self) -> str:
        return str(FOLDER / self._stamp[:16])

    def get_source_stamp(self) -> str:
        return str(self._stamp)

    def get_disambiguator(self) -> str:
        return "kernel"

    @classmethod
    def from_function(cls, function: Callable[..., Any], path: str) -> "_Place | None":
        place = cls(function)
        try:
            place.ensure_cache_path()  # type: ignore[no-untyped-call]
        except OSError:
            return None
        return place


class _Announcer(event.Listener):
    """Says, once a process, that kernels are being compiled: it takes seconds in which nothing else is seen."""

    said = False
    kept = f"they are kept in {FOLDER}"

    def on_start(self, event: Any) -> None:
        if not self.said:
            self.said = True
            print(f"Compiling kernels for this processor; {self.kept}.", file=sys.stderr, flush=True)

    def on_end(self, event: Any) -> None:
        pass


event.register("numba:compile", _Announcer())  # type: ignore[no-untyped-call]
