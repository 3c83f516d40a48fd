"""One agent step with all that its rewards are computed from: real frames, real physics, models that learned from both.

The step is one of those whose frames mimo.vision.collect recorded for the encoder, under the resting policy. Its
actions are drawn again, its physics computed again, update by update; the frame at its end is the recorded one, byte
for byte.
"""

from dataclasses import dataclass

import numpy as np

from mimo.learning import rewards
from mimo.learning.experience import Perception, untaught
from mimo.learning.outcomes import taus
from mimo.record import artifact, streams
from mimo.settings import params
from mimo.vision import collect, extractor
from mimo.world import body, scene
from mimo.world.eye import Eye
from mimo.world.physics import Worlds
from mimo.world.scene import Scene

CONDITION, ROPE = "noisy", True  # where rewards differ most, and there is an influence to find
DRAWN = ("mtl", "rtl", "cais", "surprise")  # the paper's


@dataclass(frozen=True)
class Example:
    """An agent step of one world.

    Attributes:
        step: which of the world's, from 0.
        learned: transitions that the outcome models have learned from.
        frames: (2, 128, 128, 3) uint8, what the eye saw at the step's start and at its end.
        path: (updates + 1, 3) m, the mobile's centre of mass at the start and after every update.
        transition: what the rewards are computed from, of one seed.
        conditional: (12, 2, latent, quantiles), the tables of p(h|a).
        marginal: (latent, quantiles), the table of p(h).
        levels: (quantiles,), at which the tables are.
        rewards: (12,) by reward's name, in its own units.
    """

    step: int
    learned: int
    frames: np.ndarray
    path: np.ndarray
    transition: rewards.Transition
    conditional: np.ndarray
    marginal: np.ndarray
    levels: np.ndarray
    rewards: dict[str, np.ndarray]


def take(p: params.Params, held: artifact.Artifact, frames: np.ndarray, built: Scene) -> Example:
    """The first step of world 0 in which the attached limb moves with most of its joints.

    The outcome models have then learned from every other world and from this one's earlier steps, in that order.

    Args:
        p: the params that the frames were collected under.
        held: the encoder.
        frames: (regime, world, step, 2, 128, 128, 3) uint8, as mimo.vision.collect gives them.
        built: the scene.
    """
    own = frames[collect.REGIMES.index((CONDITION, ROPE))]
    chance = np.stack([_draws(p, world, own.shape[1]) for world in range(len(own))])
    moved, positive = chance[:, :, 0] < collect.resting_probability(p.agent), chance[:, :, 1] < 0.5
    tied = collect.limbs(p)[0]
    if tied != p.protocol.limb:
        built = scene.build(p.world, p.protocol.model_copy(update={"limb": tied}))
    limb = moved[0, 1:, body.attached(tied)].sum(axis=0)
    step = 1 + int(limb.argmax())  # the first has no frame before it
    trained = extractor.load(held)
    outcomes = untaught(p, trained, CONDITION, [streams.generator(p.seed, CONDITION, 0, "memory")])
    terms = rewards.parts("_".join(DRAWN), p.rewards)
    perception = Perception(extractor.Extractor(p.encoder, trained), own[0, 0, :1], outcomes, terms)
    ends = [(world, end) for world in range(1, len(own)) for end in range(own.shape[1])]
    ends += [(0, end) for end in range(step)]
    resting = np.full((1, len(body.ACTUATED)), collect.resting_probability(p.agent), np.float32)
    for world, end in ends:
        perception.transition(moved[world, end : end + 1], np.zeros(1), own[world, end, 1:], resting)
    conditional, marginal = outcomes.conditional[0].copy(), outcomes.marginal[0].copy()
    path, before_end = _path(p, built, moved[:1, : step + 1], positive[:1, : step + 1], rewards.frames(terms))
    length = np.linalg.norm(np.diff(path, axis=0), axis=1).sum(keepdims=True)
    transition = perception.transition(moved[:1, step], length, own[0, step, 1:], resting, before_end)
    return Example(
        step=step,
        learned=len(ends),
        frames=own[0, [step - 1, step], 1],
        path=path,
        transition=transition,
        conditional=conditional,
        marginal=marginal,
        levels=taus(p.outcomes.quantiles),
        rewards={term.name: term(transition)[0] for term in terms},
    )


def _draws(p: params.Params, world: int, steps: int) -> np.ndarray:
    """(steps, 2, 12): what mimo.vision.collect compares with P(MOVE), and with the chance of a positive direction."""
    generator = streams.generator(p.seed, CONDITION, collect.stream(p, world, ROPE), "collect")
    return np.stack([generator.random((2, len(body.ACTUATED))) for _ in range(steps)])


def _path(
    p: params.Params, built: Scene, moved: np.ndarray, positive: np.ndarray, pictures: int
) -> tuple[np.ndarray, list[np.ndarray]]:
    """World 0 from its start on; of its last step the mobile's place after every update, and all frames but the last.

    Args:
        p: see `take`.
        built: the scene.
        moved: (1, steps, 12) bool.
        positive: (1, steps, 12) bool, the torques' directions.
        pictures: how many the rewards need of a step.
    """
    noise = streams.generator(p.seed, CONDITION, collect.stream(p, 0, ROPE), "collect_noise")
    worlds = Worlds(built, p.protocol, getattr(p.conditions, CONDITION).force, [noise])
    for step in range(moved.shape[1] - 1):
        worlds.step(moved[:, step], positive[:, step], ROPE)
    path, seen = [worlds.centre_of_mass], []
    updates = p.protocol.updates_per_step
    looks = {count * updates // pictures for count in range(1, pictures)}
    with Eye(built) as eye:
        for update, outcome in enumerate(worlds.pieces(moved[:, -1], positive[:, -1], ROPE, range(1, updates)), 1):
            path.append(outcome.centre_of_mass)
            if update in looks:
                seen.append(eye.frames(worlds.qpos))
    return np.concatenate(path), seen
