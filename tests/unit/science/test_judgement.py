"""From effects to verdicts, on effects whose answer is known."""

import json
import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy import stats

from mimo.science import claims, judgement
from mimo.science.judgement import FAILS, HOLDS, UNDECIDED
from mimo.settings import params

FEW = 1999
INFINITY = math.inf
CELL, CONTROL = ("free", "cais"), ("noisy", "cais")
WINDOWS = {"baseline_late": slice(0, 2), "acquisition_late": slice(2, 4)}


@pytest.fixture(autouse=True, scope="module")
def _few_resamples() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(judgement, "RESAMPLES", FEW)
        yield


def bounds(effects: np.ndarray) -> tuple[float, float]:
    return judgement.interval(judgement.resampled(effects), len(effects))


def tail(seeds: int) -> float:
    """Hesterberg (2015): how much the interval leaves out at either end, where 95 % would leave .025."""
    return float(stats.norm.cdf(stats.t.ppf(0.025, seeds - 1) * math.sqrt(seeds / (seeds - 1))))


def test_interquartile_mean_cuts_a_quarter_at_either_end():
    assert judgement.interquartile_mean(np.array([100.0, 1, 2, 3, 4, 5, 6, -100])) == pytest.approx(3.5)
    assert judgement.interquartile_mean(np.array([9.0, 1, 2])) == pytest.approx(4)


# The interval.


def test_interval_reaches_further_out_the_fewer_seeds_there_are():
    means = np.linspace(0, 1, 10_001)
    assert judgement.interval(means, 10) == pytest.approx((0.0086, 0.9914), abs=1e-4)  # t is 2.262: 2.262 √(10/9) SD
    assert judgement.interval(means, 20) == pytest.approx((0.0159, 0.9841), abs=1e-4)  # 2.093: 2.093 √(20/19) SD
    assert judgement.interval(means, 10_000) == pytest.approx((0.025, 0.975), abs=1e-4)


def test_interval_holds_the_centre_moves_with_the_effects_and_is_the_same_every_time():
    effects = np.random.default_rng(1).normal(1, 0.5, 10)
    low, high = bounds(effects)
    assert low < judgement.interquartile_mean(effects) < high
    assert bounds(effects) == (low, high)
    assert bounds(effects + 1) == pytest.approx((low + 1, high + 1))
    assert bounds(-effects) == pytest.approx((-high, -low), abs=0.05)


def test_interval_covers_the_truth_about_as_often_as_it_says():
    draws = np.random.default_rng(2).normal(0, 1, (150, 10))
    covered = np.mean([low <= 0 <= high for low, high in map(bounds, draws)])
    assert 0.9 < covered < 0.99


def test_interval_of_equal_effects_is_a_point():
    assert bounds(np.full(4, 0.25)) == (0.25, 0.25)


# The verdict.


@pytest.mark.parametrize(
    ("found", "region", "expected"),
    [
        ((0.1, 0.2), (0.05, INFINITY), HOLDS),
        ((0.05, 0.2), (0.05, INFINITY), HOLDS),
        ((0.01, 0.2), (0.05, INFINITY), UNDECIDED),
        ((0.01, 0.04), (0.05, INFINITY), FAILS),
        ((-0.04, 0.04), (-0.05, 0.05), HOLDS),
        ((-0.06, 0.04), (-0.05, 0.05), UNDECIDED),
        ((-0.06, 0.06), (-0.05, 0.05), UNDECIDED),
        ((0.06, 0.07), (-0.05, 0.05), FAILS),
        ((-0.9, -0.6), (-INFINITY, -0.5), HOLDS),
        ((-0.4, -0.3), (-INFINITY, -0.5), FAILS),
        ((-0.1, 0.1), (0.0, 0.0), HOLDS),
        ((0.0, 0.1), (0.0, 0.0), HOLDS),
        ((0.01, 0.1), (0.0, 0.0), FAILS),
        ((-0.1, -0.01), (0.0, 0.0), FAILS),
        ((math.nan, math.nan), (0.05, INFINITY), UNDECIDED),
        ((math.nan, math.nan), (0.0, 0.0), UNDECIDED),
        (None, (0.05, INFINITY), UNDECIDED),
        (None, (0.0, 0.0), UNDECIDED),
    ],
)
def test_verdict(found: tuple[float, float] | None, region: tuple[float, float], expected: str):
    assert judgement.verdict(found, *region) == expected


