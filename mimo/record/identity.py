"""Identity: what a run's bytes depend on, as digests.

A run is found again, or computed again, by the SHA-256 of its inputs. Code counts by its syntax tree without
docstrings, so that a comment, a docstring or a reformatting computes nothing again; the tree is spelled alike by every
Python. Libraries count by their release, not by how it was built.
"""

import ast
import functools
import hashlib
import importlib.metadata
import json
import math
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

import numpy as np
from pydantic import BaseModel

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = "mimo"
LIBRARIES = {
    "mujoco": "mujoco-core",
    "torch": "torch",
    "numpy": "numpy",
    "numba": "numba",
}  # mujoco-core: MuJoCo's minimal distribution
# These decide no number: settings are only checked there, and enter a digest resolved; artifact.py and identity.py only
# store and name results (artifact.SCHEMA_VERSION refuses files of another layout), cache.py keeps compiled code.
EXCLUDED = ("mimo.settings", "mimo.record.identity", "mimo.record.artifact", "mimo.record.cache")


class IdentityError(ValueError):
    """Something has no stable identity; the message says what."""


def canonical(obj: object) -> bytes:
    """One spelling for one value: JSON with sorted keys, no spaces, ASCII only, floats by repr.

    Types count: 1 and 1.0 are two values, since code may treat them differently. The fields of params.yaml are typed,
    so writing 0 for 0.0 there changes nothing. Tuples and lists are one, numpy's scalars are Python's.

    Args:
        obj: None, booleans, numbers, text, lists, tuples, mappings with text keys, pydantic models, nested at will.

    Raises:
        IdentityError: NaN, infinity, a key that is no text, or any other type.
    """
    return json.dumps(_plain(obj), sort_keys=True, separators=(",", ":"), ensure_ascii=True).encode()


class Digest(str):
    """SHA-256 of canonical(inputs), in hexadecimal; it remembers the inputs, so that an artifact can keep them."""

    inputs: Mapping[str, object]

    def __new__(cls, inputs: Mapping[str, object]) -> "Digest":  # noqa: D102
        made = super().__new__(cls, hashlib.sha256(canonical(inputs)).hexdigest())
        made.inputs = inputs
        return made

    def __reduce__(self) -> "tuple[type[Digest], tuple[Mapping[str, object]]]":
        return Digest, (self.inputs,)


def code(*modules: str, root: Path = ROOT) -> dict[str, str]:
    """Hash the modules and all that they import from this package, directly or not.

    Imports are found in the source, also within functions, but not under `if TYPE_CHECKING:`; importlib's are not.
    A package's `__init__` counts with each of its modules, since importing them runs it. EXCLUDED, modules and all
    below packages, is passed over.

    Args:
        modules: dotted names, such as "mimo.world.physics".
        root: the folder that holds the package.

    Returns:
        SHA-256 of each module's syntax tree, in the order of names.

    Raises:
        IdentityError: a module is missing or is not Python.
    """
    hashes: dict[str, str] = {}
    pending = list(modules)
    while pending:
        module = pending.pop()
        if module in hashes or any(f"{module}.".startswith(f"{passed}.") for passed in EXCLUDED):
            continue
        path = _find(module, root)
        if path is None:
            raise IdentityError(f"There is no module {module} in {root}.")
        hashes[module], imports = _parse(path, path.read_text(encoding="utf-8"))
        pending += _named(module, imports, path.name == "__init__.py", root)
    return dict(sorted(hashes.items()))


def syntax(path: Path) -> str:
    """SHA-256 of one Python file's syntax tree, as `code` has it for a module; what it imports does not count.

    Raises:
        IdentityError: it is not Python.
    """
    return _parse(path, path.read_text(encoding="utf-8"))[0]


def versions() -> dict[str, str]:
    """Releases of the libraries that decide numbers, as installed.

    Raises:
        importlib.metadata.PackageNotFoundError: one is not.
    """
    return {name: release(distribution) for name, distribution in LIBRARIES.items()}


def release(distribution: str) -> str:
    """The installed version without its local label: PyTorch 2.13.0 for the builds 2.13.0+cpu and 2.13.0.

    Raises:
        importlib.metadata.PackageNotFoundError: it is not installed.
    """
    return build(distribution).partition("+")[0]


