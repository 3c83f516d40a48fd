"""Whether settings really run: calibration and some steps with every reward, small in all that is only counted."""

import functools
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mimo.learning import calibrate, resting
from mimo.learning.experiment import Experiment
from mimo.learning.rewards import REWARDS
from mimo.settings import params, studies
from mimo.settings.params import Params
from mimo.vision import encoder
from mimo.vision.extractor import Trained
from mimo.world import scene

Run = Callable[[Params], None]

ROOT = Path(__file__).parents[2]
P = params.load(ROOT / "params.yaml")
STUDIES = studies.load(P, ROOT / studies.PATH)
TALLY: Counter[str] = Counter()
ALL = "_".join(REWARDS)


def train(*given: Any) -> Trained:
    """encoder.train in one thread: with so little to do, two would wait for each other."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(encoder, "THREADS", 1)
        return encoder.train(*given)


@contextmanager
def computing(trained: Trained, tiny: Params, pairs: np.ndarray) -> Iterator[Run]:
    """Calibration and some steps in each phase with all rewards at once; all numbers are finite.

    There are fewer worlds, steps and iterations than asked for, but every size within a step is as asked for. What does
    not reach a run is taken to run as it did before.
    """
    done: set[str] = set()

    def eye(own: params.Encoder) -> tuple[params.Encoder, Trained]:
        published = P.encoder.model_copy(update={"latent_sd": own.latent_sd})
        if own == published:
            ratio = np.float32(own.latent_sd / tiny.encoder.latent_sd)
            small = tiny.encoder.model_copy(update={"latent_sd": own.latent_sd})
            return small, replace(trained, quantiles=trained.quantiles * ratio)
        brief = own.model_copy(update={"iterations": min(2, own.iterations)})
        return own, train(brief, pairs[:, ::5], np.random.default_rng(0))  # of all regimes

    def compute(p: Params) -> None:
        if key(p) in done:
            return
        done.add(key(p))
        sizes, sight = eye(p.encoder)
        few = 60 if p.world.rope_slack else 6  # a rope that is not taut pulls seldom
        brief = p.calibrate.model_copy(update={"steps": few, "worlds": 1})
        own = p.model_copy(update={"encoder": sizes, "calibrate": brief})
        scales = calibrate.scales(own, sight, resting.record(own, sight))
        condition = "noisy" if p.conditions.free == P.conditions.free else "free"
        made = Experiment(own, condition, ALL, [0], sight, scales)
        attached = own.protocol.baseline_steps
        with made.eye:
            for step in (0, attached, attached + own.protocol.attached_steps):
                made.step(step)
        for name, dataset in made.log.records()[0].items():
            assert np.isfinite(dataset.values).all(), name
        TALLY["computed"] += 1

    with pytest.MonkeyPatch.context() as patch:  # a scene takes half a second, and most mutants leave it as it is
        patch.setattr(scene, "build", functools.lru_cache(4)(scene.build))
        yield compute


def key(p: Params) -> str:
    """All that a run reads."""
    return p.model_dump_json(exclude={"collect", "calibrate", "sweep", "film"})
