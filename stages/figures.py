"""`python -m stages.figures`: reports/figures/, each figure as SVG, PDF and PNG, from results, encoder and frames."""

import sys

from mimo.record import artifact
from mimo.settings import params
from stages.base import console, origin, paths, store
from stages.drawing import figures


def main() -> None:
    """Draw every figure."""
    results, held = artifact.read(paths.RESULTS, store.RESULTS), artifact.read(paths.ENCODER, store.ENCODER)
    frames = artifact.read(paths.FRAMES, store.FRAME)["frames"]
    for name, draw in figures.plan(params.load(), results, held, frames).items():
        for kind, data in figures.files(draw).items():
            artifact.publish(data, paths.FIGURES / f"{name}.{kind}")
    origin.write("figures", paths.FIGURES / origin.NAME, (paths.RESULTS, paths.ENCODER, paths.FRAMES))


if __name__ == "__main__":
    sys.exit(console.main(main))
