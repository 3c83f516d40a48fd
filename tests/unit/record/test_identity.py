"""Identity: what must change a digest does, and nothing else does."""

import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from pydantic import BaseModel

from mimo.record import identity
from mimo.record.identity import IdentityError


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """A small package: experiment -> world -> body (within a function), experiment -> rewards -> outcomes."""
    sources = {
        "__init__": '"""Package."""\n',
        "experiment": "from mimo import rewards\nfrom mimo.settings import params\nimport mimo.world\nN = 2500\n",
        "world": "import numpy\n\nclass World:\n    def start(self):\n        import mimo.body\n",
        "body": "MASS = 10.9\n",
        "rewards": "from .outcomes import w1\n",
        "outcomes": "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from mimo.eye import Eye\n",
        "settings/__init__": "from mimo.eye import Eye\n",
        "settings/params": "from mimo.eye import Eye\n",
        "eye": "class Eye: ...\n",
    }
    (tmp_path / "mimo/settings").mkdir(parents=True)
    for name, source in sources.items():
        (tmp_path / "mimo" / f"{name}.py").write_text(source)
    return tmp_path


def edit(root: Path, module: str, old: str, new: str) -> None:
    path = root / "mimo" / f"{module}.py"
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new))


def test_line_ends_do_not_count(root: Path) -> None:
    """Some editors and clones bring others; text over several lines is then one value all the same."""
    edit(root, "body", "MASS = 10.9\n", 'MASS = 10.9\nTEXT = """one\ntwo"""\n')
    before = identity.code("mimo.experiment", root=root)
    for path in root.rglob("*.py"):
        path.write_bytes(path.read_bytes().replace(b"\n", b"\r\n"))
    assert identity.code("mimo.experiment", root=root) == before


def test_imports_are_followed(root: Path) -> None:
    found = identity.code("mimo.experiment", root=root)
    assert list(found) == ["mimo", *(f"mimo.{name}" for name in ("body", "experiment", "outcomes", "rewards", "world"))]


@pytest.mark.parametrize(
    ("module", "old", "new"),
    [
        ("body", "MASS = 10.9", "MASS  =  10.90 # kg"),
        ("body", "MASS", '"""Body.\n\nTable."""\nMASS'),
        ("body", "10.9\n", '10.9\n"""kg"""\n'),
        ("world", "class World:\n", 'class World:\n    """A world."""\n\n'),
        ("world", "(self):\n", '(self):\n        """Start."""\n'),
        ("outcomes", "import Eye", "import Eye, Nose"),
        ("settings/params", "import Eye", "import Nose"),
        ("settings/__init__", "import Eye", "import Nose"),
        ("eye", "...", "size = 128"),
    ],
)
def test_comments_docstrings_formatting_and_type_checking_do_not_count(
    root: Path, module: str, old: str, new: str
) -> None:
    before = identity.code("mimo.experiment", root=root)
    edit(root, module, old, new)
    assert identity.code("mimo.experiment", root=root) == before


def test_every_python_spells_a_tree_alike(root: Path) -> None:
    """The hash is that of 3.11, 3.12 and 3.13, which differ in how they quote, and in what they write of a node."""
    source = """
import numpy as np
class A(list, metaclass=type):
    x: int = 1 if None else -2.5e-3
    def f(self, a, /, b=(), *c, d=[], **e): return f"{a!r:>{b}} {c['k']} {{}}" f"{d=}" + 'é' * 2
@property
async def g(y):
    async with y as (z, *_): yield {k: v for k, v in z if (n := k)} or {**z}
    match y:
        case {"a": [1, *_], **r} | A(x=0): raise ValueError("a\\n\\x00") from None
    try: pass
    except* OSError: global h
    return lambda: (b"\\xff", 1j, ..., True, y[1:, ::2])
"""
    (root / "mimo/odd.py").write_text(source)
    assert (
        identity.code("mimo.odd", root=root)["mimo.odd"]
        == "a91b27d1dfd6fc81f1c5a352ce0bf45b2937835d22cdf7d60913c593ca489f5b"
    )


