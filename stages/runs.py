"""`python -m stages.runs MANIFEST`: publish the runs of a cell or of a variant from the store to data/."""

import json
import sys
from pathlib import Path
from typing import Any

from mimo.record import artifact
from mimo.settings import params
from stages.base import console, paths, store


def main() -> None:
    """Copy every run that the manifest lists, verified."""
    if len(sys.argv) != 2:
        raise console.StageError("usage: python -m stages.runs MANIFEST")
    params.load()
    manifest = Path(sys.argv[1])
    listed = json.loads(manifest.read_text(encoding="utf-8"))
    targets = [paths.run(run["condition"], run["reward"], run["seed"], run["variant"]) for run in listed]
    lacking = sum(
        not store.has(store.RUN, run["digest"], elsewhere=[target]) for run, target in zip(listed, targets, strict=True)
    )
    if lacking:
        raise console.StageError(f"The store lacks {lacking} of {len(listed)} runs of {manifest}; {_remedy(listed)}")
    for run, target in zip(listed, targets, strict=True):
        stored = store.place(store.RUN, run["digest"])
        if artifact.content(stored) != run["content"]:
            raise console.StageError(f"{stored} is not the run that {manifest} lists; {_remedy(listed)}")
        artifact.copy(stored, target)


def _remedy(listed: list[dict[str, Any]]) -> str:
    """What costs least: to get the runs, or to compute them alone and nothing that they are made from."""
    pipeline, own = "dvc.yaml", "train runs"
    if listed[0]["variant"]:
        pipeline, own = "studies/dvc.yaml", "studies/dvc.yaml:vary studies/dvc.yaml:variants"
    return (
        f"get them by `make fetch` or `dvc repro --pull {pipeline}`, or compute them, and nothing else that is "
        f"missing, by `dvc repro --single-item --force {own}`."
    )


if __name__ == "__main__":
    sys.exit(console.main(main))
