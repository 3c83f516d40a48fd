"""What stages at work say of themselves in the store, for `make watch`: a file each, which goes when they end."""

import json
import os
import platform
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path

import psutil  # type: ignore[import-untyped]

from stages.base import paths

EVERY = 1.0  # s between what is said


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


class Told:
    """This process's file. Whatever goes wrong with it is no fault: the work goes on."""

    def __init__(self) -> None:
        self._path = paths.progress() / f"{platform.node()}-{os.getpid()}.json"
        self._last = -EVERY

    def say(self, text: str) -> None:
        """How far it is; at most once in EVERY seconds."""
        if time.monotonic() - self._last < EVERY:
            return
        self._last = time.monotonic()
        word = Word(os.environ.get("DVC_STAGE", ""), str(Path.cwd()), text, time.time(), platform.node(), os.getpid())
        with suppress(OSError):
            self._path.parent.mkdir(parents=True, exist_ok=True)
            part = self._path.with_suffix(".part")
            part.write_text(json.dumps(asdict(word)), encoding="utf-8")
            part.replace(self._path)

    def end(self) -> None:
        """It has nothing more to say."""
        with suppress(OSError):
            self._path.unlink(missing_ok=True)


def words() -> Iterator[Word]:
    """What each process that is at work said last; of one that was killed, nothing."""
    for path in sorted(paths.progress().glob("*.json")):
        with suppress(OSError, ValueError, TypeError):
            word = Word(**json.loads(path.read_text(encoding="utf-8")))
            if word.node == platform.node() and not psutil.pid_exists(word.pid):
                path.unlink(missing_ok=True)
                continue
            yield word
