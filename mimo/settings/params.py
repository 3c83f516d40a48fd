"""params.yaml as frozen pydantic models: every constant once, typed, checked before any work begins."""

import difflib
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar, get_args, get_origin

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from mimo.learning.rewards import REWARDS
from mimo.settings.files import ParamsError as ParamsError  # noqa: PLC0414 - callers know it from here
from mimo.settings.files import dotted, read, shown

S = TypeVar("S", bound="Section")
Steps = Annotated[int, Field(gt=0, le=20_000)]  # of a phase; a chunk's records then fit in memory
Updates = Annotated[int, Field(gt=0, le=2000)]
Worlds = Annotated[int, Field(gt=0, le=64)]
Seeds = Annotated[int, Field(gt=0, le=1000)]  # files are numbered with three digits
Width = Annotated[int, Field(gt=0, le=32)]
Rate = Annotated[float, Field(ge=1e-6, le=0.1)]  # Adam moves a weight by as much in a step, in float32
Factor = Annotated[float, Field(ge=0.001, le=100)]  # of what is computed in float32, and divided by
Limb = Literal["left_foot", "right_foot", "left_hand", "right_hand"]
Condition = Literal["free", "noisy"]
# What a variant may change: it keeps the seed, the protocol and the published encoder, whatever world that has seen.
VARIED = ("conditions", "world", "agent", "outcomes", "rewards", "encoder.latent_sd")


class Section(BaseModel):
    """A part of params.yaml: unknown keys, text for numbers and later changes are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


class Protocol(Section):
    """Timing of a run (paper §2.3, §2.4). Steps are agent steps, updates are physics updates of `timestep` seconds."""

    limb: Limb
    baseline_steps: Steps
    attached_steps: Steps
    extinction_steps: Steps
    updates_per_step: Updates
    torque_updates: Updates
    timestep: Annotated[float, Field(ge=0.001, le=0.01)]  # finer, the infant is not at rest yet when the rope is tied

    @model_validator(mode="after")
    def _torque_fits(self) -> "Protocol":
        if self.torque_updates > self.updates_per_step:
            raise ValueError("torque_updates must not exceed updates_per_step")
        return self


class ConditionParams(Section):
    """What disturbs the mobile: `force` in N at every update."""

    force: Annotated[float, Field(ge=0, le=100)]


class Conditions(Section):
    """The paper's two conditions (§2.4)."""

    free: ConditionParams
    noisy: ConditionParams


class World(Section):
    """Mobile, suspension and rope, in SI units; linear constants refer to the mobile's end of the rod.

    At every corner of these ranges, and those of `timestep` and `force`, physics stay finite: springs are resolved
    (timestep² stiffness < 4 mass + 2 timestep drag), and drag holds the noise.
    """

    mobile_mass: Annotated[float, Field(ge=0.001, le=10)]
    mobile_height: Annotated[float, Field(ge=0.1, le=1)]
    mobile_forward: Annotated[float, Field(ge=-0.1, le=0.1)]  # in the picture, at every height
    rod_length: Annotated[float, Field(ge=0.1, le=3)]
    suspension_stiffness: Annotated[float, Field(ge=0, le=500)]
    suspension_drag: Annotated[float, Field(ge=10, le=1000)]
    rope_stiffness: Annotated[float, Field(ge=10, le=1000)]
    rope_slack: Annotated[float, Field(ge=0, le=0.1)]  # a limb's way; a longer rope never pulls


class Collect(Section):
    """The encoder's frames, taken under the resting policy."""

    worlds: Annotated[int, Field(gt=0, le=16)]
    steps: Annotated[int, Field(ge=5, le=400)]  # 0.4 MB of frames each, in every world
    pair_updates: Updates
    held_out: Annotated[float, Field(gt=0, lt=1)]


class Encoder(Section):
    """U-Net, projector and their training (paper appendix)."""

    widths: Annotated[list[Width], Field(min_length=4, max_length=4)]
    latent: Annotated[int, Field(gt=0, le=256)]
    projection: Annotated[int, Field(gt=0, le=4096)]
    pairs: Annotated[int, Field(ge=2, le=128)]  # 25 MB each at the greatest widths
    tau: Annotated[float, Field(ge=0.01, le=100)]
    iterations: Annotated[int, Field(gt=0, le=100_000)]
    learning_rate: Rate
    cltt_weight: Annotated[float, Field(ge=0, le=1000)]
    latent_sd: Factor