# Its p.


def test_p_of_a_border_that_no_resample_reaches_is_the_smallest():
    means = np.linspace(1, 2, 99_999)
    smallest = 2 * stats.t.cdf(stats.norm.ppf(1e-5) * math.sqrt(19 / 20), 19)
    for region in ((0.5, INFINITY), (-INFINITY, 2.5), (0.5, 2.5), (-INFINITY, 0.5), (2.5, INFINITY), (0.0, 0.0)):
        assert judgement.p_value(means, 20, *region) == pytest.approx(smallest), region


def test_p_of_a_border_in_the_middle_is_one():
    means = np.linspace(-1, 1, FEW)
    for region in ((0.0, INFINITY), (-INFINITY, 0.0), (0.0, 0.0), (-2.0, 0.0)):
        assert judgement.p_value(means, 20, *region) == pytest.approx(1, abs=0.01), region


def test_p_of_an_equivalence_is_that_of_the_nearer_border():
    means = np.linspace(-1, 1, FEW)
    near, far = judgement.p_value(means, 20, -INFINITY, 0.97), judgement.p_value(means, 20, -1.2, INFINITY)
    assert far < near
    assert judgement.p_value(means, 20, -1.2, 0.97) == near


@given(
    seeds=st.integers(4, 24),
    draw=st.integers(0, 10**6),
    places=st.tuples(st.floats(0, 1), st.floats(0, 1)),
    kind=st.sampled_from(("at least", "at most", "between", "point")),
)
def test_p_is_below_05_exactly_where_the_interval_is_inside_or_outside(
    seeds: int, draw: int, places: tuple[float, float], kind: str
):
    """Borders lie anywhere between two resamples, but for the quantile's grain: two of FEW resamples."""
    means = judgement.resampled(np.random.default_rng(draw).standard_t(3, seeds))
    ordered = np.unique(means)
    between = (ordered[1:] + ordered[:-1]) / 2
    low, high = sorted(float(between[round(place * (len(between) - 1))]) for place in places)
    for border in (low, high):
        below = np.mean(means < border)
        assume(abs(min(below, 1 - below) - tail(seeds)) > 2 / FEW)
    assume(kind != "between" or low < high)
    region = {
        "at least": (low, INFINITY), "at most": (-INFINITY, high), "between": (low, high), "point": (low, low)
    }[kind]  # fmt: skip
    word = judgement.verdict(judgement.interval(means, seeds), *region)
    decided = word == FAILS if kind == "point" else word != UNDECIDED
    assert (judgement.p_value(means, seeds, *region) < 0.05) == decided


def test_p_outside_an_equivalence_on_either_side_is_below_05():
    means = judgement.resampled(np.random.default_rng(5).normal(3, 1, 20))
    for region in ((-1.0, 1.0), (5.0, 7.0)):
        assert judgement.verdict(judgement.interval(means, 20), *region) == FAILS
        assert judgement.p_value(means, 20, *region) < 0.05


def test_a_clear_effect_passes_holm_with_the_published_number_of_seeds_but_not_with_ten():
    number = sum(len(claim.shown) + len(claim.said) for claim in claims.CLAIMS)
    clear = np.ones(99_999)
    assert np.array_equal(judgement.resampled(np.ones(20)), clear[:FEW])
    seeds = params.load().sweep.seeds
    assert judgement.p_value(clear, seeds, 0.5, INFINITY) <= 0.05 / number < judgement.p_value(clear, 10, 0.5, INFINITY)


# Holm's correction.


