"""Mobile trajectory length (paper §3.3)."""

import numpy as np

from mimo.learning.rewards.reward import Reward, Transition


class MTL(Reward):
    """Metres the mobile travelled, the same for all joints."""

    name = "mtl"
    unit = "m"

    def __call__(self, t: Transition) -> np.ndarray:
        """See Reward."""
        return np.broadcast_to(t.path_length[:, None], t.action.shape)
