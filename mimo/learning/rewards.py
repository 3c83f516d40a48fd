"""The intrinsic rewards (paper §3.3 to §3.5), each in its own units, before the gain of the section `rewards`.

To add one, write a subclass of Reward with a name: params.yaml then accepts it, alone or joined to others by `_`.
This file loads without torch, since params.py reads the names in places where torch would only cost time.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

if TYPE_CHECKING:
    from torch import Tensor

    from mimo.settings import params

REWARDS: dict[str, type[Reward]] = {}


class UnknownRewardError(LookupError):
    """A reward's name that no class has; the message is a sentence."""


@dataclass(frozen=True)
class Transition:
    """What an agent step of N seeds has shown by its end.

    Attributes:
        path_length: (N,), metres the mobile's centre of mass travelled during the step.
        latent_before: (N, 64), the visual latent at the step's start.
        latent: (N, 64), the visual latent at its end.
        action: (N, 12) bool, True where the joint moved.
        influence: (N, 12, 2), W1 between p(h|a) and p(h) for NO_TORQUE and MOVE; None without outcome models.
        expectation: (N, 12, 64), E[h|a] of each joint's action; None without outcome models.
    """

    path_length: Tensor
    latent_before: Tensor
    latent: Tensor
    action: Tensor
    influence: Tensor | None = None
    expectation: Tensor | None = None


class Reward:
    """A reward for each joint.

    Attributes:
        name: as in params.yaml; no `_`, which joins names.
        needs_outcomes: whether the transition must hold `influence` and `expectation`.
    """

    name: ClassVar[str]
    needs_outcomes: ClassVar[bool] = False

    def __init_subclass__(cls) -> None:
        """Register the subclass under its name."""
        if "_" in cls.name:
            raise ValueError(f"{cls.__name__}.name is {cls.name!r}: '_' joins the names of rewards.")
        if cls.name in REWARDS:
            raise ValueError(f"{cls.__name__}.name is {cls.name!r}: {REWARDS[cls.name].__name__} has it already.")
        REWARDS[cls.name] = cls

    def __init__(self, settings: params.Rewards) -> None:
        """Keep the section `rewards` of params.yaml."""
        self.settings = settings

    def __call__(self, t: Transition) -> Tensor:
        """The reward (N, 12) of each joint for the step."""
        raise NotImplementedError


class MTL(Reward):
    """Mobile trajectory length (paper §3.3): metres the mobile travelled, the same for all joints."""

    name = "mtl"

    def __call__(self, t: Transition) -> Tensor:
        """See Reward."""
        return t.path_length.unsqueeze(-1).expand(t.action.shape)


class RTL(Reward):
    """Representation trajectory length (paper §3.3, §4): ||h_t - h_(t-1)||, in units of h, the same for all joints."""

    name = "rtl"

    def __call__(self, t: Transition) -> Tensor:
        """See Reward."""
        return _length(t.latent - t.latent_before).unsqueeze(-1).expand(t.action.shape)


class CAIS(Reward):
    """Causal action influence score (paper §3.4, eq. causality_continuous): W1 of the action, in units of h.

    `rewards.cais.pays` says which actions are paid: `taken` pays the influence of the action taken, `move` that of MOVE
    if the joint moved and nothing if it did not.
    """

    name = "cais"
    needs_outcomes = True

    def __call__(self, t: Transition) -> Tensor:
        """See Reward."""
        assert t.influence is not None, "CAIS needs the influence of actions"
        rest, move = t.influence.unbind(-1)
        if self.settings.cais.pays == "move":
            rest = rest.new_zeros(())
        return move.where(t.action, rest)


class Surprise(Reward):
    """Violation of the expectation (paper §3.5): ||h - E[h|a]|| for the action of each joint, in units of h.

    `rewards.surprise.pays` says which actions are paid: `taken` pays whichever was taken, `move` a joint that moved.
    """

    name = "surprise"
    needs_outcomes = True

    def __call__(self, t: Transition) -> Tensor:
        """See Reward."""
        assert t.expectation is not None, "Surprise needs the expected outcome of actions"
        error = _length(t.latent.unsqueeze(-2) - t.expectation)
        return error.where(t.action, error.new_zeros(())) if self.settings.surprise.pays == "move" else error


def parts(name: str, settings: params.Rewards) -> list[Reward]:
    """The rewards that `name` adds up, in its order: `mtl_surprise` is MTL and Surprise.

    Raises:
        UnknownRewardError: a part is no reward's name.
    """
    return [kind(settings) for kind in _kinds(name)]


def needs_outcomes(name: str) -> bool:
    """Whether any part of `name` needs the outcome models.

    Raises:
        UnknownRewardError: a part is no reward's name.
    """
    return any(kind.needs_outcomes for kind in _kinds(name))


def _kinds(name: str) -> list[type[Reward]]:
    unknown = [part for part in name.split("_") if part not in REWARDS]
    if unknown:
        raise UnknownRewardError(f"{name!r} has an unknown part, {unknown[0]!r}: known are {', '.join(REWARDS)}.")
    return [REWARDS[part] for part in name.split("_")]


def _length(x: Tensor) -> Tensor:
    """Euclidean length over the last dimension."""
    return x.square().sum(-1).sqrt()