def held(p: float, verdict: str, region: Sequence[float | None] = (0.2, None)) -> dict[str, Any]:
    return {"p": p, "verdict": verdict, "region": list(region)}


def test_holm_goes_by_rank_from_the_smallest_p():
    # Sorted .012, .016, .02, .04 against .0125, .0167, .025, .05: all stand, and only .012 by Bonferroni.
    tests = [held(0.04, HOLDS), held(0.012, FAILS), held(0.02, HOLDS), held(0.016, HOLDS)]
    assert judgement.corrected(tests) == [HOLDS, FAILS, HOLDS, HOLDS]


def test_holm_stops_at_the_first_p_that_is_too_large():
    # Sorted .01, .02, .021, .022 against .0125, .0167, .025, .05: the second stops the others.
    tests = [held(0.022, HOLDS), held(0.01, FAILS), held(0.021, FAILS), held(0.02, HOLDS)]
    assert judgement.corrected(tests) == [UNDECIDED, FAILS, UNDECIDED, UNDECIDED]


def test_holm_counts_undecided_tests_and_leaves_them():
    assert judgement.corrected([held(0.03, HOLDS), held(0.5, UNDECIDED)]) == [UNDECIDED, UNDECIDED]
    assert judgement.corrected([held(0.02, HOLDS), held(0.5, UNDECIDED)]) == [HOLDS, UNDECIDED]
    assert judgement.corrected([held(0.001, UNDECIDED)]) == [UNDECIDED]


def test_a_difference_that_holm_does_not_let_stand_is_no_discernible_one():
    point = (0.0, 0.0)
    tests = [held(0.03, FAILS, point), held(0.6, HOLDS, point), held(0.9, UNDECIDED, point)]
    assert judgement.corrected(tests) == [HOLDS, HOLDS, UNDECIDED]
    assert judgement.corrected([held(0.01, FAILS, point), held(0.6, HOLDS, point)]) == [FAILS, HOLDS]


# Claims as a whole.


YES = np.linspace(1, 1.5, 20)  # against a region from .5 on
NO, MAYBE = YES - 5, YES - 0.75


def test_of(effects: np.ndarray, *cells: judgement.Cell, **changes: Any) -> judgement.Test:
    about: dict[str, Any] = {
        "name": "one",
        "says": "one with other",
        "unit": "1",
        "low": 0.5,
        "high": INFINITY,
    } | changes
    return judgement.Test(cells=cells or (CELL,), measure=lambda curves, windows: effects, **about)


test_of.__test__ = False  # type: ignore[attr-defined]


def claim_of(
    shown: Sequence[judgement.Test], said: Sequence[judgement.Test] = (), besides: Sequence[judgement.Test] = ()
) -> judgement.Claim:
    return judgement.Claim("a claim", "§4", "It is so.", "fig. 3", tuple(shown), tuple(said), tuple(besides))


def cell_of(before: float = 0.0, late: float = 0.0, seeds: int = 6) -> dict[str, np.ndarray]:
    """So many joints are locked in late baseline and in late acquisition."""
    return {"locked": np.tile(np.repeat(np.array([before, late], np.float32), 2), (seeds, 1))}


def judged(claim: judgement.Claim, curves: judgement.Curves | None = None) -> dict[str, Any]:
    (found,) = judgement.evaluate(curves or {CELL: cell_of(), CONTROL: cell_of()}, WINDOWS, [claim])
    return found


@pytest.mark.parametrize(
    ("effects", "expected"),
    [
        ([YES, YES], HOLDS),
        ([YES, MAYBE], UNDECIDED),
        ([MAYBE, MAYBE], UNDECIDED),
        ([YES, NO], FAILS),
        ([MAYBE, NO], FAILS),
    ],
)
def test_a_group_holds_if_all_its_tests_do_and_fails_if_any_does(effects: list[np.ndarray], expected: str):
    found = judged(claim_of([test_of(own) for own in effects], [test_of(YES)]))
    assert (found["shown"]["verdict"], found["said"]["verdict"]) == (expected, HOLDS)
    found = judged(claim_of([test_of(YES)], [test_of(own) for own in effects]))
    assert (found["shown"]["verdict"], found["said"]["verdict"]) == (HOLDS, expected)


