"""A study's numbers, as reports/studies/STUDY.json has them, in the order and the company in which the page shows them.

Every effect stands beside the published one of the same seeds, and the change between the two is of each seed with its
own twin. What a study's answer is made of is here; the words are in html/answers and html/kinds.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import numpy as np

from mimo.record.streams import CONDITIONS
from mimo.science import components, judgement, measures, summary
from mimo.science.measures import MEASURES, Found, Measure
from mimo.settings.studies import FIGURES, Study
from stages.base.numbers import number
from stages.page import verdicts
from stages.page.charted import Charted

STATES = RISEN, FLAT, FALLEN, OPEN = "risen", "flat", "fallen", "open"
REFERENCE = "cais"  # the published reward that stands beside those that the paper has not
DRAW = "collect.draw"  # a study that changes this alone is of encoders
ANSWERS = Path(__file__).with_name("html") / "answers"

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

    def otherwise(self, measure: Measure) -> bool:
        """Whether that is another than the published encoder's alone."""
        return self.told(measure) != state(self.published, measure)

    @property
    def label(self) -> str:
        """`noisy, CAIS`."""
        return f"{self.condition}, {summary.label(self.reward)}"


@dataclass(frozen=True)
class Studied:
    """A study and its numbers.

    `made` is reports/studies/NAME.json, `claims` the claims of reports/claims.json.
    """

    name: str
    study: Study
    made: Mapping[str, Any]
    claims: list[Mapping[str, Any]]

    @property
    def kind(self) -> str:
        """What of html/kinds shows it: by what its variants are to each other."""
        variants = self.study.variants.values()
        if self.study.space:
            return "space"
        if self.study.axis:
            return "along"
        if all(set(variant.set) == {DRAW} for variant in variants):
            return "draws"
        return "turned" if all(variant.asks for variant in variants) else "plain"

    @cached_property
    def space(self) -> Charted:
        """Of a study whose variants are points of one."""
        first, points = (
            self.variants[next(iter(self.variants))],
            {name: own["set"] for name, own in self.variants.items()},
        )
        return Charted(self.study.space, first["published"], points, self.made["space"])

    @property
    def answer(self) -> str:
        """The template that answers it: its own or, of a study that a user adds, its kind's."""
        own = f"{self.name}.html.j2"
        return f"answers/{own}" if (ANSWERS / own).exists() else f"kinds/{self.kind}.html.j2"

    @property
    def measures(self) -> dict[str, Measure]:
        """Those it shows, by name."""
        return {name: MEASURES[name] for name in self.study.measures}

    @property
    def drawn(self) -> dict[str, Measure]:
        """Those that its figure has room for."""
        return dict(list(self.measures.items())[:FIGURES])

    @property
    def variants(self) -> dict[str, Mapping[str, Any]]:
        """Of `made`, those that the study has."""
        return {name: own for name, own in self.made["variants"].items() if name in self.study.variants}

    @property
    def seeds(self) -> int:
        """How many there are of each cell."""
        return max((own["seeds"] for own in self.variants.values()), default=0)

    @property
    def level(self) -> str:
        """Of the intervals."""
        return f"{100 * self.made['level']:g}\u00a0%"

    @cached_property
    def cells(self) -> list[Cell]:
        """Every variant's."""
        return [
            self._cell(variant, name, effects)
            for variant, own in self.variants.items()
            for name, effects in own["cells"].items()
        ]

    def of(self, variant: str = "", condition: str = "", reward: str = "") -> list[Cell]:
        """Those of one variant, condition or reward, where one is named."""
        wanted = {"variant": variant, "condition": condition, "reward": reward}
        return [
            cell for cell in self.cells if all(getattr(cell, name) == value for name, value in wanted.items() if value)
        ]

    @cached_property
    def published(self) -> dict[tuple[str, str], dict[str, Found]]:
        """By condition and reward, of the published cells beside the study's: effects of the same seeds."""
        found = {}
        for condition, reward in dict.fromkeys((cell.condition, cell.twin) for cell in self.cells if cell.twin):
            effects = self._paper(condition, reward)
            found[condition, reward] = {
                name: _summed(twins)
                for name in self.study.measures
                if name in effects and (twins := self._twins(effects[name]))
            }
        return found

    @cached_property
    def turns(self) -> list[Turn]:
        """Tests whose verdict is another than the published runs' of the same seeds, by a change that is not 0."""
        published = {
            (claim["name"], group, test["name"]): test for claim in self.claims for group, test in _judged(claim)
        }
        found = []
        for variant, own in self.variants.items():
            for claim in own["claims"]:
                for group, test in _judged(claim):
                    before = published.get((claim["name"], group, test["name"]))
                    turn = before and _turned(variant, claim["name"], group, before, test, self.study.first)
                    found += [turn] if turn else []
        return found

    def turning(self, variant: str) -> list[Turn]:
        """A variant's."""
        return [turn for turn in self.turns if turn.variant == variant]

    def tested(self, variant: str) -> int:
        """How many tests a variant's cells answer."""
        return sum(1 for claim in self.variants[variant]["claims"] for _ in _judged(claim))

    @property
    def most(self) -> str:
        """The variant with which most tests turn."""
        return max(self.variants, key=lambda variant: len(self.turning(variant)))

    @property
    def strongest(self) -> Turn:
        """Of those that turn outright, the one whose change is largest beside its interval's width."""
        return max((turn for turn in self.turns if turn.outright), key=lambda turn: _size(turn.change))

    def largest(self, variant: str) -> Turn:
        """Of a variant's turns, as `strongest`, those outright first."""
        return max(self.turning(variant), key=lambda turn: (turn.outright, _size(turn.change)))

    @property
    def whole(self) -> int:
        """How many published seeds there are."""
        return max((len(seeds) for cell in self.made["paper"].values() for seeds in cell.values()), default=0)

    def states(self, measure: str, changes: bool = False, condition: str = "") -> dict[str, list[Cell]]:
        """Cells by what a measure, or its change, is in them, in the order of STATES; `condition` as in `of`."""
        held = [cell for cell in self.of(condition=condition) if measure in (cell.changes if changes else cell.effects)]
        found: dict[str, list[Cell]] = {name: [] for name in STATES}
        for cell in held:
            found[state((cell.changes if changes else cell.effects)[measure], MEASURES[measure])].append(cell)
        return {name: cells for name, cells in found.items() if cells}

    def least(self, measure: str, reward: str, condition: str) -> Cell | None:
        """Of a reward's cells in a condition, that with the least effect."""
        held = [cell for cell in self.of(condition=condition, reward=reward) if measure in cell.effects]
        return min(held, key=lambda cell: cell.effects[measure].effect, default=None)

    def beside(self, cell: Cell, variant: str, measure: str) -> Found:
        """The change of a cell's measure from another variant's, same condition, reward and seeds."""
        name = f"{cell.condition}/{cell.reward}"
        own, other = (self.variants[each]["cells"][name][measure] for each in (cell.variant, variant))
        return _change(own, other)

    def all_seeds(self, condition: str, reward: str, measure: str) -> Found:
        """The published effect, of every published seed."""
        return _summed(list(self._paper(condition, reward)[measure]))

    def moved(self, measure: str) -> list[Cell]:
        """Cells whose measure is certainly another than the published one."""
        return [cell for cell in self.cells if measure in cell.changes and cell.changes[measure].certain]

    def lines(self, measure: str) -> list[Line]:
        """Of every condition and reward, along the axis; the published runs are a point of each."""
        assert self.study.axis is not None
        found = []
        for condition, reward in dict.fromkeys((cell.condition, cell.reward) for cell in self.cells):
            name, points = f"{condition}/{reward}", {}
            for own in self.variants.values():
                points[float(own["set"][self.study.axis])] = own["cells"].get(name, {}).get(measure)
                points.setdefault(float(own["published"][self.study.axis]), self._same(condition, reward, measure))
            held = {value: points[value] for value in sorted(points) if points[value]}
            if held:
                found.append(_line(condition, reward, held))
        return found

    @property
    def standard(self) -> float:
        """The axis' published value."""
        return float(next(iter(self.variants.values()))["published"][self.study.axis])

    @property
    def span(self) -> tuple[str, str]:
        """The axis' first value and its last."""
        values = [self.standard, *(float(own["set"][self.study.axis]) for own in self.variants.values())]
        return f"{min(values):g}", f"{max(values):g}"

    @property
    def trends(self) -> dict[str, dict[str, Found]]:
        """By condition and reward in words, then by measure."""
        found: dict[str, dict[str, Found]] = {}
        for name in self.study.measures:
            for line in self.lines(name):
                found.setdefault(line.label, {})[name] = line.trend
        return found

    def encoders(self, measure: str) -> list[Drawn]:
        """Of every condition and reward whose published runs there are."""
        found = []
        for condition, reward in dict.fromkeys((cell.condition, cell.reward) for cell in self.cells):
            name = f"{condition}/{reward}"
            each = {"published": self._same(condition, reward, measure)}
            each |= {variant: own["cells"].get(name, {}).get(measure) for variant, own in self.variants.items()}
            held = {own: effects for own, effects in each.items() if effects}
            if "published" in held:
                found.append(_drawn(condition, reward, held))
        return found

    def probes(self) -> list[float]:
        """R² of the variants' own encoders, in order; a limb's own where it hardly pulls means little."""
        axes = [f"r2_{condition}_{axis}" for condition in CONDITIONS for axis in "xyz"]
        probed = [own["probe"] for own in self.variants.values() if own["probe"]]
        return sorted(probe[axis] for probe in probed for axis in axes)

    def _cell(self, variant: str, name: str, effects: Effects) -> Cell:
        condition, reward = name.split("/")
        twin = next((own for own in (reward, REFERENCE) if f"{condition}/{own}" in self.made["paper"]), None)
        paper: Effects = self._paper(condition, twin) if twin else {}
        found = {
            measure: _compared(effects[measure], self._twins(paper.get(measure, [])))
            for measure in self.study.measures
            if measure in effects
        }
        return Cell(variant, condition, reward, twin, found)

    def _paper(self, condition: str, reward: str) -> Effects:
        found: Effects = self.made["paper"].get(f"{condition}/{reward}", {})
        return found

    def _same(self, condition: str, reward: str, measure: str) -> list[float | None] | None:
        """The published effects of the study's seeds."""
        effects = self._paper(condition, reward).get(measure)
        return effects and self._twins(effects)

    def _twins(self, published: list[float | None]) -> list[float | None]:
        """Of the published effects, those of the study's own seeds; none if one is missing."""
        found = published[self.study.first :][: self.seeds]
        return found if len(found) == self.seeds else []


