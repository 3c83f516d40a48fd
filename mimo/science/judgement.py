"""How a claim is judged: tests with an effect in every seed, a region, an interval, a verdict.

A test measures one effect in every seed and says in which region the paper's claim puts it: at least the smallest
effect that counts, at most so much, or so close to nothing that it does not count (an equivalence test). Effects are
differences inside a seed, or between rewards that saw the same noise: seeds pair. Their centre is the interquartile
mean over seeds; its 95 % interval decides:

- `holds`: the whole interval lies in the region;
- `fails`: the whole interval lies outside;
- `undecided`: it straddles the region's border.

A region that is the point 0 is a claim in words, "no discernible difference": it holds while the interval has 0 in it.

A test that something does *not* happen is met by agents that are saturated, whose behaviour is not free to differ: it
is then `undecided`, and says `saturated`.

A claim has two verdicts: *as shown*, by the quantities of the paper's panels, and *as said*, by what its text says of
behaviour. Each holds if all its tests do, and fails if any does.

The interval is the bootstrap's percentile interval, expanded for small samples (Hesterberg 2015, The American
Statistician 69:371): of those tried, its coverage is nearest to 95 % for so few seeds (benchmarks/coverage.py). Its p,
that the effect lies on the region's border, is what Holm's correction (1979) over all tests of the claims uses.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import stats

Array = np.ndarray
Cell = tuple[str, str]  # condition, reward
Curves = Mapping[Cell, Mapping[str, Array]]  # (seed, step) by name, as mimo.science.analysis.curves names them
Windows = Mapping[str, slice]
Measure = Callable[[Curves, Windows], Array]  # -> (seed,) effects

LEVEL = 0.95  # of the intervals
TRIMMED = 0.25  # of the values, at either end
RESAMPLES = 99_999  # so many that a p can be small enough for Holm's correction
MARGINS = (0.75, 1.25)  # times a region's borders: would another margin have given another verdict?
SATURATED = 0.5  # of the joints are locked: at least so many, and a test is saturated
GROUPS = ("shown", "said")
VERDICTS = HOLDS, FAILS, UNDECIDED = "holds", "fails", "undecided"


@dataclass(frozen=True)
class Test:
    """One effect, and where the claim puts it.

    Attributes:
        name: unique within its claim.
        says: what is compared with what, in words.
        cells: the conditions and rewards whose runs it reads.
        unit: of the effect.
        low: the claim's region is low <= effect <= high; either end may be infinite, and both 0: "no difference".
        high: see low.
        measure: from curves and windows to the effect in each seed.
        absent: whether the claim is that something does not happen.
    """

    name: str
    says: str
    cells: tuple[Cell, ...]
    unit: str
    low: float
    high: float
    measure: Measure
    absent: bool = False


@dataclass(frozen=True)
class Claim:
    """A claim of the paper, in our words.

    Attributes:
        name: short and unique.
        section: of the paper.
        says: the claim.
        panel: the panel that shows it.
        shown: what must hold of the quantities in the panel.
        said: what must hold of behaviour, and of all else that the text says.
        besides: tests that help to see why; they have no part in the verdicts.
    """

    name: str
    section: str
    says: str
    panel: str
    shown: tuple[Test, ...]
    said: tuple[Test, ...]
    besides: tuple[Test, ...] = ()


def interquartile_mean(effects: Array, axis: int = -1) -> Array:
    """Mean of the middle half: a quarter of the values is cut at either end (rounded down)."""
    return np.asarray(stats.trim_mean(effects, TRIMMED, axis=axis))


def resampled(effects: Array) -> Array:
    """Bootstrap distribution of the interquartile mean over seeds, (RESAMPLES,); the same effects give the same."""
    found = stats.bootstrap(
        (effects,), interquartile_mean, n_resamples=RESAMPLES, method="percentile", vectorized=True,
        rng=np.random.default_rng(0),
    )  # fmt: skip
    return np.asarray(found.bootstrap_distribution)


def interval(means: Array, seeds: int) -> tuple[float, float]:
    """LEVEL interval: percentiles as far out as Student's t is for so many seeds, where n, not n - 1, divides.

    Args:
        means: as `resampled` gives them.
        seeds: how many effects there were, at least two.
    """
    reach = stats.t.ppf((1 + LEVEL) / 2, seeds - 1) * np.sqrt(seeds / (seeds - 1))
    tail = float(stats.norm.cdf(-reach))
    low, high = np.quantile(means, (tail, 1 - tail))
    return float(low), float(high)


def p_value(means: Array, seeds: int, low: float, high: float) -> float:
    """That the effect lies on its region's border: below 1 - LEVEL where `interval` is wholly inside, or outside.

    Args:
        means: as `resampled` gives them.
        seeds: how many effects there were, at least two.
        low: the region is low <= effect <= high; if both are one point, p is that the effect is this point.
        high: see low.
    """

    def chance(beyond: Array) -> float:
        share = (np.count_nonzero(beyond) + 1) / (len(means) + 1)
        return float(stats.t.cdf(stats.norm.ppf(min(share, 0.5)) * np.sqrt((seeds - 1) / seeds), seeds - 1))

    inside = max(chance(means <= low), chance(means >= high))
    outside = min(chance(means >= low), chance(means <= high))
    if low == high:
        return min(1.0, 2 * outside)
    return min(1.0, 2 * min(inside, outside))


def verdict(bounds: tuple[float, float] | None, low: float, high: float) -> str:
    """Whether an interval lies in the region, outside, or straddles its border."""
    if bounds is None or np.isnan(bounds).any():
        return UNDECIDED  # one seed, or effects that are no numbers
    if low == high:
        return HOLDS if bounds[0] <= low <= bounds[1] else FAILS
    if low <= bounds[0] and bounds[1] <= high:
        return HOLDS
    return FAILS if bounds[1] < low or high < bounds[0] else UNDECIDED


def corrected(tests: Sequence[Mapping[str, Any]]) -> list[str]:
    """Verdicts that stand after Holm's correction over all tests; of the others, a point's holds, the rest are open.

    Args:
        tests: as in `evaluate`; `verdict`, `p` and `region` are read.
    """
    found = [str(test["verdict"]) for test in tests]
    stands = True
    for rank, place in enumerate(sorted(range(len(tests)), key=lambda place: tests[place]["p"])):
        test = tests[place]
        stands = stands and test["p"] <= (1 - LEVEL) / (len(tests) - rank)
        if not stands and found[place] != UNDECIDED:
            found[place] = HOLDS if test["region"] == [0, 0] else UNDECIDED
    return found


def evaluate(curves: Curves, windows: Windows, claims: Sequence[Claim]) -> list[dict[str, Any]]:
    """Every claim's verdicts with what is behind them, ready for JSON.

    Tests whose cells are missing from `curves` are left out; so are claims with no test left, while a claim that lost
    some is `complete: false` and cannot hold.

    Args:
        curves: (seed, step) by name, of each condition and reward.
        windows: stretches of steps, as mimo.science.analysis.windows names them.
        claims: usually CLAIMS.

    Returns:
        For each claim `name`, `section`, `says`, `panel`, `complete`, `shown` and `said` (each with its `verdict`, that
        after Holm's correction, `holm`, whether it is undecided as agents are `saturated`, and its `tests`), and the
        tests `besides`. For each test `name`, `says`, `cells`, `unit`, `region` and `interval` ([low, high], None for
        no end), `effect`, `p`, `n`, `seeds` (the effect in each), `verdict`, `holm`, `locked` (the share of locked
        joints in the cell that has most), `saturated` and `margins`, the verdicts with other margins.
    """
    found: list[dict[str, Any]] = []
    for claim in claims:
        shown, said, besides = (
            [_tested(test, curves, windows) for test in group if all(cell in curves for cell in test.cells)]
            for group in (claim.shown, claim.said, claim.besides)
        )
        if shown or said:
            about = {"name": claim.name, "section": claim.section, "says": claim.says, "panel": claim.panel}
            complete = len(shown) == len(claim.shown) and len(said) == len(claim.said)
            tests = {"shown": {"tests": shown}, "said": {"tests": said}, "besides": besides}
            found.append(about | {"complete": complete} | tests)
    primary = [test for judged in found for group in GROUPS for test in judged[group]["tests"]]
    for test, holm in zip(primary, corrected(primary), strict=True):
        test["holm"] = holm
    for judged in found:
        for group in GROUPS:
            judged[group] |= _together(judged[group]["tests"], judged["complete"])
    return found


def _tested(test: Test, curves: Curves, windows: Windows) -> dict[str, Any]:
    effects = np.asarray(test.measure(curves, windows), np.float64)
    locked = max(_locked(curves[cell], windows) for cell in test.cells)
    saturated = test.absent and locked >= SATURATED
    bounds, p = None, 1.0
    if len(effects) > 1 and np.isfinite(effects).all():
        means = resampled(effects)
        bounds, p = interval(means, len(effects)), p_value(means, len(effects), test.low, test.high)

    def judged(share: float) -> str:
        return UNDECIDED if saturated else verdict(bounds, share * test.low, share * test.high)

    return {
        "name": test.name,
        "says": test.says,
        "cells": ["/".join(cell) for cell in test.cells],
        "unit": test.unit,
        "region": [None if np.isinf(end) else end for end in (test.low, test.high)],
        "effect": float(interquartile_mean(effects)),
        "interval": None if bounds is None else list(bounds),
        "p": p,
        "n": len(effects),
        "seeds": effects.tolist(),
        "verdict": judged(1),
        "margins": {f"{share:g}": judged(share) for share in MARGINS},
        "locked": locked,
        "saturated": saturated,
    }


def _together(tests: Sequence[Mapping[str, Any]], complete: bool) -> dict[str, Any]:
    """The verdict of all tests, without and with Holm's correction."""

    def judged(verdicts: list[str]) -> str:
        if FAILS in verdicts:
            return FAILS
        return HOLDS if complete and set(verdicts) == {HOLDS} else UNDECIDED

    word = judged([test["verdict"] for test in tests])
    saturated = word == UNDECIDED and any(test["saturated"] for test in tests)
    return {"verdict": word, "holm": judged([test["holm"] for test in tests]), "saturated": saturated}


def _locked(cell: Mapping[str, Array], windows: Windows) -> float:
    """Share of locked joints, an interquartile mean over seeds, in late baseline or late acquisition: the larger."""
    shares = [cell["locked"][:, windows[name]].mean(axis=1) for name in ("baseline_late", "acquisition_late")]
    return float(max(interquartile_mean(share.astype(np.float64)) for share in shares))
