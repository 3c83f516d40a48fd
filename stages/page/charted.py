"""A map's numbers in words' order: which verdicts hold where, on which constants they hang, which points have most."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from mimo.science.judgement import FAILS, HOLDS
from mimo.settings.studies import Range

TOLD = 0.5  # Q2 from which a surface is taken to foretell
MUCH, LITTLE = 0.9, 0.01  # of the space


@dataclass(frozen=True)
class Charting:
    """A claim's verdict, as shown or as said: shares of the space where it is foretold to hold, and to fail.

    `points` are the points where it is foretold to hold, `least` is the test that holds in the least share.
    """

    label: str
    holds: float
    fails: float
    points: int
    least: Mapping[str, Any]

    @property
    def open(self) -> float:
        """Share of the space where neither is foretold."""
        return max(0.0, 1 - self.holds - self.fails)


@dataclass(frozen=True)
class Charted:
    """A study's `space`, as reports/studies/NAME.json has it.

    Attributes:
        ranges: of the constants, by dotted key.
        published: their published values, by dotted key.
        points: by name, each point's values by dotted key.
        made: what mimo.science.space gave.
    """

    ranges: Mapping[str, Range]
    published: Mapping[str, Any]
    points: Mapping[str, Mapping[str, Any]]
    made: Mapping[str, Any]

    @property
    def constants(self) -> list[str]:
        """Short, in order: `gain`, `cais pays`; with their sections where two would be alike."""
        short = [key.partition(".")[2] for key in self.ranges]
        return [
            key.replace(".", " ").replace("_", " ") for key in (short if len({*short}) == len(short) else self.ranges)
        ]

    @property
    def columns(self) -> list[tuple[str, tuple[str, ...], bool, float | None]]:
        """By constant: name, ends of its range or both values, whether those, and where the published value lies."""
        return [
            (
                name,
                tuple(map(str, own.of)) if own.of else (f"{own.low:g}", f"{own.high:g}"),
                bool(own.of),
                own.place(self.published[key]),
            )
            for name, (key, own) in zip(self.constants, self.ranges.items(), strict=True)
        ]

    @cached_property
    def verdicts(self) -> list[Charting]:
        """In the order of the claims."""
        found = []
        for each in self.made["verdicts"]:
            own = [test for test in self.tests if (test["claim"], test["group"]) == (each["claim"], each["group"])]
            label = f"{each['claim']}, as {each['group']}"
            points = each["points"].count(HOLDS)
            least = min(own, key=lambda test: (test["holds"], -test["fails"]))
            found.append(Charting(label, each["holds"], each["fails"], points, least))
        return found

    @property
    def parted(self) -> dict[str, list[Charting]]:
        """Verdicts by what is foretold of them: `holds` or `fails` in MUCH of the space, in a `part`, or `nowhere`.

        `nowhere` are those that hold in less than LITTLE of it, and do not fail in MUCH.
        """
        found: dict[str, list[Charting]] = {"holds": [], "part": [], "nowhere": [], "fails": []}
        for each in self.verdicts:
            hardly = "fails" if each.fails >= MUCH else "nowhere"
            found["holds" if each.holds >= MUCH else "part" if each.holds >= LITTLE else hardly].append(each)
        found["part"].sort(key=lambda each: -each.holds)
        return found

    @property
    def tests(self) -> list[Mapping[str, Any]]:
        """Of all verdicts."""
        found: list[Mapping[str, Any]] = self.made["tests"]
        return found

    @property
    def told(self) -> list[Mapping[str, Any]]:
        """Tests whose surface foretells points that it has not seen."""
        return [test for test in self.tests if test["q2"] is not None and test["q2"] >= TOLD]

    @property
    def leading(self) -> list[tuple[str, int]]:
        """Constants, by how many of `told` each has the largest single share of the variance, most first."""
        counts = Counter(self.constants[test["shares"].index(max(test["shares"]))] for test in self.told)
        return counts.most_common()

    @property
    def beside(self) -> tuple[int, int]:
        """Tests whose published effect lies within two SD of the surface there, and all that have both."""
        held = [test["published"] for test in self.tests if test["published"]]
        return sum(abs(found - effect) <= 2 * unknown for found, unknown, effect in held), len(held)

    @property
    def most(self) -> tuple[int, float]:
        """How many verdicts hold together at most, and in which share of the space so many do."""
        counts: list[float] = self.made["together"][HOLDS]
        most = max(number for number, share in enumerate(counts) if share > 0)
        return most, counts[most]

    @property
    def unfailing(self) -> float:
        """Share of the space where no verdict is foretold to fail."""
        return float(self.made["together"][FAILS][0])

    @property
    def order(self) -> list[tuple[str, int, int, list[Any]]]:
        """Points by how many verdicts, then tests, are foretold to hold: name, both numbers, the constants' values."""
        found = []
        for place in self.made["order"]:
            name = list(self.points)[place]
            held = [sum(each["points"][place] == HOLDS for each in self.made[kind]) for kind in ("verdicts", "tests")]
            found.append((name, held[0], held[1], [self.points[name][key] for key in self.ranges]))
        return found

    def foretold(self, point: str, tests: bool = False) -> dict[str, str]:
        """Verdicts at a point, by claim and `shown` or `said`; or the tests', by that and the test."""
        place = list(self.points).index(point)
        if tests:
            held = {f"{test['claim']}, as {test['group']}: {test['name']}": test for test in self.tests}
        else:
            held = {f"{each['claim']}, as {each['group']}": each for each in self.made["verdicts"]}
        return {name: own["points"][place] for name, own in held.items()}

    def largest(self, test: Mapping[str, Any], number: int = 3) -> list[tuple[str, float]]:
        """The constants, and pairs of them, that have most of a test's variance, if it is among `told`."""
        if test not in self.told:
            return []
        found = list(zip(self.constants, test["shares"], strict=True))
        found += [(f"{self.constants[a]} x {self.constants[b]}", share) for a, b, share in test["pairs"]]
        return sorted(found, key=lambda one: -one[1])[:number]
