"""Representation trajectory length (paper §3.3, §4)."""

import numpy as np

from mimo.learning.rewards.reward import Reward, Transition, length


class RTL(Reward):
    """||h_t - h_(t-1)||, in units of h, the same for all joints."""

    name = "rtl"

    def __call__(self, t: Transition) -> np.ndarray:
        """See Reward."""
        return np.broadcast_to(length(t.latent - t.latent_before)[:, None], t.action.shape)
