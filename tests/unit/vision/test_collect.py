"""Frames under the resting policy, and the rewards' scales measured under it."""

import math

import numpy as np
import pytest
import torch

from mimo.learning import calibrate, rewards
from mimo.record import streams
from mimo.settings.params import Params
from mimo.vision import collect
from mimo.vision.encoder import Extractor, Trained
from mimo.world import body, scene
from mimo.world.eye import Eye
from mimo.world.physics import Worlds

Collected = tuple[np.ndarray, np.ndarray]


def test_resting_probability(tiny: Params) -> None:
    assert collect.resting_probability(tiny.agent) == pytest.approx(1 / (1 + math.exp(0.2 / 0.3)), rel=1e-12)
    unbiased = tiny.agent.model_copy(update={"move_bias": 0.0})
    assert collect.resting_probability(unbiased) == 0.5


def test_shapes_and_types(collected: Collected) -> None:
    frames, centres = collected
    assert frames.shape == (4, 2, 5, 2, 128, 128, 3)
    assert frames.dtype == np.uint8
    assert centres.shape == (4, 2, 5, 2, 3)
    assert centres.dtype == np.float64
    assert np.isfinite(centres).all()
    assert collect.REGIMES == (("free", False), ("free", True), ("noisy", False), ("noisy", True))


def test_the_same_bytes_again(tiny: Params, collected: Collected) -> None:
    told: list[int] = []
    again = collect.collect(tiny, told.append)
    assert again[0].tobytes() == collected[0].tobytes()
    assert again[1].tobytes() == collected[1].tobytes()
    assert told == list(range(2, 41, 2))


def test_a_world_is_the_same_bytes_alone(tiny: Params, collected: Collected) -> None:
    alone = collect.collect(tiny.model_copy(update={"collect": tiny.collect.model_copy(update={"worlds": 1})}))
    assert alone[0].tobytes() == collected[0][:, :1].tobytes()
    assert alone[1].tobytes() == collected[1][:, :1].tobytes()


def test_no_two_worlds_see_the_same(collected: Collected) -> None:
    lively = collected[1][1:].reshape(6, -1)  # all but free and detached, where nothing moves
    assert len({row.tobytes() for row in lively}) == 6


def test_rope_and_noise_move_the_mobile(collected: Collected) -> None:
    centres = collected[1]
    spread = np.ptp(centres, axis=(2, 3)).max(axis=-1)  # regime, world
    assert (spread[0] < 1e-9).all()
    assert (spread[1:] > 0.001).all()


def test_the_frames_of_a_pair_are_near(collected: Collected) -> None:
    """In noise, 40 ms move the mobile less than an agent step does."""
    for centres in collected[1][2:]:
        within = np.linalg.norm(centres[:, :, 1] - centres[:, :, 0], axis=-1)
        across = np.linalg.norm(np.diff(centres[:, :, 1], axis=1), axis=-1)
        assert within.min() > 0
        assert within.mean() < 0.5 * across.mean()


@pytest.mark.parametrize("regime", range(4))
def test_pairs_are_pair_updates_apart_at_the_end_of_a_step(regime: int, tiny: Params, collected: Collected) -> None:
    """The same worlds by steps that are cut elsewhere: update by update over the pair's gap."""
    condition, attached = collect.REGIMES[regime]
    frames, centres = (array[regime, 1] for array in collected)
    draw, noise = (
        streams.generator(tiny.seed, condition, 2 + attached, purpose) for purpose in ("collect", "collect_noise")
    )
    built = scene.build(tiny.world, tiny.protocol)
    worlds = Worlds(built, tiny.protocol, {"free": 0.0, "noisy": 40.0}[condition], [noise])
    with Eye(built) as eye:
        for step in range(5):
            moved = draw.random(12) < 1 / (1 + math.exp(0.2 / 0.3))
            positive = draw.random(12) < 0.5
            control = worlds.control(worlds.torque(moved[None], positive[None]))
            assert control.shape[1] == 120
            for update in range(120):
                if update == 120 - 8:
                    assert worlds.centre_of_mass[0].tobytes() == centres[step, 0].tobytes()
                    assert (eye.frames(worlds.qpos)[0] == frames[step, 0]).all()
                worlds.advance(control[:, update : update + 1], attached)
            assert worlds.centre_of_mass[0].tobytes() == centres[step, 1].tobytes()
            assert (eye.frames(worlds.qpos)[0] == frames[step, 1]).all()


# The scales of the rewards.


@pytest.fixture(scope="module")
def measured(tiny: Params, trained: Trained) -> dict[str, float]:
    return calibrate.scales(tiny, trained)


def test_every_reward_has_a_scale(measured: dict[str, float]) -> None:
    assert set(measured) == set(rewards.REWARDS)
    assert all(type(scale) is float and 0 < scale < math.inf for scale in measured.values())


def test_scales_are_the_same_again(measured: dict[str, float], tiny: Params, trained: Trained) -> None:
    told: list[int] = []
    assert calibrate.scales(tiny, trained, told.append) == measured
    assert told == [2, 4, 6, 8, 10, 12]


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
                path = worlds.step(worlds.torque(moved[None], positive[None]), attached=True).path_length[0]
                before, latent = latent, extract(eye.frames(worlds.qpos))
                if step >= 3:
                    lengths.append((float(path), float(torch.linalg.norm(latent - before))))
    mtl, rtl = np.std(lengths, axis=0)
    assert measured["mtl"] == pytest.approx(mtl, rel=1e-5)
    assert measured["rtl"] == pytest.approx(rtl, rel=1e-5)


def test_a_reward_that_does_not_vary_has_no_scale(
    tiny: Params, trained: Trained, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rewards.RTL, "__call__", lambda self, t: torch.ones(t.action.shape))
    with pytest.raises(FloatingPointError, match="reward rtl does not vary"):
        calibrate.scales(tiny, trained)
