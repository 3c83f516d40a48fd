"""studies/params.yaml: what is asked beyond the paper, each study by changing a few values of params.yaml."""

import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field, StringConstraints, model_validator

from mimo.settings.complaints import bad_names, bad_rewards, unless
from mimo.settings.files import ParamsError, shown
from mimo.settings.params import REWARDS, Params, changed, loaded
from mimo.settings.section import Condition, Section, Seeds, Worlds

PATH = Path("studies/params.yaml")
FEWEST = 20  # agent steps of an effect
FEWEST_POINTS = 8  # of a space, for surfaces through them (mimo.science.surfaces)
# What a variant may change: it keeps the seed, the phases and, but for `collect`, the published encoder.
VARIED = (
    "conditions", "world", "agent", "outcomes", "rewards", "encoder.latent_sd", "protocol.limb", "collect.limbs",
    "collect.draw",
)  # fmt: skip
MOST = 1000  # seeds
SIGNIFICANT = 3  # digits of a point's values
RESERVED = {"studies": ("artifacts", "effects"), "variants": ("encoders",)}  # files beside theirs have these names
DRAW = "collect.draw"
FIGURES = 3  # measures that a study's figure has room for

Text = Annotated[str, StringConstraints(strip_whitespace=True, min_length=1)]
End = Annotated[float, Field(ge=-1e6, le=1e6)]
Cells = Annotated[dict[Condition, Annotated[list[str], Field(min_length=1)]], Field(min_length=1)]


class Effects(Section):
    """How large a joint's effect is under the resting policy, in the published world and in `alternatives` to it.

    `steps` are of each world, the first `dropped` left out. An alternative has values of `world` by dotted key; `load`
    checks them.
    """

    steps: Annotated[int, Field(gt=0, le=20_000)]
    dropped: Annotated[int, Field(ge=0, le=1000)]
    worlds: Worlds
    alternatives: dict[str, Annotated[dict[str, Any], Field(min_length=1)]]

    @model_validator(mode="after")
    def _known(self) -> "Effects":
        faults = bad_names("alternatives", self.alternatives)
        if (self.steps - self.dropped) * self.worlds < FEWEST:
            faults.append(
                f"steps less dropped, times worlds, must be at least {FEWEST}, for every joint to move and to rest"
            )
        if "published" in self.alternatives:
            faults.append("alternatives has 'published', which is the world of params.yaml itself")
        faults += [
            f"alternatives.{name} has {shown(key)}, but an alternative may change only world"
            for name, values in self.alternatives.items()
            for key in values
            if not key.startswith("world.")
        ]
        return unless(faults, self)


class Range(Section):
    """Values of a constant in a space: from `low` to `high`, evenly in the logarithm with `log`, or the two in `of`."""

    low: End | None = None
    high: End | None = None
    log: bool = False
    of: Annotated[list[str | bool], Field(min_length=2, max_length=2)] | None = None

    @model_validator(mode="after")
    def _known(self) -> "Range":
        ends = (self.low, self.high)
        if (self.of is None) == (None in ends) or (self.of and ends != (None, None)):
            return unless(["low and high, or else of, must be given"], self)
        if self.of and self.of[0] == self.of[1]:
            return unless(["of must have two values, not one twice"], self)
        if self.of is None and not (ends[0] < ends[1] and (ends[0] > 0 or not self.log)):  # type: ignore[operator]
            return unless(["low must be less than high, and above 0 with log"], self)
        return self

    def value(self, share: float, kind: type) -> Any:
        """What lies at a share of the range, in [0, 1): with SIGNIFICANT digits, and whole if `kind` is int."""
        if self.of:
            return self.of[int(share * len(self.of))]
        assert self.low is not None and self.high is not None
        low, high = (math.log(end) if self.log else end for end in (self.low, self.high))
        found = low + share * (high - low)
        found = float(f"{math.exp(found) if self.log else found:.{SIGNIFICANT}g}")
        return round(found) if kind is int else found

    def place(self, value: Any) -> float | None:
        """Where a value lies, as `share` has it; None where it does not lie in the range."""
        if self.of:
            return self.share(value) if value in self.of else None
        assert self.low is not None and self.high is not None
        return self.share(value) if self.low <= value <= self.high else None

    def share(self, value: Any) -> float:
        """Where a value of the range lies, from 0 to 1; of the two in `of`, the middle of either half."""
        if self.of:
            return (self.of.index(value) + 0.5) / len(self.of)
        assert self.low is not None and self.high is not None
        low, high, at = (math.log(end) if self.log else end for end in (self.low, self.high, value))
        return (at - low) / (high - low)