def test_a_build_of_a_library_is_its_release(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, version in (("here-one", "2.13.0+cpu"), ("here-two", "2.13.0")):
        folder = tmp_path / f"{name.replace('-', '_')}-{version}.dist-info"
        folder.mkdir()
        (folder / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n")
    monkeypatch.syspath_prepend(tmp_path)
    assert [identity.release(name) for name in ("here-one", "here-two")] == ["2.13.0", "2.13.0"]
    assert identity.build("here-one") == "2.13.0+cpu"


def test_a_constant_counts_in_its_module_alone(root: Path) -> None:
    before = identity.code("mimo.experiment", root=root)
    edit(root, "body", "10.9", "11.0")
    after = identity.code("mimo.experiment", root=root)
    assert {name for name in after if after[name] != before[name]} == {"mimo.body"}


def test_several_modules_count_with_all_that_each_imports(root: Path) -> None:
    world, rewards = (identity.code(f"mimo.{name}", root=root) for name in ("world", "rewards"))
    assert "mimo.body" in world.keys() - rewards.keys()
    assert identity.code("mimo.rewards", "mimo.world", root=root) == world | rewards


def test_relative_imports_and_packages(root: Path) -> None:
    (root / "mimo/deep").mkdir()
    (root / "mimo/deep/__init__.py").write_text("from .. import body\n")
    (root / "mimo/deep/inner.py").write_text("from . import other\nfrom ..eye import Eye\n")
    (root / "mimo/deep/other.py").write_text("import mimology, numpy as mimo\n")
    found = identity.code("mimo.deep.inner", root=root)
    assert list(found) == ["mimo", "mimo.body", "mimo.deep", "mimo.deep.inner", "mimo.deep.other", "mimo.eye"]


def test_faults_are_named(root: Path) -> None:
    with pytest.raises(IdentityError, match=r"no module mimo\.nose"):
        identity.code("mimo.nose", root=root)
    edit(root, "body", "=", "= =")
    with pytest.raises(IdentityError, match=r"body\.py is not Python"):
        identity.code("mimo.body", root=root)


def test_the_same_in_another_process() -> None:
    script = """
from mimo.record import identity
print(identity.Digest(identity.code("mimo.record.streams") | identity.versions()))
"""
    run = subprocess.run([sys.executable, "-c", script], cwd=identity.ROOT, capture_output=True, check=True, text=True)
    assert run.stdout.strip() == identity.Digest(identity.code("mimo.record.streams") | identity.versions())


def test_canonical_is_one_spelling() -> None:
    class Point(BaseModel):
        x: float
        tags: tuple[str, ...]

    assert identity.canonical({"b": (1, 2.5), "a": Point(x=0, tags=("é",))}) == (
        b'{"a":{"tags":["\\u00e9"],"x":0.0},"b":[1,2.5]}'
    )
    assert identity.Digest({"a": 1, "b": {"c": 2, "d": 3}}) == identity.Digest({"b": {"d": 3, "c": 2}, "a": 1})
    assert identity.Digest({"a": np.float64(0.1), "b": np.int32(3)}) == identity.Digest({"a": 0.1, "b": 3})
    # SHA-256 of '{"a":1}', as `printf '{"a":1}' | sha256sum` gives it.
    assert identity.Digest({"a": 1}) == "015abd7f5cc57a2dd94b7590f04ad8084273905ee33ec5cebeae62276a97f862"


def test_types_count() -> None:
    values = (1, 1.0, True, "1", None, [1], -0.0, 0.0)
    assert len({identity.Digest({"x": value}) for value in values}) == len(values)


@pytest.mark.parametrize(
    "value", [math.nan, [math.inf], np.float32("nan"), {1: 2}, {"a": {None: 1}}, {1, 2}, b"", Path()]
)
def test_what_has_no_stable_spelling_is_refused(value: object) -> None:
    with pytest.raises(IdentityError):
        identity.canonical({"x": value})


def test_versions_are_of_what_is_installed() -> None:
    found = identity.versions()
    assert set(found) == {"mujoco", "torch", "numpy", "numba"}
    assert found["numpy"] == np.__version__