class Agent(Section):
    """Expected SARSA (paper §3.1, §3.6, appendix)."""

    hidden: Annotated[int, Field(gt=0, le=1024)]
    learning_rate: Rate
    gamma: Annotated[float, Field(ge=0, lt=1)]
    temperature: Factor
    move_bias: float

    @model_validator(mode="after")
    def _explores(self) -> "Agent":
        # P(MOVE) of the resting policy then lies in [.007, .993]: every joint moves now and then, and rests.
        if abs(self.move_bias) > 5 * self.temperature:
            raise ValueError(f"move_bias must lie within 5 times temperature of 0; it is {self.move_bias!r}")
        return self


class Outcomes(Section):
    """Quantile models of p(h|a) and p(h) (paper §3.4.2)."""

    quantiles: Annotated[int, Field(gt=0, le=199)]
    kappa: Factor
    learning_rate: Rate
    batch: Annotated[int, Field(gt=0, le=64)]
    memory: Annotated[int, Field(gt=0, le=20_000)]


class Calibrate(Section):
    """How the rewards' scales are measured."""

    steps: Annotated[int, Field(ge=4, le=20_000)]
    worlds: Worlds


class Effects(Section):
    """How large a joint's effect is under the resting policy, in the published world and in `alternatives` to it.

    `steps` are of each world, the first 20 dropped. An alternative has values of `world` by dotted key; `changed`
    checks them.
    """

    steps: Annotated[int, Field(gt=20, le=20_000)]
    worlds: Worlds
    alternatives: dict[str, Annotated[dict[str, Any], Field(min_length=1)]]

    @model_validator(mode="after")
    def _known(self) -> "Effects":
        faults = _bad_names("alternatives", self.alternatives)
        if (self.steps - 20) * self.worlds < 20:
            faults.append("steps less 20, times worlds, must be at least 20, for every joint to move and to rest")
        if "published" in self.alternatives:
            faults.append("alternatives has 'published', which is the world of params.yaml itself")
        faults += [
            f"alternatives.{name} has {shown(key)}, but an alternative may change only world"
            for name, values in self.alternatives.items()
            for key in values
            if not key.startswith("world.")
        ]
        return _unless(faults, self)


class Pays(Section):
    """Which actions a reward pays: `move` pays MOVE alone, `taken` whichever action was taken."""

    pays: Literal["move", "taken"]


class Rewards(Section):
    """Gain and scale, which all rewards share, and a section for each reward that has constants of its own.

    `scale`: `resting` divides by the SD under the resting policy, `running` standardises by mean and SD so far.
    """

    gain: Factor
    scale: Literal["resting", "running"]
    cais: Pays
    surprise: Pays


class Sweep(Section):
    """Which runs the paper is made of."""

    conditions: Annotated[list[Condition], Field(min_length=1)]
    rewards: Annotated[list[str], Field(min_length=1)]
    seeds: Seeds
    chunk: Annotated[int, Field(gt=0, le=32)]

    @model_validator(mode="after")
    def _known(self) -> "Sweep":
        faults = [
            f"{name} names one entry twice"
            for name, given in (("conditions", self.conditions), ("rewards", self.rewards))
            if len(set(given)) < len(given)
        ]
        faults += _bad_rewards("rewards", self.rewards)
        return _unless(faults, self)


class Film(Section):
    """What the films show of one run of each condition, and how."""

    run: Annotated[str, Field(pattern=r"^[a-z_]+/seed-\d{3}$")]
    steps: Steps
    frame_updates: Updates
    width: Annotated[int, Field(gt=0, le=1920, multiple_of=160)]  # all lengths are then even, as H.264 has it


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
        faults = [f"set has {shown(key)}, but a variant may change only {', '.join(VARIED)}" for key in fixed]
        for condition, rewards in self.cells.items():
            faults += _bad_rewards(f"cells.{condition}", rewards)
            if len(set(rewards)) < len(rewards):
                faults.append(f"cells.{condition} names one entry twice")
        return _unless(faults, self)


