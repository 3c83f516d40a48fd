"""Surprise: violation of the expectation (paper §3.5)."""

from typing import Literal

import numpy as np

from mimo.learning.rewards.reward import Reward, Transition, length
from mimo.settings.section import Factor, Section


class Surprise(Reward):
    """||h - E[h|a]|| for the action of each joint, in units of h."""

    name = "surprise"
    unit = "h"
    needs_outcomes = True

    class Constants(Section):
        """`pays`: a joint that moved (`move`), or each (`taken`); `weight`: times which it is paid, beside the gain."""

        pays: Literal["move", "taken"]
        weight: Factor

    @property
    def weight(self) -> float:
        """See Reward."""
        return float(self.constants.weight)

    def __call__(self, t: Transition) -> np.ndarray:
        """See Reward."""
        assert t.expectation is not None, "Surprise needs the expected outcome of actions"
        error = length(t.latent[:, None] - t.expectation)
        return np.where(t.action, error, np.float32(0)) if self.constants.pays == "move" else error
