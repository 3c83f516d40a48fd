"""CAIS with other distances: against numbers worked by hand, and against scipy and plain numpy in float64."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as examples
from hypothesis import strategies as st
from scipy import stats

from mimo.learning import distances, rewards
from mimo.learning.outcomes import wasserstein
from mimo.learning.rewards import Reward, Transition
from mimo.settings import params

JOINTS, LATENT, JOINT = 12, 4, 7
NAMES = ("means", "kl", "energy", "mmd")
ROW = 2 * JOINT + 1  # of p(h|MOVE)
NARROW = 0.5 / 0.3**2


def made(name: str, **own: Any) -> Reward:
    """The reward of that name; `own` changes its constants."""
    held = params.load().rewards
    changed = params.checked(held, {name: getattr(held, name).model_dump() | own}) if own else held
    (reward,) = rewards.parts(name, changed)
    return reward


def step(tables: np.ndarray, moved: tuple[int, ...] = (JOINT,)) -> Transition:
    """One seed's (25, quantiles, latent), in which some joints moved."""
    action = np.zeros((1, JOINTS), bool)
    action[0, list(moved)] = True
    latents = np.zeros((1, 2, LATENT), np.float32)
    return Transition(np.zeros(1, np.float32), latents, action, tables=tables[None].astype(np.float32))


def two_points(move: tuple[float, float], marginal: tuple[float, float], dimension: int = 2) -> np.ndarray:
    """Tables of two quantiles. All are 0 but in one dimension, where a joint's p(h|MOVE) and p(h) are as given."""
    tables = np.zeros((25, 2, LATENT))
    tables[:, :, dimension] = marginal
    tables[ROW, :, dimension] = move
    return tables


def paid(name: str, move: tuple[float, float], marginal: tuple[float, float], **own: Any) -> float:
    """What the joint is paid, times the latent's dimensions, three of which add nothing."""
    (found,) = made(name, **own)(step(two_points(move, marginal)))
    assert not np.delete(found, JOINT).any()
    return float(found[JOINT]) * LATENT


def test_means_by_hand() -> None:
    assert paid("means", (1, 2), (0.25, 0.75)) == pytest.approx(1)
    assert paid("means", (-1, 1), (0, 0)) == 0  # spread is not seen
    assert paid("means", (-3, -1), (0, 0)) == pytest.approx(2)


def test_gaussian_kl_by_hand() -> None:
    """SDs of two points at 1 and 3, and at -2 and 2, are 1 and 2."""
    assert paid("kl", (1, 3), (-2, 2)) == pytest.approx(math.log(2) + (1 + 4) / 8 - 0.5, rel=1e-6)
    assert paid("kl", (-2, 2), (1, 3)) == pytest.approx(-math.log(2) + (4 + 4) / 2 - 0.5, rel=1e-6)


def test_gaussian_kl_has_a_floor() -> None:
    assert paid("kl", (0.5, 0.5), (0, 0), floor=0.25) == pytest.approx(0.5 * (0.5 / 0.25) ** 2)
    assert paid("kl", (0.5, 0.5), (-1, 1), floor=0.25) == pytest.approx(math.log(4) + (1 / 16 + 0.25) / 2 - 0.5)


def test_energy_distance_by_hand() -> None:
    """Between points 2 |a - b|; between {0, 2} and {1, 1} it is 2 - 1 - 0."""
    assert paid("energy", (3, 3), (1, 1)) == pytest.approx(2)
    assert paid("energy", (0, 2), (1, 1)) == pytest.approx(1)
    assert paid("energy", (2, 0), (1, 1)) == pytest.approx(1)  # quantiles that have crossed
    assert paid("energy", (0, 1), (1, 0)) == 0


def test_mmd_by_hand() -> None:
    """Between points a and b it is 2 - 2 k(a, b); between {0, 2} and {1, 1} it is 3 / 2 + k(0, 2) / 2 - 2 k(0, 1)."""
    assert paid("mmd", (0.3, 0.3), (0, 0)) == pytest.approx(math.sqrt(2 - 2 * math.exp(-0.5)), rel=1e-5)
    assert paid("mmd", (0, 2), (1, 1), bandwidth=1.0) == pytest.approx(
        math.sqrt(1.5 + math.exp(-2) / 2 - 2 * math.exp(-0.5)), rel=1e-5
    )
    assert paid("mmd", (0, 1), (1, 0)) == pytest.approx(0, abs=1e-7)


