"""What is published can be had again: in a fresh clone, after `dvc pull`, by a sample; each artifact knows its inputs.

All start from the project of tests/pipeline/conftest.py.
"""

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from mimo.record import artifact, identity
from stages import catalogue
from stages.base import paths, store
from stages.commands import verify
from tests.pipeline.conftest import CELLS, GAIN
from tests.pipeline.project import digests, done, edit, python, ran, repro

RUN = paths.run("noisy", "cais", 0)

pytestmark = pytest.mark.timeout(900)


# Elsewhere.


def test_a_fresh_clone_recomputes_everything_to_the_same_bytes(clone: Path) -> None:
    assert not (clone / "data").exists()
    said = python(clone, "stages.commands.paper")
    assert said.returncode == 0, said.stderr
    assert said.stdout.splitlines()[-1] == (
        "9 artifacts, 9 of them recomputed; 9 equal the 9 published; dvc.lock and reports are the same bytes."
    )
    said = python(clone, "stages.commands.studies")
    assert said.stdout.splitlines()[-1] == (
        "7 artifacts, 6 of them recomputed; 7 equal the 7 published; dvc.lock and reports are the same bytes."
    )
    assert done(clone, "git", "status", "--porcelain") == ""
    again = python(clone, "stages.commands.paper").stdout.splitlines()[-1]
    assert again.startswith("9 artifacts, 0 of them recomputed; 9 equal the 9 published;")
    python(clone, "stages.commands.publish")
    (machine,) = json.loads((clone / paths.PUBLISHED_ON).read_text())["machines"]
    assert machine["versions"] == identity.versions()


def test_what_is_fetched_is_published_and_one_more_seed_computes_its_own_runs_alone(
    clone: Path, published: tuple[Path, str]
) -> None:
    assert python(clone, "stages.commands.share", "fetch").returncode == 0
    assert "Running stage" not in repro(clone)
    assert digests(clone, "data", "reports") == digests(published[0], "data", "reports")
    before = {path: path.read_bytes() for path in (clone / paths.RUNS).rglob("*.h5")}
    edit(clone, ("sweep.seeds", 2))
    said = done(clone, "dvc", "repro", "analyse")
    assert "8 runs, 4 of them in the store." in said
    assert ran(said) == {"train", "analyse", *(f"runs@{cell}" for cell in CELLS)}
    after = {path: path.read_bytes() for path in (clone / paths.RUNS).rglob("*.h5")}
    assert len(after) == 8
    assert all(after[path] == data for path, data in before.items())


def test_an_archive_without_git_works_likewise(project: Path) -> None:
    shutil.rmtree(project / ".git")
    assert "is not a git repository" in python(project, "dvc", "status").stderr  # what a command of ours mends
    for command in ("paper", "verify", "share"):
        said = python(
            project, f"stages.commands.{command}", *{"verify": ["--runs", "1"], "share": ["push"]}.get(command, [])
        )
        assert said.returncode == 0, said.stderr
        if command == "paper":
            assert said.stdout.splitlines()[-1] == "9 artifacts, 0 of them recomputed; 9 equal the 9 published."
    assert python(project, "dvc", "status", "--quiet").returncode == 0


# A sample, computed again.


def shift(held: artifact.Artifact) -> dict[str, artifact.Dataset]:
    """The run's datasets, but `reward` is 0.5 more at the fourth step."""
    reward = held["reward"].copy()
    reward[3] += 0.5
    return held.datasets | {"reward": artifact.Dataset(reward, "scaled reward", "step, joint")}


def alter(project: Path, run: Path, datasets: Callable[[artifact.Artifact], dict[str, artifact.Dataset]]) -> None:
    """Publish another run in its place."""
    held = artifact.read(project / run, store.RUN)
    assert held.inputs is not None
    artifact.write(project / run, store.RUN, identity.Digest(held.inputs), datasets(held), held.about)
    listed = json.loads((project / paths.ARTIFACTS).read_text())
    listed[str(run)]["content"] = artifact.content(project / run)
    (project / paths.ARTIFACTS).write_text(json.dumps(listed))


def drawing(project: Path, *runs: Path) -> tuple[str, ...]:
    """Options by which these are the sample."""
    listed = catalogue.published((project / paths.ARTIFACTS).read_text())
    draw = next(draw for draw in range(99) if verify.sample(listed, len(runs), draw) == sorted(runs))
    return "--runs", str(len(runs)), "--draw", str(draw), "--serial"


