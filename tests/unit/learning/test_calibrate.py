"""The rewards' scales, measured under the resting policy."""

import math

import numpy as np
import pytest

from mimo.learning import calibrate, resting, rewards
from mimo.learning.resting import Rest
from mimo.record import streams
from mimo.settings.params import Params
from mimo.vision.extractor import Extractor, Trained
from mimo.world import body, scene
from mimo.world.eye import Eye
from mimo.world.physics import Worlds


@pytest.fixture(scope="module")
def rest(tiny: Params, trained: Trained) -> Rest:
    return resting.record(tiny, trained)


@pytest.fixture(scope="module")
def measured(tiny: Params, trained: Trained, rest: Rest) -> dict[str, float]:
    return calibrate.scales(tiny, trained, rest)


def test_every_reward_has_a_scale(measured: dict[str, float]) -> None:
    assert set(measured) == set(rewards.REWARDS)
    assert all(type(scale) is float and 0 < scale < math.inf for scale in measured.values())


def test_a_record_is_the_same_again(rest: Rest, measured: dict[str, float], tiny: Params, trained: Trained) -> None:
    told: list[int] = []
    again = resting.record(tiny, trained, told.append)
    assert told == [2, 4, 6, 8, 10, 12]
    shapes = {"action": (6, 2, 12), "path_length": (6, 2), "latent": (7, 2, 64)}
    for name, shape in shapes.items():
        assert getattr(rest, name).shape == shape
        assert getattr(rest, name).tobytes() == getattr(again, name).tobytes()
    assert rest.latent.dtype == rest.path_length.dtype == np.float32
    assert rest.action.dtype == bool
    assert calibrate.scales(tiny, trained, again) == measured


def test_scales_are_standard_deviations_over_the_second_half(
    measured: dict[str, float], tiny: Params, trained: Trained
) -> None:
    """MTL and RTL by a loop over worlds, one at a time: free, the rope on."""
    built = scene.build(tiny.world, tiny.protocol)
    extract = Extractor(tiny.encoder, trained)
    lengths: list[tuple[float, float]] = []
    with Eye(built) as eye:
        for world in range(2):
            draw = streams.generator(tiny.seed, "free", world, "calibrate")
            worlds = Worlds(built, tiny.protocol, 0.0, [np.random.default_rng()])
            latent = extract(eye.frames(worlds.qpos))
            for step in range(6):
                moved = draw.random(len(body.ACTUATED)) < 1 / (1 + math.exp(0.2 / 0.3))
                positive = draw.random(len(body.ACTUATED)) < 0.5
                path = worlds.step(moved[None], positive[None], attached=True).path_length[0]
                before, latent = latent, extract(eye.frames(worlds.qpos))
                if step >= 3:
                    lengths.append((float(path), float(np.linalg.norm(latent - before))))
    mtl, rtl = np.std(lengths, axis=0)
    assert measured["mtl"] == pytest.approx(mtl, rel=1e-5)
    assert measured["rtl"] == pytest.approx(rtl, rel=1e-5)


def test_a_reward_that_does_not_vary_has_no_scale(
    tiny: Params, trained: Trained, rest: Rest, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rewards.REWARDS["rtl"], "__call__", lambda self, t: np.ones(t.action.shape))
    with pytest.raises(FloatingPointError, match="reward rtl does not vary"):
        calibrate.scales(tiny, trained, rest)
