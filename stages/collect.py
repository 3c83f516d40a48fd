"""`python -m stages.collect`: frames for the encoder, data/frames.h5."""

import sys

from mimo.settings import params
from mimo.vision import collect
from stages.base import console, paths, store
from stages.sweep import encoders


def main() -> None:
    """Collect frames under the resting policy, unless the store has them."""
    p = params.load()

    def make() -> bytes:
        total = len(collect.REGIMES) * p.collect.worlds * p.collect.steps
        with console.Progress("Frames", total, "agent steps") as progress:
            return encoders.frames(p, progress.update)

    store.publish(store.FRAME, encoders.frames_digest(p), paths.FRAMES, make)


if __name__ == "__main__":
    sys.exit(console.main(main))
