"""`python -m stages.calibrate`: the scale of each reward, data/scales.h5."""

import sys

from mimo.record import artifact
from mimo.settings import params
from mimo.vision import extractor
from stages.base import console, paths, store
from stages.sweep import scales


def main() -> None:
    """Measure every reward under the resting policy, unless the store has the scales."""
    p = params.load()
    held = artifact.read(paths.ENCODER, store.ENCODER)
    sight = store.sight(held)

    def make() -> bytes:
        trained, rest = extractor.load(held), scales.rest_digest(p, sight)
        if not store.has(store.REST, rest):
            total = p.calibrate.steps * p.calibrate.worlds
            with console.Progress("Resting policy", total, "agent steps") as progress:
                store.keep(store.REST, rest, scales.record(p, trained, sight, progress.update))
        record = artifact.read(store.place(store.REST, rest), store.REST, rest)
        return scales.measure(p, trained, sight, record)

    store.publish(store.SCALE, scales.digest(p, sight), paths.SCALES, make)


if __name__ == "__main__":
    sys.exit(console.main(main))
