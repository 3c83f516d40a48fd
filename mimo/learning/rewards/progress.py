"""Learning progress (Oudeyer, Kaplan & Hafner 2007, IEEE Trans. Evol. Comput. 11:265; Kaplan & Oudeyer 2007)."""

from collections import deque
from collections.abc import Sequence
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from mimo.learning.rewards.reward import Reward, Transition, length
from mimo.settings.section import Section


class Progress(Reward):
    """By how much ||h - E[h|a]|| of each joint's action fell from one window of steps to the next, in units of h.

    The sum of errors over the window of W steps before the last, less that over the last, divided by W. As long as
    fewer than 2 W steps are seen, the windows are the halves of what is, less the first step of an odd number, and the
    divisor is W all the same: what was not seen is no progress, so that it begins at 0.
    """

    name = "progress"
    unit = "h"
    needs_outcomes = True

    class Constants(Section):
        """`window`: steps of a window."""

        window: Annotated[int, Field(gt=0, le=1000)]

    def __init__(self, constants: Any, draws: Sequence[np.random.Generator] = ()) -> None:
        """See Reward."""
        super().__init__(constants, draws)
        self._errors: deque[np.ndarray] = deque(maxlen=2 * constants.window)

    def __call__(self, t: Transition) -> np.ndarray:
        """See Reward."""
        assert t.expectation is not None, "learning progress needs the expected outcome of actions"
        self._errors.append(length(t.latent[:, None] - t.expectation).astype(np.float64))
        half = len(self._errors) // 2
        errors = list(self._errors)[len(self._errors) - 2 * half :]
        fall = np.zeros(t.action.shape)
        for before, since in zip(errors[:half], errors[half:], strict=True):
            fall += before - since
        return fall / float(self.constants.window)
