"""One effect of a study beside another: the published one of the same seeds, others along an axis, other encoders'."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from mimo.science import components, judgement, measures, summary
from mimo.science.measures import Found, Measure
from stages.base.numbers import number

STATES = RISEN, FLAT, FALLEN, OPEN = "risen", "flat", "fallen", "open"

Effects = Mapping[str, list[float | None]]  # in each seed, by measure


@dataclass(frozen=True)
class Compared:
    """A variant's effect, the published one of the same seeds, and the change from seed to same seed.

    Without a published cell to compare with, the last two are None.
    """

    own: Found
    published: Found | None = None
    change: Found | None = None


@dataclass(frozen=True)
class Cell:
    """A condition and reward of a variant; `twin` is the published reward beside it, by measure what is `found`."""

    variant: str
    condition: str
    reward: str
    twin: str | None
    found: Mapping[str, Compared]

    @property
    def label(self) -> str:
        """`noisy, CAIS`."""
        return f"{self.condition}, {summary.label(self.reward)}"

    @property
    def effects(self) -> dict[str, Found]:
        """Its own, by measure."""
        return {name: found.own for name, found in self.found.items()}

    @property
    def changes(self) -> dict[str, Found]:
        """From the published ones, by measure."""
        return {name: found.change for name, found in self.found.items() if found.change}


@dataclass(frozen=True)
class Turn:
    """A claim's test that a variant answers otherwise than the published runs of the same seeds do."""

    variant: str
    claim: str
    group: str
    says: str
    unit: str
    region: list[float | None]
    before: str
    after: str
    published: Found
    own: Found
    change: Found

    @property
    def outright(self) -> bool:
        """Whether it is from `holds` to `fails`, or back."""
        return judgement.UNDECIDED not in (self.before, self.after)

    @property
    def size(self) -> float:
        """The change in widths of its interval."""
        bounds = self.change.interval
        return abs(self.change.effect) / ((bounds[1] - bounds[0]) or 1.0) if bounds else 0.0


@dataclass(frozen=True)
class Line:
    """A reward's effect in a condition along the study's axis, `points` in its order.

    `trend` is the least-squares line's rise in each seed, from the axis' first value to its last.
    """

    condition: str
    reward: str
    points: dict[float, Found]
    trend: Found

    @property
    def label(self) -> str:
        """`noisy, CAIS`."""
        return f"{self.condition}, {summary.label(self.reward)}"

    def reaches(self, low: float) -> float | None:
        """The value up to which, from the least on, every whole interval lies above `low`; None if none does."""
        last = None
        for value, found in self.points.items():
            if not found.within(low, np.inf):
                break
            last = value
        return last

    def above(self, low: float) -> list[float]:
        """The values at which the whole interval lies above `low`."""
        return [value for value, found in self.points.items() if found.within(low, np.inf)]


@dataclass(frozen=True)
class Drawn:
    """A cell's effect with every encoder, the published one first: whose its variance is, and both its intervals.

    `both` is over encoders and seeds, None where there are too few; `published` over the same seeds, of one encoder.
    """

    condition: str
    reward: str
    each: Mapping[str, Found]
    centre: float
    both: tuple[float, float] | None
    published: Found
    parts: components.Components | None

    def told(self, measure: Measure) -> str:
        """The state that the interval over both tells."""
        return state(Found(self.centre, self.both, self.published.n, self.published.seeds), measure)

    def differs(self, measure: Measure) -> bool:
        """Whether runs differ by an SD that is worth parting: a tenth of the least effect that counts."""
        parts = self.parts
        return parts is not None and np.hypot(parts.encoders, np.hypot(parts.seeds, parts.rest)) >= measure.low / 10

    def otherwise(self, measure: Measure) -> bool:
        """Whether that is another than the published encoder's alone."""
        return self.told(measure) != state(self.published, measure)

    @property
    def label(self) -> str:
        """`noisy, CAIS`."""
        return f"{self.condition}, {summary.label(self.reward)}"


