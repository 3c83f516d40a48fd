"""Claims: statistics on numbers worked out by hand, and worlds made so that every claim holds, or fails."""

import json
import math
from typing import Any

import numpy as np
import pytest

from mimo.science import analysis, claims, judgement

PHASES = analysis.phases(500, 1500, 500)
WINDOWS = analysis.windows(PHASES)
REWARDS = ("mtl", "rtl", "cais", "surprise", "mtl_surprise", "rtl_surprise", "cais_surprise")
CELL = ("free", "cais")
GONE = ("baseline", "extinction")


def by_phase(baseline: float, attached: float, extinction: float, seeds: int = 2) -> np.ndarray:
    """(seed, step), a constant in each phase."""
    return np.tile(np.repeat([baseline, attached, extinction], [500, 1500, 500]), (seeds, 1)).astype(np.float32)


def measured(measure: judgement.Measure, **curves: np.ndarray) -> list[Any]:
    named = {name.replace("__", "/"): values for name, values in curves.items()}
    return [pytest.approx(value) for value in measure({CELL: named}, WINDOWS)]


def bounds(effects: np.ndarray) -> tuple[float, float]:
    found = judgement.interval(effects)
    assert found is not None
    return found


def test_interquartile_mean_cuts_a_quarter_at_either_end():
    assert judgement.interquartile_mean(np.array([100.0, 1, 2, 3, 4, 5, 6, -100])) == pytest.approx(3.5)
    assert judgement.interquartile_mean(np.array([9.0, 1, 2])) == pytest.approx(4)


def test_interval_holds_the_centre_and_is_the_same_every_time():
    effects = np.random.default_rng(1).normal(1, 0.5, 10)
    low, high = bounds(effects)
    assert low < judgement.interquartile_mean(effects) < high
    assert judgement.interval(effects) == (low, high)
    assert judgement.interval(effects + 1) == pytest.approx((low + 1, high + 1))


def test_interval_covers_the_truth_about_as_often_as_it_says():
    draws = np.random.default_rng(2).normal(0, 1, (150, 10))
    covered = np.mean([low <= 0 <= high for low, high in map(bounds, draws)])
    assert 0.85 < covered < 0.99


def test_interval_of_equal_effects_is_a_point_and_of_one_seed_nothing():
    assert judgement.interval(np.full(4, 0.25)) == (0.25, 0.25)
    assert judgement.interval(np.array([1.0])) is None


@pytest.mark.parametrize(
    ("bounds", "region", "expected"),
    [
        ((0.1, 0.2), (0.05, math.inf), judgement.HOLDS),
        ((0.05, 0.2), (0.05, math.inf), judgement.HOLDS),
        ((0.01, 0.2), (0.05, math.inf), judgement.UNDECIDED),
        ((0.01, 0.04), (0.05, math.inf), judgement.FAILS),
        ((-0.04, 0.04), (-0.05, 0.05), judgement.HOLDS),
        ((-0.06, 0.04), (-0.05, 0.05), judgement.UNDECIDED),
        ((-0.06, 0.06), (-0.05, 0.05), judgement.UNDECIDED),
        ((0.06, 0.07), (-0.05, 0.05), judgement.FAILS),
        ((-0.9, -0.6), (-math.inf, -0.5), judgement.HOLDS),
        (None, (0.05, math.inf), judgement.UNDECIDED),
    ],
)
def test_verdict(bounds: tuple[float, float] | None, region: tuple[float, float], expected: str):
    assert judgement.verdict(bounds, *region) == expected


def test_shift_is_cohens_d_of_steps():
    curve = by_phase(1, 1, 1)
    curve[:, 1700:2000:2] = 3  # mean 2 and SD 1 against mean 1 and SD 0
    found = measured(claims.shift(CELL, "x", "acquisition_late", "baseline_late"), x=curve)
    assert found == [1 / math.sqrt(0.5)] * 2
    assert measured(claims.shift(CELL, "x", "baseline_late", "baseline_end"), x=curve) == [0, 0]


def test_change_and_what_remains_of_a_rise():
    assert measured(claims.change(CELL, "x", "acquisition_late", "baseline_late"), x=by_phase(1, 3, 1.5)) == [2, 2]
    assert measured(claims.remains(CELL, "x"), x=by_phase(1, 3, 1.5)) == [0.25, 0.25]


def test_singled_out_is_the_gain_of_the_lead():
    curves = {"p__attached": by_phase(0.4, 0.7, 0.5), "p__others": by_phase(0.3, 0.4, 0.5)}
    assert measured(claims.singled_out(CELL, "p"), **curves) == [0.2, 0.2]


def test_excess_and_throughout_read_the_influence():
    limb, others = by_phase(1, 3, 1), by_phase(1, 2, 1)
    limb[:, 500:800] = 1  # three of fifteen minutes
    curves = {"influence__attached": limb, "influence__others": others}
    assert measured(claims.excess(CELL, "acquisition_late"), **curves) == [0.5, 0.5]
    assert measured(claims.throughout(CELL), **curves) == [0.8, 0.8]
    assert measured(claims.throughout(CELL, skipped=2), **curves) == [12 / 13, 12 / 13]


def test_correlation_is_of_ranks_in_the_attached_phase():
    path = by_phase(0, 0, 0)
    path[:, 500:2000] = np.arange(1500)
    latent = np.exp(path / 1500)
    latent[:, 2000:] = 9
    assert measured(claims.correlation(CELL, "a", "b"), a=path, b=latent) == [1, 1]