def test_what_stands_besides_has_no_part_in_the_verdicts_nor_in_holms_correction():
    found = judged(claim_of([test_of(YES)], [test_of(YES)], [test_of(NO)] * 200))
    assert {test["verdict"] for test in found["besides"]} == {FAILS}
    assert not any("holm" in test for test in found["besides"])
    assert [found[group][of] for group in ("shown", "said") for of in ("verdict", "holm")] == [HOLDS] * 4


def test_holms_correction_is_over_all_claims():
    claim = claim_of([test_of(YES)], [test_of(YES)])
    alone = judged(claim)
    assert alone["shown"]["holm"] == alone["said"]["tests"][0]["holm"] == HOLDS
    curves = {CELL: cell_of()}
    many = judgement.evaluate(curves, WINDOWS, [claim] * 100)
    assert {claim[group]["verdict"] for claim in many for group in ("shown", "said")} == {HOLDS}
    assert {claim[group]["holm"] for claim in many for group in ("shown", "said")} == {UNDECIDED}


def test_a_claim_that_lost_a_test_with_its_cell_cannot_hold_but_can_fail():
    both = claim_of([test_of(YES)], [test_of(YES), test_of(YES, CELL, CONTROL)])
    whole = judged(both)
    assert (whole["complete"], whole["shown"]["verdict"], whole["said"]["verdict"]) == (True, HOLDS, HOLDS)
    part = judged(both, {CELL: cell_of()})
    assert (part["complete"], part["shown"]["verdict"], part["said"]["verdict"]) == (False, UNDECIDED, UNDECIDED)
    assert len(part["said"]["tests"]) == 1
    part = judged(claim_of([test_of(YES)], [test_of(NO), test_of(YES, CONTROL)]), {CELL: cell_of()})
    assert (part["complete"], part["shown"]["verdict"], part["said"]["verdict"]) == (False, UNDECIDED, FAILS)


def test_a_group_without_tests_left_is_undecided_and_a_claim_without_any_left_out():
    part = judged(claim_of([test_of(YES)], [test_of(YES, CONTROL)]), {CELL: cell_of()})
    assert (part["said"]["tests"], part["said"]["verdict"], part["said"]["holm"]) == ([], UNDECIDED, UNDECIDED)
    gone = claim_of([test_of(YES, CONTROL)], [test_of(YES, CONTROL)], [test_of(YES)])
    assert judgement.evaluate({CELL: cell_of()}, WINDOWS, [gone]) == []


def test_what_is_missing_besides_makes_no_claim_incomplete():
    assert judged(claim_of([test_of(YES)], [test_of(YES)], [test_of(YES, CONTROL)]), {CELL: cell_of()})["complete"]


@pytest.mark.parametrize(
    ("absent", "before", "late", "saturated"),
    [
        (True, 0.0, 0.49, False),
        (True, 0.0, 0.5, True),
        (True, 0.5, 0.0, True),
        (True, 0.25, 0.25, False),
        (False, 0.0, 1.0, False),
    ],
)
@pytest.mark.parametrize("effects", [YES, NO])
def test_what_does_not_happen_is_undecided_where_half_the_joints_are_locked(
    effects: np.ndarray, absent: bool, before: float, late: float, saturated: bool
):
    own = judged(claim_of([test_of(effects, absent=absent)], [test_of(YES)]), {CELL: cell_of(before, late)})["shown"]
    test = own["tests"][0]
    expected = UNDECIDED if saturated else HOLDS if effects is YES else FAILS
    assert (own["verdict"], own["holm"], test["verdict"], test["holm"]) == (expected,) * 4
    assert own["saturated"] == test["saturated"] == saturated
    assert test["locked"] == pytest.approx(max(before, late))
    assert set(test["margins"].values()) == {expected}


