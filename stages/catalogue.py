"""`python -m stages.catalogue [studies]`: every published artifact with its hashes, each verified.

The paper's in reports/artifacts.json, or those of the studies in reports/studies/artifacts.json.
"""

import json
import sys
from pathlib import Path

from mimo.record import artifact
from mimo.settings import params
from stages.base import console, paths, store

PAPER = {
    paths.FRAMES: store.FRAME,
    paths.ENCODER: store.ENCODER,
    paths.TRIAL: store.ENCODER,
    paths.SCALES: store.SCALE,
    paths.RESULTS: store.RESULTS,
}

Published = dict[Path, dict[str, str]]  # schema, digest and content hash by path


def main() -> None:
    """Read every artifact and list it."""
    params.load()
    if sys.argv[1:] == ["studies"]:
        curves = dict.fromkeys(sorted(paths.study("*").parent.glob("*.h5")), store.STUDY)
        encoders = dict.fromkeys(sorted(paths.VARIANTS.glob("*/*/encoder.h5")), store.ENCODER)
        write(curves | encoders, paths.VARIANTS, paths.STUDIES_ARTIFACTS)
    else:
        write(PAPER, paths.RUNS, paths.ARTIFACTS)


def write(single: dict[Path, str], runs: Path, target: Path) -> None:
    """List the artifacts of `single`, schemas by path, and all runs below a folder."""
    listed = {}
    for path, schema in (single | dict.fromkeys(sorted(runs.rglob("seed-*.h5")), store.RUN)).items():
        held = artifact.read(path, schema)
        listed[path.as_posix()] = {"schema": schema, "digest": held.digest, "content": held.content}
    artifact.publish(f"{json.dumps(listed, indent=1)}\n".encode(), target)


def published(text: str) -> Published:
    """From the text of such a list."""
    return {Path(path): entry for path, entry in json.loads(text).items()}


if __name__ == "__main__":
    sys.exit(console.main(main))