class Variant(Section):
    """The published params with some values changed.

    `set` has a value, or a list, by dotted key; `load` checks them. `cells` has rewards' names by condition, where they
    are not the study's. `yoked` names the reward whose published runs are the donors (see mimo.world.yoked). Seeds
    begin at `first`, which is the same for all variants of a study. One with `points` is so many variants, numbered
    from 0: those of a scrambled Sobol sequence over the ranges `over`, by dotted key, whose order counts; `load` puts
    them in its place.
    """

    asks: Text | None = None
    set: dict[str, Any] = Field(default_factory=dict)
    cells: Cells | None = None
    yoked: Text | None = None
    first: Annotated[int, Field(ge=0, lt=MOST)] = 0
    points: Annotated[int, Field(ge=FEWEST_POINTS, le=100)] | None = None
    over: Annotated[dict[str, Range], Field(min_length=1)] | None = None

    @model_validator(mode="after")
    def _known(self) -> "Variant":
        faults = [
            f"{where} has {shown(key)}, but a variant may change only {', '.join(VARIED)}"
            for where, values in (("set", self.set), ("over", self.over or {}))
            for key in values
            if key.split(".")[0] in Params.model_fields and not any(f"{key}.".startswith(f"{v}.") for v in VARIED)
        ]
        if (self.points is None) != (self.over is None):
            faults.append("points and over must be given together, or neither")
        faults += [f"set has {shown(key)}, which is in over, too" for key in self.set if key in (self.over or {})]
        faults += [f"set has {shown(key)}, a section; give its values" for key, v in self.set.items() if _section(v)]
        for condition, rewards in (self.cells or {}).items():
            faults += bad_rewards(f"cells.{condition}", rewards, REWARDS)
        return unless(faults + (bad_rewards("yoked", [self.yoked], REWARDS) if self.yoked else []), self)


def _section(value: object) -> bool:
    return isinstance(value, dict)


class Study(Section):
    """A question, and the variants whose runs answer it.

    `asks` is the question, `expects` what the paper or earlier work let expect, `limits` what the answer cannot say.
    `seeds` seeds are computed of each cell; `measures` (mimo.science.measures) are shown, the
    first FIGURES in the figure. Where `axis` is a key that every variant sets to a number, and the published params
    have one too, effects are shown against it.
    """

    title: Text
    asks: Text
    expects: Text
    limits: Text
    seeds: Seeds
    measures: Annotated[list[str], Field(min_length=1)]
    axis: Text | None = None
    cells: Cells
    variants: Annotated[dict[str, Variant], Field(min_length=1)]

    @property
    def space(self) -> dict[str, Range]:
        """By dotted key, what its variants are points of; empty where they are not points of one space."""
        spaces = [variant.over or {} for variant in self.variants.values()]
        fixed = [
            {key: value for key, value in variant.set.items() if key not in spaces[0]}
            for variant in self.variants.values()
        ]
        one = all(space == spaces[0] for space in spaces) and all(values == fixed[0] for values in fixed)
        return spaces[0] if one else {}

    @property
    def first(self) -> int:
        """The seed at which all its variants begin."""
        return next(iter(self.variants.values())).first

    def numbers(self) -> range:
        """Its seeds'."""
        return range(self.first, self.first + self.seeds)

    def pairs(self, variant: str) -> tuple[tuple[Condition, str], ...]:
        """Condition and reward of each of a variant's cells."""
        cells = self.variants[variant].cells or self.cells
        return tuple((condition, reward) for condition, rewards in cells.items() for reward in rewards)

    @model_validator(mode="after")
    def _known(self) -> "Study":
        faults = _bad_names("variants", self.variants)
        points = [(name, place) for name, own in self.variants.items() for place in range(own.points or 0)]
        taken = [f"{name}{place:02d}" for name, place in points if f"{name}{place:02d}" in self.variants]
        faults += [f"variants has {shown(name)}, which is the name of a point" for name in taken]
        if len({variant.first for variant in self.variants.values()}) > 1:
            faults.append("variants must have one first seed for all")
        if self.numbers().stop > MOST:
            faults.append(f"seeds and the first of variants come to more than {MOST}; files have three digits")
        if len(set(self.measures)) < len(self.measures):
            faults.append("measures names one entry twice")
        for condition, rewards in self.cells.items():
            faults += bad_rewards(f"cells.{condition}", rewards, REWARDS)
        if self.axis:
            faults += [
                f"variants.{name}.set must give {shown(self.axis)}, the axis, a number"
                for name, variant in self.variants.items()
                if type(variant.set.get(self.axis)) not in (int, float)
            ]
            faults += _alike(self.axis, self.variants)
        if all(set(variant.set) == {DRAW} for variant in self.variants.values()):
            faults += _alike(DRAW, self.variants)
        return unless(faults, self)


