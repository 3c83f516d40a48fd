"""Learning progress (Oudeyer, Kaplan & Hafner 2007, IEEE Trans. Evol. Comput. 11:265)."""

from collections.abc import Sequence
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from mimo.learning.rewards.reward import Reward, Transition, length
from mimo.settings.section import Section
from mimo.world.protocol import ACTIONS


class Progress(Reward):
    """By how much ||h - E[h|a]|| fell over the last steps in which a joint took the action that it now took, in h.

    The regions whose progress is told apart are a joint's two actions: each has an outcome model and errors of its
    own. The sum of errors over the W steps of an action before its last W, less that over the last W, divided by W. As
    long as an action was taken in fewer than 2 W steps, the windows are the halves of what is, less the first step of
    an odd number, and the divisor is W all the same: what was not seen is no progress, so that it begins at 0.
    """

    name = "progress"
    unit = "h"
    needs_outcomes = True

    class Constants(Section):
        """`window`: steps of a window."""

        window: Annotated[int, Field(gt=0, le=1000)]

    def __init__(self, constants: Any, draws: Sequence[np.random.Generator] = ()) -> None:
        """See Reward; memory is made in the first step."""
        super().__init__(constants, draws)
        self._errors = np.empty((0, 0, ACTIONS, 2 * constants.window))
        self._taken = np.empty((0, 0, ACTIONS), int)

    def __call__(self, t: Transition) -> np.ndarray:
        """See Reward."""
        assert t.expectation is not None, "learning progress needs the expected outcome of actions"
        window = self.constants.window
        if not len(self._errors):
            self._errors = np.zeros((*t.action.shape, ACTIONS, 2 * window))
            self._taken = np.zeros((*t.action.shape, ACTIONS), int)
        own = (*np.indices(t.action.shape), t.action.astype(int))
        errors = np.roll(self._errors[own], 1, axis=-1)
        errors[..., 0] = length(t.latent[:, None] - t.expectation)
        self._errors[own] = errors
        self._taken[own] += 1
        half = np.minimum(self._taken[own] // 2, window)
        fall = np.zeros(t.action.shape)
        for place in range(window):
            before = np.take_along_axis(errors, (half + place)[..., None] % (2 * window), axis=-1)[..., 0]
            fall += np.where(place < half, before - errors[..., place], 0)
        return fall / float(window)
