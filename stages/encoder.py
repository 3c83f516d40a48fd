"""`python -m stages.encoder`: train the visual encoder and measure it, data/encoder.h5 and reports/encoder.json."""

import json
import sys
from pathlib import Path

import numpy as np

from mimo.record import artifact, identity, streams
from mimo.settings import params
from mimo.vision import extractor
from stages.base import console, paths, store


def main() -> None:
    """Train the encoder, unless the store has it."""
    p = params.load()
    frames = artifact.read(paths.FRAMES, store.FRAME)
    digest = made_from(p, frames)

    def make(path: Path) -> None:
        from mimo.vision import probe  # late: torch, which `made_from` does without

        trained = train(p, frames["frames"])
        measures = probe.measure(p, trained, frames["frames"], frames["centre_of_mass"], _cut(p))
        extractor.save(trained, path, digest, measures)

    store.publish(store.ENCODER, digest, paths.ENCODER, make)
    held = artifact.read(paths.ENCODER, store.ENCODER, digest)
    start = "measures/"
    measures = {n[len(start) :]: float(f"{held[n]:.6g}") for n in held.datasets if n.startswith(start)}
    artifact.publish(f"{json.dumps(measures, indent=2)}\n".encode(), paths.ENCODER_METRICS)


def made_from(p: params.Params, frames: artifact.Artifact, measured: bool = True) -> identity.Digest:
    """The digest of all that an encoder depends on; how it was measured, too, if it is."""
    inputs = {
        "params": {"seed": p.seed, "encoder": p.encoder.model_dump(), "held_out": p.collect.held_out},
        "frames": frames.content,
        "code": identity.code(
            "mimo.vision.encoder", "mimo.record.streams", *(["mimo.vision.probe"] if measured else [])
        ),
        "versions": identity.versions(),
    }
    return identity.Digest(inputs)


def train(p: params.Params, frames: np.ndarray) -> extractor.Trained:
    """An encoder by `p.encoder`, from the frames that are not held out."""
    from mimo.vision import encoder  # late, likewise

    pairs = frames[:, :, : _cut(p)]
    with console.Progress("Encoder", p.encoder.iterations, "iterations") as progress:
        return encoder.train(
            p.encoder,
            pairs.reshape(len(pairs), -1, *pairs.shape[3:]),
            streams.generator(p.seed, "free", 0, "encoder"),
            progress.update,
        )


def _cut(p: params.Params) -> int:
    """The first step that is held out."""
    return round(p.collect.steps * (1 - p.collect.held_out))


if __name__ == "__main__":
    sys.exit(console.main(main))
