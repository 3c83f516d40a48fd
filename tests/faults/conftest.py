"""A small project whose runs are all to be computed, and what an undisturbed `dvc repro` makes of them."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from stages.commands import preview
from tests import once
from tests.faults import harness
from tests.faults.harness import Repro
from tests.pipeline.project import edit, repro, study

if TYPE_CHECKING:
    import numpy as np

    from mimo.settings.params import Params
    from mimo.vision.extractor import Trained
    from tests.faults.running import Run

ROOT = Path(__file__).parents[2]
TINY = {
    "sweep.conditions": ["free"],
    "sweep.rewards": ["mtl", "cais"],
    "sweep.seeds": harness.RUNS // 2,
    "sweep.chunk": 1,
    "protocol.baseline_steps": 6,
    "protocol.attached_steps": 12,
    "protocol.extinction_steps": 6,
    "encoder.widths": [2, 4, 4, 4],
    "encoder.pairs": 4,
    "encoder.iterations": 4,
    "calibrate.steps": 6,
    "collect.steps": 6,
    "effects.steps": 40,
    "effects.alternatives": {},
    "studies": {"own": study({"same": {"set": {"rewards.gain": 1.0}, "cells": {"free": ["mtl"]}}})},
}

Kept = dict[str, tuple[int, int]]


class Pipeline:
    """A project of harness.RUNS runs of which none is computed, and what an undisturbed `dvc repro` makes of it."""

    def __init__(self, project: Path, undisturbed: dict[str, str]) -> None:
        self.project, self.undisturbed = project, undisturbed
        self.runs = project / ".work/runs"
        self.started: list[Repro] = []

    def start(self, workers: bool = True, within: Sequence[str] = (), also: Mapping[str, str] | None = None) -> Repro:
        """`dvc repro`, as far as the published runs; left alone, so small a sweep would do without Ray's workers."""
        self._ask_for(workers)
        self.started.append(Repro(self.project, "runs", within=within, also=also or {}))
        return self.started[-1]

    def stopped(self, repro: Repro, sentence: str, kept: Kept, but: Collection[str] = ()) -> Kept:
        """It ends with the sentence and no traceback, and keeps what was finished; returns what is finished now."""
        assert repro.end(but) != 0
        assert re.search(sentence, repro.said), repro.said
        assert "Traceback" not in repro.said
        harness.assert_whole(self.project)
        found = harness.finished(self.project)
        assert kept.items() <= found.items()
        return found

    def completes(self, repro: Repro, kept: Kept) -> None:
        """It succeeds, computes no run that was kept, and every byte is as undisturbed."""
        assert repro.end() == 0, repro.said
        self._completed(repro.said, kept)

    def goes_on(self, kept: Kept) -> str:
        """The next `dvc repro` computes what is missing, and no more; returns what it says."""
        self._ask_for(workers=False)
        said = repro(self.project, "runs")
        assert f"{harness.RUNS} runs, {len(kept)} of them in the store." in said
        self._completed(said, kept)
        return said

    def _ask_for(self, workers: bool) -> None:
        stages = self.project / "dvc.yaml"
        command = "python -m stages.train"
        text = stages.read_text().replace(f"{command} --workers 2", command)
        stages.write_text(text.replace(command, f"{command} --workers 2") if workers else text)

    def _completed(self, said: str, kept: Kept) -> None:
        assert "Traceback" not in said
        assert kept.items() <= harness.finished(self.project).items()
        assert harness.digests(self.project) == self.undisturbed
        assert not harness.parts(self.project)


@pytest.fixture(scope="session")
def reference(tmp_path_factory: pytest.TempPathFactory) -> Pipeline:
    """Computed undisturbed."""
    top, said = once.made(tmp_path_factory, "undisturbed", _compute)
    return Pipeline(top / "project", json.loads(said))


def _compute(top: Path) -> str:
    project = top / "project"
    preview.prepare(ROOT, project)
    edit(project, *TINY.items())
    repro(project, "runs")
    made = Pipeline(project, {})
    assert len(list(made.runs.iterdir())) == len(list(project.glob("data/runs/*/*/*.h5"))) == harness.RUNS
    return json.dumps(harness.digests(project))


@pytest.fixture
def computed(reference: Pipeline, tmp_path: Path) -> Iterator[Pipeline]:
    """A copy in which all runs are in the store; what runs there is ended after the test."""
    copy = Path(shutil.copytree(reference.project, tmp_path / "project"))
    harness.forget(copy)
    made = Pipeline(copy, reference.undisturbed)
    yield made
    for each in made.started:
        each.kill()


@pytest.fixture
def pipeline(computed: Pipeline) -> Pipeline:
    for run in computed.runs.iterdir():
        run.unlink()
    return computed


@pytest.fixture(scope="module")
def run(trained: Trained, tiny: Params, pairs: np.ndarray) -> Iterator[Run]:
    """Fails where settings do not really run."""
    from tests.faults import running  # late, as it loads torch

    with running.computing(trained, tiny, pairs) as computed:
        yield computed
