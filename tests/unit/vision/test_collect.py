"""Frames under the resting policy."""

import math

import numpy as np
import pytest

from mimo.record import streams
from mimo.settings.params import Params
from mimo.vision import collect
from mimo.world import scene
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
            made = 0
            for _ in worlds.pieces(moved[None], positive[None], attached, range(1, 120)):
                made += 1
                if made in (120 - 8, 120):
                    frame = made // 120
                    assert worlds.centre_of_mass[0].tobytes() == centres[step, frame].tobytes()
                    assert (eye.frames(worlds.qpos)[0] == frames[step, frame]).all()
            assert made == 120
