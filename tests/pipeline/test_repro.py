"""The real pipeline under real DVC and Ray, tiny: from nothing, then again after each kind of change."""

import hashlib
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import h5py
import pytest
import yaml

from stages import preview

ROOT = Path(__file__).parents[2]
CELLS = [f"{condition}-{reward}" for condition in ("free", "noisy") for reward in ("mtl", "cais")]
ENDS = {"analyse", "claims", "figures", "report"}
GAIN = yaml.safe_load((ROOT / "params.yaml").read_text())["rewards"]["gain"]
VARIANTS = {  # the first changes nothing, the second no scale, the third scales too
    "same": {"asks": "?", "set": {"rewards.gain": GAIN}, "cells": {"free": ["mtl"]}},
    "greedy": {"asks": "?", "set": {"rewards.gain": 7 * GAIN}, "cells": {"free": ["cais"]}},
    "heavy": {"asks": "?", "set": {"world.mobile_mass": 1.5}, "cells": {"noisy": ["mtl"]}},
}


def edit(project: Path, *changes: tuple[str, Any]) -> None:
    path = project / "params.yaml"
    whole = yaml.safe_load(path.read_text())
    for key, value in changes:
        *sections, name = key.split(".")
        part = whole
        for section in sections:
            part = part[section]
        part[name] = value
    path.write_text(yaml.safe_dump(whole, sort_keys=False))


