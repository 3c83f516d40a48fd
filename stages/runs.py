"""`python -m stages.runs MANIFEST`: publish the runs of a cell or of a variant from the store to data/."""

import json
import sys
from pathlib import Path

from mimo.record import artifact
from mimo.settings import params
from stages.base import console, paths, store


def main() -> None:
    """Copy every run that the manifest lists, verified."""
    if len(sys.argv) != 2:
        raise console.StageError("usage: python -m stages.runs MANIFEST")
    params.load()
    manifest = Path(sys.argv[1])
    for run in json.loads(manifest.read_text(encoding="utf-8")):
        name = f"{run['condition']}, {run['reward']}, seed {run['seed']}"
        remedy = f"run `dvc repro --force {'studies/dvc.yaml:vary' if run['variant'] else 'train'}`"
        target = paths.run(run["condition"], run["reward"], run["seed"], run["variant"])
        if not store.has(store.RUN, run["digest"], elsewhere=[target]):
            raise console.StageError(f"The run store lacks {name} of {manifest}; {remedy}.")
        stored = store.place(store.RUN, run["digest"])
        if artifact.content(stored) != run["content"]:
            raise console.StageError(f"{stored} is not the run that {manifest} lists; {remedy}.")
        artifact.copy(stored, target)


if __name__ == "__main__":
    sys.exit(console.main(main))