def studied(
    studies: Mapping[str, Study], made: Mapping[str, Mapping[str, Any]], claims: Mapping[str, Any]
) -> list[Studied]:
    """Those of the studies that have been computed, in their order.

    Args:
        studies: by name.
        made: by name, reports/studies/NAME.json.
        claims: reports/claims.json.
    """
    return [Studied(name, study, made[name], claims["claims"]) for name, study in studies.items() if name in made]


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


def listed(texts: Iterable[str], last: str = "and") -> str:
    """`a, b and c`."""
    *most, end = list(texts) or [""]
    return f"{', '.join(most)} {last} {end}" if most else end


def summed(effects: Iterable[float | None]) -> Found:
    """As mimo.science.measures has it, once for the same effects; what is no number is None in JSON."""
    return _summed(list(effects))


def _summed(effects: list[float | None]) -> Found:
    return _once(tuple(np.nan if effect is None else float(effect) for effect in effects))


@cache
def _once(effects: tuple[float, ...]) -> Found:
    return measures.summed(list(effects))


def _compared(own: list[float | None], twins: list[float | None]) -> Compared:
    if not twins:
        return Compared(_summed(own))
    return Compared(_summed(own), _summed(twins[: len(own)]), _change(own, twins))


def _change(own: list[float | None], paper: list[float | None]) -> Found:
    """Of each seed that both have."""
    return _summed([None if None in pair else pair[0] - pair[1] for pair in zip(own, paper, strict=False)])  # type: ignore[operator]


