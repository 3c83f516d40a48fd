"""What studies measure, on curves of a few levels whose effects are worked by hand."""

import numpy as np
import pytest

from mimo.science import measures
from mimo.science.measures import MEASURES

WINDOWS = {
    "baseline": slice(0, 8), "baseline_late": slice(4, 8), "baseline_end": slice(4, 8), "attached": slice(8, 16),
    "acquisition_start": slice(8, 10), "acquisition_early": slice(8, 12), "acquisition_late": slice(12, 16),
    "acquisition_end": slice(12, 16), "extinction": slice(16, 24), "extinction_early": slice(16, 20),
    "extinction_late": slice(20, 24),
}  # fmt: skip


def levels(late_baseline: float, late_attached: float, early_extinction: float, ripple: float = 0.0) -> np.ndarray:
    """(2, 24): 0 elsewhere; the second seed's levels are twice the first's. A ripple of an SD lies on both alike."""
    curve = np.zeros(24)
    for name, level in zip(
        ("baseline_late", "acquisition_late", "extinction_early"),
        (late_baseline, late_attached, early_extinction),
        strict=True,
    ):
        curve[WINDOWS[name]] = level
    return np.stack([curve, 2 * curve]) + ripple * np.tile([1, -1], 12)


CURVES = {
    "move_probability/attached": levels(0.1, 0.4, 0.45),
    "move_probability/others": levels(0.1, 0.2, 0.1),
    "q_move/attached": levels(1.0, 4.0, 0.0),
    "q_move/others": levels(1.0, 2.0, 0.0),
    "influence/attached": levels(0.001, 0.006, 0.0),
    "influence/others": levels(0.001, 0.004, 0.0),
    "locked": levels(0.0, 0.25, 0.0),
    "reward/all": levels(0.0, 1.0, 3.0, ripple=0.5),
    "path_length": levels(0.01, 0.03, 0.0, ripple=0.01),
}
WORKED = {  # in the first seed, which the second doubles, but for `excess`, a ratio
    "lead": (0.4 - 0.2) - (0.1 - 0.1),
    "lead_q": (4.0 - 2.0) - (1.0 - 1.0),
    "limb": 0.3,
    "others": 0.1,
    "influence": 5.0,
    "burst": 0.05,
    "burst_others": -0.1,
    "locked": 0.25,
}


@pytest.fixture(scope="module")
def found() -> dict[str, list[float]]:
    return measures.effects(CURVES, WINDOWS)


def test_every_measure_is_tried(found: dict[str, list[float]]) -> None:
    assert set(found) == set(MEASURES) == {*WORKED, "excess", "reward", "burst_reward", "path"}


@pytest.mark.parametrize("name", WORKED)
def test_by_hand(name: str, found: dict[str, list[float]]) -> None:
    assert found[name] == pytest.approx([WORKED[name], 2 * WORKED[name]])


def test_excess_is_a_share_of_the_others(found: dict[str, list[float]]) -> None:
    assert found["excess"] == pytest.approx([0.5, 0.5])


def test_shifts_are_in_sds_over_steps(found: dict[str, list[float]]) -> None:
    """A ripple of .5 has that SD in each window, n - 1 less: of four steps .5 sqrt(4 / 3)."""
    sd = 0.5 * np.sqrt(4 / 3)
    assert found["reward"] == pytest.approx([1 / sd, 2 / sd], rel=0.2)
    assert found["burst_reward"] == pytest.approx([2 / sd, 4 / sd], rel=0.2)
    assert found["path"] == pytest.approx([0.02 / (0.02 * sd), 0.04 / (0.02 * sd)], rel=0.2)


def test_a_measure_whose_curve_is_missing_is_left_out() -> None:
    less = {name: curve for name, curve in CURVES.items() if not name.startswith("influence")}
    assert set(MEASURES) - set(measures.effects(less, WINDOWS)) == {"influence", "excess"}


def test_summed_is_the_interquartile_mean_with_its_interval() -> None:
    found = measures.summed([0.1, 0.2, 0.3, 10.0])
    assert found.effect == pytest.approx(0.25)
    assert found.interval is not None
    assert found.interval[0] < 0.25 < found.interval[1]
    assert (found.n, found.seeds, found.certain) == (4, [0.1, 0.2, 0.3, 10.0], True)
    assert found.within(0.05, 11)
    assert not found.within(0.26, 11)


@pytest.mark.parametrize("seeds", [[0.1], [0.1, float("nan")]])
def test_one_seed_or_no_number_has_no_interval_and_is_not_certain(seeds: list[float]) -> None:
    found = measures.summed(seeds)
    assert found.interval is None
    assert not found.certain
    assert not found.within(-1, 1)


def test_an_interval_with_0_in_it_is_not_certain() -> None:
    assert not measures.summed([-0.1, 0.1, -0.2, 0.2]).certain
