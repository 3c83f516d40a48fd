"""Mobile trajectory length (paper §3.3)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mimo.learning.rewards.reward import Reward, Transition

if TYPE_CHECKING:
    from torch import Tensor


class MTL(Reward):
    """Metres the mobile travelled, the same for all joints."""

    name = "mtl"

    def __call__(self, t: Transition) -> Tensor:
        """See Reward."""
        return t.path_length.unsqueeze(-1).expand(t.action.shape)
