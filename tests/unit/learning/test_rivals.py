"""CAIS's rivals: RND against torch, learning progress and CAI against numbers worked by hand and a toy world."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
import torch

from mimo.learning import rewards
from mimo.learning.influence import Models
from mimo.learning.rewards import Reward, Transition
from mimo.learning.rewards.cai import influence
from mimo.learning.rewards.rnd import _Distillation
from mimo.settings import params
from tests.unit.learning.test_agent import twin

JOINTS, LATENT, ANGLES = 12, 6, 47


def made(name: str, seeds: Sequence[int] = (0,), **own: Any) -> Any:
    """The reward of that name for some seeds; `own` changes its constants."""
    held = params.load().rewards
    changed = params.checked(held, {name: getattr(held, name).model_dump() | own})
    (reward,) = rewards.parts(name, changed, lambda _: [np.random.default_rng((3, seed)) for seed in seeds])
    return reward


def seen(h: np.ndarray, **fields: Any) -> Transition:
    """One seed's step to h (latent,), in which no joint moved unless told otherwise."""
    latents = np.stack([np.zeros_like(h), h])[None].astype(np.float32)
    held: dict[str, Any] = {"action": np.zeros((1, JOINTS), bool)} | fields
    return Transition(np.zeros(1, np.float32), latents, **held)


# Random network distillation.


def test_rnd_is_the_error_before_the_step_and_learns_as_torch_does() -> None:
    generator, reward = np.random.default_rng(0), made("rnd", hidden=16)
    drawn = _Distillation(LATENT, 16, 0.001, np.random.default_rng((3, 0)))  # as the reward's own
    target, predictor = twin(drawn.target), twin(drawn.predictor)
    optimizer = torch.optim.AdamW(predictor.parameters(), lr=0.001)
    for _ in range(20):
        h = generator.normal(0, 0.3, LATENT)
        paid = reward(seen(h))
        x = torch.from_numpy(h.astype(np.float32)).double()[None]
        optimizer.zero_grad()
        loss = torch.nn.functional.mse_loss(predictor(x), target(x).detach())
        loss.backward()
        optimizer.step()
        assert paid.shape == (1, JOINTS)
        assert (paid == paid[0, 0]).all()
        assert paid[0, 0] == pytest.approx(loss.item(), rel=2e-3)


def test_rnd_wears_off_on_what_repeats_and_returns_with_what_is_new() -> None:
    generator, reward = np.random.default_rng(1), made("rnd")
    old, new = generator.normal(0, 0.3, (2, LATENT))
    paid = [float(reward(seen(old))[0, 0]) for _ in range(150)]
    assert paid[-1] < 0.05 * paid[0]
    assert reward(seen(new))[0, 0] > 5 * paid[-1]


def test_rnd_draws_other_networks_for_each_seed_and_two_for_each() -> None:
    reward = made("rnd", seeds=(0, 1))
    h = np.zeros((2, 2, LATENT), np.float32)
    reward(Transition(np.zeros(2, np.float32), h, np.zeros((2, JOINTS), bool)))
    weights = [net.inlet.weight for seed in reward._seeds for net in (seed.target, seed.predictor)]
    assert len({held.tobytes() for held in weights}) == 4
    assert all(0.9 < np.abs(held).max() * math.sqrt(LATENT) < 1.01 for held in weights)


@pytest.mark.parametrize("name", ["rnd", "cai"])
def test_what_must_draw_says_so(name: str) -> None:
    (reward,) = rewards.parts(name, params.load().rewards)
    t = seen(np.zeros(LATENT), proprioception=np.zeros((1, ANGLES)), probability=np.zeros((1, JOINTS)))
    with pytest.raises(AssertionError, match=r"needs a generator for each seed$"):
        reward(t)


# Learning progress.


def progress(reward: Reward, *errors: float, moved: str = "") -> list[float]:
    """What joint 4 is paid for its errors; the others' are 1 throughout. It moves where `moved` has an m."""
    found = []
    for error, action in zip(errors, moved or "-" * len(errors), strict=True):
        expectation = np.zeros((1, JOINTS, LATENT), np.float32)
        expectation[..., 0] = 1
        expectation[0, 4, 0] = error
        moves = np.zeros((1, JOINTS), bool)
        moves[0, 4] = action == "m"
        (paid,) = reward(seen(np.zeros(LATENT), expectation=expectation, action=moves))
        assert not np.delete(paid, 4).any()
        found.append(float(paid[4]))
    return found


