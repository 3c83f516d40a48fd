"""Frames for the encoder: the resting policy in both conditions, detached and attached (paper §3.2)."""

from collections.abc import Callable

import numpy as np

from mimo.record import runtime, streams
from mimo.settings.params import Agent, Params
from mimo.world import body, scene
from mimo.world.eye import SIZE, Eye
from mimo.world.physics import Worlds
from mimo.world.protocol import JOINTS

REGIMES = tuple((condition, attached) for condition in streams.CONDITIONS for attached in (False, True))

APART = 1000  # between the random streams of two draws, which no draw's worlds reach


def stream(params: Params, world: int, attached: bool) -> int:
    """Index of a world's random streams."""
    return APART * params.collect.draw + 2 * world + attached


def resting_probability(settings: Agent) -> float:
    """P(MOVE) of the policy that has learned nothing: both Q are 0, the bias decides (paper §3.6)."""
    return float(1.0 / (1.0 + np.exp(-settings.move_bias / settings.temperature)))


def limbs(params: Params) -> list[str]:
    """Which limb the rope is tied to: world w has that of place w, round and round."""
    return list(body.LIMB_JOINTS) if params.collect.limbs == "all" else [params.protocol.limb]


def collect(params: Params, progress: Callable[[int], None] = lambda steps: None) -> tuple[np.ndarray, np.ndarray]:
    """Frame pairs `pair_updates` apart, at the end of every agent step.

    Args:
        params: all of params.yaml.
        progress: called with the number of agent steps done, over all worlds.

    Returns:
        frames: (regime, world, step, 2, 128, 128, 3) uint8, regimes in the order of REGIMES.
        centres: (regime, world, step, 2, 3) m, the mobile's centre of mass in each frame.
    """
    runtime.check("numpy")
    settings = params.collect
    shape = (len(REGIMES), settings.worlds, settings.steps, 2)
    frames = np.empty((*shape, SIZE, SIZE, 3), np.uint8)
    centres = np.empty((*shape, 3))
    first = params.protocol.updates_per_step - settings.pair_updates  # updates before the first frame of a pair
    probability, tied, done = resting_probability(params.agent), limbs(params), 0
    for place, limb in enumerate(tied):
        protocol, own = params.protocol.model_copy(update={"limb": limb}), slice(place, None, len(tied))
        built = scene.build(params.world, protocol)
        with Eye(built) as eye:
            for index, (condition, attached) in enumerate(REGIMES):
                draws, noise = (
                    [
                        streams.generator(params.seed, condition, stream(params, world, attached), purpose)
                        for world in range(settings.worlds)[own]
                    ]
                    for purpose in ("collect", "collect_noise")
                )
                worlds = Worlds(built, protocol, getattr(params.conditions, condition).force, noise)
                for step in range(settings.steps):
                    chance = np.stack([draw.random((2, JOINTS)) for draw in draws], axis=1)
                    moved, positive = chance[0] < probability, chance[1] < 0.5
                    for frame, outcome in enumerate(worlds.pieces(moved, positive, attached, [first])):
                        centres[index, own, step, frame] = outcome.centre_of_mass
                        frames[index, own, step, frame] = eye.frames(worlds.qpos)
                    done += worlds.size
                    progress(done)
    return frames, centres
