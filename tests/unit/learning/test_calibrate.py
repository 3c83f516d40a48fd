"""The rewards' scales, measured under the resting policy."""

import math

import numpy as np
import pytest

from mimo.learning import calibrate, resting, rewards
from mimo.learning.experience import initial_quantiles
from mimo.learning.outcomes import Outcomes
from mimo.learning.resting import Rest
from mimo.record import streams
from mimo.settings import params
from mimo.settings.params import Params
from mimo.vision.extractor import Extractor, Trained
from mimo.world import body, scene
from mimo.world.eye import Eye
from mimo.world.physics import Worlds
from mimo.world.protocol import MOVE


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
    shapes = {"action": (6, 2, 12), "path_length": (6, 2), "latent": (2, 7, 64), "proprioception": (6, 2, 47)}
    for name, shape in shapes.items():
        assert getattr(rest, name).shape == shape
        assert getattr(rest, name).tobytes() == getattr(again, name).tobytes()
    assert rest.latent.dtype == rest.path_length.dtype == rest.proprioception.dtype == np.float32
    assert rest.action.dtype == bool
    assert calibrate.scales(tiny, trained, again) == measured


@pytest.mark.parametrize(("frames", "cuts"), [(1, ()), (4, (30, 60, 90))])
def test_scales_are_standard_deviations_over_the_second_half(
    frames: int, cuts: tuple[int, ...], tiny: Params, trained: Trained
) -> None:
    """MTL and RTL by a loop over worlds, one at a time: free, the rope on."""
    asked = params.changed(tiny, {"rewards.rtl.frames": frames})
    rest = resting.record(asked, trained)
    assert rest.latent.shape == (2, 6 * frames + 1, 64)
    measured = calibrate.scales(asked, trained, rest)
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
                path, way = 0.0, 0.0
                for piece in worlds.pieces(moved[None], positive[None], True, cuts):
                    before, latent = latent, extract(eye.frames(worlds.qpos))
                    path, way = path + float(piece.path_length[0]), way + float(np.linalg.norm(latent - before))
                if step >= 3:
                    lengths.append((path, way))
    mtl, rtl = np.std(lengths, axis=0)
    assert measured["mtl"] == pytest.approx(mtl, rel=1e-5)
    assert measured["rtl"] == pytest.approx(rtl, rel=1e-5)


def test_how_much_is_paid_changes_no_scale(
    measured: dict[str, float], tiny: Params, trained: Trained, rest: Rest
) -> None:
    paid = params.changed(tiny, {"rewards.surprise.weight": 0.5, "rewards.gain": 2.0})
    assert calibrate.scales(paid, trained, rest) == measured


def test_the_rope_holds_while_scales_are_measured(tiny: Params, trained: Trained, rest: Rest) -> None:
    again = resting.record(params.changed(tiny, {"world.rope_holds": 0.0}), trained)
    for name in ("action", "path_length", "latent", "proprioception"):
        assert getattr(again, name).tobytes() == getattr(rest, name).tobytes()


@pytest.mark.parametrize(
    "changes",
    [{}, {"outcomes.marginal": "policy"}, {"outcomes.action": "limb"}, {"rewards.rtl.frames": 4}],
    ids=str,
)
def test_cais_and_surprise_are_of_outcome_models_that_learn_as_they_go(
    changes: dict[str, object], tiny: Params, trained: Trained
) -> None:
    """From the record of actions and h at the ends of steps; the policy's mixture is by the resting P(MOVE)."""
    asked = params.changed(tiny, changes)
    rest = resting.record(asked, trained)
    ends = rest.latent[:, :: asked.rewards.rtl.frames]
    draws = [streams.generator(tiny.seed, "free", world, "calibrate_memory") for world in range(2)]
    outcomes = Outcomes(asked.outcomes, initial_quantiles(asked, trained, "free"), draws)
    probability = np.full((2, 12), 1 / (1 + math.exp(0.2 / 0.3)), np.float32)
    cais, surprise = np.zeros((2, 6, 2, 12))
    for step, moved in enumerate(rest.action):
        cais[step] = np.where(moved, outcomes.influence(probability)[..., MOVE], 0)
        after = ends[:, step + 1]
        surprise[step] = np.linalg.norm(after[:, None] - outcomes.expectation(moved), axis=-1)
        outcomes.update(moved, np.ascontiguousarray(after))
    measured = calibrate.scales(asked, trained, rest)
    assert measured["cais"] == pytest.approx(cais[3:].std(), rel=1e-5)
    assert measured["surprise"] == pytest.approx(surprise[3:].std(), rel=1e-5)


def test_a_reward_that_does_not_vary_has_no_scale(
    tiny: Params, trained: Trained, rest: Rest, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rewards.REWARDS["rtl"], "__call__", lambda self, t: np.ones(t.action.shape))
    with pytest.raises(FloatingPointError, match="reward rtl does not vary"):
        calibrate.scales(tiny, trained, rest)