def test_progress_is_the_fall_of_the_mean_error() -> None:
    """Windows of two: (8 + 6) / 2 - (4 + 2) / 2, and so on; before the fourth step, half a window's fall counts."""
    assert progress(made("progress", window=2), 8, 6, 4, 2, 2, 6) == [0, 1, 1, 4, 3, -1]


def test_progress_is_that_of_the_action_taken() -> None:
    """MOVE's errors are 8, 6, 4, 2, the other action's 9, 1, 1, 5: neither's progress is the other's."""
    paid = progress(made("progress", window=2), 8, 6, 9, 4, 1, 2, 1, 5, moved="mm-m-m--")
    assert paid == [0, 1, 0, 1, 4, 4, 0, 2]


def test_progress_needs_what_was_expected() -> None:
    with pytest.raises(AssertionError, match=r"^learning progress needs the expected outcome of actions$"):
        made("progress")(seen(np.zeros(LATENT)))


# Causal action influence.


def test_influence_by_hand() -> None:
    """Means 0 and 2, variance 1, P(MOVE) 1/4: the mixture is N(1/2, 1 + 3/16 of 4), and MOVE is 3/2 from its mean."""
    means, variance = np.zeros((1, JOINTS, 2, LATENT), np.float32), np.ones((1, JOINTS, LATENT), np.float32)
    means[0, 3, 1, 5] = 2
    (found,) = influence(means, variance, np.full((1, JOINTS), 0.25, np.float32), 0.01)
    expected = 0.5 * (math.log(1.75) + (1 + 2.25) / 1.75 - 1) / LATENT
    assert found[3] == pytest.approx(expected, rel=1e-6)
    assert not np.delete(found, 3).any()
    (sure,) = influence(means, variance, np.ones((1, JOINTS), np.float32), 0.01)
    assert not sure.any()  # who always moves learns nothing by moving
    (tight,) = influence(means, 0 * variance, np.zeros((1, JOINTS), np.float32), 0.5)
    assert tight[3] == pytest.approx(0.5 * 4 / 0.25 / LATENT)


def test_models_learn_as_linear_ones_in_torch_do() -> None:
    """A memory of one transition leaves nothing to the draw; models of actions not taken have no gradient."""
    generator, models = np.random.default_rng(2), Models(5, LATENT, 1, 3, 0.001, [np.random.default_rng(0)])
    weights = torch.zeros((JOINTS, 2, LATENT, 5), dtype=torch.float64, requires_grad=True)
    optimizer, mean_square = torch.optim.AdamW([weights], lr=0.001), np.zeros((JOINTS, LATENT))
    for _ in range(30):
        state, h = generator.normal(size=(1, 5)).astype(np.float32), generator.normal(size=(1, LATENT))
        action, h = generator.random((1, JOINTS)) < 0.5, h.astype(np.float32)
        taken = weights[torch.arange(JOINTS), torch.from_numpy(action[0]).long()]
        errors = torch.from_numpy(h[0]).double() - taken @ torch.from_numpy(state[0]).double()
        mean_square = errors.detach().numpy() ** 2
        optimizer.zero_grad()
        (0.5 * errors.square().sum()).backward()
        optimizer.step()
        models.update(state, action, h)
        np.testing.assert_allclose(models.variance[0], mean_square, rtol=1e-4, atol=1e-6)
        expected = weights.detach().numpy() @ state[0].astype(float)
        np.testing.assert_allclose(models.means(state)[0], expected, atol=2e-5)


def test_variances_are_means_over_the_memory() -> None:
    models = Models(1, 1, 4, 1, 1e-6, [np.random.default_rng(0)])  # which hardly learn
    for h in (1, 2, 3):
        models.update(np.ones((1, 1), np.float32), np.zeros((1, JOINTS), bool), np.full((1, 1), h, np.float32))
    np.testing.assert_allclose(models.variance, 14 / 3, rtol=1e-4)
    for _ in range(2):
        models.update(np.ones((1, 1), np.float32), np.ones((1, JOINTS), bool), np.zeros((1, 1), np.float32))
    np.testing.assert_allclose(models.variance, 14 / 3 * 0.75**2, rtol=1e-4)


