"""One run of the paper's experiment (§2): an agent, a reward, a condition, a seed; 2500 steps through three phases.

Several seeds run in lock step, for speed alone: a run's bytes are the same in any company.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from mimo.learning import rewards
from mimo.learning.agent import Agents
from mimo.learning.experience import Experience, untaught
from mimo.learning.rewards.reward import length
from mimo.record import identity, streams
from mimo.record.artifact import Dataset
from mimo.settings.errors import Fault
from mimo.settings.params import Params
from mimo.vision.extractor import READ, Extractor, Trained
from mimo.world import scene
from mimo.world.eye import Eye
from mimo.world.physics import Tied, Worlds
from mimo.world.protocol import JOINTS, MOVE, phase, steps
from mimo.world.yoked import Yoked

Record = dict[str, Dataset]


class RunError(Fault):
    """A run came to nothing; the message names condition, reward, seed and step."""


@dataclass(frozen=True)
class Donor:
    """Whose mobile a yoked infant is under (mimo.world.yoked): a run of the same condition, protocol and world.

    Attributes:
        content: the run's content hash.
        seed: index of its seed.
        moved: (steps, 12) bool, its actions.
        positive: (steps, 12) bool, the directions of its torques.
    """

    content: str
    seed: int
    moved: np.ndarray
    positive: np.ndarray


def inputs(params: Params, condition: str, reward: str, encoder: str, scales: Mapping[str, float]) -> dict[str, Any]:
    """All that the bytes of a cell's runs depend on but their seed; identity.Digest of it with `seed` names a run.

    A yoked run's has its donor's content hash, too, as `donor`.

    Args:
        params: all of params.yaml; only what the run reads counts.
        condition: free or noisy.
        reward: its name, or several joined by "_".
        encoder: content hash of the encoder.
        scales: each reward's scale; only those of the run's parts count, and none if `rewards.scale` is running.
    """
    parts = reward.split("_")
    read: dict[str, Any] = {
        "seed": params.seed,
        "protocol": params.protocol.model_dump(),
        "world": params.world.model_dump(),
        "condition": getattr(params.conditions, condition).model_dump(),
        "encoder": {name: getattr(params.encoder, name) for name in READ},
        "agent": params.agent.model_dump(),
        "rewards": {"gain": params.rewards.gain, "scale": params.rewards.scale}
        | {part: getattr(params.rewards, part).model_dump() for part in parts if rewards.REWARDS[part].Constants},
    }
    if rewards.needs_outcomes(reward):
        read["outcomes"] = params.outcomes.model_dump()
    return {
        "params": read,
        "condition": condition,
        "reward": reward,
        "encoder": encoder,
        "scales": {part: scales[part] for part in parts} if params.rewards.scale == "resting" else {},
        "code": identity.code("mimo.learning.experiment", *rewards.modules(reward)),
        "versions": identity.versions(),
    }


class Running:
    """Standardises one reward of N seeds by its mean and SD so far, over steps and joints, each seed by its own.

    Chan, Golub & LeVeque's update (1979), in float64.
    """

    def __init__(self, seeds: int) -> None:
        self._count = 0
        self._mean, self._squares = np.zeros((2, seeds))  # squares: sum of squared distances from the mean

    def __call__(self, values: np.ndarray) -> np.ndarray:
        """Take in a step's values and standardise them; the mean and SD are those with this step.

        Args:
            values: (N, 12), in the reward's own units.

        Returns:
            (N, 12) float32, in SDs from the mean; 0 as long as all values are equal.
        """
        rows = np.ascontiguousarray(values, np.float64)
        old, new = self._count, rows.shape[1]
        self._count += new
        # Row by row, since a sum over a stack may take another order in another stack.
        ahead = np.array([row.mean() for row in rows]) - self._mean
        self._mean += ahead * new / self._count
        self._squares += np.array([row.var() for row in rows]) * new + ahead**2 * old * new / self._count
        deviation = np.sqrt(self._squares / self._count)[:, None]
        deviation[deviation == 0] = np.inf
        return ((rows - self._mean[:, None]) / deviation).astype(np.float32)


class Experiment:
    """Some seeds of one condition and reward, in lock step.

    Args:
        params: all of params.yaml.
        condition: free or noisy.
        reward: a reward's name, or several joined by "_".
        seeds: seed indices.
        trained: the encoder.
        scales: by reward name, the SD by which it is divided; not read if `rewards.scale` is running.
        donors: of yoked infants, one for each seed.
    """

    def __init__(
        self,
        params: Params,
        condition: str,
        reward: str,
        seeds: Sequence[int],
        trained: Trained,
        scales: Mapping[str, float],
        donors: Sequence[Donor] = (),
    ) -> None:
        self.params, self.condition, self.reward, self.seeds = params, condition, reward, tuple(seeds)

        def generators(purpose: str, name: str = "", of: Sequence[int] = seeds) -> list[np.random.Generator]:
            return [streams.generator(params.seed, condition, seed, purpose, name) for seed in of]

        built, force = scene.build(params.world, params.protocol), getattr(params.conditions, condition).force
        own = Worlds(built, params.protocol, 0.0 if donors else force, generators("noise"))
        worlds: Worlds | Yoked = own
        if donors:
            theirs = Worlds(built, params.protocol, force, generators("noise", of=[donor.seed for donor in donors]))
            acted = (np.stack([getattr(donor, name) for donor in donors], axis=1) for name in ("moved", "positive"))
            worlds = Yoked(own, theirs, *acted)
        outcomes = (
            untaught(params, trained, condition, generators("memory")) if rewards.needs_outcomes(reward) else None
        )
        self.eye = Eye(built)
        self.parts = rewards.parts(reward, params.rewards, lambda name: generators("reward", name))
        extract = Extractor(params.encoder, trained)
        self.experience = Experience(worlds, self.eye, extract, outcomes, self.parts)
        gain, running = params.rewards.gain, params.rewards.scale == "running"
        self._gains = [gain * part.weight / (1.0 if running else scales[part.name]) for part in self.parts]
        self._running = [Running(len(self.seeds)) for _ in self.parts] if running else None
        self._direction, self._policy, self._rope = (generators(name) for name in ("direction", "policy", "rope"))
        self.state = self._state(worlds.proprioception())
        self.agents = Agents(params.agent, self.state.shape[1], generators("weights"))
        self.log = _Log(len(self.seeds), steps(params.protocol))

    def run(self, progress: Callable[[int], None] = lambda done: None) -> list[Record]:
        """All steps of all phases.

        Args:
            progress: called with the number of agent steps done by each seed.

        Returns:
            One record a seed: what artifact.write takes.

        Raises:
            RunError: physics diverged or a number is not finite.
        """
        with self.eye:
            for step in range(steps(self.params.protocol)):
                try:
                    self.step(step)
                except (ArithmeticError, RuntimeError) as fault:
                    raise RunError(f"{self._name()} stopped at step {step + 1}: {fault}") from fault
                progress(step + 1)
        return self.log.records()

    def step(self, step: int) -> None:
        """One agent step, counted from 0 (paper §2.3, fig. 1B)."""
        values = self.agents.values(self.state)
        probability = self.agents.move_probability(values)
        chance = np.stack([generator.random(JOINTS) for generator in self._policy])
        positive = np.stack([generator.random(JOINTS) for generator in self._direction]) < 0.5
        moved = chance < probability
        attached: Tied = phase(self.params.protocol, step) == "attached"
        if (holds := self.params.world.rope_holds) < 1:
            attached &= np.array([generator.random() for generator in self._rope]) < holds
        outcome, transition = self.experience.step(moved, positive, attached, probability)
        parts = rewards.paid(self.parts, transition)
        scaled = parts
        if self._running:
            scaled = [running(part) for running, part in zip(self._running, parts, strict=True)]
        reward: np.ndarray = np.sum([gain * part for gain, part in zip(self._gains, scaled, strict=True)], axis=0)
        self.state = self._state(outcome.proprioception)
        finite = np.isfinite(self.agents.update(moved, reward, self.state)).all(axis=1)
        if not finite.all():
            raise FloatingPointError(f"the TD error of seed {self.seeds[int(finite.argmin())]} is not finite")
        entry = {
            "action": moved,
            "positive": positive,
            "centre_of_mass": outcome.centre_of_mass,
            "path_length": outcome.path_length,
            "latent_length": length(transition.latent - transition.latent_before),
            "q": values,
            "move_probability": probability,
            "reward": reward,
        }
        entry |= {f"part/{part.name}": raw for part, raw in zip(self.parts, parts, strict=True)}
        if not isinstance(attached, bool):
            entry["attached"] = attached
        if transition.influence is not None:
            entry["influence"] = transition.influence[..., MOVE]
        self.log.add(step, entry)

    def _state(self, proprioception: np.ndarray) -> np.ndarray:
        """(N, 47 + latent) float32: joint angles in rad, then h (paper §3.2)."""
        return np.concatenate([proprioception.astype(np.float32), self.experience.perception.latent], axis=1)

    def _name(self) -> str:
        which = f"seed {self.seeds[0]}" if len(self.seeds) == 1 else f"seeds {', '.join(map(str, self.seeds))}"
        return f"{self.condition}, {self.reward}, {which}"


class _Log:
    """What is kept of every step; arrays are made on first sight, (seed, step, ...)."""

    MEANING: ClassVar = {  # units, axes
        "action": ("1 = MOVE", "step, joint"),
        "positive": ("1 = towards the upper torque limit", "step, joint"),
        "centre_of_mass": ("m", "step, xyz"),
        "path_length": ("m", "step"),
        "latent_length": ("h", "step"),
        "q": ("scaled reward", "step, joint, action"),
        "move_probability": ("1", "step, joint"),
        "reward": ("scaled reward", "step, joint"),
        "influence": ("h", "step, joint"),
        "attached": ("1 = the rope holds", "step"),
    }

    def __init__(self, seeds: int, steps: int) -> None:
        self._shape = (seeds, steps)
        self._arrays: dict[str, np.ndarray] = {}

    def add(self, step: int, entry: Mapping[str, np.ndarray]) -> None:
        for name, value in entry.items():
            if name not in self._arrays:
                dtype = np.uint8 if value.dtype == bool else np.float32
                self._arrays[name] = np.zeros((*self._shape, *value.shape[1:]), dtype)
            self._arrays[name][:, step] = value

    def records(self) -> list[Record]:
        return [
            {
                name: Dataset(values[seed], *self.MEANING.get(name, ("own units", "step, joint")))
                for name, values in self._arrays.items()
            }
            for seed in range(self._shape[0])
        ]
