"""The claims' effects on numbers worked by hand, what there is of tests, and worlds in which all holds, or fails."""

import json
import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from mimo.science import analysis, claims, judgement, summary
from mimo.science.judgement import FAILS, GROUPS, HOLDS
from mimo.settings import params

WINDOWS = analysis.windows(analysis.phases(500, 1500, 500))
CELL = ("free", "cais")
SEEDS = 6
ABSENT = ("4", "8")  # claims that something does not happen


def levels(*five: float, seeds: int = 2) -> np.ndarray:
    """(seed, step): baseline; the rope's first minute and the rest of it; extinction's first minute and its rest."""
    steps = np.repeat(five, [500, 100, 1400, 100, 400])
    return np.tile(steps, (seeds, 1)).astype(np.float32)


def measured(measure: judgement.Measure, **curves: np.ndarray) -> list[Any]:
    named = {name.replace("__", "/"): values for name, values in curves.items()}
    return [pytest.approx(value) for value in measure({CELL: named}, WINDOWS)]


# Effects.


def test_shift_is_cohens_d_of_steps():
    curve = levels(1, 1, 1, 1, 1)
    curve[:, 1700:2000:2] = 3  # mean 2 and SD 1 against mean 1 and SD 0
    assert measured(claims.shift(CELL, "x", "acquisition_late", "baseline_late"), x=curve) == [math.sqrt(2)] * 2
    assert measured(claims.shift(CELL, "x", "baseline_late", "acquisition_late"), x=curve) == [-math.sqrt(2)] * 2
    assert measured(claims.shift(CELL, "x", "baseline_late", "baseline_end"), x=curve) == [0, 0]


def test_change_is_of_means_from_one_window_to_another():
    curve = levels(1, 5, 3, 7, 1.5)
    assert measured(claims.change(CELL, "x", "acquisition_late", "baseline_late"), x=curve) == [2, 2]
    assert measured(claims.change(CELL, "x", "extinction_early", "acquisition_end"), x=curve) == [4, 4]


def test_remains_is_the_share_of_the_rise_that_late_extinction_keeps():
    assert measured(claims.remains(CELL, "x"), x=levels(1, 9, 3, 9, 1.5)) == [0.25, 0.25]
    assert measured(claims.remains(CELL, "x"), x=levels(1, 9, 3, 9, 0.5)) == [-0.25, -0.25]


def test_singled_out_is_the_gain_of_the_lead():
    curves = {"p__attached": levels(0.4, 9, 0.7, 9, 9), "p__others": levels(0.3, 0, 0.4, 0, 0)}
    assert measured(claims.singled_out(CELL, "p"), **curves) == [0.2, 0.2]


def test_leads_more_is_cohens_d_of_the_lead():
    shared = np.random.default_rng(0).normal(0, 9, (2, 2500)).astype(np.float32)  # of both, so not of the lead
    limb = levels(1, 1, 1, 1, 1)
    limb[:, 1700:2000:2] = 3
    curves = {"x__attached": limb + shared, "x__others": shared}
    found = claims.leads_more(CELL, "x", "acquisition_late", "baseline_late")(
        {CELL: {name.replace("__", "/"): values for name, values in curves.items()}}, WINDOWS
    )
    np.testing.assert_allclose(found, math.sqrt(2), rtol=1e-5)


def test_excess_is_of_the_others_influence():
    curves = {"influence__attached": levels(1, 1, 3, 1, 1), "influence__others": levels(1, 1, 2, 1, 2)}
    assert measured(claims.excess(CELL, "acquisition_late"), **curves) == [0.5, 0.5]
    assert measured(claims.excess(CELL, "extinction_late"), **curves) == [-0.5, -0.5]


def test_lapses_are_minutes_of_the_rope_in_which_the_limb_is_not_above_the_others():
    limb = levels(1, 3, 3, 1, 1)
    limb[0, 500:800] = 2  # as much as the others in three of fifteen minutes
    limb[1, 1950:2000] = -1  # below them in half of the last minute, and in its mean
    curves = {"x__attached": limb, "x__others": levels(9, 2, 2, 9, 9)}
    assert measured(claims.lapses(CELL, "x"), **curves) == [3 / 15, 1 / 15]
    assert measured(claims.lapses(CELL, "x", skipped=2), **curves) == [1 / 13, 1 / 13]
    assert measured(claims.lapses(CELL, "x", skipped=3), **curves) == [0, 1 / 12]


def test_correlation_is_of_ranks_in_the_attached_phase():
    path = levels(0, 0, 0, 0, 0)
    path[:, 500:2000] = np.arange(1500)
    latent = np.exp(path / 1500)
    latent[:, 2000:] = 9
    latent[1] *= -1
    assert measured(claims.correlation(CELL, "a", "b"), a=path, b=latent) == [1, -1]


def test_more_pairs_the_seeds():
    rise = levels(0, 0, 1, 0, 0) * np.array([[1], [3]], np.float32)
    first, second = (claims.change(CELL, curve, "acquisition_late", "baseline_late") for curve in "xy")
    assert measured(claims.more(first, second), x=rise, y=rise[::-1]) == [-2, 2]


# What there is of claims and tests.

ALL = [(claim, group, test) for claim in claims.CLAIMS for group in GROUPS for test in getattr(claim, group)]


def test_claims_are_named_once_and_so_are_tests_within_a_group():
    assert len({claim.name for claim in claims.CLAIMS}) == len(claims.CLAIMS)
    for claim in claims.CLAIMS:
        for group in (claim.shown, claim.said, claim.besides):
            assert len({test.name for test in group}) == len(group), claim.name


def test_every_claim_has_tests_of_what_is_shown_and_of_what_is_said():
    assert all(claim.shown and claim.said for claim in claims.CLAIMS)


