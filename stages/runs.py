"""`python -m stages.runs CONDITION REWARD`: publish a cell's runs from the store to data/runs/."""

import json
import sys

from mimo import artifact, params
from stages import console, paths, store


def main() -> None:
    """Copy every run that the cell's manifest lists, verified."""
    if len(sys.argv) != 3:
        raise console.StageError("usage: python -m stages.runs CONDITION REWARD")
    params.load()
    condition, reward = sys.argv[1:]
    listed = json.loads(paths.manifest(condition, reward).read_text())["runs"]
    for run in listed:
        target = paths.run(condition, reward, run["seed"])
        if not store.has(store.RUN, run["digest"], elsewhere=[target]):
            raise console.StageError(
                f"The run store lacks {condition}, {reward}, seed {run['seed']}; run `dvc repro --force train`."
            )
        stored = store.place(store.RUN, run["digest"])
        if artifact.content(stored) != run["content"]:
            raise console.StageError(
                f"{stored} is not the run that {condition}-{reward} lists; run `dvc repro --force train`."
            )
        artifact.copy(stored, target)


if __name__ == "__main__":
    sys.exit(console.main(main))
