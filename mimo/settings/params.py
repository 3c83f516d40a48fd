"""params.yaml as frozen pydantic models: every constant once, typed, checked before any work begins.

A reward's constants are where the reward is, in mimo.learning.rewards. This floor imports none above it: it finds the
rewards by the name of their folder, as plug-ins are found.
"""

import importlib
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar, get_args

from pydantic import Field, ValidationError, create_model, model_validator

from mimo.settings.complaints import bad_rewards, sentences, unless
from mimo.settings.files import ParamsError, read, shown
from mimo.settings.section import Condition, Factor, Limb, Rate, Section, Seeds, Steps, Updates, Width, Worlds

S = TypeVar("S", bound=Section)
REWARDS = importlib.import_module("mimo.learning.rewards").REWARDS


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
    rope_holds: Annotated[float, Field(ge=0, le=1)]  # probability, in each agent step of the attached phase


class Collect(Section):
    """The encoder's frames, taken under the resting policy."""

    worlds: Annotated[int, Field(gt=0, le=16)]
    steps: Annotated[int, Field(ge=5, le=400)]  # 0.4 MB of frames each, in every world
    limbs: Literal["own", "all"]  # worlds tied to the protocol's limb, or to each limb in turn
    draw: Annotated[int, Field(ge=0, le=1000)]  # of the frames' and the training's random streams
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
    bias_in_target: bool

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
    batches: Literal["own", "shared"]
    memory: Annotated[int, Field(gt=0, le=20_000)]
    action: Literal["joint", "limb"]
    marginal: Literal["table", "policy"]
    start: Literal["detached", "zero"]


class Calibrate(Section):
    """How the rewards' scales are measured."""

    steps: Annotated[int, Field(ge=4, le=20_000)]
    worlds: Worlds


class _Shared(Section):
    """What all rewards share; a section for each reward that has constants of its own stands beside it.

    `scale`: `resting` divides by the SD under the resting policy, `running` standardises by mean and SD so far.
    """

    gain: Factor
    scale: Literal["resting", "running"]


if TYPE_CHECKING:

    class Rewards(_Shared):
        """See _Shared."""

        def __getattr__(self, reward: str) -> Any: ...
else:
    Rewards = create_model(
        "Rewards",
        __base__=_Shared,
        __doc__=_Shared.__doc__,
        **{name: (kind.Constants, ...) for name, kind in REWARDS.items() if kind.Constants},
    )


class Sweep(Section):
    """Which runs the paper is made of."""

    conditions: Annotated[list[Condition], Field(min_length=1)]
    rewards: Annotated[list[str], Field(min_length=1)]
    seeds: Seeds
    chunk: Annotated[int, Field(gt=0, le=32)]

    @model_validator(mode="after")
    def _known(self) -> "Sweep":
        faults = ["conditions names one entry twice"] if len(set(self.conditions)) < len(self.conditions) else []
        return unless(faults + bad_rewards("rewards", self.rewards, REWARDS), self)


class Film(Section):
    """What the films show of one run of each condition, and how."""

    run: Annotated[str, Field(pattern=r"^[a-z_]+/seed-\d{3}$")]
    steps: Steps
    frame_updates: Updates
    width: Annotated[int, Field(gt=0, le=1920, multiple_of=160)]  # all lengths are then even, as H.264 has it


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
    rewards: Rewards
    sweep: Sweep
    film: Film

    @model_validator(mode="after")
    def _across(self) -> "Params":
        if self.collect.pair_updates >= self.protocol.updates_per_step:
            raise ValueError("collect.pair_updates must be less than protocol.updates_per_step")
        if not 0 < round(self.collect.steps * (1 - self.collect.held_out)) < self.collect.steps:
            raise ValueError("collect.held_out must leave at least one of collect.steps on either side")
        if self.collect.limbs == "all" and self.collect.worlds < len(get_args(Limb)):
            raise ValueError(f"collect.worlds must be at least {len(get_args(Limb))} where collect.limbs is 'all'")
        if self.outcomes.action == "limb" and self.rewards.cais.pays == "taken":
            raise ValueError(
                "rewards.cais.pays must be 'move' where outcomes.action is 'limb': a joint may rest meanwhile"
            )
        for name, kind in REWARDS.items():
            if kind.Constants and kind(getattr(self.rewards, name)).frames > self.protocol.updates_per_step:
                raise ValueError(f"rewards.{name} must need no more pictures of a step than protocol.updates_per_step")
        reward, _, seed = self.film.run.partition("/seed-")
        if reward not in self.sweep.rewards or int(seed) >= self.sweep.seeds:
            raise ValueError(f"film.run must be one of the runs of sweep; it is {shown(self.film.run)}")
        return self


def load(path: str | Path = "params.yaml") -> Params:
    """Read and check params.yaml.

    Raises:
        ParamsError: unreadable, or one or more values do not hold; all faults at once, a sentence each.
    """
    return loaded(Path(path), Params)


def published() -> Params:
    """The project's own constants: of its params.yaml, or of the copy that an installed library brings.

    Raises:
        ParamsError: as `load` does.
    """
    package = Path(__file__).parents[1]
    brought = package / "params.yaml"
    return load(brought if brought.is_file() else package.parent / "params.yaml")


def loaded(path: Path, kind: type[S]) -> S:
    """Read and check a file of settings.

    Raises:
        ParamsError: as `load` does.
    """
    try:
        return kind.model_validate(read(path))
    except ValidationError as error:
        raise ParamsError("\n".join(f"{path}: {sentence}" for sentence in sentences(error, kind))) from None


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
        raise ParamsError("\n".join(sentences(error, type(section)))) from None
