"""Each reward's scale: its SD under the resting policy, free condition, rope on. One rule for all (params `rewards`).

The paper gives no scale, but against the temperature of 0.3 a reward's scale decides how much is learned.
"""

import numpy as np

from mimo.learning import rewards
from mimo.learning.experience import learned, untaught
from mimo.learning.resting import Rest
from mimo.learning.rewards import Transition
from mimo.record import streams
from mimo.settings.params import Params
from mimo.vision.collect import resting_probability
from mimo.vision.extractor import Trained


def scales(params: Params, trained: Trained, rest: Rest) -> dict[str, float]:
    """SD of every known reward, in its own units, over worlds, steps and joints.

    The first half of the steps is for the outcome models to settle, the second is measured.

    Args:
        params: all of params.yaml.
        trained: the encoder.
        rest: what `resting.record` gives for these two.

    Raises:
        FloatingPointError: a reward does not vary, so that it has no scale.
    """
    worlds = range(params.calibrate.worlds)

    def generators(purpose: str, name: str = "") -> list[np.random.Generator]:
        return [streams.generator(params.seed, "free", world, purpose, name) for world in worlds]

    outcomes = untaught(params, trained, "free", generators("calibrate_memory"))
    terms = rewards.parts("_".join(rewards.REWARDS), params.rewards, lambda name: generators("calibrate_reward", name))
    frames = rewards.frames(terms)
    probability = np.full(rest.action.shape[1:], resting_probability(params.agent), np.float32)
    seen = np.empty((len(terms), *rest.action.shape))
    for step in range(len(rest.action)):
        found = Transition(
            path_length=rest.path_length[step],
            latents=rest.latent[:, step * frames : (step + 1) * frames + 1],
            action=rest.action[step],
            probability=probability,
            proprioception=rest.proprioception[step],
        )
        seen[:, step] = rewards.paid(terms, learned(found, outcomes, terms))
    half = params.calibrate.steps // 2
    deviations = {term.name: float(values[half:].std()) for term, values in zip(terms, seen, strict=True)}
    flat = [name for name, value in deviations.items() if not value > 0]
    if flat:
        raise FloatingPointError(f"reward {flat[0]} does not vary under the resting policy, so it has no scale")
    return deviations