class Studies(Section):
    """The whole of studies/params.yaml."""

    effects: Effects
    studies: Annotated[dict[str, Study], Field(min_length=1)]

    @model_validator(mode="after")
    def _named(self) -> "Studies":
        return unless(_bad_names("studies", self.studies), self)


def _bad_names(where: str, names: Iterable[str]) -> list[str]:
    return bad_names(where, names) + [
        f"{where} has {shown(name)}, which another file is named" for name in names if name in RESERVED[where]
    ]


def _alike(key: str, variants: Mapping[str, Variant]) -> list[str]:
    """Variants that set a key to one value, where each should stand for another."""
    first: dict[Any, str] = {}
    faults = []
    for name, value in ((name, variant.set[key]) for name, variant in variants.items() if key in variant.set):
        if isinstance(value, (int, float)) and first.setdefault(value, name) != name:
            faults.append(f"variants.{name} and variants.{first[value]} have one value of {shown(key)}")
    return faults


def load(params: Params, path: Path = PATH) -> Studies:
    """Read and check studies/params.yaml.

    Args:
        params: all of params.yaml, which the studies' values must fit.
        path: the file.

    Raises:
        ParamsError: unreadable, or one or more values do not hold; all faults at once, a sentence each.
    """
    found = loaded(path, Studies)
    found = found.model_copy(update={"studies": {name: spanned(params, own) for name, own in found.studies.items()}})
    changes = {
        f"studies.{name}.variants.{own}.set": variant.set
        for name, study in found.studies.items()
        for own, variant in study.variants.items()
    }
    changes |= {f"effects.alternatives.{name}": values for name, values in found.effects.alternatives.items()}
    faults = []
    for where, values in changes.items():
        try:
            changed(params, values)
        except ParamsError as error:
            faults += [f"{path}: {where}: {sentence}" for sentence in str(error).splitlines()]
    faults += [
        f"{path}: studies.{name}.variants.{own} {fault}."
        for name, study in found.studies.items()
        for own, variant in study.variants.items()
        if variant.yoked
        for fault in _without_donors(params, variant, {condition for condition, _ in study.pairs(own)})
    ]
    faults += [
        f"{path}: studies.{name}.variants.{own} sets {shown(DRAW)} alone, to what it is as published."
        for name, study in found.studies.items()
        for own, variant in study.variants.items()
        if variant.set == {DRAW: params.collect.draw}
    ]
    if faults:
        raise ParamsError("\n".join(faults))
    return found


def study(params: Params, name: str) -> Study:
    """One of studies/params.yaml.

    Raises:
        ParamsError: the file does not hold, or has no such study.
    """
    known = load(params).studies
    if name not in known:
        raise ParamsError(f"There is no study {shown(name)} in {PATH}; known are {', '.join(known)}.")
    return known[name]


def spanned(params: Params, study: Study) -> Study:
    """The study with points in place of each variant that has some; an unknown key is `load`'s to find."""
    variants: dict[str, Variant] = {}
    for name, variant in study.variants.items():
        if variant.points is None or variant.over is None:
            variants[name] = variant
            continue
        whole = params.model_dump()
        kinds = [type(_value(whole, key)) for key in variant.over]
        for place, shares in enumerate(_sobol(len(variant.over), variant.points)):
            values = zip(variant.over.items(), shares, kinds, strict=True)
            own = {key: over.value(share, kind) for (key, over), share, kind in values}
            variants[f"{name}{place:02d}"] = variant.model_copy(update={"set": variant.set | own})
    return study.model_copy(update={"variants": variants})


def _value(values: Any, key: str) -> Any:
    """At a dotted key; None where there is none."""
    for part in key.split("."):
        values = values.get(part) if isinstance(values, dict) else None
    return values


def _sobol(dimensions: int, points: int) -> list[list[float]]:
    """The first points of the one scrambled Sobol sequence of so many dimensions."""
    from scipy.stats import qmc  # here, as it takes half a second to load

    sequence = qmc.Sobol(dimensions, rng=np.random.default_rng(0))
    found: list[list[float]] = sequence.random_base2((points - 1).bit_length())[:points].tolist()
    return found


def _without_donors(params: Params, variant: Variant, conditions: set[str]) -> list[str]:
    """Why there are no donors for a yoked variant: they are the paper's own runs."""
    faults = ["is yoked, so its set must be empty: donors' worlds are the paper's"] if variant.set else []
    if variant.yoked not in params.sweep.rewards:
        faults.append(f"is yoked to {shown(variant.yoked)}, which is not among sweep.rewards")
    lacking = sorted(conditions - set(params.sweep.conditions))
    return [*faults, *(f"is yoked in {shown(condition)}, which is not among sweep.conditions" for condition in lacking)]