def test_a_test_is_saturated_by_any_cell_that_it_reads():
    curves = {CELL: cell_of(), CONTROL: cell_of(late=0.75)}
    found = judged(claim_of([test_of(YES, CELL, CONTROL, absent=True)], [test_of(YES, absent=True)]), curves)
    assert (found["shown"]["saturated"], found["shown"]["tests"][0]["locked"]) == (True, 0.75)
    assert (found["said"]["saturated"], found["said"]["verdict"]) == (False, HOLDS)


def test_locked_is_a_centre_over_seeds_which_a_few_do_not_move():
    curves = {CELL: {"locked": np.array([[0, 0, 1, 1]] * 2 + [[0] * 4] * 6, np.float32)}}
    assert judged(claim_of([test_of(YES, absent=True)]), curves)["shown"]["tests"][0]["locked"] == 0


def test_a_group_that_fails_or_holds_is_not_called_saturated():
    curves = {CELL: cell_of(late=1.0), CONTROL: cell_of()}
    found = judged(claim_of([test_of(YES, absent=True), test_of(NO, CONTROL)], [test_of(YES)]), curves)
    assert (found["shown"]["verdict"], found["shown"]["saturated"]) == (FAILS, False)
    assert (found["said"]["verdict"], found["said"]["saturated"]) == (HOLDS, False)


def test_margins_are_the_verdicts_with_a_region_a_quarter_smaller_or_greater():
    tight = np.full(6, 0.45)
    found = judged(claim_of([test_of(tight), test_of(tight, low=-0.5, high=0.5), test_of(tight, low=0.0, high=0.0)]))
    assert [(test["verdict"], test["margins"]) for test in found["shown"]["tests"]] == [
        (FAILS, {"0.75": HOLDS, "1.25": FAILS}),
        (HOLDS, {"0.75": FAILS, "1.25": HOLDS}),
        (FAILS, {"0.75": FAILS, "1.25": FAILS}),
    ]


def test_a_region_that_is_a_point_holds_while_the_interval_has_it():
    point = {"low": 0.0, "high": 0.0}
    found = judged(claim_of([test_of(YES - 1.2, **point)], [test_of(YES, **point)]))
    assert (found["shown"]["verdict"], found["said"]["verdict"]) == (HOLDS, FAILS)
    assert found["shown"]["tests"][0]["region"] == [0, 0]


def test_a_test_says_all_that_backs_its_verdict():
    found = judged(claim_of([test_of(YES, CELL, CONTROL)], [test_of(YES, low=-INFINITY, high=2.0)]))
    assert {name: found[name] for name in ("name", "section", "says", "panel")} == {
        "name": "a claim", "section": "§4", "says": "It is so.", "panel": "fig. 3"
    }  # fmt: skip
    test = found["shown"]["tests"][0]
    assert (test["name"], test["says"], test["unit"]) == ("one", "one with other", "1")
    assert (test["cells"], test["region"]) == (["free/cais", "noisy/cais"], [0.5, None])
    assert (test["n"], test["seeds"], test["effect"]) == (20, YES.tolist(), pytest.approx(1.25))
    assert test["interval"] == list(bounds(YES))
    assert 0 < test["p"] < 0.05
    assert found["said"]["tests"][0]["region"] == [None, 2.0]
    json.dumps(found, allow_nan=False)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("effects", [np.ones(1), np.array([1.0, math.nan, 1.2]), np.array([1.0, math.inf, 1.2])])
@pytest.mark.parametrize("region", [(0.5, INFINITY), (0.0, 0.0)])
def test_one_seed_or_an_effect_that_is_no_number_decides_nothing(effects: np.ndarray, region: tuple[float, float]):
    low, high = region
    found = judged(claim_of([test_of(effects, low=low, high=high)]))["shown"]
    test = found["tests"][0]
    assert (found["verdict"], found["holm"], test["interval"], test["p"]) == (UNDECIDED, UNDECIDED, None, 1)
    assert set(test["margins"].values()) == {UNDECIDED}
