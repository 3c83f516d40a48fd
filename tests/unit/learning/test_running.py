"""Running scales: each reward standardised by its mean and SD so far."""

import numpy as np
import pytest

from mimo.learning.experiment import Running
from tests.unit.learning.recorded import ALL, STEPS, Records, arrays


def test_running_against_all_so_far() -> None:
    values = np.random.default_rng(0).exponential(size=(5, 3, 12)) * [[[1e-3], [1], [1e3]]] + 7  # step, seed, joint
    values[:2, 2] = 0.1  # equal until the third step
    taken, shown = Running(3), values.astype(np.float32)
    for step in range(5):
        given = taken(shown[step])
        assert given.dtype == np.float32
        for seed in range(3):
            so_far = shown[: step + 1, seed].astype(float)
            wanted = (so_far[-1] - so_far.mean()) / so_far.std() if seed < 2 or step > 1 else np.zeros(12)
            assert given[seed] == pytest.approx(wanted, rel=1e-6, abs=1e-6)


def test_running_by_hand() -> None:
    taken, row = Running(1), np.ones((1, 12), np.float32)
    assert taken(0 * row).tolist() == [[0.0] * 12]
    assert taken(2 * row).tolist() == [[1.0] * 12]  # mean 1, SD 1
    assert taken(4 * row)[0] == pytest.approx(np.full(12, 1.5**0.5))  # mean 2, variance (4 + 0 + 4) / 3
    assert np.isnan(taken(float("nan") * row)).all()  # not hidden


@pytest.mark.parametrize("value", [0.0, 0.1, 1e-20, 3e7])
def test_running_gives_nothing_for_a_constant(value: float) -> None:
    taken = Running(2)
    for _ in range(100):
        assert not taken(np.full((2, 12), value, np.float32)).any()


@pytest.mark.parametrize("reward", ALL)
def test_with_running_scales_the_reward_is_gain_times_standardised_parts(reward: str, running: Records) -> None:
    for record in map(arrays, running("noisy", reward, 0, 1)):
        for step in range(STEPS):
            so_far = [record[f"part/{part}"][: step + 1].astype(float) for part in reward.split("_")]
            total = sum(0.3 * (part[-1] - part.mean()) / (part.std() or np.inf) for part in so_far)
            assert record["reward"][step] == pytest.approx(total, rel=1e-5, abs=1e-6)
        assert record["reward"].std() > 0
