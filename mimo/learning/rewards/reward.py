"""What a reward is given, and what it gives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from mimo.settings.section import Section

REWARDS: dict[str, type[Reward]] = {}


@dataclass(frozen=True)
class Transition:
    """What an agent step of N seeds has shown by its end; numbers are float32.

    Attributes:
        path_length: (N,), metres the mobile's centre of mass travelled during the step.
        latents: (N, frames + 1, latent), h at the step's start and at each of its pictures, the last at its end.
        action: (N, 12) bool, True where the joint moved.
        influence: (N, 12, 2), W1 between p(h|a) and p(h) for NO_TORQUE and MOVE; None without outcome models.
        expectation: (N, 12, latent), E[h|a] of each joint's action; None without outcome models.
        tables: (N, 25, quantiles, latent), the outcome models as they were before the step: row 2 * joint + action is
            p(h|a), the last p(h); None where no reward needs them.
        proprioception: (N, 47), joint angles at the step's start, rad; None where they are not known.
        probability: (N, 12), P(MOVE) by which the action was decided; None where it is not known.
    """

    path_length: np.ndarray
    latents: np.ndarray
    action: np.ndarray
    influence: np.ndarray | None = None
    expectation: np.ndarray | None = None
    tables: np.ndarray | None = None
    proprioception: np.ndarray | None = None
    probability: np.ndarray | None = None

    @property
    def latent_before(self) -> np.ndarray:
        """(N, latent), h at the step's start."""
        return self.latents[:, 0]

    @property
    def latent(self) -> np.ndarray:
        """(N, latent), h at its end."""
        return self.latents[:, -1]


class Reward:
    """A reward for each joint, in units of its own; the section `rewards` of params.yaml scales it.

    One object serves N seeds through a run, step by step, and may learn as it goes: what it draws comes from `draws`.

    Attributes:
        name: as in params.yaml; no `_`, which joins names.
        unit: of what it gives.
        needs_outcomes: whether the transition must hold `influence` and `expectation`.
        needs_tables: whether it must hold `tables`, too.
        Constants: the reward's section in params.yaml, `rewards.<name>`; None if it has none.
    """

    name: ClassVar[str]
    unit: ClassVar[str] = "own units"
    needs_outcomes: ClassVar[bool] = False
    needs_tables: ClassVar[bool] = False
    Constants: ClassVar[type[Section] | None] = None

    def __init_subclass__(cls) -> None:
        """Register the subclass under its name."""
        if "_" in cls.name:
            raise ValueError(f"{cls.__name__}.name is {cls.name!r}: '_' joins the names of rewards.")
        if cls.name in REWARDS:
            raise ValueError(f"{cls.__name__}.name is {cls.name!r}: {REWARDS[cls.name].__name__} has it already.")
        if cls.name in ("gain", "scale") or hasattr(Section, cls.name):
            raise ValueError(f"{cls.__name__}.name is {cls.name!r}, which means something else in `rewards`.")
        REWARDS[cls.name] = cls

    def __init__(self, constants: Any, draws: Sequence[np.random.Generator] = ()) -> None:
        """Keep the reward's own section, or None, and a generator for each seed."""
        self.constants, self.draws = constants, draws

    @property
    def weight(self) -> float:
        """Times which it is paid, beside the gain that all rewards share."""
        return 1.0

    @property
    def frames(self) -> int:
        """How many pictures of a step it needs: one, at the end, unless a subclass says otherwise."""
        return 1

    def __call__(self, t: Transition) -> np.ndarray:
        """The reward (N, 12) of each joint for the step."""
        raise NotImplementedError


def length(x: np.ndarray) -> np.ndarray:
    """Euclidean length over the last dimension."""
    found: np.ndarray = np.linalg.norm(x, axis=-1)
    return found
