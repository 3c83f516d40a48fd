"""`python -m stages.catalogue`: reports/artifacts.json, every published artifact with its hashes, each verified."""

import json
import sys
from pathlib import Path

from mimo.record import artifact
from mimo.settings import params
from stages.base import console, paths, store

ENCODER = "encoder"  # schema, as mimo.vision.encoder names it; that loads torch
SINGLE = {
    paths.FRAMES: store.FRAME,
    paths.ENCODER: ENCODER,
    paths.TRIAL: ENCODER,
    paths.SCALES: store.SCALE,
    paths.RESULTS: store.RESULTS,
    paths.VARIANT_RESULTS: store.VARIANTS,
}

Published = dict[Path, dict[str, str]]  # schema, digest and content hash by path


def main() -> None:
    """Read every artifact under data/ and list it."""
    params.load()
    expected = SINGLE | {path: store.RUN for top in (paths.RUNS, paths.VARIANTS) for path in sorted(top.rglob("*.h5"))}
    listed = {}
    for path, schema in expected.items():
        held = artifact.read(path, schema)
        listed[path.as_posix()] = {"schema": schema, "digest": held.digest, "content": held.content}
    artifact.publish(f"{json.dumps(listed, indent=1)}\n".encode(), paths.ARTIFACTS)


def published(text: str) -> Published:
    """From the text of reports/artifacts.json."""
    return {Path(path): entry for path, entry in json.loads(text).items()}


if __name__ == "__main__":
    sys.exit(console.main(main))
