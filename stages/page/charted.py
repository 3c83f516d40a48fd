"""A map's numbers in words' order: which verdicts hold where, on which constants they hang, which points have most."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from mimo.settings.studies import Range

TOLD = 0.5  # Q2 from which a surface is taken to tell
EVERYWHERE, NOWHERE = 0.95, 0.01  # of the space


@dataclass(frozen=True)
class Verdict:
    """A claim's, as shown or as said.

    `share` is of the space, `points` of the map's points where it is foretold, `least` the test with the least share.
    """

    label: str
    share: float
    points: int
    tests: int
    least: Mapping[str, Any]


@dataclass(frozen=True)
class Charted:
    """A study's `space`, as reports/studies/NAME.json has it.

    Attributes:
        ranges: of the constants, by dotted key.
        published: their published values, by dotted key.
        names: of the points.
        made: what mimo.science.space gave.
    """

    ranges: Mapping[str, Range]
    published: Mapping[str, Any]
    names: tuple[str, ...]
    made: Mapping[str, Any]

    @property
    def constants(self) -> list[str]:
        """Short, in order: `gain`, `cais pays`."""
        return [key.partition(".")[2].replace(".", " ").replace("_", " ") for key in self.ranges]

    @property
    def columns(self) -> list[tuple[str, tuple[str, ...], bool, float | None]]:
        """By constant: name, ends of its range or few values, whether those, and where the published value lies."""
        return [
            (
                name,
                tuple(map(str, own.of)) if own.of else (f"{own.low:g}", f"{own.high:g}"),
                bool(own.of),
                _within(own, self.published[key]),
            )
            for name, (key, own) in zip(self.constants, self.ranges.items(), strict=True)
        ]

    @cached_property
    def verdicts(self) -> list[Verdict]:
        """In the order of the claims."""
        found = []
        for each in self.made["verdicts"]:
            own = [test for test in self.tests if (test["claim"], test["group"]) == (each["claim"], each["group"])]
            least = min(own, key=lambda test: test["share"])
            label = f"{each['claim']}, as {each['group']}"
            found.append(Verdict(label, each["share"], sum(each["met"]), len(own), least))
        return found

    @property
    def everywhere(self) -> list[Verdict]:
        """Those that hold in as good as all of the space."""
        return [each for each in self.verdicts if each.share >= EVERYWHERE]

    @property
    def nowhere(self) -> list[Verdict]:
        """Those that hold in as good as none of it."""
        return [each for each in self.verdicts if each.share < NOWHERE]

    @property
    def somewhere(self) -> list[Verdict]:
        """The others, those that hold in most of it first."""
        held = [each for each in self.verdicts if NOWHERE <= each.share < EVERYWHERE]
        return sorted(held, key=lambda each: -each.share)

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
        """Constants, by how many of `told` each has the largest share of the variance, most first."""
        counts = Counter(self.constants[test["shares"].index(max(test["shares"]))] for test in self.told)
        return counts.most_common()

    @property
    def most(self) -> tuple[int, float]:
        """How many verdicts hold together at most, and in which share of the space so many do."""
        counts: list[float] = self.made["together"]["counts"]
        most = max(number for number, share in enumerate(counts) if share > 0)
        return most, counts[most]

    @property
    def order(self) -> list[tuple[str, int, int]]:
        """Points by how many verdicts, then tests, are foretold: name and both numbers."""
        return [
            (
                self.names[place],
                sum(each["met"][place] for each in self.made["verdicts"]),
                sum(test["foretold"][place] for test in self.tests),
            )
            for place in self.made["order"]
        ]

    @property
    def excluding(self) -> list[tuple[str, str]]:
        """Verdicts that exclude each other."""
        return [(first, second) for first, second in self.made["excluding"]]

    def largest(self, test: Mapping[str, Any], number: int = 3) -> list[tuple[str, float]]:
        """The constants, and pairs of them, that have most of a test's variance, and how much."""
        found = list(zip(self.constants, test["shares"], strict=False))
        found += [(f"{self.constants[a]} x {self.constants[b]}", share) for a, b, share in test["pairs"]]
        return sorted(found, key=lambda one: -one[1])[:number]


def _within(own: Range, value: Any) -> float | None:
    """A value's share of the range; None where it is not in it."""
    if own.of:
        return own.share(value) if value in own.of else None
    share = own.share(value)
    return share if 0 <= share <= 1 else None
