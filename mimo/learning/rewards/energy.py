"""CAIS by the energy distance (Székely & Rizzo 2013, J. Stat. Plan. Inference 143:1249)."""

import numpy as np

from mimo.learning.rewards.divergence import of_moves
from mimo.learning.rewards.reward import Reward, Transition


class Energy(Reward):
    """Root of 2 E|x - y| - E|x - x'| - E|y - y'|, x of p(h|MOVE) and y of p(h), in roots of h's unit, paid as CAIS.

    The root is the metric, which grows with a small shift as W1 does; the mean over the latent is of roots.
    """

    name = "energy"
    unit = "sqrt(h)"
    needs_outcomes = True
    needs_tables = True

    def __call__(self, t: Transition) -> np.ndarray:
        """See Reward."""
        from mimo.learning.distances import energy

        return of_moves(t, energy)
