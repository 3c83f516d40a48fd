"""The store: finished artifacts by the digest of their inputs, outside DVC and git, so that nothing is computed twice.

An artifact enters whole, by os.replace, so that several processes may use one store at once. One that does not verify
is set aside and computed again.
"""

import sys
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

from mimo.record import artifact
from stages.base import paths, provenance

# Kinds of artifact, as their schemas call them.
FRAME, ENCODER, REST, SCALE, EFFECT = "frame", "encoder", "rest", "scale", "effect"
RUN, RESULTS, STUDY = "run", "results", "study"


def sight(held: artifact.Artifact) -> str:
    """What runs and scales read of the encoder, as a hash: weights and latent, not how well they measured."""
    return artifact.part(held, "weights/", "latent/")


def place(schema: str, digest: str) -> Path:
    """Where the artifact of that schema and digest lies, or would."""
    return paths.store() / f"{schema}s" / f"{digest}.h5"


def has(schema: str, digest: str, elsewhere: Iterable[Path] = ()) -> bool:
    """Whether the store holds the artifact, and it verifies; taken in from `elsewhere` if it is found there."""
    path = place(schema, digest)
    if path.exists():
        try:
            artifact.read(path, schema, digest)
            return True
        except artifact.ArtifactError as fault:
            aside = path.with_suffix(".damaged")
            with suppress(FileNotFoundError):  # another process was first
                path.replace(aside)
            with suppress(artifact.ArtifactError):  # or has put a good one in its place meanwhile
                artifact.read(aside, schema, digest)
                aside.replace(path)
                return True
            print(f"{fault} It was set aside as {aside} and is computed again.", file=sys.stderr)
    for other in elsewhere:
        if other.exists():
            try:
                artifact.read(other, schema, digest)
            except artifact.ArtifactError:
                continue
            artifact.copy(other, path)
            return True
    return False


def keep(schema: str, digest: str, data: bytes, machine: dict[str, Any] | None = None) -> None:
    """Take in the file of an artifact that was just computed, on that machine or (None) on this one."""
    provenance.note(
        schema, digest, machine
    )  # first: a note too many does no harm, an artifact without one cannot be published
    artifact.publish(data, place(schema, digest))


def publish(schema: str, digest: str, target: Path, make: Callable[[], bytes]) -> bool:
    """Put the artifact at `target`, from the store or else as `make` gives its file; True if it was made."""
    made = not has(schema, digest)
    if made:
        keep(schema, digest, make())
    artifact.copy(place(schema, digest), target)
    return made
