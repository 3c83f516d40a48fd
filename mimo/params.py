"""params.yaml as frozen pydantic models: every constant once, typed, checked before any work begins."""

import difflib
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar, get_args, get_origin

import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from mimo.errors import Fault
from mimo.rewards import REWARDS

S = TypeVar("S", bound="Section")
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NonNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Count = Annotated[int, Field(gt=0)]
Limb = Literal["left_foot", "right_foot", "left_hand", "right_hand"]
Condition = Literal["free", "noisy"]
# What a variant may change: it keeps the seed, the protocol and the published encoder, whatever world that has seen.
VARIED = ("conditions", "world", "agent", "outcomes", "rewards", "encoder.latent_sd")


class ParamsError(Fault, ValueError):
    """params.yaml does not hold; the message has one sentence for each fault."""


class Section(BaseModel):
    """A part of params.yaml: unknown keys, text for numbers and later changes are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


class Protocol(Section):
    """Timing of a run (paper §2.3, §2.4). Steps are agent steps, updates are physics updates of `timestep` seconds."""

    limb: Limb
    baseline_steps: Count
    attached_steps: Count
    extinction_steps: Count
    updates_per_step: Count
    torque_updates: Count
    timestep: Positive

    @model_validator(mode="after")
    def _torque_fits(self) -> "Protocol":
        if self.torque_updates > self.updates_per_step:
            raise ValueError("torque_updates must not exceed updates_per_step")
        return self


class ConditionParams(Section):
    """What disturbs the mobile: `force` in N at every update."""

    force: NonNegative


class Conditions(Section):
    """The paper's two conditions (§2.4)."""

    free: ConditionParams
    noisy: ConditionParams


class World(Section):
    """Mobile, suspension and rope, in SI units; linear constants refer to the mobile's end of the rod."""

    mobile_mass: Positive
    mobile_height: Positive
    mobile_forward: float
    rod_length: Positive
    suspension_stiffness: NonNegative
    suspension_drag: NonNegative
    rope_stiffness: Positive
    rope_slack: NonNegative


class Collect(Section):
    """The encoder's frames, taken under the resting policy."""

    worlds: Count
    steps: Annotated[int, Field(ge=5)]
    pair_updates: Count
    held_out: Annotated[float, Field(gt=0, lt=1)]


class Encoder(Section):
    """U-Net, projector and their training (paper appendix)."""

    widths: Annotated[list[Count], Field(min_length=4, max_length=4)]
    latent: Count
    projection: Count
    pairs: Annotated[int, Field(ge=2)]
    tau: Positive
    iterations: Count
    learning_rate: Positive
    cltt_weight: NonNegative
    latent_sd: Positive


class Agent(Section):
    """Expected SARSA (paper §3.1, §3.6, appendix)."""

    hidden: Count
    learning_rate: Positive
    gamma: Annotated[float, Field(ge=0, lt=1)]
    temperature: Positive
    move_bias: float


class Outcomes(Section):
    """Quantile models of p(h|a) and p(h) (paper §3.4.2)."""

    quantiles: Count
    kappa: Positive
    learning_rate: Positive
    batch: Count
    memory: Count


class Calibrate(Section):
    """How the rewards' scales are measured."""

    steps: Annotated[int, Field(ge=2)]
    worlds: Count


class Effects(Section):
    """How large a joint's effect is under the resting policy, in the published world and in `alternatives` to it.

    `steps` are of each world, the first 20 dropped. An alternative has values of `world` by dotted key; `changed`
    checks them.
    """

    steps: Annotated[int, Field(gt=20)]
    worlds: Count
    alternatives: dict[str, Annotated[dict[str, Any], Field(min_length=1)]]

    @model_validator(mode="after")
    def _known(self) -> "Effects":
        faults = _bad_names("alternatives", self.alternatives)
        if "published" in self.alternatives:
            faults.append("alternatives has 'published', which is the world of params.yaml itself")
        faults += [
            f"alternatives.{name} has {key!r}, but an alternative may change only world"
            for name, values in self.alternatives.items()
            for key in values
            if not key.startswith("world.")
        ]
        if faults:
            raise ValueError("; ".join(faults))
        return self


