"""studies/params.yaml: what is asked beyond the paper, each study by changing a few values of params.yaml."""

from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, model_validator

from mimo.settings.complaints import bad_names, bad_rewards, unless
from mimo.settings.files import ParamsError, shown
from mimo.settings.params import REWARDS, Params, changed, loaded
from mimo.settings.section import Condition, Section, Seeds, Worlds

PATH = Path("studies/params.yaml")
FEWEST = 20  # agent steps of an effect
# What a variant may change: it keeps the seed, the phases and, but for `collect`, the published encoder.
VARIED = (
    "conditions", "world", "agent", "outcomes", "rewards", "encoder.latent_sd", "protocol.limb", "collect.limbs",
    "collect.draw",
)  # fmt: skip
FIGURES = 3  # measures that a study's figure has room for

Text = Annotated[str, Field(min_length=1)]
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


class Variant(Section):
    """The published params with some values changed.

    `set` has a value, or a list, by dotted key; `load` checks them. `cells` has rewards' names by condition, where they
    are not the study's. `yoked` names the reward whose published runs are the donors (see mimo.world.yoked).
    """

    asks: Text | None = None
    set: dict[str, Any]
    cells: Cells | None = None
    yoked: Text | None = None

    @model_validator(mode="after")
    def _known(self) -> "Variant":
        faults = [
            f"set has {shown(key)}, but a variant may change only {', '.join(VARIED)}"
            for key in self.set
            if key.split(".")[0] in Params.model_fields and not any(f"{key}.".startswith(f"{v}.") for v in VARIED)
        ]
        faults += [f"set has {shown(key)}, a section; give its values" for key, v in self.set.items() if _section(v)]
        for condition, rewards in (self.cells or {}).items():
            faults += bad_rewards(f"cells.{condition}", rewards, REWARDS)
        return unless(faults + (bad_rewards("yoked", [self.yoked], REWARDS) if self.yoked else []), self)


def _section(value: object) -> bool:
    return isinstance(value, dict)


class Study(Section):
    """A question, and the variants whose runs answer it.

    `asks` is the question, `expects` what the paper or earlier work let expect, `limits` what the answer cannot say.
    `seeds` seeds are computed of each cell; `measures` (mimo.science.measures) are shown, the first FIGURES in the
    figure. Where `axis` is a key that every variant sets to a number, and the published params have one too, effects
    are shown against it.
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

    def pairs(self, variant: str) -> tuple[tuple[Condition, str], ...]:
        """Condition and reward of each of a variant's cells."""
        cells = self.variants[variant].cells or self.cells
        return tuple((condition, reward) for condition, rewards in cells.items() for reward in rewards)

    @model_validator(mode="after")
    def _known(self) -> "Study":
        faults = bad_names("variants", self.variants)
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
        return unless(faults, self)


class Studies(Section):
    """The whole of studies/params.yaml."""

    effects: Effects
    studies: Annotated[dict[str, Study], Field(min_length=1)]

    @model_validator(mode="after")
    def _named(self) -> "Studies":
        return unless(bad_names("studies", self.studies), self)


def load(params: Params, path: Path = PATH) -> Studies:
    """Read and check studies/params.yaml.

    Args:
        params: all of params.yaml, which the studies' values must fit.
        path: the file.

    Raises:
        ParamsError: unreadable, or one or more values do not hold; all faults at once, a sentence each.
    """
    found = loaded(path, Studies)
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


def _without_donors(params: Params, variant: Variant, conditions: set[str]) -> list[str]:
    """Why there are no donors for a yoked variant: they are the paper's own runs."""
    faults = ["is yoked, so its set must be empty: donors' worlds are the paper's"] if variant.set else []
    if variant.yoked not in params.sweep.rewards:
        faults.append(f"is yoked to {shown(variant.yoked)}, which is not among sweep.rewards")
    lacking = sorted(conditions - set(params.sweep.conditions))
    return [*faults, *(f"is yoked in {shown(condition)}, which is not among sweep.conditions" for condition in lacking)]
