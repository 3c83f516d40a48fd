"""Does the world ask a fair question? How large each joint's effect is under the resting policy.

The attached limb's joints stand against the other nine, whose effects are what chance gives in a sample of that size.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from mimo.learning.experience import Experience
from mimo.learning.outcomes import taus
from mimo.learning.rewards.reward import length
from mimo.record import streams
from mimo.settings.params import Params
from mimo.settings.studies import Effects
from mimo.vision.collect import resting_probability
from mimo.vision.extractor import Extractor, Trained
from mimo.world import body, scene
from mimo.world.eye import Eye
from mimo.world.physics import Worlds
from mimo.world.protocol import JOINTS
from mimo.world.scene import Scene

REGIMES = (("free", True), ("noisy", True), ("noisy", False))  # condition, and whether the rope is on
FIRST_SEED = 10**6  # of the random streams, which are then no run's; they are the same in all worlds, rope on or off


@dataclass(frozen=True)
class Sample:
    """Agent steps of all worlds of a regime.

    Attributes:
        moved: (steps, 12) bool, which joints moved.
        mtl: (steps,) m, the mobile's path.
        rtl: (steps,) distance of h from that of the step before, in units of h.
        position: (steps, 3) m, the mobile's centre of mass at the step's end.
        latent: (steps, latent) h at the step's end.
    """

    moved: np.ndarray
    mtl: np.ndarray
    rtl: np.ndarray
    position: np.ndarray
    latent: np.ndarray


def measure(
    params: Params, settings: Effects, trained: Trained, progress: Callable[[int], None] = lambda steps: None
) -> dict[str, Any]:
    """Effects in both conditions with the rope on (see `joints`), and the rope's own in noise.

    Args:
        params: all of params.yaml.
        settings: how much is measured.
        trained: the encoder.
        progress: called with the number of agent steps done, over all worlds.

    Returns:
        `free`, `noisy`: see `joints`. `phases`: for mtl and rtl, Cohen's d of rope on against rope off, noisy.

    Raises:
        FloatingPointError: something does not vary, so that it has no effect.
    """
    steps = settings.steps * settings.worlds
    built, extract = scene.build(params.world, params.protocol), Extractor(params.encoder, trained)
    with Eye(built) as eye:
        free, noisy, loose = (
            sample(params, settings, built, eye, extract, regime, partial(_after, index * steps, progress))
            for index, regime in enumerate(REGIMES)
        )
    attached, levels = body.attached(params.protocol.limb), taus(params.outcomes.quantiles).astype(float)
    return {
        "free": joints(free, attached, levels),
        "noisy": joints(noisy, attached, levels),
        "phases": {"mtl": cohens_d(noisy.mtl, loose.mtl), "rtl": cohens_d(noisy.rtl, loose.rtl)},
    }


def sample(
    params: Params,
    settings: Effects,
    built: Scene,
    eye: Eye,
    extract: Extractor,
    regime: tuple[str, bool],
    progress: Callable[[int], None],
) -> Sample:
    """`worlds` worlds of `steps` agent steps under the resting policy, less the first `dropped`.

    Args:
        params: all of params.yaml.
        settings: how many steps and worlds.
        built: the scene.
        eye: of that scene.
        extract: pictures to h.
        regime: condition, and whether the rope is on.
        progress: called with the number of agent steps done, over all worlds.
    """
    condition, attached = regime
    policy, direction, noise = (
        [streams.generator(params.seed, condition, FIRST_SEED + world, purpose) for world in range(settings.worlds)]
        for purpose in ("policy", "direction", "noise")
    )
    worlds = Worlds(built, params.protocol, getattr(params.conditions, condition).force, noise)
    probability = resting_probability(params.agent)
    seen: list[tuple[np.ndarray, ...]] = []
    experience = Experience(worlds, eye, extract)
    for step in range(settings.steps):
        moved = np.stack([draw.random(JOINTS) for draw in policy]) < probability
        positive = np.stack([draw.random(JOINTS) for draw in direction]) < 0.5
        outcome, transition = experience.step(moved, positive, attached)
        distance = length(transition.latent - transition.latent_before)
        seen.append((moved, outcome.path_length, distance, outcome.centre_of_mass, transition.latent))
        progress((step + 1) * settings.worlds)
    return Sample(*(np.concatenate(values) for values in zip(*seen[settings.dropped :], strict=True)))


def _after(before: int, progress: Callable[[int], None], done: int) -> None:
    progress(before + done)


def joints(found: Sample, attached: np.ndarray, levels: np.ndarray) -> dict[str, Any]:
    """The joints' effects, and how far the mobile travels.

    Args:
        found: the sample.
        attached: (12,) bool, the attached limb's joints, which are listed in the order of body.ACTUATED.
        levels: (quantiles,) levels at which distributions are compared.

    Returns:
        `mtl`, `rtl`: the difference that moving makes, in SD: of the `attached` joints, and the largest size of the
        `others`. `position`, `latent`: W1 between p(x | moved) and p(x), in SD and in units of h: of the `attached`
        joints, the mean of the `others`, and the `ratio` of the two means. `position_sd_mm`: (3). `mtl_mm`: mean, SD.

    Raises:
        FloatingPointError: something does not vary, so that it has no effect.
    """
    for name, values in (("a joint's action", found.moved), ("mtl", found.mtl), ("rtl", found.rtl),
                         ("the mobile's position", found.position)):  # fmt: skip
        if (values == values[0]).all(axis=0).any():
            raise FloatingPointError(f"{name} does not vary under the resting policy, so it has no effect")
    effects: dict[str, Any] = {}
    for name, reward in (("mtl", found.mtl), ("rtl", found.rtl)):
        sizes = differences(reward, found.moved)
        effects[name] = {"attached": sizes[attached].tolist(), "others": float(np.abs(sizes[~attached]).max())}
    sd = found.position.std(axis=0)
    for name, x in (("position", found.position / sd), ("latent", found.latent)):
        sizes = distances(x, found.moved, levels)
        own, others = sizes[attached], float(sizes[~attached].mean())
        effects[name] = {"attached": own.tolist(), "others": others, "ratio": float(own.mean()) / others}
    path = 1000 * found.mtl
    return effects | {
        "position_sd_mm": (1000 * sd).tolist(),
        "mtl_mm": {"mean": float(path.mean()), "sd": float(path.std())},
    }


def differences(reward: np.ndarray, moved: np.ndarray) -> np.ndarray:
    """E[r | moved] - E[r | not moved] of each joint.

    Args:
        reward: (steps,), the same for all joints.
        moved: (steps, joints) bool.

    Returns:
        (joints,) in SD of the reward.
    """
    sizes: np.ndarray = np.array([reward[own].mean() - reward[~own].mean() for own in moved.T]) / reward.std()
    return sizes


def distances(x: np.ndarray, moved: np.ndarray, levels: np.ndarray) -> np.ndarray:
    """W1 between p(x | moved) and p(x) for each joint, as CAIS has it: mean over levels and dimensions.

    Args:
        x: (steps, dimensions).
        moved: (steps, joints) bool.
        levels: (quantiles,) in (0, 1).

    Returns:
        (joints,) in units of x.
    """
    marginal = np.quantile(x, levels, axis=0)
    return np.array([np.abs(np.quantile(x[own], levels, axis=0) - marginal).mean() for own in moved.T])


def cohens_d(on: np.ndarray, off: np.ndarray) -> float:
    """Difference of the means of two samples of one size (steps,), in units of their pooled SD."""
    return float((on.mean() - off.mean()) / np.sqrt((on.var() + off.var()) / 2))