class Sweeps(Section):
    """Variants of the published params, each in `seeds` seeds: which constant decides what is found?"""

    seeds: Seeds
    variants: Annotated[dict[str, Variant], Field(min_length=1)]

    @model_validator(mode="after")
    def _named(self) -> "Sweeps":
        return _unless(_bad_names("variants", self.variants), self)


class Params(Section):
    """The whole of params.yaml."""

    seed: Annotated[int, Field(ge=0, lt=2**63)]
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
    film: Film
    sweeps: Sweeps

    @model_validator(mode="after")
    def _across(self) -> "Params":
        if self.collect.pair_updates >= self.protocol.updates_per_step:
            raise ValueError("collect.pair_updates must be less than protocol.updates_per_step")
        if not 0 < round(self.collect.steps * (1 - self.collect.held_out)) < self.collect.steps:
            raise ValueError("collect.held_out must leave at least one of collect.steps on either side")
        reward, _, seed = self.film.run.partition("/seed-")
        if reward not in self.sweep.rewards or int(seed) >= self.sweep.seeds:
            raise ValueError(f"film.run must be one of the runs of sweep; it is {self.film.run}")
        return self


def load(path: str | Path = "params.yaml") -> Params:
    """Read and check params.yaml.

    Raises:
        ParamsError: unreadable, or one or more values do not hold; all faults at once, a sentence each.
    """
    path = Path(path)
    raw = read(path)
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
    key = dotted(location)
    if fault["type"] == "extra_forbidden":
        return f"{key} is not a known key; {_nearest(str(location[-1]), _keys(location[:-1]))}."
    if fault["type"] == "missing":
        return f"{key} is missing."
    if fault["type"] == "model_type":
        return f"{key} must be a section of keys and values."
    message = str(fault["msg"])
    if fault["type"] == "value_error":  # of a section, about the key that its text begins with
        return f"{f'{key}.' if location else ''}{message.removeprefix('Value error, ')}."
    rule = f" must {message[13:]}" if message.startswith("Input should ") else f": {message[:1].lower()}{message[1:]}"
    near = ""
    if fault["type"] == "literal_error" and isinstance(fault["input"], str):
        near = _near(fault["input"], re.findall(r"'(\w+)'", message))
    return f"{key}{rule}{_given(fault['input'])}{near and f', {near}'}."


def _given(value: object) -> str:
    if not isinstance(value, str | int | float | None):
        return ""
    looks_a_number = isinstance(value, str) and re.fullmatch(r"[-+]?[\d.]+([eE][-+]?\d+)?", value)
    hint = ", which is text: write it without quotes, and as 0.001 rather than 1e-3" if looks_a_number else ""
    return f"; it is {shown(value)}{hint}"


def _keys(location: tuple[object, ...]) -> list[str]:
    kind: Any = Params
    for part in location:
        kind = get_args(kind)[1] if get_origin(kind) is dict else kind.model_fields[str(part)].annotation
    return list(kind.model_fields)


def _unless(faults: list[str], section: S) -> S:
    if faults:
        raise ValueError("; ".join(faults))
    return section


def _bad_names(where: str, names: Iterable[str]) -> list[str]:
    bad = ", ".join(shown(name) for name in names if not re.fullmatch("[a-z0-9_]{1,40}", name))
    return [f"{where} has {bad}: use small letters, digits and '_' alone, at most 40"] if bad else []


def _bad_rewards(where: str, given: list[str]) -> list[str]:
    faults = []
    for reward in given:
        parts = reward.split("_")
        unknown = [part for part in parts if part not in REWARDS]
        faults += [f"{where} has {shown(reward)}, but {shown(part)} is unknown; {_nearest(part, list(REWARDS))}"
                   for part in unknown]  # fmt: skip
        if len(set(parts)) < len(parts):
            faults.append(f"{where} has {shown(reward)}, which adds one reward twice")
    return faults


def _nearest(name: str, known: list[str]) -> str:
    return _near(name, known) or f"known are {', '.join(known)}"


def _near(name: str, known: list[str]) -> str:
    near = difflib.get_close_matches(name.lower(), known, n=1, cutoff=0.5)
    return f"perhaps {near[0]!r} is meant" if near else ""
