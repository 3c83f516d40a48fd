"""Each reward's scale: its SD under the resting policy, free condition, rope on. One rule for all (params `rewards`).

The paper gives no scale, but against the temperature of 0.3 a reward's scale decides how much is learned.
"""

from collections.abc import Callable

import numpy as np
import torch

from mimo.learning import rewards
from mimo.learning.agent import JOINTS
from mimo.learning.experience import Experience, untaught
from mimo.record import streams
from mimo.settings.params import Params
from mimo.vision.collect import resting_probability
from mimo.vision.encoder import Extractor, Trained
from mimo.world import scene
from mimo.world.eye import Eye
from mimo.world.physics import Worlds


def scales(params: Params, trained: Trained, progress: Callable[[int], None] = lambda steps: None) -> dict[str, float]:
    """SD of every known reward, in its own units, over worlds, steps and joints.

    The first half of the steps is for the outcome models to settle, the second is measured.

    Args:
        params: all of params.yaml.
        trained: the encoder.
        progress: called with the number of agent steps done, over all worlds.

    Raises:
        FloatingPointError: a reward does not vary, so that it has no scale.
    """
    torch.set_num_threads(1)
    settings = params.calibrate
    draws, batches = (
        [streams.generator(params.seed, "free", world, purpose) for world in range(settings.worlds)]
        for purpose in ("calibrate", "calibrate_memory")
    )
    built = scene.build(params.world, params.protocol)
    worlds = Worlds(built, params.protocol, params.conditions.free.force, draws)
    terms = rewards.parts("_".join(rewards.REWARDS), params.rewards)
    seen = np.empty((len(terms), settings.steps, settings.worlds, JOINTS))
    with Eye(built) as eye:
        experience = Experience(worlds, eye, Extractor(params.encoder, trained), untaught(params, trained, batches))
        for step in range(settings.steps):
            chance = np.stack([draw.random((2, JOINTS)) for draw in draws], axis=1)
            moved = chance[0] < resting_probability(params.agent)
            _, transition = experience.step(moved, chance[1] < 0.5, attached=True)
            seen[:, step] = [term(transition).numpy() for term in terms]
            progress((step + 1) * settings.worlds)
    found = {term.name: float(values[settings.steps // 2 :].std()) for term, values in zip(terms, seen, strict=True)}
    flat = [name for name, value in found.items() if not value > 0]
    if flat:
        raise FloatingPointError(f"reward {flat[0]} does not vary under the resting policy, so it has no scale")
    return found
