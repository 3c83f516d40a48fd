"""The rewards' scales as an artifact: of the published params or, under another digest, of a variant's.

Those that differ in rewards and outcome models alone are measured on one record of the resting policy, unless rewards
need other pictures of a step.
"""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from mimo.learning import calibrate, resting, rewards
from mimo.record import artifact, identity
from mimo.settings.params import Params
from mimo.vision import extractor
from mimo.vision.extractor import Trained
from mimo.world import protocol
from stages.base import store


def digest(p: Params, encoder_hash: str) -> identity.Digest:
    """The digest of all that the scales depend on, under which the store keeps them."""
    own: dict[str, object] = {
        "outcomes": p.outcomes.model_dump(),
        "rewards": {name: own for name, own in p.rewards.model_dump().items() if name not in ("gain", "scale")},
    }
    modules = ("mimo.learning.calibrate", *rewards.modules("_".join(rewards.REWARDS)))
    return _digest(p, encoder_hash, own, modules)


def rest_digest(p: Params, encoder_hash: str) -> identity.Digest:
    """The digest of all that the resting policy's record depends on."""
    frames = rewards.frames(rewards.parts("_".join(rewards.REWARDS), p.rewards))
    return _digest(p, encoder_hash, {"frames": frames}, ("mimo.learning.resting",))


def _digest(p: Params, encoder_hash: str, own: dict[str, object], modules: Sequence[str]) -> identity.Digest:
    inputs = {
        "params": {"world": p.world.model_dump(exclude={"rope_holds"}), "calibrate": p.calibrate.model_dump()}
        | {name: getattr(p.protocol, name) for name in protocol.STEP}
        | {name: getattr(p.encoder, name) for name in extractor.READ}
        | {
            "seed": p.seed,
            "force": p.conditions.free.force,
            "move_bias": p.agent.move_bias,
            "temperature": p.agent.temperature,
        }
        | own,
        "encoder": encoder_hash,
        "code": identity.code(*modules),
        "versions": identity.versions(),
    }
    return identity.Digest(inputs)


def record(
    p: Params, trained: Trained, encoder_hash: str, progress: Callable[[int], None] = lambda steps: None
) -> bytes:
    """The file of the resting policy's record.

    Raises:
        DivergedError: the physics diverged.
    """
    found = resting.record(p, trained, progress)
    datasets = {
        "action": artifact.Dataset(found.action.astype(np.uint8), "1 = MOVE", "step, world, joint"),
        "path_length": artifact.Dataset(found.path_length, "m", "step, world"),
        "latent": artifact.Dataset(found.latent, "h", "world, picture, dimension"),
        "proprioception": artifact.Dataset(found.proprioception, "rad", "step, world, joint"),
    }
    return artifact.to_bytes(store.REST, rest_digest(p, encoder_hash), datasets)


def measure(p: Params, trained: Trained, encoder_hash: str, held: artifact.Artifact) -> bytes:
    """The scales' file, measured on a record of the resting policy.

    Raises:
        FloatingPointError: a reward does not vary, so that it has no scale.
    """
    values = (held[name] for name in ("path_length", "latent", "proprioception"))
    found = calibrate.scales(p, trained, resting.Rest(held["action"] > 0, *values))
    datasets = {name: artifact.Dataset(np.array(value), "own units", "") for name, value in found.items()}
    return artifact.to_bytes(store.SCALE, digest(p, encoder_hash), datasets)


def read(path: Path, digest: str | None = None) -> dict[str, float]:
    """Each reward's scale, of a file of schema store.SCALE."""
    return {name: float(data.values) for name, data in artifact.read(path, store.SCALE, digest).datasets.items()}
