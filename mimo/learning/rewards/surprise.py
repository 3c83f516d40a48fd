"""Surprise: violation of the expectation (paper §3.5)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from mimo.learning.rewards.reward import Reward, Transition, length
from mimo.settings.section import Section

if TYPE_CHECKING:
    from torch import Tensor


class Surprise(Reward):
    """||h - E[h|a]|| for the action of each joint, in units of h."""

    name = "surprise"
    needs_outcomes = True

    class Constants(Section):
        """`pays`: a joint that moved (`move`), or each, whichever action it took (`taken`)."""

        pays: Literal["move", "taken"]

    def __call__(self, t: Transition) -> Tensor:
        """See Reward."""
        assert t.expectation is not None, "Surprise needs the expected outcome of actions"
        error = length(t.latent.unsqueeze(-2) - t.expectation)
        return error.where(t.action, error.new_zeros(())) if self.constants.pays == "move" else error
