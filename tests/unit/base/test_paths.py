"""Whose store it is."""

import subprocess
from pathlib import Path

import pytest

from stages.base import paths


@pytest.fixture
def clone(tmp_path: Path) -> Path:
    top = tmp_path / "clone"
    identity = ["-c", "user.name=lab", "-c", "user.email=lab@example.org"]
    for command in (["init", "-q", str(top)], ["-C", str(top), *identity, "commit", "-q", "--allow-empty", "-m", "1"]):
        subprocess.run(["git", *command], check=True)
    return top


def test_a_clone_has_its_own(clone: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(clone)
    assert paths.store() == Path(".work")
    assert paths.log() == Path(".work/error.log")


def test_a_folder_without_git_has_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert paths.store() == Path(".work")


def test_a_worktree_and_an_experiments_copy_use_the_clones(clone: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tree = clone.parent / "tree"
    subprocess.run(["git", "-C", str(clone), "worktree", "add", "-q", str(tree)], check=True)
    for top in (clone, tree):  # experiments may start in either
        (copy := top / ".dvc/tmp/exps/tmp123").mkdir(parents=True)
        subprocess.run(["git", "init", "-q", str(copy)], check=True)
        monkeypatch.chdir(copy)
        assert paths.store() == clone / ".work"
    monkeypatch.chdir(tree)
    assert paths.store() == clone / ".work"


def test_a_preview_within_a_clone_has_its_own(clone: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (inner := clone / ".work/preview").mkdir(parents=True)
    monkeypatch.chdir(inner)
    assert paths.store() == Path(".work")


def test_a_submodule_has_its_own(clone: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (inner := clone / "sub").mkdir()
    (inner / ".git").write_text("gitdir: ../.git/modules/sub\n")
    (clone / ".git/modules/sub").mkdir(parents=True)
    monkeypatch.chdir(inner)
    assert paths.store() == Path(".work")


def test_the_user_may_name_another(clone: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(clone)
    monkeypatch.setenv("MIMO_STORE", str(tmp_path / "shared"))
    assert paths.store() == tmp_path / "shared"
    monkeypatch.setenv("MIMO_STORE", "~/shared")
    assert paths.store() == Path.home() / "shared"
