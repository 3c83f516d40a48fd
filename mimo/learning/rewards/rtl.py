"""Representation trajectory length (paper §3.3, §4)."""

from typing import Annotated

import numpy as np
from pydantic import Field

from mimo.learning.rewards.reward import Reward, Transition, length
from mimo.settings.section import Section


class RTL(Reward):
    """The way of h during a step, in units of h, the same for all joints.

    With one picture a step it is the paper's ||h_t - h_(t-1)|| (§4.1); with more, the sum from picture to picture.
    """

    name = "rtl"
    unit = "h"

    class Constants(Section):
        """How many pictures of a step count, evenly in time; the last is at its end."""

        frames: Annotated[int, Field(ge=1, le=12)]

    @property
    def frames(self) -> int:
        """See Reward."""
        return int(self.constants.frames)

    def __call__(self, t: Transition) -> np.ndarray:
        """See Reward."""
        pictures = t.latents.shape[1] - 1
        assert pictures % self.frames == 0, f"RTL needs {self.frames} pictures of a step"
        way = length(np.diff(t.latents[:, :: pictures // self.frames], axis=1)).sum(axis=1)
        return np.broadcast_to(way[:, None], t.action.shape)
