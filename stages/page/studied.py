"""A study's numbers, as reports/studies/STUDY.json has them, in the order and the company in which the page shows them.

Every effect stands beside the published one of the same seeds, as compared.py has it. What a study's answer
is made of is here; the words are in html/answers and html/kinds.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from mimo.record.streams import CONDITIONS
from mimo.science import judgement
from mimo.science.measures import MEASURES, Found, Measure
from mimo.settings.studies import DRAW, FIGURES, Study
from stages.page import compared, verdicts
from stages.page.charted import Charted
from stages.page.compared import STATES, Cell, Drawn, Effects, Line, Turn

REFERENCE = "cais"  # the published reward that stands beside those that the paper has not
ANSWERS = Path(__file__).with_name("html") / "answers"
# What a study must still be for its own words to be true of it: its kind, and the measures that they are about.
WORDED: dict[str, tuple[str, list[str]]] = {
    "constants": ("turned", ["burst"]), "readings": ("turned", []), "yoked": ("plain", ["reward", "lead"]),
    "noise": ("along", ["lead"]), "limbs": ("plain", ["lead"]), "divergences": ("plain", ["lead"]),
    "rivals": ("plain", ["lead"]), "rope": ("along", ["lead", "burst"]), "encoders": ("draws", ["lead"]),
    "map": ("space", []), "confirmed": ("plain", []),
}  # fmt: skip


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
        """The template that answers it: its own or, of a study that a user adds or makes another, its kind's."""
        own = f"{self.name}.html.j2"
        kind, needs = WORDED.get(self.name, (self.kind, []))
        fits = (ANSWERS / own).exists() and kind == self.kind and set(needs) <= set(self.study.measures)
        return f"answers/{own}" if fits else f"kinds/{self.kind}.html.j2"

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
                name: compared.summed(twins)
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
                    turn = before and compared.turned(variant, claim["name"], group, before, test, self.study.first)
                    found += [turn] if turn else []
        return found

    def turning(self, variant: str) -> list[Turn]:
        """A variant's."""
        return [turn for turn in self.turns if turn.variant == variant]

    def tested(self, variant: str) -> int:
        """How many tests a variant's cells answer."""
        return sum(1 for claim in self.variants[variant]["claims"] for _ in _judged(claim))

    def judged(self, variant: str, tests: bool = False) -> dict[str, str]:
        """A variant's verdicts, or its tests', of the claims all of whose cells it has, named as Charted.foretold."""
        found: dict[str, str] = {}
        for claim in self.variants[variant]["claims"]:
            for group in judgement.GROUPS if claim["complete"] else ():
                name = f"{claim['name']}, as {group}"
                held = {f"{name}: {test['name']}": test["verdict"] for test in claim[group]["tests"]}
                found |= held if tests else {name: claim[group]["verdict"]}
        return found

    def against(self, charted: "Studied", tests: bool = False) -> dict[str, dict[str, list[str]]]:
        """Verdicts, or tests, at points of a map: by what it foretells, then by what is found, `point: name`."""
        both: dict[str, dict[str, list[str]]] = {}
        for point in self.variants:
            found = self.judged(point, tests)
            for name, word in self.foretold(charted, point, tests).items():
                if name in found:
                    both.setdefault(word, {}).setdefault(found[name], []).append(f"{point}: {name}")
        return both

    def foretold(self, charted: "Studied", point: str, tests: bool = False) -> dict[str, str]:
        """What a map foretells at a point, as Charted has it; nothing where it has no point of the same values."""
        twin = charted.variants.get(point)
        same = twin is not None and twin["set"] == self.variants[point]["set"]
        return charted.space.foretold(point, tests) if same else {}

    @property
    def verdicts(self) -> list[str]:
        """Names of those that any variant has."""
        return list(dict.fromkeys(name for variant in self.variants for name in self.judged(variant)))

    @cached_property
    def same_seeds(self) -> dict[str, str]:
        """The published runs' verdicts by the study's seeds alone, named as in `verdicts`; none if they lack some."""
        found = {}
        for claim in self.claims if self.paired else ():
            for group in judgement.GROUPS:
                tests = claim[group]["tests"]
                seeds = [test["seeds"][self.study.first :][: self.seeds] for test in tests]
                words = [compared.judged(test, own) for test, own in zip(tests, seeds, strict=True)]
                found[f"{claim['name']}, as {group}"] = compared.together(words)
        return {name: word for name, word in found.items() if name in self.verdicts}

    @property
    def turned(self) -> list[int]:
        """How many tests turn, by variant."""
        return [len(self.turning(variant)) for variant in self.variants]

    @property
    def most(self) -> str:
        """The variant with which most tests turn."""
        return max(self.variants, key=lambda variant: len(self.turning(variant)))

    @property
    def strongest(self) -> Turn:
        """Of those that turn outright, the one whose change is largest beside its interval's width."""
        return max((turn for turn in self.turns if turn.outright), key=lambda turn: turn.size)

    def largest(self, variant: str) -> Turn:
        """Of a variant's turns, as `strongest`, those outright first."""
        return max(self.turning(variant), key=lambda turn: (turn.outright, turn.size))

    @property
    def whole(self) -> int:
        """How many published seeds there are."""
        return max((len(seeds) for cell in self.made["paper"].values() for seeds in cell.values()), default=0)

    @property
    def paired(self) -> bool:
        """Whether the published runs have all of its seeds, to be compared with."""
        return self.study.first + self.seeds <= self.whole

    def states(self, measure: str, changes: bool = False, condition: str = "") -> dict[str, list[Cell]]:
        """Cells by what a measure, or its change, is in them, in the order of STATES; `condition` as in `of`."""
        held = [cell for cell in self.of(condition=condition) if measure in (cell.changes if changes else cell.effects)]
        found: dict[str, list[Cell]] = {name: [] for name in STATES}
        for cell in held:
            found[compared.state((cell.changes if changes else cell.effects)[measure], MEASURES[measure])].append(cell)
        return {name: cells for name, cells in found.items() if cells}

    def least(self, measure: str, reward: str, condition: str) -> Cell | None:
        """Of a reward's cells in a condition, that with the least effect."""
        held = [cell for cell in self.of(condition=condition, reward=reward) if measure in cell.effects]
        return min(held, key=lambda cell: cell.effects[measure].effect, default=None)

    def beside(self, cell: Cell, variant: str, measure: str) -> Found | None:
        """The change of a cell's measure from another variant's, same condition, reward and seeds; None without one."""
        name = f"{cell.condition}/{cell.reward}"
        held = [self.variants[each]["cells"] for each in (cell.variant, variant) if each in self.variants]
        found = [cells[name][measure] for cells in held if measure in cells.get(name, {})]
        return compared.change(*found) if len(found) == 2 else None

    def all_seeds(self, condition: str, reward: str, measure: str) -> Found:
        """The published effect, of every published seed."""
        return compared.summed(list(self._paper(condition, reward)[measure]))

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
                found.append(compared.line(condition, reward, held))
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
                found.append(compared.drawn(condition, reward, held))
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
            measure: compared.compared(effects[measure], self._twins(paper.get(measure, [])))
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


def listed(texts: Iterable[str], last: str = "and") -> str:
    """`a, b and c`."""
    *most, end = list(texts) or [""]
    return f"{', '.join(most)} {last} {end}" if most else end


def _judged(claim: Mapping[str, Any]) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """The tests that verdicts are made of."""
    yield from ((group, test) for group, test in verdicts.tests(claim) if group in judgement.GROUPS)
