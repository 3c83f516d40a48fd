"""`python -m stages.runs MANIFEST`: publish the runs of a cell from the store to data/.

MANIFEST may be a study's folder: then the runs of all its variants, and the encoders that are theirs alone.
"""

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
    study = manifest.name if manifest.is_dir() else ""
    wanted = [  # schema, place, digest and content of each
        (store.RUN, paths.run(run["condition"], run["reward"], run["seed"], run["variant"]), run)
        for file in (sorted(manifest.rglob("*.json")) if study else [manifest])
        if file != paths.variant_encoders(study)
        for run in json.loads(file.read_text(encoding="utf-8"))
    ]
    if study:
        own = json.loads(paths.variant_encoders(study).read_text(encoding="utf-8"))
        wanted += [(store.ENCODER, paths.variant_encoder(name), made) for name, made in own.items()]
    lacking = sum(not store.has(schema, made["digest"], elsewhere=[target]) for schema, target, made in wanted)
    if lacking:
        said = f"The store lacks {lacking} of {len(wanted)} artifacts of {manifest}"
        raise console.StageError(f"{said}; {_remedy(study)}")
    for schema, target, made in wanted:
        stored = store.place(schema, made["digest"])
        if artifact.content(stored) != made["content"]:
            raise console.StageError(f"{stored} is not what {manifest} lists; {_remedy(study)}")
        artifact.copy(stored, target)


def _remedy(study: str) -> str:
    """What costs least: to get the runs, or to compute them alone and nothing that they are made from."""
    pipeline, own = "dvc.yaml", "train runs"
    if study:
        pipeline, own = "studies/dvc.yaml", f"studies/dvc.yaml:vary@{study} studies/dvc.yaml:variants@{study}"
    return (
        f"get them by `make fetch` or `dvc repro --pull {pipeline}`, or compute them, and nothing else that is "
        f"missing, by `dvc repro --single-item --force {own}`."
    )


if __name__ == "__main__":
    sys.exit(console.main(main))
