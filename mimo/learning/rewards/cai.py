"""Causal action influence in a state (Seitzer, Schölkopf & Martius 2021, NeurIPS): CAIS that knows where it is."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import Field

from mimo.learning.rewards.reward import Reward, Transition
from mimo.settings.section import Factor, Rate, Section
from mimo.world.protocol import MOVE, NO_TORQUE

if TYPE_CHECKING:
    from mimo.learning.influence import Models


class CAI(Reward):
    """KL(p(h'|s, MOVE) || p(h'|s)) in nats, mean over the latent, of a joint that moved, else 0, as CAIS is paid.

    Its authors take the mean over actions drawn evenly, and networks whose variance knows the state. Here MOVE's own
    part is paid, against the policy's mixture, as p(h) of CAIS is: it fades as P(MOVE) nears 1.

    The state s is the joint angles, h before the step and 1. p(h'|s, a) is a Gaussian, whose mean is linear in s for
    each action and whose variance both actions share. p(h'|s) is the policy's mixture of the two, taken for the
    Gaussian with its mean and variance, as mixtures have no KL in closed form (Hershey & Olsen 2007, ICASSP).
    Outcome models are not needed: the models here are learned along the way.
    """

    name = "cai"
    unit = "nats"

    class Constants(Section):
        """Of the models.

        Attributes:
            memory: transitions that batches are drawn from, and steps that the variance is a running mean over.
            batch: transitions that a model learns from in a step.
            learning_rate: of AdamW.
            floor: the least SD of a Gaussian, in units of h.
        """

        memory: Annotated[int, Field(gt=0, le=2000)]
        batch: Annotated[int, Field(gt=0, le=64)]
        learning_rate: Rate
        floor: Factor

    def __init__(self, constants: Any, draws: Sequence[np.random.Generator] = ()) -> None:
        """See Reward; models are made in the first step."""
        super().__init__(constants, draws)
        self._models: Models | None = None

    def __call__(self, t: Transition) -> np.ndarray:
        """See Reward; the models learn from the step once it has been paid."""
        assert t.proprioception is not None, "CAI needs the joint angles at the step's start"
        assert t.probability is not None, "CAI needs P(MOVE) by which the action was decided"
        assert len(self.draws) == len(t.action), "CAI draws its batches: it needs a generator for each seed"
        state = np.concatenate([t.proprioception, t.latent_before, np.ones_like(t.latent_before[:, :1])], axis=1)
        if self._models is None:
            from mimo.learning.influence import Models

            own = self.constants
            sizes = state.shape[1], t.latent.shape[1]
            self._models = Models(*sizes, own.memory, own.batch, own.learning_rate, self.draws)
        found = influence(self._models.means(state), self._models.variance, t.probability, self.constants.floor)
        self._models.update(state, t.action, np.ascontiguousarray(t.latent))
        return np.where(t.action, found, 0)


def influence(means: np.ndarray, variance: np.ndarray, probability: np.ndarray, floor: float) -> np.ndarray:
    """(N, 12) float64, the KL divergence of MOVE's Gaussian from the one with the mixture's mean and variance, nats.

    Args:
        means: (N, 12, 2, latent), of NO_TORQUE's and MOVE's Gaussian.
        variance: (N, 12, latent), of both.
        probability: (N, 12), P(MOVE).
        floor: least SD.
    """
    p = probability.astype(np.float64)[..., None]
    apart = means[..., MOVE, :].astype(np.float64) - means[..., NO_TORQUE, :]
    own = np.maximum(variance.astype(np.float64), floor**2)
    whole = own + p * (1 - p) * apart**2
    ratio = own / whole
    found: np.ndarray = 0.5 * (ratio - 1 - np.log(ratio) + ((1 - p) * apart) ** 2 / whole).mean(axis=-1)
    return found
