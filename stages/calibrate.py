"""`python -m stages.calibrate`: the scale of each reward, data/scales.h5."""

import sys
from pathlib import Path

from mimo.record import artifact
from mimo.settings import params
from mimo.vision import encoder
from stages.base import console, paths, store
from stages.sweep import scales


def main() -> None:
    """Measure every reward under the resting policy, unless the store has the scales."""
    p = params.load()
    held = artifact.read(paths.ENCODER, encoder.SCHEMA)
    sight = store.sight(held)

    def make(path: Path) -> None:
        total = p.calibrate.steps * p.calibrate.worlds
        with console.Progress("Reward scales", total, "agent steps") as progress:
            artifact.publish(scales.measure(p, encoder.load(held), sight, progress.update), path)

    store.publish(store.SCALE, scales.digest(p, sight), paths.SCALES, make)


if __name__ == "__main__":
    sys.exit(console.main(main))
