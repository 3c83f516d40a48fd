"""How a claim is judged: tests with an effect in every seed, a region, an interval, a verdict.

A test measures one effect in every seed and says in which region the paper's claim puts it: at least the smallest
effect that counts, at most so much, or so close to nothing that it does not count (an equivalence test). Effects are
differences inside a seed, or between rewards that saw the same noise: seeds pair. Their centre is the interquartile
mean over seeds; its 95 % bootstrap interval decides:

- `holds`: the whole interval lies in the region;
- `fails`: the whole interval lies outside;
- `undecided`: it straddles the region's border.

A claim holds if all its tests do, and fails if any does.
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
RESAMPLES = 9999
VERDICTS = HOLDS, FAILS, UNDECIDED = "holds", "fails", "undecided"


@dataclass(frozen=True)
class Test:
    """One effect, and where the claim puts it.

    Attributes:
        name: unique within its claim.
        says: what is compared with what, in words.
        cells: the conditions and rewards whose runs it reads.
        unit: of the effect.
        low: the claim's region is low <= effect <= high; either end may be infinite.
        high: see low.
        measure: from curves and windows to the effect in each seed.
    """

    name: str
    says: str
    cells: tuple[Cell, ...]
    unit: str
    low: float
    high: float
    measure: Measure


@dataclass(frozen=True)
class Claim:
    """A claim of the paper, in our words.

    Attributes:
        name: short and unique.
        section: of the paper.
        says: the claim.
        panel: the panel that shows it.
        tests: what must hold.
        afterwards: tests that came after the verdict, to see why; they have no part in it.
    """

    name: str
    section: str
    says: str
    panel: str
    tests: tuple[Test, ...]
    afterwards: tuple[Test, ...] = ()


def interquartile_mean(effects: Array, axis: int = -1) -> Array:
    """Mean of the middle half: a quarter of the values is cut at either end (rounded down)."""
    return np.asarray(stats.trim_mean(effects, 0.25, axis=axis))


def interval(effects: Array) -> tuple[float, float] | None:
    """Percentile bootstrap of the interquartile mean over seeds, LEVEL; None for fewer than two seeds.

    Resampling is seeded, so the same effects always have the same interval.
    """
    if len(effects) < 2:
        return None
    found = stats.bootstrap(
        (effects,),
        interquartile_mean,
        confidence_level=LEVEL,
        n_resamples=RESAMPLES,
        method="percentile",
        vectorized=True,
        rng=np.random.default_rng(0),
    )
    return float(found.confidence_interval.low), float(found.confidence_interval.high)


def verdict(bounds: tuple[float, float] | None, low: float, high: float) -> str:
    """Whether an interval lies in the region, outside, or straddles its border."""
    if bounds is None:
        return UNDECIDED
    if low <= bounds[0] and bounds[1] <= high:
        return HOLDS
    return FAILS if bounds[1] < low or high < bounds[0] else UNDECIDED


def evaluate(curves: Curves, windows: Windows, claims: Sequence[Claim]) -> list[dict[str, Any]]:
    """Every claim's verdict with what is behind it, ready for JSON.

    Tests whose cells are missing from `curves` are left out; so are claims with no test left, while a claim that lost
    some is `complete: false` and cannot hold.

    Args:
        curves: (seed, step) by name, of each condition and reward.
        windows: stretches of steps, as mimo.science.analysis.windows names them.
        claims: usually CLAIMS.

    Returns:
        For each claim `name`, `section`, `says`, `panel`, `verdict`, `complete`, `tests` and `afterwards`; for each
        test `name`, `says`, `cells`, `unit`, `region` and `interval` ([low, high], None for no end), `effect`, `n`,
        `seeds` (the effect in each) and `verdict`.
    """
    found = []
    for claim in claims:
        tests, afterwards = (
            [_tested(test, curves, windows) for test in group if all(cell in curves for cell in test.cells)]
            for group in (claim.tests, claim.afterwards)
        )
        if tests:
            complete = len(tests) == len(claim.tests)
            found.append(
                {
                    "name": claim.name,
                    "section": claim.section,
                    "says": claim.says,
                    "panel": claim.panel,
                    "verdict": _together([test["verdict"] for test in tests], complete),
                    "complete": complete,
                    "tests": tests,
                    "afterwards": afterwards,
                }
            )
    return found


def _tested(test: Test, curves: Curves, windows: Windows) -> dict[str, Any]:
    effects = np.asarray(test.measure(curves, windows), np.float64)
    bounds = interval(effects)
    return {
        "name": test.name,
        "says": test.says,
        "cells": ["/".join(cell) for cell in test.cells],
        "unit": test.unit,
        "region": [None if np.isinf(end) else end for end in (test.low, test.high)],
        "effect": float(interquartile_mean(effects)),
        "interval": None if bounds is None else list(bounds),
        "n": len(effects),
        "seeds": effects.tolist(),
        "verdict": verdict(bounds, test.low, test.high),
    }


def _together(verdicts: Sequence[str], complete: bool) -> str:
    if FAILS in verdicts:
        return FAILS
    return HOLDS if complete and set(verdicts) == {HOLDS} else UNDECIDED
