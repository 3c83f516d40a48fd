"""Claims and their tests, of mimo.science.claims, as the page shows them."""

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from mimo.science import judgement
from stages.base.numbers import number

DIGITS = 3  # decimals of effects
MARGINS = tuple(f"{share:g}" for share in sorted((1, *judgement.MARGINS)))  # times a region's borders
WIDTH, MARGIN = 160, 6  # of a strip, in pixels

Ends = tuple[float | None, float | None] | list[float | None]
Test = Mapping[str, Any]  # as mimo.science.judgement.evaluate describes it
Judged = Mapping[str, Any]  # reports/claims.json, or a variant in reports/studies/STUDY.json


@dataclass(frozen=True)
class Strip:
    """A test's effects along a line, as pixels from the left; `interval` is None where there is none."""

    region: tuple[float, float]
    zero: float
    interval: tuple[float, float] | None
    effect: float
    seeds: list[float]


def strip(test: Test) -> Strip | None:
    """Where a test's seeds lie, on a scale that spans them, its region's ends and zero; None without finite effects."""
    seeds = [effect for effect in test["seeds"] if effect is not None]
    if test["effect"] is None:
        return None
    bounds = test["interval"]
    if bounds is not None and None in bounds:  # of effects that are no numbers
        bounds = None
    values = [0.0, *seeds, *(end for end in test["region"] if end is not None), *(bounds or ())]
    low, high = min(values), max(values)

    def at(value: float) -> float:
        return float(round(MARGIN + (value - low) / ((high - low) or 1) * (WIDTH - 2 * MARGIN), 1))

    first, last = test["region"]
    region = 0.0 if first is None else at(first), float(WIDTH) if last is None else at(last)
    bar = None if bounds is None else (at(bounds[0]), at(bounds[1]))
    return Strip(region, at(0.0), bar, at(test["effect"]), [at(effect) for effect in seeds])


def region(ends: Ends) -> str:
    """Where a claim puts an effect: `≥ 0.05`, `≤ −0.5`, `within ±0.2`, `no difference`."""
    low, high = ("" if end is None else f"{end:g}".replace("-", "−") for end in ends)
    if not low or not high:
        return f"≥ {low}" if low else f"≤ {high}"
    if low == high:
        return "no difference" if low == "0" else low
    return f"within ±{high}" if low == f"−{high}" else f"{low} to {high}"


def interval(ends: Ends | None) -> str:
    """`[0.100, 0.200]`, or a dash."""
    return number(None) if ends is None or None in ends else f"[{effect(ends[0])}, {effect(ends[1])}]"


def effect(value: float | None) -> str:
    """An effect, or a dash."""
    return number(value, DIGITS)


def panels(text: str) -> list[tuple[str, str]]:
    """`figs. 3 C, 4 C` in pieces, each with the name of the figure it points to, or with none."""
    pieces = re.split(r"(\d [A-Z](?:, [A-Z])*)", text)
    return [(piece, f"fig{piece[0]}" if place % 2 else "") for place, piece in enumerate(pieces) if piece]


def tests(claim: Mapping[str, Any]) -> Iterator[tuple[str, Test]]:
    """All tests of a claim, each with the group it is of."""
    for group in judgement.GROUPS:
        yield from ((group, test) for test in claim[group]["tests"])
    yield from (("besides", test) for test in claim["besides"])


def refuted(test: Test) -> bool:
    """Whether a test's interval lies outside its region, whatever its verdict."""
    (low, high), bounds = test["region"], test["interval"]
    if bounds is None or None in bounds:  # of effects that are no numbers
        return False
    region = -math.inf if low is None else low, math.inf if high is None else high
    return judgement.verdict((bounds[0], bounds[1]), *region) == judgement.FAILS


def primary(claims: Iterable[Mapping[str, Any]]) -> list[Test]:
    """The tests that verdicts are made of, of all claims."""
    return [test for claim in claims for group, test in tests(claim) if group in judgement.GROUPS]
