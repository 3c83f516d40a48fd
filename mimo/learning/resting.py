"""What happens under the resting policy, free condition, rope on: recorded once, for all that is measured on it."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mimo.learning import rewards
from mimo.learning.experience import Experience
from mimo.record import streams
from mimo.settings.params import Params
from mimo.vision.collect import resting_probability
from mimo.vision.extractor import Extractor, Trained
from mimo.world import body, scene
from mimo.world.eye import Eye
from mimo.world.physics import Worlds
from mimo.world.protocol import JOINTS


@dataclass(frozen=True)
class Rest:
    """Agent steps of all worlds, `calibrate.steps` and `calibrate.worlds` of params.yaml.

    Attributes:
        action: (steps, worlds, 12) bool, True where the joint moved.
        path_length: (steps, worlds) m travelled by the mobile, float32.
        latent: (worlds, steps * frames + 1, latent) float32, h at the start and at each picture of each step, as many
            as all rewards together need.
        proprioception: (steps, worlds, 47) joint angles at each step's start, rad, float32.
    """

    action: np.ndarray
    path_length: np.ndarray
    latent: np.ndarray
    proprioception: np.ndarray


def record(params: Params, trained: Trained, progress: Callable[[int], None] = lambda steps: None) -> Rest:
    """Act, and keep what came of it. The rope holds in every step, whatever `world.rope_holds`.

    Args:
        params: all of params.yaml.
        trained: the encoder.
        progress: called with the number of agent steps done, over all worlds.

    Raises:
        DivergedError: the physics diverged.
    """
    steps, worlds = params.calibrate.steps, params.calibrate.worlds
    draws, noise = (
        [streams.generator(params.seed, "free", world, purpose) for world in range(worlds)]
        for purpose in ("calibrate", "calibrate_noise")
    )
    built = scene.build(params.world, params.protocol)
    action, path_length = np.empty((steps, worlds, JOINTS), bool), np.empty((steps, worlds), np.float32)
    terms = rewards.parts("_".join(rewards.REWARDS), params.rewards)
    frames, joints = rewards.frames(terms), np.empty((steps, worlds, len(body.JOINTS)), np.float32)
    latent = np.empty((worlds, steps * frames + 1, params.encoder.latent), np.float32)
    probability = resting_probability(params.agent)
    with Eye(built) as eye:
        acting = Worlds(built, params.protocol, params.conditions.free.force, noise)
        experience = Experience(acting, eye, Extractor(params.encoder, trained), terms=terms)
        for step in range(steps):
            chance = np.stack([draw.random((2, JOINTS)) for draw in draws], axis=1)
            action[step] = chance[0] < probability
            _, found = experience.step(action[step], chance[1] < 0.5, attached=True)
            path_length[step], joints[step] = found.path_length, found.proprioception
            latent[:, step * frames : (step + 1) * frames + 1] = found.latents
            progress((step + 1) * worlds)
    return Rest(action, path_length, latent, joints)
