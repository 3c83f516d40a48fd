"""Causal action influence score (paper §3.4)."""

from typing import Literal

import numpy as np

from mimo.learning.rewards.reward import Reward, Transition
from mimo.settings.section import Section
from mimo.world.protocol import MOVE, NO_TORQUE


class CAIS(Reward):
    """W1 between p(h|a) and p(h) (paper eq. causality_continuous), in units of h."""

    name = "cais"
    unit = "h"
    needs_outcomes = True

    class Constants(Section):
        """`pays`: the influence of MOVE, if the joint moved (`move`), or that of the action taken (`taken`)."""

        pays: Literal["move", "taken"]

    def __call__(self, t: Transition) -> np.ndarray:
        """See Reward."""
        assert t.influence is not None, "CAIS needs the influence of actions"
        of_rest = t.influence[..., NO_TORQUE] if self.constants.pays == "taken" else np.float32(0)
        return np.where(t.action, t.influence[..., MOVE], of_rest)
