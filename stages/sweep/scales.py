"""The rewards' scales as an artifact: of the published params or, under another digest, of a variant's."""

from collections.abc import Callable

import numpy as np

from mimo.learning import calibrate, rewards
from mimo.record import artifact, identity
from mimo.settings.params import Params
from mimo.vision import encoder
from stages.base import store


def digest(p: Params, encoder_hash: str) -> identity.Digest:
    """The digest of all that the scales depend on, under which the store keeps them."""
    inputs = {
        "params": {name: getattr(p, name).model_dump() for name in ("world", "outcomes", "calibrate")}
        | {name: getattr(p.protocol, name) for name in ("limb", "updates_per_step", "torque_updates", "timestep")}
        | {name: getattr(p.encoder, name) for name in ("widths", "latent", "projection", "latent_sd")}
        | {"rewards": {name: own for name, own in p.rewards.model_dump().items() if name not in ("gain", "scale")}}
        | {
            "seed": p.seed,
            "force": p.conditions.free.force,
            "move_bias": p.agent.move_bias,
            "temperature": p.agent.temperature,
        },
        "encoder": encoder_hash,
        "code": identity.code("mimo.learning.calibrate", *rewards.modules("_".join(rewards.REWARDS))),
        "versions": identity.versions(),
    }
    return identity.Digest(inputs)


def measure(
    p: Params, trained: encoder.Trained, encoder_hash: str, progress: Callable[[int], None] = lambda steps: None
) -> bytes:
    """The scales' file, measured.

    Raises:
        FloatingPointError: a reward does not vary, so that it has no scale.
    """
    found = calibrate.scales(p, trained, progress)
    datasets = {name: artifact.Dataset(np.array(value), "own units", "") for name, value in found.items()}
    return artifact.to_bytes(store.SCALE, digest(p, encoder_hash), datasets)
