"""Frames under the resting policy."""

import math

import numpy as np
import pytest

from mimo.record import streams
from mimo.settings.params import Params
from mimo.vision import collect
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
            made = 0
            for _ in worlds.pieces(moved[None], positive[None], attached, range(1, 120)):
                made += 1
                if made in (120 - 8, 120):
                    frame = made // 120
                    assert worlds.centre_of_mass[0].tobytes() == centres[step, frame].tobytes()
                    assert (eye.frames(worlds.qpos)[0] == frames[step, frame]).all()
            assert made == 120


# Other draws, and frames of all limbs.


def changed(p: Params, **values: object) -> Params:
    return p.model_copy(update={"collect": p.collect.model_copy(update=values)})


def test_another_draw_sees_other_frames(tiny: Params, collected: Collected) -> None:
    frames, centres = collect.collect(changed(tiny, draw=1))
    seen = {row.tobytes() for row in (*centres[1:].reshape(6, -1), *collected[1][1:].reshape(6, -1))}
    assert len(seen) == 12
    assert (frames[1:] != collected[0][1:]).any(axis=(3, 4, 5, 6)).any(axis=-1).all()
    assert np.abs(centres[0] - collected[1][0]).max() < 1e-9  # nothing moves there


def test_no_draw_has_a_stream_of_anothers(tiny: Params) -> None:
    """At as many worlds as there may be."""
    places = [
        collect.stream(changed(tiny, draw=draw), world, attached)
        for draw in (0, 1, 2, 999, 1000)
        for world in range(16)
        for attached in (False, True)
    ]
    assert len(set(places)) == len(places)
    assert places[:32] == list(range(32))  # of draw 0, as they were


def test_worlds_may_be_tied_to_each_limb_in_turn(tiny: Params) -> None:
    """Five worlds: the first limb has two. Each world is as it is where all are tied to its limb."""
    told: list[int] = []
    few = changed(tiny, worlds=5, steps=2)
    together = collect.collect(changed(few, limbs="all"), told.append)
    limbs = list(body.LIMB_JOINTS)
    assert collect.limbs(changed(few, limbs="all")) == limbs
    assert collect.limbs(few) == [tiny.protocol.limb] == ["left_foot"]
    tied = [limbs[world % 4] for world in range(5)]
    for limb in limbs:
        own = collect.collect(few.model_copy(update={"protocol": few.protocol.model_copy(update={"limb": limb})}))
        for world, its in enumerate(tied):
            for one, other in zip(together, own, strict=True):
                assert (one[:, world].tobytes() == other[:, world].tobytes()) == (limb == its)
    assert told == [*range(2, 17, 2), *(16 + steps for steps in range(1, 25))]
