"""`python -m stages.trial`: data/trial.h5, the encoder as params.preview.yaml trains it, for `make verify` to repeat.

Nothing else depends on it: it shows, within seconds, that training from the published frames gives the published bytes.
"""

import sys
from pathlib import Path

from mimo.record import artifact
from mimo.settings import params
from stages.base import console, overlay, paths, store
from stages.sweep import encoders


def main() -> None:
    """Train it, unless the store has it."""
    p = settings(params.load())
    frames = artifact.read(paths.FRAMES, store.FRAME)
    digest = encoders.digest(p, frames, measured=False)
    store.publish(store.ENCODER, digest, paths.TRIAL, lambda: encoders.encoder(p, frames, measured=False))


def settings(p: params.Params) -> params.Params:
    """The published params, but the encoder's training as in the preview."""
    short = overlay.merged(Path(), paths.PARAMS)["encoder"]
    return p.model_copy(update={"encoder": params.checked(p.encoder, short)})


if __name__ == "__main__":
    sys.exit(console.main(main))
