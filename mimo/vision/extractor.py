"""A trained encoder: as an artifact, and as what an agent sees by, the frozen extractor of h (paper §3.2).

All of it is free of torch, which is needed to train alone.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mimo.record import artifact, kernels, runtime
from mimo.settings import params
from mimo.vision import inference

SCHEMA = "encoder"
READ = ("widths", "latent", "projection", "latent_sd")  # fields of params.Encoder on which h depends, once trained
LEVELS = np.arange(1, 100) / 100.0  # probabilities at which the marginal quantiles of h are kept


@dataclass(frozen=True)
class Trained:
    """A trained encoder.

    Attributes:
        weights: every tensor of the U-Net by name.
        mean, sd: (latent,) of raw h over the training frames.
        quantiles: (group, latent, 99) of the scaled h over each group of training frames, at LEVELS.
        reconstruction, cltt: (iterations,) losses of each training batch.
    """

    weights: dict[str, np.ndarray]
    mean: np.ndarray
    sd: np.ndarray
    quantiles: np.ndarray
    reconstruction: np.ndarray
    cltt: np.ndarray


class Extractor:
    """The frozen encoder: pictures to h, each dimension centred and scaled to SD `latent_sd` over the training frames.

    Frames pass one at a time, so that a frame's h is the same bytes in whatever company it comes.
    """

    def __init__(self, settings: params.Encoder, trained: Trained) -> None:
        runtime.check("numpy")
        kernels.check()
        self._layers = inference.layers(trained.weights)
        shape = (settings.latent,)
        self._mean, sd = (kernels.checked(name, getattr(trained, name), shape, np.float32) for name in ("mean", "sd"))
        self._gain = np.float32(settings.latent_sd) / sd

    def __call__(self, frames: np.ndarray) -> np.ndarray:
        """(N, 128, 128, 3) uint8 frames to h (N, latent) float32.

        Raises:
            ValueError: frames of another shape or type.
        """
        latent: np.ndarray = (inference.raw(self._layers, frames) - self._mean) * self._gain
        return latent


def to_bytes(trained: Trained, digest: str, measures: Mapping[str, float]) -> bytes:
    """The file of a trained encoder, with what was measured of it."""
    return artifact.to_bytes(SCHEMA, digest, _datasets(trained, measures))


def save(trained: Trained, path: str | Path, digest: str, measures: Mapping[str, float]) -> str:
    """Write that file; returns the content hash (see artifact.write)."""
    return artifact.write(path, SCHEMA, digest, _datasets(trained, measures))


def _datasets(trained: Trained, measures: Mapping[str, float]) -> dict[str, artifact.Dataset]:
    datasets = {f"weights/{name}": artifact.Dataset(value, "1", "") for name, value in trained.weights.items()}
    datasets |= {
        "latent/mean": artifact.Dataset(trained.mean, "1", "dimension"),
        "latent/sd": artifact.Dataset(trained.sd, "1", "dimension"),
        "latent/quantiles": artifact.Dataset(trained.quantiles, "h", "group, dimension, level"),
        "curves/reconstruction": artifact.Dataset(trained.reconstruction, "squared intensity", "iteration"),
        "curves/cltt": artifact.Dataset(trained.cltt, "nat", "iteration"),
    }
    return datasets | {
        f"measures/{name}": artifact.Dataset(np.array(value), "1", "") for name, value in measures.items()
    }


def load(held: artifact.Artifact) -> Trained:
    """The encoder that an artifact of schema SCHEMA holds."""
    start = "weights/"
    weights = {name[len(start) :]: held[name] for name in held.datasets if name.startswith(start)}
    return Trained(
        weights,
        held["latent/mean"],
        held["latent/sd"],
        held["latent/quantiles"],
        held["curves/reconstruction"],
        held["curves/cltt"],
    )