def test_more_pairs_the_seeds():
    rises = claims.singled_out(CELL, "p")
    zero = claims.more(rises, rises)
    curves = {"p__attached": by_phase(0, 1, 0), "p__others": by_phase(0, 0, 0)}
    assert measured(zero, **curves) == [0, 0]


def world(learns: bool) -> judgement.Curves:
    """Curves of all cells, 6 seeds: as the paper tells it, or such that every claim is clearly wrong."""
    draw = np.random.default_rng(3)
    seeds = 6

    def noisy(curve: np.ndarray, size: float) -> np.ndarray:
        return np.asarray(curve + draw.normal(0, size, curve.shape), np.float32)

    def lead(on: bool) -> np.ndarray:
        return by_phase(0, 0.3 if on else 0, 0, seeds)

    found = {}
    for condition in ("free", "noisy"):
        for reward in REWARDS:
            informed = condition == "free" or reward.startswith("cais")
            found_out = informed if learns else not informed
            burst = np.zeros((seeds, 2500))
            burst[:, 2000:2100] = 0.5
            bursts = reward == "cais_surprise" if learns else reward in ("mtl_surprise", "rtl_surprise")
            p = 0.3 + lead(found_out) + (burst if bursts else 0)
            pay = by_phase(0, 2, 0, seeds) if found_out else by_phase(0, 0, 0, seeds)
            if reward == "surprise":
                pay = np.zeros((seeds, 2500))
                pay[:, 500:600] = pay[:, 2000:2100] = 3 if learns else 0
            own = pay + (20 * burst if bursts else -pay if "_" in reward else 0)
            steps = noisy(np.zeros((seeds, 2500)), 1)
            found[condition, reward] = {
                "reward/all": noisy(pay, 0.5),
                "reward/attached": noisy(own, 0.5),
                "move_probability/attached": noisy(p, 0.01),
                "move_probability/others": noisy(by_phase(0.3, 0.3, 0.3, seeds), 0.01),
                "q_move/attached": noisy(lead(found_out), 0.01),
                "q_move/others": noisy(0 * p, 0.01),
                "influence/attached": noisy(by_phase(1, 2, 1, seeds) if learns else by_phase(1, 1, 2, seeds), 0.01),
                "influence/others": noisy(by_phase(1, 1, 1, seeds), 0.01),
                "path_length": steps,
                "latent_length": steps if learns else -steps,
                "displacement": -steps,
            }
    return found


@pytest.mark.parametrize(("learns", "expected"), [(True, judgement.HOLDS), (False, judgement.FAILS)])
def test_every_claim_can_hold_and_can_fail(learns: bool, expected: str):
    found = judgement.evaluate(world(learns), WINDOWS, claims.CLAIMS)
    assert {claim["name"]: claim["verdict"] for claim in found} == {claim.name: expected for claim in claims.CLAIMS}
    assert all(claim["complete"] for claim in found)
    json.dumps(found, allow_nan=False)


def test_a_test_says_all_that_backs_its_verdict():
    (first, *_) = judgement.evaluate(world(learns=True), WINDOWS, claims.CLAIMS)
    test = first["tests"][0]
    assert (test["n"], len(test["seeds"]), test["region"]) == (6, 6, [claims.MEDIUM, None])
    assert test["interval"][0] <= test["effect"] <= test["interval"][1]
    assert test["cells"] == ["free/mtl"]


def test_what_was_looked_at_afterwards_has_no_part_in_the_verdict():
    judged = judgement.evaluate(world(learns=True), WINDOWS, claims.CLAIMS)
    found = next(claim for claim in judged if claim["name"].startswith("1b"))
    assert {test["verdict"] for test in found["afterwards"]} == {judgement.FAILS}
    assert found["verdict"] == judgement.HOLDS


def test_missing_cells_leave_claims_out_or_open():
    curves = {cell: found for cell, found in world(learns=True).items() if cell in {("free", "mtl"), ("noisy", "cais")}}
    found = {claim["name"][:2]: claim for claim in judgement.evaluate(curves, WINDOWS, claims.CLAIMS)}
    assert set(found) == {"1 ", "2 ", "3 ", "5 "}
    assert {claim["verdict"] for claim in found.values()} == {judgement.UNDECIDED}
    assert not any(claim["complete"] for claim in found.values())
    assert {test["verdict"] for claim in found.values() for test in claim["tests"]} == {judgement.HOLDS}


def test_one_failed_test_fails_a_claim_even_where_others_are_missing():
    curves = {("noisy", "cais"): world(learns=False)["noisy", "cais"]}
    verdicts = {claim["name"]: claim["verdict"] for claim in judgement.evaluate(curves, WINDOWS, claims.CLAIMS)}
    assert verdicts["5 CAIS alone learns, noisy"] == judgement.FAILS


def test_claims_are_named_once_read_cells_of_the_sweep_and_have_a_region():
    assert len({claim.name for claim in claims.CLAIMS}) == len(claims.CLAIMS)
    for claim in claims.CLAIMS:
        assert len({test.name for test in claim.tests}) == len(claim.tests), claim.name
        for test in claim.tests:
            assert test.low < test.high
            assert np.isfinite([test.low, test.high]).any()
            assert all(condition in ("free", "noisy") and reward in REWARDS for condition, reward in test.cells)