def test_a_sample_computed_again_is_what_is_published(project: Path) -> None:
    before = {path: path.stat().st_mtime_ns for path in project.rglob("*") if path.suffix == ".h5"}
    said = python(project, "stages.commands.verify", "--runs", "2", "--serial")
    assert said.returncode == 0, said.stdout + said.stderr
    lines = said.stdout.splitlines()
    assert lines[-1] == "OK: 3 artifacts computed again."
    assert "data/trial.h5: the published bytes." in lines
    assert sum(line.startswith("data/runs/") and line.endswith(": the published bytes.") for line in lines) == 2
    assert {path: path.stat().st_mtime_ns for path in project.rglob("*") if path.suffix == ".h5"} == before


def test_what_differs_is_told_by_run_dataset_step_and_size(project: Path) -> None:
    alter(project, RUN, shift)
    said = python(project, "stages.commands.verify", *drawing(project, RUN))
    assert said.returncode == 1
    assert f"{RUN}: not the published one: reward differs first at step 4, by 0.5 (" in said.stdout
    assert "data/trial.h5: the published bytes." in said.stdout
    assert said.stderr.splitlines()[-1] == "1 of 2 artifacts are not the published ones."


def test_on_another_class_of_machine_a_tolerance_holds_and_is_told(project: Path) -> None:
    """One run differs within it, another beyond."""
    assert python(project, "stages.commands.publish").returncode == 0
    found = json.loads((project / paths.PUBLISHED_ON).read_text())
    found["machines"][0]["class"] = "x86_64 AnotherVendor avx"
    (project / paths.PUBLISHED_ON).write_text(json.dumps(found))

    def still(held: artifact.Artifact) -> dict[str, artifact.Dataset]:
        moving = held["move_probability"]
        return held.datasets | {"move_probability": artifact.Dataset(np.zeros_like(moving), "1", "step, joint")}

    other = paths.run("free", "cais", 0)
    alter(project, RUN, shift)
    alter(project, other, still)
    said = python(project, "stages.commands.verify", *drawing(project, RUN, other))
    assert said.returncode == 1
    assert "is of another class than the published results'" in said.stdout
    told = "tolerance 0.05 of mean P(MOVE)"
    assert f"{RUN}: within the {told}: 0.000 apart; reward differs first at step 4" in said.stdout
    assert f"{other}: not the published one, nor within the {told}" in said.stdout
    assert said.stderr.splitlines()[-1] == "1 of 3 artifacts are not the published ones."


def test_a_sample_is_not_compared_with_what_the_tree_would_not_make(project: Path) -> None:
    edit(project, ("agent.gamma", 0.2))
    said = python(project, "stages.commands.verify", "--runs", "1")
    assert said.returncode == 1
    assert "asks for another run than the published one; `python -m stages.commands.identify data/runs/" in said.stderr


# Identity.


def test_an_artifact_knows_its_inputs_and_which_of_them_changed(project: Path) -> None:
    said = python(project, "stages.commands.identify", str(RUN))
    assert said.returncode == 0, said.stderr
    lines = said.stdout.splitlines()
    assert lines[-1] == "It matches the working tree."
    for expected in ("  params.agent.gamma: 0.1", "  condition: noisy", "  seed: 0", "  params.condition.force: 40.0"):
        assert expected in lines
    assert any(line.startswith("  code.mimo.learning.agent: ") for line in lines)
    own = ("studies/own", "studies/drawn", "variants/drawn/draw1/encoder", "variants/drawn/draw1/free/mtl/seed-000")
    for other in ("encoder", "trial", "frames", "scales", "results", *own):
        said = python(project, "stages.commands.identify", f"data/{other}.h5")
        assert said.stdout.endswith("It matches the working tree.\n"), other
    variant = paths.run("free", "cais", 0, "own/greedy")
    assert f"  params.rewards.gain: {7 * GAIN}\n" in python(project, "stages.commands.identify", str(variant)).stdout

    edit(project, ("agent.gamma", 0.2))
    agent = project / "mimo/learning/outcomes.py"
    agent.write_text(agent.read_text().replace("1) / (quantiles + 1)", "1) / (quantiles + 2)"))
    said = python(project, "stages.commands.identify", str(RUN))
    assert said.returncode == 1
    heading, code, gamma = said.stdout.splitlines()[-3:]
    assert heading == "It does not match the working tree; what differs (2):"
    assert code.startswith("  code.mimo.learning.outcomes: ")
    assert gamma == "  params.agent.gamma: 0.1 in the file, 0.2 in the working tree"
