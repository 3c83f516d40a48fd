"""Causal action influence score (paper §3.4)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from mimo.learning.rewards.reward import Reward, Transition
from mimo.settings.section import Section

if TYPE_CHECKING:
    from torch import Tensor


class CAIS(Reward):
    """W1 between p(h|a) and p(h) (paper eq. causality_continuous), in units of h."""

    name = "cais"
    needs_outcomes = True

    class Constants(Section):
        """`pays`: the influence of MOVE, if the joint moved (`move`), or that of the action taken (`taken`)."""

        pays: Literal["move", "taken"]

    def __call__(self, t: Transition) -> Tensor:
        """See Reward."""
        assert t.influence is not None, "CAIS needs the influence of actions"
        rest, move = t.influence.unbind(-1)
        if self.constants.pays == "move":
            rest = rest.new_zeros(())
        return move.where(t.action, rest)