class Pays(Section):
    """Which actions a reward pays: `move` pays MOVE alone, `taken` whichever action was taken."""

    pays: Literal["move", "taken"]


class Rewards(Section):
    """Gain and scale, which all rewards share, and a section for each reward that has constants of its own.

    `scale`: `resting` divides by the SD under the resting policy, `running` standardises by mean and SD so far.
    """

    gain: Positive
    scale: Literal["resting", "running"]
    cais: Pays
    surprise: Pays


class Sweep(Section):
    """Which runs the paper is made of."""

    conditions: Annotated[list[Condition], Field(min_length=1)]
    rewards: Annotated[list[str], Field(min_length=1)]
    seeds: Count
    chunk: Count

    @model_validator(mode="after")
    def _known(self) -> "Sweep":
        faults = [
            f"{name} names one entry twice"
            for name, given in (("conditions", self.conditions), ("rewards", self.rewards))
            if len(set(given)) < len(given)
        ]
        faults += _bad_rewards("rewards", self.rewards)
        if faults:
            raise ValueError("; ".join(faults))
        return self


class Variant(Section):
    """The published params with some values changed, and the few cells that show what it does.

    `set` has a value, or a list, by dotted key; `varied` checks them. `cells` has rewards' names by condition.
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
        faults = [f"set has {key!r}, but a variant may change only {', '.join(VARIED)}" for key in fixed]
        for condition, rewards in self.cells.items():
            faults += _bad_rewards(f"cells.{condition}", rewards)
            if len(set(rewards)) < len(rewards):
                faults.append(f"cells.{condition} names one entry twice")
        if faults:
            raise ValueError("; ".join(faults))
        return self


class Sweeps(Section):
    """Variants of the published params, each in `seeds` seeds: which constant decides what is found?"""

    seeds: Count
    variants: Annotated[dict[str, Variant], Field(min_length=1)]

    @model_validator(mode="after")
    def _named(self) -> "Sweeps":
        faults = _bad_names("variants", self.variants)
        if faults:
            raise ValueError("; ".join(faults))
        return self


class Params(Section):
    """The whole of params.yaml."""

    seed: Annotated[int, Field(ge=0)]
    protocol: Protocol
    conditions: Conditions
    world: World
    collect: Collect
    encoder: Encoder
    agent: Agent
    outcomes: Outcomes
    calibrate: Calibrate
    effects: Effects
    rewards: Rewards
    sweep: Sweep
    sweeps: Sweeps

    @model_validator(mode="after")
    def _across(self) -> "Params":
        if self.collect.pair_updates >= self.protocol.updates_per_step:
            raise ValueError("collect.pair_updates must be less than protocol.updates_per_step")
        if not 0 < round(self.collect.steps * (1 - self.collect.held_out)) < self.collect.steps:
            raise ValueError("collect.held_out must leave at least one of collect.steps on either side")
        return self


def load(path: str | Path = "params.yaml") -> Params:
    """Read and check params.yaml.

    Raises:
        ParamsError: unreadable, or one or more values do not hold; all faults at once, a sentence each.
    """
    path = Path(path)
    try:
        raw = yaml.safe_load(path.read_text())
    except FileNotFoundError:
        raise ParamsError(f"{path} is missing; run from the project's top folder.") from None
    except yaml.YAMLError as error:
        raise ParamsError(f"{path} is not valid YAML: {error}") from None
    try:
        params = Params.model_validate(raw)
    except ValidationError as error:
        raise ParamsError("\n".join(f"{path}: {_sentence(dict(fault))}" for fault in error.errors())) from None
    changes = {f"sweeps.variants.{name}.set": variant.set for name, variant in params.sweeps.variants.items()}
    changes |= {f"effects.alternatives.{name}": values for name, values in params.effects.alternatives.items()}
    faults = []
    for where, values in changes.items():
        try:
            changed(params, values)
        except ParamsError as error:
            faults += [f"{path}: {where}: {sentence}" for sentence in str(error).splitlines()]
    if faults:
        raise ParamsError("\n".join(faults))
    return params


def varied(params: Params, name: str) -> Params:
    """`params` with the values that the variant `name` sets; see `changed`."""
    return changed(params, params.sweeps.variants[name].set)


def changed(params: Params, values: Mapping[str, object]) -> Params:
    """`params` with other values at some dotted keys, checked like those of params.yaml.

    Raises:
        ParamsError: a key is unknown or a value does not hold; all faults at once, a sentence each.
    """
    whole = params.model_dump()
    for key, value in values.items():
        *sections, last = key.split(".")
        part = whole
        for section in sections:
            part = part.setdefault(section, {})
            if not isinstance(part, dict):
                raise ParamsError(f"{key} is not a known key; {section} is a value, not a section.")
        part[last] = value
    return checked(params, whole)


def checked(section: S, changes: Mapping[str, object]) -> S:
    """`section` with some values changed, checked like those of params.yaml.

    Raises:
        ParamsError: a value does not hold; all faults at once, a sentence each.
    """
    try:
        return type(section).model_validate(section.model_dump() | dict(changes))
    except ValidationError as error:
        raise ParamsError("\n".join(_sentence(dict(fault)) for fault in error.errors())) from None


def _sentence(fault: dict[str, object]) -> str:
    location = fault["loc"]
    assert isinstance(location, tuple)
    key = ".".join(str(part) for part in location if part != "[key]") or "the file"
    if fault["type"] == "extra_forbidden":
        return f"{key} is not a known key; {_nearest(str(location[-1]), _keys(location[:-1]))}."
    if fault["type"] == "missing":
        return f"{key} is missing."
    if fault["type"] == "model_type":
        return f"{key} must be a section of keys and values."
    message = str(fault["msg"]).removeprefix("Value error, ")
    rule = f" must {message[13:]}" if message.startswith("Input should ") else f": {message[:1].lower()}{message[1:]}"
    return f"{key}{rule}{_given(fault['input'])}."


def _given(value: object) -> str:
    if not isinstance(value, str | int | float | None):
        return ""
    looks_a_number = isinstance(value, str) and re.fullmatch(r"[-+.\deE]*\d[-+.\deE]*", value)
    hint = ", which is text: write it without quotes, and as 0.001 rather than 1e-3" if looks_a_number else ""
    return f"; it is {value!r}{hint}"


def _keys(location: tuple[object, ...]) -> list[str]:
    kind: Any = Params
    for part in location:
        kind = get_args(kind)[1] if get_origin(kind) is dict else kind.model_fields[str(part)].annotation
    return list(kind.model_fields)


def _bad_names(where: str, names: Iterable[str]) -> list[str]:
    bad = ", ".join(repr(name) for name in names if not re.fullmatch("[a-z0-9_]+", name))
    return [f"{where} has {bad}: use small letters, digits and '_' alone"] if bad else []


def _bad_rewards(where: str, given: list[str]) -> list[str]:
    faults = []
    for reward in given:
        parts = reward.split("_")
        faults += [f"{where} has {reward!r}, but {_unknown(part, list(REWARDS))}" for part in parts
                   if part not in REWARDS]  # fmt: skip
        if len(set(parts)) < len(parts):
            faults.append(f"{where} has {reward!r}, which adds one reward twice")
    return faults


def _unknown(name: str, known: list[str]) -> str:
    return f"{name!r} is unknown; {_nearest(name, known)}"


def _nearest(name: str, known: list[str]) -> str:
    near = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
    return f"perhaps {near[0]!r} is meant" if near else f"known are {', '.join(known)}"