def _judged(claim: Mapping[str, Any]) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """The tests that verdicts are made of."""
    yield from ((group, test) for group, test in verdicts.tests(claim) if group in judgement.GROUPS)


def _turned(
    variant: str, claim: str, group: str, before: Mapping[str, Any], test: Mapping[str, Any], first: int
) -> Turn | None:
    """None where the verdict is the published one of the same seeds, or where the effect may be the same.

    A published test that is saturated with all its seeds is so with some of them.
    """
    twins = before["seeds"][first : first + test["n"]]
    if len(twins) < test["n"]:
        return None
    published, own = _summed(twins), _summed(test["seeds"])
    low, high = (-np.inf if test["region"][0] is None else test["region"][0]), test["region"][1]
    bounds = None if before["saturated"] else published.interval
    word = judgement.verdict(bounds, low, np.inf if high is None else high)
    change = _change(test["seeds"], twins)
    if word == test["verdict"] or not change.certain:
        return None
    says, unit, region = test["says"], test["unit"], test["region"]
    return Turn(variant, claim, group, says, unit, region, word, test["verdict"], published, own, change)


def _size(found: Found) -> float:
    """An effect in widths of its interval."""
    return abs(found.effect) / ((found.interval[1] - found.interval[0]) or 1.0) if found.interval else 0.0


def _line(condition: str, reward: str, points: Mapping[float, list[float | None]]) -> Line:
    """The trend is over the seeds that every point has."""
    values = np.array(list(points))
    seeds = min(len(effects) for effects in points.values())
    held = np.array([effects[:seeds] for effects in points.values()], np.float64)
    away = values - values.mean()
    spread = float((away**2).sum())
    slopes = away @ held / spread if spread else np.full(seeds, np.nan)
    trend = _summed((slopes * float(np.ptp(values))).tolist())
    return Line(condition, reward, {value: _summed(effects) for value, effects in points.items()}, trend)


def _drawn(condition: str, reward: str, each: Mapping[str, list[float | None]]) -> Drawn:
    seeds = min(len(effects) for effects in each.values())
    held = np.array([effects[:seeds] for effects in each.values()], np.float64)
    found = {name: _summed(effects[:seeds]) for name, effects in each.items()}
    return Drawn(
        condition, reward, found, components.centre(held), components.interval(held), found["published"],
        components.components(held),
    )  # fmt: skip
