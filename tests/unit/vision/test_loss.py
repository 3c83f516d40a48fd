"""The CLTT loss against a loop, hand-worked numbers and its laws."""

import math

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from mimo.vision.encoder import cltt_loss
from tests.unit.vision.reference import normal, nt_xent

PAIRS = st.integers(2, 6)
TAU = st.floats(0.05, 5.0)


@given(PAIRS, st.integers(1, 8), TAU, st.integers(0, 99))
def test_the_loss_against_a_loop(pairs: int, width: int, tau: float, seed: int) -> None:
    first, second = normal(2, pairs, width, seed=seed)
    assert cltt_loss(first, second, tau).item() == pytest.approx(nt_xent(first.numpy(), second.numpy(), tau), rel=1e-9)


@pytest.mark.parametrize(
    ("second", "expected"),
    [
        ([[1.0, 0.0], [0.0, 1.0]], math.log(1 + 2 * math.exp(-2))),  # each anchor: itself again 1, two others 0
        ([[0.0, 1.0], [1.0, 0.0]], math.log(2 + math.exp(2))),  # its partner 0, the other pair 0 and 1
        ([[-1.0, 0.0], [0.0, -1.0]], math.log(1 + 2 * math.exp(2))),  # its partner -1, two others 0
        ([[0.0, 5.0], [-3.0, 0.0]], (math.log(2 + math.exp(-2)) + math.log(2 + math.exp(2))) / 2),
    ],
)
def test_the_loss_of_two_pairs_by_hand(second: list[list[float]], expected: float) -> None:
    first = torch.tensor([[1.0, 0.0], [0.0, 1.0]], dtype=torch.float64)
    loss = cltt_loss(first, torch.tensor(second, dtype=torch.float64), 0.5)
    assert loss.item() == pytest.approx(expected, rel=1e-12)


@given(PAIRS, TAU, st.integers(0, 99))
def test_the_loss_ignores_lengths_and_orders(pairs: int, tau: float, seed: int) -> None:
    first, second = normal(2, pairs, 5, seed=seed)
    loss = pytest.approx(cltt_loss(first, second, tau).item(), rel=1e-9)
    rng = np.random.default_rng(seed)
    order = torch.from_numpy(rng.permutation(pairs))
    longer, shorter = torch.from_numpy(rng.uniform(0.01, 100, (2, pairs, 1)))
    assert cltt_loss(first * longer, second * shorter, tau).item() == loss
    assert cltt_loss(first[order], second[order], tau).item() == loss
    assert cltt_loss(second, first, tau).item() == loss


@given(PAIRS, TAU, st.lists(st.floats(0, math.pi / 2), min_size=2, max_size=2, unique=True))
def test_the_loss_falls_as_pairs_align(pairs: int, tau: float, angles: list[float]) -> None:
    """Frames that are orthogonal but for the angle within each pair: only the positives' similarity counts."""
    axes = torch.eye(2 * pairs, dtype=torch.float64)
    near, far = sorted(angles)
    losses = []
    for angle in (near, far):
        second = math.cos(angle) * axes[:pairs] + math.sin(angle) * axes[pairs:]
        losses.append(cltt_loss(axes[:pairs], second, tau).item())
        expected = math.log1p((2 * pairs - 2) * math.exp(-math.cos(angle) / tau))
        assert losses[-1] == pytest.approx(expected, rel=1e-9, abs=1e-12)
    assert losses[0] <= losses[1] + 1e-12


@given(PAIRS)
def test_the_loss_at_its_limits(pairs: int) -> None:
    """Nothing told apart: one in all the others. Pairs perfectly told apart, cold: nothing left to lose."""
    first, second = normal(2, pairs, 5)
    chance = pytest.approx(math.log(2 * pairs - 1), rel=1e-5)
    assert cltt_loss(torch.ones(pairs, 3), torch.ones(pairs, 3), 0.5).item() == chance
    assert cltt_loss(first, second, 1e7).item() == chance
    axes = torch.eye(pairs, dtype=torch.float64)
    assert cltt_loss(axes, axes, 0.01).item() == pytest.approx(0.0, abs=1e-12)


def test_the_gradient_of_the_loss() -> None:
    first, second = normal(2, 3, 4).requires_grad_()
    assert torch.autograd.gradcheck(lambda a, b: cltt_loss(a, b, 0.5), (first, second))