def test_batches_are_of_the_own_action() -> None:
    """h is 1 where a joint moved and -1 where it rested: each model arrives at its own, whatever the others see."""
    generator, models = np.random.default_rng(5), Models(1, JOINTS, 50, 4, 0.01, [np.random.default_rng(0)])
    for _ in range(400):
        action = generator.random((1, JOINTS)) < 0.3
        models.update(np.ones((1, 1), np.float32), action, np.where(action, 1, -1).astype(np.float32))
    (means,) = models.means(np.ones((1, 1), np.float32))
    own = means[np.arange(JOINTS), :, np.arange(JOINTS)]
    np.testing.assert_allclose(own, np.tile([-1, 1], (JOINTS, 1)), atol=0.05)


def test_cai_finds_the_joint_whose_move_shifts_h_and_in_which_state() -> None:
    """MOVE of joint 3 adds the first joint angle, -1/2 or 1/2, to every h, or nothing where it is 0."""
    generator, reward = np.random.default_rng(6), made("cai", learning_rate=0.01)
    found: dict[float, list[np.ndarray]] = {-0.5: [], 0.0: [], 0.5: []}
    before = np.zeros(LATENT, np.float32)
    for k in range(900):
        angle = float(generator.choice([-0.5, 0.0, 0.5]))
        angles = np.zeros((1, ANGLES), np.float32)
        angles[0, 0] = angle
        action = generator.random((1, JOINTS)) < 0.5
        after = (angle * action[0, 3] + generator.normal(0, 0.2, LATENT)).astype(np.float32)
        t = Transition(
            np.zeros(1, np.float32), np.stack([before, after])[None], action,
            proprioception=angles, probability=np.full((1, JOINTS), 0.5, np.float32),
        )  # fmt: skip
        (paid,) = reward(t)
        assert not paid[~action[0]].any()
        if k >= 300:
            found[angle].append(np.where(action[0], paid, np.nan))
        before = after
    paid_in = {angle: np.nanmean(rows, axis=0) for angle, rows in found.items()}
    own, whole = 0.25**2, 0.2**2 + 0.25**2  # squared way of MOVE from the mixture's mean, the mixture's variance
    worth = 0.5 * (math.log(whole / 0.04) + (0.04 + own) / whole - 1)
    for angle in (-0.5, 0.5):
        assert paid_in[angle][3] == pytest.approx(worth, rel=0.3)
        assert paid_in[angle][3] > 5 * np.delete(paid_in[angle], 3).max()
    assert paid_in[0.0][3] < 0.2 * worth


@pytest.mark.parametrize(
    ("fields", "lacking"),
    [
        ({"probability": np.zeros((1, JOINTS), np.float32)}, r"^CAI needs the joint angles at the step's start$"),
        ({"proprioception": np.zeros((1, ANGLES), np.float32)}, r"^CAI needs P\(MOVE\) by which the action"),
    ],
)
def test_cai_says_what_a_transition_lacks(fields: dict[str, np.ndarray], lacking: str) -> None:
    with pytest.raises(AssertionError, match=lacking):
        made("cai")(seen(np.zeros(LATENT), **fields))


def test_models_refuse_other_shapes() -> None:
    models = Models(3, LATENT, 4, 2, 0.001, [np.random.default_rng(0)])
    state, action, h = np.zeros((1, 3), np.float32), np.zeros((1, JOINTS), bool), np.zeros((1, LATENT), np.float32)
    with pytest.raises(ValueError, match=r"^state must be \(1, 3\) of float32; it is \(1, 4\)"):
        models.means(np.zeros((1, 4), np.float32))
    with pytest.raises(ValueError, match=r"^action must be"):
        models.update(state, action[:, 1:], h)
    with pytest.raises(ValueError, match=r"^latent must be"):
        models.update(state, action, h.astype(float))
