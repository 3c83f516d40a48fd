"""What the rewards share that are CAIS with another distance."""

from collections.abc import Callable

import numpy as np

from mimo.learning.rewards.reward import Transition
from mimo.world.protocol import ACTIONS, MOVE


def of_moves(t: Transition, distance: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> np.ndarray:
    """(N, 12): the distance of p(h|MOVE) from p(h), paid to a joint that moved, else 0, as CAIS with `pays: move`.

    p(h) is its own table, whatever `outcomes.marginal`; with `outcomes.action` "limb", MOVE is the limb's.

    Args:
        t: the step.
        distance: of tables (moved, quantiles, latent) from a table (quantiles, latent): (moved,), mean over the latent.
    """
    assert t.tables is not None, "a distance of outcomes needs their tables"
    found = np.zeros(t.action.shape, np.float32)
    for own, tables, moved in zip(found, t.tables, t.action, strict=True):
        own[moved] = distance(tables[MOVE:-1:ACTIONS][moved], tables[-1])
    return found
