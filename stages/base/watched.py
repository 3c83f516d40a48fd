"""What stages at work say of themselves in the store, for `make watch`: a file each, which goes when they end."""

import json
import os
import platform
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path

import psutil  # type: ignore[import-untyped]

from mimo.record import artifact
from stages.base import paths

EVERY = 1.0  # s between what is said
FORGOTTEN = 86400.0  # s of another machine's silence
BEGUN = "at work"
_here: list[Path] = []  # this process's file, while it is at work
_last = [0.0]  # when it last said something, on time.monotonic's clock


@dataclass(frozen=True)
class Word:
    """What a process said last.

    Attributes:
        stage: as DVC calls it; empty for a command of its own.
        folder: in which it works.
        text: how far it is.
        at: when it said so, s since 1970.
        node: its machine.
        pid: its process.
    """

    stage: str
    folder: str
    text: str
    at: float
    node: str
    pid: int

    def silent(self) -> float:
        """For how long it has said nothing, s."""
        return max(0.0, time.time() - self.at)


@contextmanager
def at_work() -> Iterator[None]:
    """Say that this process is at work, until the end of the block. What goes wrong with the file stops no work."""
    _here.append(paths.progress() / f"{platform.node()}-{os.getpid()}.json")
    try:
        say(BEGUN, now=True)
        yield
    finally:
        with suppress(OSError):
            _here.pop().unlink(missing_ok=True)


def say(text: str, now: bool = False) -> None:
    """How far this process is, if it is at work; at most once in EVERY seconds, unless it must be `now`."""
    if not _here or (time.monotonic() - _last[0] < EVERY and not now):
        return
    _last[0] = time.monotonic()
    word = Word(os.environ.get("DVC_STAGE", ""), str(Path.cwd()), text, time.time(), platform.node(), os.getpid())
    with suppress(artifact.ArtifactError):
        artifact.publish(json.dumps(asdict(word)).encode(), _here[-1])


def words() -> Iterator[Word]:
    """What each process that is at work said last; of one that was killed, nothing."""
    for path in sorted(paths.progress().glob("*.json")):
        with suppress(OSError, ValueError, TypeError):
            word = Word(**json.loads(path.read_text(encoding="utf-8")))
            if _gone(word):
                path.unlink(missing_ok=True)
            else:
                yield word


def _gone(word: Word) -> bool:
    if word.node != platform.node():
        return word.silent() > FORGOTTEN
    try:
        return bool(psutil.Process(word.pid).create_time() > word.at)  # another has its number now
    except psutil.NoSuchProcess:
        return True
