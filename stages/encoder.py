"""`python -m stages.encoder`: train the visual encoder and measure it, data/encoder.h5 and reports/encoder.json."""

import json
import sys

from mimo.record import artifact
from mimo.settings import params
from stages.base import console, paths, store
from stages.sweep import encoders


def main() -> None:
    """Train the encoder, unless the store has it."""
    p = params.load()
    frames = artifact.read(paths.FRAMES, store.FRAME)
    digest = encoders.digest(p, frames)

    def make() -> bytes:
        with console.Progress("Encoder", p.encoder.iterations, "iterations") as progress:
            return encoders.encoder(p, frames, progress=progress.update)

    store.publish(store.ENCODER, digest, paths.ENCODER, make)
    found = encoders.measures(artifact.read(paths.ENCODER, store.ENCODER, digest))
    measures = {name: float(f"{value:.6g}") for name, value in found.items()}
    artifact.publish(f"{json.dumps(measures, indent=2)}\n".encode(), paths.ENCODER_METRICS)


if __name__ == "__main__":
    sys.exit(console.main(main))
