"""The real pipeline under real DVC, small: from nothing, and after each kind of change.

All start from the project of tests/pipeline/conftest.py.
"""

from pathlib import Path

import h5py
import pytest

from tests.pipeline.conftest import CELLS, GAIN, STUDIES, VARIANTS
from tests.pipeline.project import digests, edit, python, ran, repro, stored, study

ENDS = {"analyse", "catalogue", "claims", "explore", "figures", "report"}
FILMS = {"film@free", "film@noisy"}
BEYOND = {"studies:catalogue", "studies:page"}

pytestmark = pytest.mark.timeout(900)


def test_from_nothing_every_stage_runs_and_leaves_what_it_promises(published: tuple[Path, str]) -> None:
    project, output = published
    assert ran(output) == {
        "collect", "encoder", "trial", "calibrate", "train", *(f"runs@{cell}" for cell in CELLS), *ENDS, *FILMS,
        "studies:effects", *BEYOND,
        *(f"studies:{stage}@{name}" for stage in ("vary", "variants", "compare") for name in STUDIES),
    }  # fmt: skip
    assert "\n9 artifacts, 9 of them recomputed; there are no published ones to compare with.\n" in output
    assert output.endswith("\n7 artifacts, 6 of them recomputed; there are no published ones to compare with.\n")
    for condition in ("free", "noisy"):
        for reward in ("mtl", "cais"):
            with h5py.File(project / f"data/runs/{condition}/{reward}/seed-000.h5") as run:
                assert run["move_probability"].shape == (11, 12)
                assert run.attrs["about.condition"] == condition.encode()
    with h5py.File(project / "data/studies/own.h5") as curves:
        assert {name: list(curves[name]) for name in curves if name != "windows"} == {
            "same": ["free"], "greedy": ["free"], "heavy": ["noisy"],
        }  # fmt: skip
        assert curves["heavy/noisy/mtl/move_probability/attached"].shape == (1, 11)
    for name in (
        "index.html",
        "metrics.json",
        "explore.json",
        "studies.html",
        "studies/effects.json",
        "studies/own.json",
        "studies/drawn.json",
        "studies/explore/own.json",
        "figures/fig1.svg",
        "figures/fig2.pdf",
        "figures/fig3.png",
        "figures/fig3.svg",
        "figures/fig4.png",
        "film/noisy.mp4",
        "film/noisy.png",
    ):
        assert (project / "reports" / name).stat().st_size > 1000, name


def test_a_variant_that_changes_nothing_is_the_published_run(published: tuple[Path, str]) -> None:
    project, _ = published
    runs = digests(project, "data/runs", "data/variants")
    assert runs["data/variants/own/same/free/mtl/seed-000.h5"] == runs["data/runs/free/mtl/seed-000.h5"]
    assert len(stored(project)) == len({runs[name] for name in runs if name.endswith("/seed-000.h5")}) == 7
    assert len(list((project / ".work/scales").glob("*.h5"))) == 3
    assert runs.keys() >= {"data/variants/drawn/draw1/encoder.h5", "data/variants/drawn/draw1/free/mtl/seed-000.h5"}


def test_only_the_runs_of_a_variant_that_changes_are_computed(project: Path) -> None:
    before, runs = stored(project), digests(project, "data/runs", "data/variants")
    changed = {
        "same": {**VARIANTS["same"], "cells": {"free": ["mtl"], "noisy": ["cais"]}},  # one more published cell
        "greedy": {**VARIANTS["greedy"], "set": {"rewards.gain": 8 * GAIN}},
    }
    edit(project, ("studies.own.variants", changed))
    output = repro(project)
    assert ran(output) == {"studies:vary@own", "studies:variants@own", "studies:compare@own", *BEYOND}
    assert "3 runs, 2 of them in the store." in output
    assert len(stored(project) - before) == 1
    after = digests(project, "data/runs", "data/variants")
    gone, new, one = (
        f"data/variants/own/{name}/seed-000.h5" for name in ("heavy/noisy/mtl", "same/noisy/cais", "greedy/free/cais")
    )
    assert after.keys() == (runs.keys() - {gone}) | {new}
    assert {name for name in after if after[name] != runs.get(name)} == {new, one}


def test_a_study_that_is_added_computes_its_own_runs_and_those_of_no_other(project: Path) -> None:
    """`make studies STUDY=more`; others' stages do not run, though the page shows them."""
    before, made = stored(project), digests(project, "reports/studies", "data/studies")
    more = {"some": {"set": {"rewards.gain": 3 * GAIN}}, "greedy": VARIANTS["greedy"]}
    edit(project, ("studies.more", study(more)))
    said = python(project, "stages.commands.studies", "more")
    assert said.returncode == 0, said.stderr
    assert ran(said.stdout) == {"studies:vary@more", "studies:variants@more", "studies:compare@more", *BEYOND}
    assert "2 runs, 1 of them in the store." in said.stdout
    assert len(stored(project) - before) == 1
    after = digests(project, "reports/studies", "data/studies")
    assert made.pop("reports/studies/artifacts.json") != after.pop("reports/studies/artifacts.json")
    assert after.items() >= made.items()
    assert after.keys() - made.keys() == {
        "reports/studies/more.json", "reports/studies/explore/more.json", "data/studies/more.h5"
    }  # fmt: skip
    again = python(project, "stages.commands.studies", "more")
    assert (again.returncode, ran(again.stdout)) == (0, set())


def test_make_studies_says_what_stands_in_its_way(project: Path) -> None:
    said = python(project, "stages.commands.studies", "mroe")
    assert (said.returncode, said.stderr) == (
        1, "There is no study 'mroe' in studies/params.yaml; known are own, drawn.\n"
    )  # fmt: skip
    edit(project, ("studies.own.measures", ["lead", "laed"]))
    said = python(project, "stages.commands.studies")
    assert said.returncode == 1
    assert said.stderr.startswith("studies/params.yaml: studies.own.measures has 'laed'; known are lead, ")
    edit(project, ("studies.own.measures", ["lead"]), ("film.steps", 2))  # of which no study knows
    said = python(project, "stages.commands.studies", "own")
    assert said.returncode == 0, said.stderr
    edit(project, ("agent.gamma", 0.2))
    said = python(project, "stages.commands.studies", "own")
    assert said.returncode == 1
    assert said.stderr.endswith("run `make paper` first.\n")


def test_bad_parameters_stop_the_pipeline_before_any_work(project: Path) -> None:
    before = stored(project)
    edit(project, ("world.mobile_mass", -1.0), ("sweep.rewards", ["mtl", "cias"]))
    said = python(project, "dvc", "repro")
    assert said.returncode != 0
    for sentence in ("world.mobile_mass must be greater than or equal to 0.001; it is -1.0.", "'cias'"):
        assert sentence in said.stdout + said.stderr
    assert "Traceback" not in said.stdout + said.stderr
    assert stored(project) == before
