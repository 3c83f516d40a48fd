"""CAIS by means alone: how far an action shifts h, whatever else it does to its distribution."""

import numpy as np

from mimo.learning.rewards.divergence import of_moves
from mimo.learning.rewards.reward import Reward, Transition


class Means(Reward):
    """|E[h|MOVE] - E[h]|, in units of h, paid as CAIS; W1 is never less, and equal for a mere shift."""

    name = "means"
    unit = "h"
    needs_outcomes = True
    needs_tables = True

    def __call__(self, t: Transition) -> np.ndarray:
        """See Reward."""
        return of_moves(t, _apart)


def _apart(moves: np.ndarray, marginal: np.ndarray) -> np.ndarray:
    """See of_moves; an expectation is the mean of quantiles."""
    found: np.ndarray = np.abs(moves.mean(axis=1) - marginal.mean(axis=0)).mean(axis=1)
    return found
