"""studies/params.yaml: what is asked beyond the paper, each by changing a few values of params.yaml."""

from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, model_validator

from mimo.settings.complaints import bad_names, bad_rewards, unless
from mimo.settings.files import ParamsError, shown
from mimo.settings.params import REWARDS, Params, changed, loaded
from mimo.settings.section import Condition, Section, Seeds, Worlds

PATH = Path("studies/params.yaml")
FEWEST = 20  # agent steps of an effect
# What a variant may change: it keeps the seed, the protocol and the published encoder, whatever world that has seen.
VARIED = ("conditions", "world", "agent", "outcomes", "rewards", "encoder.latent_sd")


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
    """The published params with some values changed, and the few cells that show what it does.

    `set` has a value, or a list, by dotted key; `load` checks them. `cells` has rewards' names by condition.
    """

    asks: Annotated[str, Field(min_length=1)]
    set: Annotated[dict[str, Any], Field(min_length=1)]
    cells: Annotated[dict[Condition, Annotated[list[str], Field(min_length=1)]], Field(min_length=1)]

    @property
    def pairs(self) -> tuple[tuple[Condition, str], ...]:
        """Condition and reward of each cell."""
        return tuple((condition, reward) for condition, rewards in self.cells.items() for reward in rewards)

    @model_validator(mode="after")
    def _known(self) -> "Variant":
        fixed = [
            key
            for key in self.set
            if key.split(".")[0] in Params.model_fields and not any(f"{key}.".startswith(f"{v}.") for v in VARIED)
        ]
        faults = [f"set has {shown(key)}, but a variant may change only {', '.join(VARIED)}" for key in fixed]
        for condition, rewards in self.cells.items():
            faults += bad_rewards(f"cells.{condition}", rewards, REWARDS)
        return unless(faults, self)


class Sweeps(Section):
    """Variants of the published params, each in `seeds` seeds: which constant decides what is found?"""

    seeds: Seeds
    variants: Annotated[dict[str, Variant], Field(min_length=1)]

    @model_validator(mode="after")
    def _named(self) -> "Sweeps":
        return unless(bad_names("variants", self.variants), self)


class Studies(Section):
    """The whole of studies/params.yaml."""

    effects: Effects
    sweeps: Sweeps


def load(params: Params, path: Path = PATH) -> Studies:
    """Read and check studies/params.yaml.

    Args:
        params: all of params.yaml, which the studies' values must fit.
        path: the file.

    Raises:
        ParamsError: unreadable, or one or more values do not hold; all faults at once, a sentence each.
    """
    studies = loaded(path, Studies)
    changes = {f"sweeps.variants.{name}.set": variant.set for name, variant in studies.sweeps.variants.items()}
    changes |= {f"effects.alternatives.{name}": values for name, values in studies.effects.alternatives.items()}
    faults = []
    for where, values in changes.items():
        try:
            changed(params, values)
        except ParamsError as error:
            faults += [f"{path}: {where}: {sentence}" for sentence in str(error).splitlines()]
    if faults:
        raise ParamsError("\n".join(faults))
    return studies
