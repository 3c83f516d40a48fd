"""Random streams: one generator for each (root seed, condition, seed, purpose), whatever else runs.

The reward is no part of the key: all rewards of a condition see the same noise for the same seed (paired comparison).
"""

import numpy as np

PURPOSES = (
    "noise",  # the force on the mobile
    "direction",  # of each joint's torque
    "policy",
    "weights",  # initial, of the agent
    "memory",  # batches of the outcome models
    "collect",
    "collect_noise",
    "encoder",
    "calibrate",
    "calibrate_memory",
    "calibrate_noise",
    "rope",  # whether it holds
    "reward",  # what a reward draws, a stream for each by its name
    "calibrate_reward",
)
CONDITIONS = ("free", "noisy")


def generator(root: int, condition: str, seed: int, purpose: str, name: str = "") -> np.random.Generator:
    """The generator of one purpose of one run.

    Args:
        root: `seed` of params.yaml.
        condition: free or noisy.
        seed: index of the run's seed, from 0.
        purpose: one of PURPOSES.
        name: of one among several that share the purpose.
    """
    key = (CONDITIONS.index(condition), seed, PURPOSES.index(purpose), *name.encode())
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(root, spawn_key=key)))
