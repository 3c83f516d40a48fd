"""One store for a clone, its experiments and worktrees; clones and branches as git makes them; what a part lacks."""

from pathlib import Path

import pytest

from stages.base import paths
from tests.pipeline.conftest import CELLS
from tests.pipeline.project import call, done, edit, python, ran, stored

pytestmark = pytest.mark.timeout(900)


def made(project: Path) -> int:
    """Lines of provenance: how many artifacts were computed for this clone."""
    return len([line for line in (project / ".work/provenance.jsonl").read_text().splitlines() if line])


def test_an_experiment_in_a_copy_uses_and_fills_the_clones_store(project: Path) -> None:
    before, runs = made(project), stored(project)
    said = done(project, "dvc", "exp", "run", "--temp", "--name", "more", "-S", "sweep.seeds=2", "analyse")
    assert "8 runs, 4 of them in the store." in said
    assert stored(project) > runs
    assert made(project) == before + 4 + 1  # four runs and the results
    assert "sweep.seeds" not in done(project, "git", "diff", "--stat")  # the working tree is as it was

    done(project, "dvc", "exp", "apply", "more")
    paper = python(project, "stages.commands.paper")
    assert paper.returncode == 0, paper.stderr
    assert "13 artifacts, 0 of them recomputed" in paper.stdout  # of what the experiment left to do, none is computed
    assert python(project, "stages.commands.publish").returncode == 0


def test_a_worktree_computes_nothing_that_the_clone_has(project: Path, tmp_path: Path) -> None:
    before = made(project)
    done(project, "git", "worktree", "add", "-q", "--detach", str(tmp_path / "tree"))
    said = python(tmp_path / "tree", "stages.commands.paper")
    assert said.returncode == 0, said.stderr
    assert said.stdout.splitlines()[-1] == (
        "9 artifacts, 1 of them recomputed; 9 equal the 9 published; dvc.lock and reports are the same bytes."
    )
    assert made(project) == before + 1  # the results, which are quick
    assert [path.name for path in (tmp_path / "tree/.work").iterdir()] == ["lock"]


def test_line_ends_are_the_same_in_a_clone_that_asks_for_others(project: Path, tmp_path: Path) -> None:
    done(tmp_path, "git", "clone", "-q", "-c", "core.autocrlf=true", str(project), "crlf")
    clone = tmp_path / "crlf"
    for name in done(clone, "git", "ls-files").splitlines():
        assert (clone / name).read_bytes() == (project / name).read_bytes(), name
    assert python(clone, "stages.commands.share", "fetch").returncode == 0
    assert python(clone, "dvc", "status", "--quiet", "dvc.yaml").returncode == 0


def test_a_merge_leaves_no_marks_in_what_dvc_repro_writes_and_it_mends_the_rest(project: Path) -> None:
    """What both sides changed is ours until then."""
    done(project, "git", "checkout", "-qb", "other")
    edit(project, ("agent.gamma", 0.2))
    done(project, "dvc", "repro", "report")
    done(project, "git", "commit", "-qam", "Another discount")
    done(project, "git", "checkout", "-q", "-")
    edit(project, ("film.steps", 2))
    done(project, "dvc", "repro", "report")
    done(project, "git", "commit", "-qam", "A longer film")
    merged = call(project, "git", "merge", "-q", "other")
    assert merged.returncode == 1
    assert "CONFLICT" in merged.stdout + merged.stderr
    for path in done(project, "git", "diff", "--name-only", "--diff-filter=U").splitlines():
        assert path == "dvc.lock" or path.startswith("reports/")
        assert b"<<<<<<<" not in (project / path).read_bytes()
    before, runs = made(project), stored(project)
    done(project, "dvc", "repro")
    assert stored(project) == runs
    assert made(project) <= before + 1  # the results, at most
    done(project, "git", "add", "dvc.lock", "reports")
    assert not done(project, "git", "diff", "--name-only", "--diff-filter=U")


def test_after_a_partial_pull_the_advice_costs_the_runs_alone(clone: Path) -> None:
    parts = [str(path) for path in (paths.ENCODER, paths.SCALES, paths.MANIFESTS)]
    done(clone, "dvc", "pull", "-q", *parts)
    failed = python(clone, "dvc", "repro", "--single-item", "runs@free-mtl")
    assert failed.returncode != 0
    advice = "dvc repro --single-item --force train runs"
    assert (
        "The store lacks 1 of 1 artifacts of data/manifests/free-mtl.json; get them by `make fetch` or "
        f"`dvc repro --pull dvc.yaml`, or compute them, and nothing else that is missing, by `{advice}`."
    ) in failed.stderr
    assert ran(done(clone, *advice.split())) == {"train", *(f"runs@{cell}" for cell in CELLS)}
    assert len(list((clone / paths.RUNS).rglob("*.h5"))) == 4
    assert {path.name for path in (clone / ".work").glob("*s")} == {
        "runs",
        "progress",
    }  # no frames, no encoder, no scales


def test_after_a_partial_pull_the_rest_can_be_pulled(clone: Path) -> None:
    done(clone, "dvc", "pull", "-q", str(paths.MANIFESTS))
    assert "Running stage" not in done(clone, "dvc", "repro", "--pull", "dvc.yaml")