def repro(project: Path) -> tuple[int, str]:
    path = os.pathsep.join((str(Path(sys.executable).parent), os.environ["PATH"]))
    done = subprocess.run(
        [sys.executable, "-m", "dvc", "repro"],
        cwd=project, env=os.environ | {"PATH": path}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    return done.returncode, done.stdout + done.stderr


def ran(output: str) -> set[str]:
    return set(re.findall(r"Running stage '([^']+)'", output))


def stored(project: Path) -> set[str]:
    return {path.name for path in (project / ".work/runs").glob("*.h5")}


def digests(project: Path, *folders: str) -> dict[str, str]:
    files = [path for folder in folders for path in sorted((project / folder).rglob("*")) if path.is_file()]
    return {str(path.relative_to(project)): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


pytestmark = pytest.mark.timeout(900)


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """A project in which `dvc repro` ran from nothing, and what it said."""
    project = tmp_path_factory.mktemp("first") / "project"
    preview.prepare(ROOT, project)
    edit(
        project,
        ("sweep.rewards", ["mtl", "cais"]),
        ("protocol.baseline_steps", 3),
        ("protocol.attached_steps", 5),
        ("protocol.extinction_steps", 3),
        ("encoder.iterations", 4),
        ("calibrate.steps", 6),
        ("collect.steps", 6),
        ("effects.alternatives", {}),
        ("sweeps.variants", VARIANTS),
    )
    code, output = repro(project)
    assert code == 0, output
    return project, output


@pytest.fixture
def project(first: tuple[Path, str], tmp_path: Path) -> Path:
    """A copy of its own for each test."""
    return Path(shutil.copytree(first[0], tmp_path / "project"))


def test_from_nothing_every_stage_runs_and_leaves_what_it_promises(first: tuple[Path, str]) -> None:
    project, output = first
    assert ran(output) == {
        "collect", "encoder", "calibrate", "effects", "train", *(f"runs@{cell}" for cell in CELLS), *ENDS,
        "vary", *(f"variants@{name}" for name in VARIANTS), "compare",
    }  # fmt: skip
    assert "agent steps" in output
    for condition in ("free", "noisy"):
        for reward in ("mtl", "cais"):
            with h5py.File(project / f"data/runs/{condition}/{reward}/seed-000.h5") as run:
                assert run["move_probability"].shape == (11, 12)
                assert run.attrs["about.condition"] == condition.encode()
    with h5py.File(project / "data/variants.h5") as curves:
        assert {name: list(curves[name]) for name in curves if name != "windows"} == {
            "same": ["free"], "greedy": ["free"], "heavy": ["noisy"],
        }  # fmt: skip
        assert curves["heavy/noisy/mtl/move_probability/attached"].shape == (1, 11)
    for name in (
        "index.html",
        "metrics.json",
        "effects.json",
        "figures/fig3.png",
        "figures/fig3.svg",
        "figures/fig4.png",
    ):
        assert (project / "reports" / name).stat().st_size > 1000, name


def test_again_nothing_runs(project: Path) -> None:
    code, output = repro(project)
    assert code == 0, output
    assert not ran(output)
    assert "up to date" in output


def test_a_constant_of_cais_reruns_its_cells_alone_and_set_back_it_comes_from_the_cache(project: Path) -> None:
    before, runs = stored(project), digests(project, "data/runs", "reports")
    edit(project, ("rewards.cais.pays", "taken"))
    code, output = repro(project)
    assert code == 0, output
    assert ran(output) == {
        "calibrate", "train", "runs@free-cais", "runs@noisy-cais", *ENDS, "vary", "variants@greedy", "compare"
    }  # fmt: skip
    assert len(stored(project) - before) == 3
    after = digests(project, "data/runs")
    changed = {name for name in after if after[name] != runs[name]}
    assert changed == {f"data/runs/{condition}/cais/seed-000.h5" for condition in ("free", "noisy")}
    edit(project, ("rewards.cais.pays", "move"))
    code, output = repro(project)
    assert code == 0, output
    assert "is cached - skipping run" in output
    assert len(stored(project) - before) == 3
    assert digests(project, "data/runs", "reports") == runs


def test_one_more_seed_computes_only_the_new_runs(project: Path) -> None:
    before, runs = stored(project), digests(project, "data/runs")
    edit(project, ("sweep.seeds", 2))
    code, output = repro(project)
    assert code == 0, output
    assert "8 runs, 4 of them in the store." in output
    assert len(stored(project) - before) == 4
    assert ran(output) == {"train", *(f"runs@{cell}" for cell in CELLS), *ENDS}
    after = digests(project, "data/runs")
    assert len(after) == 8
    assert {name: after[name] for name in runs} == runs


def test_published_runs_are_taken_in_when_the_store_is_gone(project: Path) -> None:
    """As in a fresh clone after `dvc pull`: a new seed computes only its own runs."""
    shutil.rmtree(project / ".work/runs")
    edit(project, ("sweep.seeds", 2))
    code, output = repro(project)
    assert code == 0, output
    assert "8 runs, 4 of them in the store." in output


def test_a_comment_in_the_learner_computes_nothing(project: Path) -> None:
    before = digests(project, "data", "reports")
    agent = project / "mimo/agent.py"
    agent.write_text(agent.read_text() + "\n# A comment.\n")
    code, output = repro(project)
    assert code == 0, output
    assert "4 runs, 4 of them in the store." in output
    assert "3 runs, 3 of them in the store." in output
    assert ran(output) == {"calibrate", "effects", "train", "vary"}
    assert digests(project, "data", "reports") == before


def test_a_reward_of_ones_own_is_a_class_and_a_name_and_computes_its_runs_alone(project: Path) -> None:
    before, runs = stored(project), digests(project, "data/runs")
    code = project / "mimo/rewards.py"
    code.write_text(
        code.read_text()
        + """

class Stillness(Reward):
    \"\"\"How little the mobile travelled.\"\"\"

    name = "stillness"

    def __call__(self, t: Transition) -> Tensor:
        return -t.path_length.unsqueeze(-1).expand(t.action.shape)
"""
    )
    edit(project, ("sweep.rewards", ["mtl", "cais", "stillness"]))
    exit_code, output = repro(project)
    assert exit_code == 0, output
    assert "6 runs, 4 of them in the store." in output
    assert len(stored(project) - before) == 2
    after = digests(project, "data/runs")
    assert {name: after[name] for name in runs} == runs
    assert {"data/runs/free/stillness/seed-000.h5", "data/runs/noisy/stillness/seed-000.h5"} == set(after) - set(runs)


def test_a_variant_that_changes_nothing_is_the_published_run(first: tuple[Path, str]) -> None:
    project, _ = first
    runs = digests(project, "data/runs", "data/variants")
    assert runs["data/variants/same/free/mtl/seed-000.h5"] == runs["data/runs/free/mtl/seed-000.h5"]
    assert len(stored(project)) == len(set(runs.values())) == 6
    assert len(list((project / ".work/scales").glob("*.h5"))) == 2


def test_only_the_runs_of_a_variant_that_changes_are_computed(project: Path) -> None:
    before, runs = stored(project), digests(project, "data/runs", "data/variants")
    changed = {
        "same": VARIANTS["same"] | {"cells": {"free": ["mtl"], "noisy": ["cais"]}},  # one more published cell
        "greedy": VARIANTS["greedy"] | {"set": {"rewards.gain": 8 * GAIN}},
    }
    edit(project, ("sweeps.variants", changed))
    code, output = repro(project)
    assert code == 0, output
    assert ran(output) == {"vary", "variants@same", "variants@greedy", "compare", "claims", "report"}
    assert "3 runs, 2 of them in the store." in output
    assert len(stored(project) - before) == 1
    after = digests(project, "data/runs", "data/variants")
    gone, new, one = (
        f"data/variants/{name}/seed-000.h5" for name in ("heavy/noisy/mtl", "same/noisy/cais", "greedy/free/cais")
    )
    assert after.keys() == (runs.keys() - {gone}) | {new}
    assert {name for name in after if after[name] != runs.get(name)} == {new, one}


def test_variants_without_ray_are_the_same_bytes(project: Path) -> None:
    """What is published of the paper's own is taken in; the rest is computed again."""
    before = digests(project, ".work/runs", ".work/scales")
    for folder in (".work/runs", ".work/scales", "data/variants"):
        shutil.rmtree(project / folder)
    command = [sys.executable, "-m", "stages.vary", "--serial"]
    done = subprocess.run(command, cwd=project, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "3 runs, 1 of them in the store." in done.stdout
    after = digests(project, ".work/runs", ".work/scales")
    assert len(after) == 5
    assert after.items() <= before.items()


@pytest.mark.parametrize(
    ("changes", "sentences"),
    [
        (
            [("world.mobile_mass", -1.0), ("sweep.rewards", ["mtl", "cias"])],
            ["world.mobile_mass must be greater than 0; it is -1.0.", "'cias'"],
        ),
        ([("world.mobile_mas", 1.0)], ["world.mobile_mas is not a known key"]),
    ],
)
def test_bad_parameters_stop_the_pipeline_before_any_work(
    project: Path, changes: list[tuple[str, Any]], sentences: list[str]
) -> None:
    before = stored(project)
    edit(project, *changes)
    code, output = repro(project)
    assert code != 0
    for sentence in sentences:
        assert sentence in output
    assert "Traceback" not in output
    assert stored(project) == before
