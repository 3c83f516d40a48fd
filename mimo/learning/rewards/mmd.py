"""CAIS by the maximum mean discrepancy (Gretton, Borgwardt, Rasch, Schölkopf & Smola 2012, JMLR 13:723)."""

from typing import Annotated

import numpy as np
from pydantic import Field

from mimo.learning.rewards.divergence import of_moves
from mimo.learning.rewards.reward import Reward, Transition
from mimo.settings.section import Section


class MMD(Reward):
    """MMD of p(h|MOVE) and p(h) under the kernel exp(-(x - y)² / (2 bandwidth²)), a pure number, paid as CAIS.

    It is the root of the V-statistic, in each dimension of h by itself.
    """

    name = "mmd"
    unit = "1"
    needs_outcomes = True
    needs_tables = True

    class Constants(Section):
        """`bandwidth`: the kernel's SD, in units of h."""

        bandwidth: Annotated[float, Field(ge=0.01, le=10)]  # wider, too few digits are left of 1 - k

    def __call__(self, t: Transition) -> np.ndarray:
        """See Reward."""
        from mimo.learning.distances import mmd

        narrow = 0.5 / self.constants.bandwidth**2
        return of_moves(t, lambda moves, marginal: mmd(moves.astype(float), marginal.astype(float), narrow))
