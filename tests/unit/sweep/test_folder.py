"""Where Ray works: the first folder that is short enough and takes files; else what is wrong with each."""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from stages.base import console
from stages.sweep import folder


@pytest.fixture(autouse=True)
def _unset(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("RAY_TMPDIR", "TMPDIR"):
        monkeypatch.delenv(name, raising=False)


@pytest.fixture
def short() -> Iterator[Path]:
    """A folder whose path is short, which goes with the test."""
    place = Path(f"/tmp/short-{os.getpid()}")
    place.mkdir()
    yield place
    for inner in sorted(place.rglob("*"), reverse=True):
        inner.rmdir()
    place.rmdir()


def test_what_the_user_has_set_comes_first(short: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert folder.found() == Path(f"/tmp/ray-{os.getuid()}")
    monkeypatch.setenv("TMPDIR", str(short))
    assert folder.found() == short / "ray"
    monkeypatch.setenv("RAY_TMPDIR", str(short / "own"))
    assert folder.found() == short / "own/ray"


def test_a_folder_too_long_for_sockets_is_passed_over(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TMPDIR", str(tmp_path / ("long" * 30)))
    assert folder.found() == Path(f"/tmp/ray-{os.getuid()}")


def test_where_none_will_do_each_is_named_with_its_fault(
    short: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TMPDIR", long := str(tmp_path / ("long" * 30)))
    monkeypatch.setattr(folder, "ELSEWHERE", ("/dev/null", "/proc/1"))
    with pytest.raises(console.StageError) as fault:
        folder.found()
    assert str(fault.value) == (
        f"Ray finds no folder to work in: {long}/ray is too long for sockets, which may have 107 bytes; "
        f"/dev/null/ray-{os.getuid()} takes no files (Not a directory); "
        f"/proc/1/ray-{os.getuid()} takes no files (No such file or directory). "
        "Mend one, or set RAY_TMPDIR to another, or use --serial."
    )