def effect(found: Found | None, digits: int = 2) -> str:
    """`0.12 [0.08, 0.15]`, or a dash; without interval where there is none."""
    if found is None or not np.isfinite(found.effect):
        return number(None)
    bounds = found.interval
    ends = f"\u00a0[{number(bounds[0], digits)}, {number(bounds[1], digits)}]" if bounds else ""
    return number(found.effect, digits) + ends


def state(found: Found, measure: Measure) -> str:
    """One of STATES, by where the whole interval lies: beyond what counts, above or below, or within it; else open."""
    low = abs(measure.low)
    if found.within(low, np.inf):
        return RISEN
    if found.within(-low, low):
        return FLAT
    return FALLEN if found.within(-np.inf, -low) else OPEN


def summed(effects: list[float | None]) -> Found:
    """As mimo.science.measures has it, once for the same effects; what is no number is None in JSON."""
    return _once(tuple(np.nan if effect is None else float(effect) for effect in effects))


@cache
def _once(effects: tuple[float, ...]) -> Found:
    return measures.summed(list(effects))


def compared(own: list[float | None], twins: list[float | None]) -> Compared:
    """Effects beside the published ones of the same seeds, of which there may be none."""
    if not twins:
        return Compared(summed(own))
    return Compared(summed(own), summed(twins[: len(own)]), change(own, twins))


def change(own: list[float | None], paper: list[float | None]) -> Found:
    """From the paper's effect to one's own, of each seed that both have."""
    return summed([None if None in pair else pair[0] - pair[1] for pair in zip(own, paper, strict=False)])  # type: ignore[operator]


def turned(
    variant: str, claim: str, group: str, before: Mapping[str, Any], test: Mapping[str, Any], first: int
) -> Turn | None:
    """None where the verdict is the published one of the same seeds, or where the effect may be the same."""
    twins = before["seeds"][first : first + test["n"]]
    if len(twins) < test["n"]:
        return None
    published, own, word = summed(twins), summed(test["seeds"]), judged(before, twins)
    moved = change(test["seeds"], twins)
    if word == test["verdict"] or not moved.certain:
        return None
    says, unit, region = test["says"], test["unit"], test["region"]
    return Turn(variant, claim, group, says, unit, region, word, test["verdict"], published, own, moved)


def judged(test: Mapping[str, Any], seeds: list[float | None]) -> str:
    """The verdict of a test by some of its seeds; one that is saturated with all of them is so with some."""
    low, high = (end if end is not None else far for end, far in zip(test["region"], (-np.inf, np.inf), strict=True))
    return judgement.verdict(None if test["saturated"] else summed(seeds).interval, low, high)


def together(words: Sequence[str]) -> str:
    """The verdict of all tests, as mimo.science.judgement has it."""
    if judgement.FAILS in words:
        return judgement.FAILS
    return judgement.HOLDS if all(word == judgement.HOLDS for word in words) else judgement.UNDECIDED


def line(condition: str, reward: str, points: Mapping[float, list[float | None]]) -> Line:
    """The trend is over the seeds that every point has."""
    values = np.array(list(points))
    seeds = min(len(effects) for effects in points.values())
    held = np.array([effects[:seeds] for effects in points.values()], np.float64)
    away = values - values.mean()
    spread = float((away**2).sum())
    slopes = away @ held / spread if spread else np.full(seeds, np.nan)
    trend = summed((slopes * float(np.ptp(values))).tolist())
    return Line(condition, reward, {value: summed(effects) for value, effects in points.items()}, trend)


def drawn(condition: str, reward: str, each: Mapping[str, list[float | None]]) -> Drawn:
    """Of effects by encoder, `published` among them, over the seeds that all have."""
    seeds = min(len(effects) for effects in each.values())
    held = np.array([effects[:seeds] for effects in each.values()], np.float64)
    found = {name: summed(effects[:seeds]) for name, effects in each.items()}
    return Drawn(
        condition, reward, found, components.centre(held), components.interval(held), found["published"],
        components.components(held),
    )  # fmt: skip
