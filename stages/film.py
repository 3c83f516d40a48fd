"""`python -m stages.film CONDITION`: reports/film/CONDITION.mp4, with a poster (.png) and its origin (.json)."""

import argparse
import sys

from mimo.record import artifact
from mimo.settings import params
from mimo.vision import extractor
from stages.base import console, origin, paths, store
from stages.drawing import film


def main() -> None:
    """Repeat, compare, draw, publish."""
    condition = _options().condition
    p = params.load()
    run = artifact.read(paths.RUNS / condition / f"{p.film.run}.h5", store.RUN)
    pictures, poster = film.filmed(p, run, extractor.load(artifact.read(paths.ENCODER, store.ENCODER)))
    artifact.publish(pictures, paths.FILMS / f"{condition}.mp4")
    artifact.publish(poster, paths.FILMS / f"{condition}.png")
    origin.write(f"film@{condition}", paths.FILMS / f"{condition}.json", (run.path, paths.ENCODER))


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m stages.film", description=__doc__)
    parser.add_argument("condition", choices=params.Conditions.model_fields, help="whose run")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(console.main(main))