def test_mmd_resolves_what_float32_could_not() -> None:
    """A point's small shift is as far as it is long, in bandwidths."""
    assert paid("mmd", (0.5 + 2**-20, 0.5 + 2**-20), (0.5, 0.5)) == pytest.approx(2**-20 / 0.3, rel=0.01)
    assert paid("mmd", (60, 60), (0, 0)) == pytest.approx(math.sqrt(2))  # exp of less than LEAST


@pytest.mark.parametrize("name", NAMES)
def test_who_moved_is_paid_the_distance_of_its_own_move(name: str) -> None:
    """Of NO_TORQUE's tables nothing is read."""
    tables = np.random.default_rng(4).normal(0, 0.3, (25, 9, LATENT))
    whole, some = made(name)(step(tables, tuple(range(JOINTS)))), made(name)(step(tables, (0, 5, 11)))
    assert whole.shape == (1, JOINTS)
    assert len(set(whole[0])) == JOINTS
    assert (whole > 0).all()
    assert (some == np.where(np.isin(np.arange(JOINTS), (0, 5, 11)), whole, 0)).all()
    assert not made(name)(step(tables, ())).any()
    rests = tables.copy()
    rests[:-1:2] += 1
    assert (made(name)(step(rests, (0, 5, 11))) == some).all()
    tables[11] += 1  # MOVE of joint 5
    found = made(name)(step(tables, (0, 5, 11)))
    assert np.flatnonzero(found != some).tolist() == [5]
    assert found[0, 5] > some[0, 5]


@pytest.mark.parametrize("name", NAMES)
def test_they_refuse_a_transition_without_tables(name: str) -> None:
    whole = step(two_points((0, 1), (0, 1)))
    with pytest.raises(AssertionError, match=r"^a distance of outcomes needs their tables$"):
        made(name)(Transition(whole.path_length, whole.latents, whole.action))


TABLES = st.tuples(st.integers(1, 3), st.integers(1, 20), st.integers(1, 9), st.integers(0, 99))


def drawn(shape: tuple[int, int, int, int]) -> tuple[np.ndarray, np.ndarray]:
    """(moved, quantiles, latent), (quantiles, latent); some quantiles are equal, and in no order."""
    moved, quantiles, latent, seed = shape
    values = np.random.default_rng(seed).normal(0, 0.3, (moved + 1, quantiles, latent)).round(1).astype(np.float32)
    return values[1:].copy(), values[0].copy()


@given(TABLES)
@examples(max_examples=40)
def test_the_energy_distance_is_scipys(shape: tuple[int, int, int, int]) -> None:
    moves, marginal = drawn(shape)
    expected = [
        np.mean([stats.energy_distance(x, y) for x, y in zip(move.T, marginal.T, strict=True)]) for move in moves
    ]
    np.testing.assert_allclose(distances.energy(moves, marginal), expected, rtol=1e-4, atol=1e-6)


@given(TABLES)
@examples(max_examples=40)
def test_mmd_is_that_of_the_definition(shape: tuple[int, int, int, int]) -> None:
    moves, marginal = (tables.astype(float) for tables in drawn(shape))

    def kernel(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.exp(-NARROW * (x[:, None] - y[None]) ** 2).mean(axis=(0, 1))

    squares = [kernel(x, x) + kernel(marginal, marginal) - 2 * kernel(x, marginal) for x in moves]
    expected = np.sqrt(np.maximum(squares, 0)).mean(axis=1)
    np.testing.assert_allclose(distances.mmd(moves, marginal, NARROW), expected, rtol=1e-6, atol=1e-6)


def test_a_mere_shift_is_as_far_by_means_as_by_w1() -> None:
    tables = np.random.default_rng(1).normal(0, 0.3, (25, 9, LATENT)).astype(np.float32)
    tables[ROW] = tables[-1] + np.float32(0.125)
    found = made("means")(step(tables))[0, JOINT]
    assert found == pytest.approx(0.125, rel=1e-5)
    assert found == pytest.approx(wasserstein(tables[ROW], tables[-1]), rel=1e-5)