def test_all_cells_are_of_the_sweep():
    sweep = params.load().sweep
    cells: set[judgement.Cell] = {(condition, reward) for condition in sweep.conditions for reward in sweep.rewards}
    read = {
        cell for claim in claims.CLAIMS for test in (*claim.shown, *claim.said, *claim.besides) for cell in test.cells
    }
    assert read <= cells


def test_regions_hold_something_and_not_everything_and_only_no_difference_is_a_point():
    for claim in claims.CLAIMS:
        for test in (*claim.shown, *claim.said, *claim.besides):
            assert test.low <= test.high
            assert np.isfinite([test.low, test.high]).any()
            assert test.low < test.high or (test.low, test.high) == (0, 0)


def test_only_claims_that_something_does_not_happen_can_be_saturated():
    for claim, _, test in ALL:
        assert test.absent == (claim.name.split()[0] in ABSENT), (claim.name, test.name)
    assert not any(test.absent for claim in claims.CLAIMS for test in claim.besides)


def test_what_a_test_says_begins_with_its_cell():
    for _, _, test in ALL:
        assert test.says.startswith(f"{test.cells[0][0]}, {summary.label(test.cells[0][1])}: "), test.name


# Worlds.


def world(told: bool) -> dict[judgement.Cell, dict[str, np.ndarray]]:
    """Curves of all cells: as the paper tells it, or the contrary in all that it tells.

    Rewards have an SD of .5 around their level, which is greater from seed to seed; what is to be nothing is 0 exactly.
    """
    sweep = params.load().sweep
    more = 1 + np.arange(SEEDS, dtype=np.float32)[:, None] / 20
    noise = np.tile(np.array([-0.5, 0.5], np.float32), (SEEDS, 1250))
    shuffled = np.random.default_rng(0).permuted(np.tile(np.arange(2500, dtype=np.float32), (SEEDS, 1)), axis=1)

    def level(*five: float) -> np.ndarray:
        return np.asarray(levels(*five, seeds=SEEDS) * more)

    flat = level(0, 0, 0, 0, 0)

    def perceived(condition: str) -> np.ndarray:
        """MTL's and RTL's reward."""
        if condition == "noisy":
            return flat if told else level(0, 1, 2, 0, 0)
        return level(0, 1, 2, 0, 0) if told else level(2, 1, 0, 0, 0)

    found: dict[judgement.Cell, dict[str, np.ndarray]] = {}
    for condition in sweep.conditions:
        for reward in sweep.rewards:
            learns = (condition == "free" or reward.startswith("cais")) == told
            bursts = reward.endswith("_surprise") and reward.startswith("cais") == told
            rope = 1.0 if learns else 0.0
            lead = level(0, rope / 2, rope, rope + 1 if bursts else 0, 0)
            surprise = level(0, 3, 1, 4, 1) if told else flat
            pay = surprise if reward == "surprise" else perceived(condition)
            own = level(0, 1, 1, 3 if bursts else 0, 0) if reward.endswith("_surprise") else pay
            if reward == "cais":
                own = level(0, 2, 2, 0, 0) if told else flat
            found[condition, reward] = {
                "reward/all": pay + noise,
                "reward/attached": own + noise,
                "reward/others": flat,
                "move_probability/attached": 0.3 + 0.2 * lead,
                "move_probability/others": 0.3 + flat,
                "q_move/attached": lead,
                "q_move/others": flat,
                "q_rest/attached": flat,
                "influence/attached": 1 + (level(0, 1, 1, 0, 0) if told else level(0, -0.5, 0, 1, 1)),
                "influence/others": 1 + flat,
                "displacement": shuffled,
                "path_length": shuffled,
                "latent_length": shuffled if told else -shuffled,
                "locked": flat,
            }
    return found


@pytest.fixture(autouse=True, scope="module")
def _few_resamples() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(judgement, "RESAMPLES", 499)
        yield


@pytest.mark.parametrize(("told", "expected"), [(True, HOLDS), (False, FAILS)])
def test_every_test_can_hold_and_can_fail(told: bool, expected: str):
    found = judgement.evaluate(world(told), WINDOWS, claims.CLAIMS)
    words = {(claim["name"], group): claim[group]["verdict"] for claim in found for group in GROUPS}
    assert words == {(claim.name, group): expected for claim in claims.CLAIMS for group in GROUPS}
    tests = [(claim["name"], test) for claim in found for group in GROUPS for test in claim[group]["tests"]]
    assert [(name, test["name"]) for name, test in tests if test["verdict"] != expected] == []
    assert all(claim["complete"] for claim in found)
    json.dumps(found, allow_nan=False)


def test_locked_joints_leave_open_what_does_not_happen_and_nothing_else():
    curves = world(told=True)
    for cell in curves.values():
        cell["locked"] = np.full((SEEDS, 2500), 0.6, np.float32)
    found = judgement.evaluate(curves, WINDOWS, claims.CLAIMS)
    saturated = {claim["name"].split()[0] for claim in found for group in GROUPS if claim[group]["saturated"]}
    undecided = {claim["name"].split()[0] for claim in found for group in GROUPS if claim[group]["verdict"] != HOLDS}
    assert saturated == undecided == set(ABSENT)


def test_missing_cells_leave_claims_out_or_open():
    whole = world(told=True)
    curves = {cell: whole[cell] for cell in (("free", "mtl"), ("noisy", "cais"))}
    found = {claim["name"].split()[0]: claim for claim in judgement.evaluate(curves, WINDOWS, claims.CLAIMS)}
    assert set(found) == {"1", "2", "3", "5"}
    assert not any(claim["complete"] for claim in found.values())
    assert {claim[group]["verdict"] for claim in found.values() for group in GROUPS} == {judgement.UNDECIDED}
