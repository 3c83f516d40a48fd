"""Where a Ray of this machine's own keeps its sockets and logs: the first folder in which that can be."""

import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

from stages.base import console

LONGEST = 107  # bytes of a socket's path (Linux)
# What Ray adds; process IDs have at most seven digits.
BELOW = len("/session_2026-01-01_00-00-00_000000_0000000/sockets/plasma_store")
ROOM = 2**16  # bytes that it must take at the least
ELSEWHERE = ("/tmp", "/var/tmp", "/dev/shm")  # noqa: S108  # a folder of the user's own is made there


def found() -> Path:
    """A folder that is short enough and takes files: Ray's own choice, then others.

    Raises:
        console.StageError: there is none; it says what is wrong with each.
    """
    wrong = []
    for folder in _candidates():
        if fault := _fault(folder):
            wrong.append(f"{folder} {fault}")
        else:
            return folder
    raise console.StageError(
        f"Ray finds no folder to work in: {'; '.join(wrong)}. Mend one, or set RAY_TMPDIR to another, or use --serial."
    )


def _candidates() -> Iterator[Path]:
    for name in ("RAY_TMPDIR", "TMPDIR"):
        if own := os.environ.get(name):
            yield Path(own).absolute() / "ray"
    for place in ELSEWHERE:
        yield Path(place) / f"ray-{os.getuid()}"


def _fault(folder: Path) -> str:
    """What keeps Ray from working there, in words; empty if nothing does."""
    if len(os.fsencode(folder)) + BELOW > LONGEST:
        return f"is too long for sockets, which may have {LONGEST} bytes"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder) as probe:
            probe.write(bytes(ROOM))
            probe.flush()
    except OSError as fault:
        return f"takes no files ({fault.strerror})"
    return ""
