"""`python -m stages.trial`: data/trial.h5, the encoder as params.preview.yaml trains it, for `make verify` to repeat.

Nothing else depends on it: it shows, within seconds, that training from the published frames gives the published bytes.
"""

import sys
from pathlib import Path

from mimo import artifact, encoder, identity, params
from stages import console, paths, preview, store
from stages.encoder import train


def main() -> None:
    """Train it, unless the store has it."""
    p = settings(params.load())
    frames = artifact.read(paths.FRAMES, store.FRAME)
    digest = made_from(p, frames)

    def make(path: Path) -> None:
        encoder.save(train(p, frames["frames"]), path, digest, {})

    store.publish(encoder.SCHEMA, digest, paths.TRIAL, make)


def settings(p: params.Params) -> params.Params:
    """The published params, but the encoder's training as in the preview."""
    short = preview.merged_params(Path())["encoder"]
    return p.model_copy(update={"encoder": params.checked(p.encoder, short)})


def made_from(p: params.Params, frames: artifact.Artifact) -> identity.Digest:
    """The digest of all that it depends on."""
    return identity.Digest(
        {
            "params": {"seed": p.seed, "encoder": p.encoder.model_dump(), "held_out": p.collect.held_out},
            "frames": frames.content,
            "code": identity.code("mimo.encoder", "mimo.streams"),
            "versions": identity.versions(),
        }
    )


if __name__ == "__main__":
    sys.exit(console.main(main))
