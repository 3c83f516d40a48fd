"""Representation trajectory length (paper §3.3, §4)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mimo.learning.rewards.reward import Reward, Transition, length

if TYPE_CHECKING:
    from torch import Tensor


class RTL(Reward):
    """||h_t - h_(t-1)||, in units of h, the same for all joints."""

    name = "rtl"

    def __call__(self, t: Transition) -> Tensor:
        """See Reward."""
        return length(t.latent - t.latent_before).unsqueeze(-1).expand(t.action.shape)