# Kept, since a sweep asks once a cell, and reading takes milliseconds.
@functools.cache
def build(distribution: str) -> str:
    """The installed version, local label and all.

    Raises:
        importlib.metadata.PackageNotFoundError: it is not installed.
    """
    return importlib.metadata.version(distribution)


def _plain(obj: object) -> object:
    if isinstance(obj, BaseModel):
        obj = obj.model_dump(mode="json")
    if isinstance(obj, np.generic):
        obj = obj.item()
    if obj is None or isinstance(obj, bool | int | str):
        return obj
    if isinstance(obj, float):
        if not math.isfinite(obj):
            raise IdentityError(f"{obj} has no place in a digest; look for what made it.")
        return obj
    if isinstance(obj, list | tuple):
        return [_plain(item) for item in obj]
    if isinstance(obj, Mapping):
        for key in obj:
            if not isinstance(key, str):
                raise IdentityError(f"{key!r} is no key for a digest; use text, since 1 and '1' would become one.")
        return {key: _plain(value) for key, value in obj.items()}
    raise IdentityError(f"{type(obj).__name__} has no place in a digest; use numbers, text, lists or mappings.")


class _Bare(ast.NodeTransformer):
    """Drops what runs nothing: docstrings, other text standing alone, and blocks for type checkers."""

    def visit_Expr(self, node: ast.Expr) -> ast.Expr | None:
        self.generic_visit(node)
        text = isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
        return None if text else node

    def visit_JoinedStr(self, node: ast.JoinedStr) -> ast.JoinedStr:
        self.generic_visit(node)
        # Early releases of Python 3.12 end a nested format with an empty text.
        node.values = [part for part in node.values if not (isinstance(part, ast.Constant) and part.value == "")]
        return node

    def visit_If(self, node: ast.If) -> ast.AST | list[ast.stmt]:
        self.generic_visit(node)
        test = node.test
        name = test.id if isinstance(test, ast.Name) else test.attr if isinstance(test, ast.Attribute) else None
        return node.orelse if name == "TYPE_CHECKING" else node


@functools.lru_cache(maxsize=256)  # a sweep asks for the same modules once a run
def _parse(path: Path, source: str) -> tuple[str, tuple[ast.Import | ast.ImportFrom, ...]]:
    """The hash of a module's syntax tree, and its imports."""
    try:
        tree = _Bare().visit(ast.parse(source))
    except (SyntaxError, ValueError) as fault:
        raise IdentityError(f"{path} is not Python: {fault}.") from None
    imports = tuple(node for node in ast.walk(tree) if isinstance(node, ast.Import | ast.ImportFrom))
    return hashlib.sha256(json.dumps(_spelled(tree)).encode()).hexdigest(), imports


def _spelled(node: object) -> object:
    """A syntax tree as lists and text: ast.dump and ast.unparse give each Python's release a spelling of its own."""
    if isinstance(node, ast.AST):
        # Absent and empty fields are one; later Pythons have more of them.
        fields = {name: _spelled(value) for name, value in ast.iter_fields(node) if value not in (None, [])}
        return [type(node).__name__, fields]
    return [_spelled(item) for item in node] if isinstance(node, list) else ascii(node)


def _named(module: str, imports: Iterable[ast.Import | ast.ImportFrom], package: bool, root: Path) -> Iterator[str]:
    """The modules of this package that `module` runs: its parents, then what its imports name."""
    parts = module.split(".")
    parents = (".".join(parts[:depth]) for depth in range(1, len(parts)))
    yield from (parent for parent in parents if _find(parent, root))
    for node in imports:
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        else:
            above = parts[: len(parts) - node.level + package] if node.level else []
            base = ".".join([*above, *([node.module] if node.module else [])])
            # `from mimo.world import physics` names a module, `from mimo.world.physics import World` does not.
            names = [base, *(name for alias in node.names if _find(name := f"{base}.{alias.name}", root))]
        yield from (name for name in names if name.split(".")[0] == PACKAGE)


def _find(module: str, root: Path) -> Path | None:
    if not f"{module}.".startswith(f"{PACKAGE}."):
        return None
    stem = root.joinpath(*module.split("."))
    return next((path for path in (stem.with_suffix(".py"), stem / "__init__.py") if path.is_file()), None)
