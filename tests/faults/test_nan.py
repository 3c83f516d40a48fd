"""Training that comes to NaN stops its own run, by name and step, and no other."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from mimo.learning.experiment import Experiment, Record, RunError
from mimo.settings.params import Params
from mimo.vision import encoder
from mimo.vision.extractor import Trained


def test_a_nan_in_one_seed_stops_its_run_and_touches_no_other(
    tiny: Params, trained: Trained, scales: dict[str, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A weight of seed 1 becomes NaN before the third step, in company and alone."""
    step = Experiment.step

    def poison(self: Experiment, number: int) -> None:
        if number == 2 and 1 in self.seeds:
            self.agents.networks[self.seeds.index(1)].inlet.weight[0, 0] = np.nan
        step(self, number)

    def computed(*seeds: int) -> list[Record]:
        return Experiment(tiny, "noisy", "cais_surprise", seeds, trained, scales).run()

    before = computed(0, 1)
    monkeypatch.setattr(Experiment, "step", poison)
    for seeds, name in (((0, 1), "seeds 0, 1"), ((1,), "seed 1")):
        with pytest.raises(RunError) as caught:
            computed(*seeds)
        assert str(caught.value) == (
            f"noisy, cais_surprise, {name} stopped at step 3: the TD error of seed 1 is not finite"
        )
    (alone,) = computed(0)
    assert all((dataset.values == before[0][name].values).all() for name, dataset in alone.items())


def test_a_poisoned_encoder_stops_the_first_step(tiny: Params, trained: Trained, scales: dict[str, float]) -> None:
    name = next(iter(trained.weights))
    bad = replace(trained, weights=trained.weights | {name: np.full_like(trained.weights[name], np.nan)})
    with pytest.raises(RunError, match=r"^free, mtl, seed 7 stopped at step 1: the TD error of seed 7 is not finite$"):
        Experiment(tiny, "free", "mtl", [7], bad, scales).run()


def test_a_poisoned_frame_stops_the_encoder_when_it_is_drawn(tiny: Params, pairs: np.ndarray) -> None:
    frames = pairs[:, ::5].astype(np.float32)
    frames[1, 1, 1, 64, 64, 0] = np.nan  # pair 3 of 8
    brief = tiny.encoder.model_copy(update={"pairs": 2, "iterations": 50})
    told: list[int] = []
    draws = np.random.default_rng(4)
    draws.integers(2**31)
    drawn = next(i for i in itertools.count() if 3 in draws.choice(8, size=2, replace=False))
    assert drawn > 0
    with pytest.raises(FloatingPointError, match=f"^encoder training: the loss is not finite at iteration {drawn}$"):
        encoder.train(brief, frames, np.random.default_rng(4), told.append)
    assert told == list(range(1, drawn + 1))
