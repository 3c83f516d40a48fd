"""How a stage runs: alone in its folder, with one progress bar, and faults as sentences with the traceback in a log."""

import atexit
import ctypes
import errno
import fcntl
import gc
import os
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType, TracebackType

import psutil  # type: ignore[import-untyped]
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn
from rich.progress import Progress as Bar

from mimo.settings.errors import Fault
from stages.base import paths, watched

LINE_SECONDS = 30  # between lines where there is no terminal
MEND = "free space or mend permissions, then run again"
STOPPED = "Stopped; what was finished is kept."
REFUSALS = {errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EACCES, errno.EIO}  # of a disk
OLD = 600  # s after which nobody writes at a file any more
WATCH_SECONDS = 0.25  # between looks whether `dvc repro` still runs


class StageError(Fault):
    """A stage cannot go on; the message is for people."""


def main(work: Callable[[], None]) -> int:
    """Run a stage; the exit code is 0 if it succeeded.

    Known faults are printed as they are; an unknown one as a sentence, its traceback in paths.log(), which has all.
    SIGINT and SIGTERM end the stage in good order, and so does the end of the `dvc repro` that started it, by whatever
    cause.
    """
    atexit.register(gc.freeze)  # else Python looks through all of torch for garbage before it ends, for a second
    signal.signal(signal.SIGTERM, _stop)
    if STARTER:
        threading.Thread(target=_end_with, args=(STARTER,), daemon=True).start()
    try:
        with alone(), watched.at_work():
            work()
    except Fault as fault:
        print(fault, file=sys.stderr)
        _logged(str(fault))
        return 1
    except KeyboardInterrupt:
        print(STOPPED, file=sys.stderr)
        return 130
    except Exception as fault:
        print(f"{_sentence(fault)}{_logged(traceback.format_exc())}", file=sys.stderr)
        return 1
    return 0


@contextmanager
def alone() -> Iterator[None]:
    """One stage at a time in one folder: another waits for it to end, as a lost `dvc repro` may have left one.

    The lock goes with its process, however that ends. Under it, what a killed process left half-written is removed.

    Raises:
        StageError: the lock cannot be had, since the folder takes no file.
    """
    try:
        paths.store().mkdir(parents=True, exist_ok=True)
        paths.LOCK.parent.mkdir(exist_ok=True)
        file = paths.LOCK.open("a+", encoding="utf-8", errors="replace")
    except OSError as fault:
        raise StageError(f"{fault.filename or paths.LOCK} cannot be opened ({fault.strerror}); {MEND}.") from fault
    with file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            file.seek(0)
            holder = file.read().strip() or "another process"
            print(
                f"Waiting for {holder}, which works in this folder; end that one if it is not wanted.", file=sys.stderr
            )
            fcntl.flock(file, fcntl.LOCK_EX)
        with suppress(OSError):  # a full disk: whoever waits then reads of another process
            os.ftruncate(file.fileno(), 0)
            os.write(file.fileno(), f"process {os.getpid()} ({' '.join(sys.orig_argv[1:])[:80]})".encode())
        _drop_parts()
        yield


def _drop_parts() -> None:
    """Remove what artifact.publish was writing when its process was killed.

    In the store, which others may use at this moment, only what is OLD; `.work` may hold other projects, deeper.
    """
    left = [part for folder in (paths.FRAMES.parent, paths.REPORT.parent) for part in folder.rglob(".*.part")]
    for part in paths.store().glob("*/.*.part"):
        with suppress(FileNotFoundError):
            left += [part] if time.time() - part.stat().st_mtime > OLD else []
    for part in left:
        part.unlink(missing_ok=True)


def _stop(signum: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt


def die_with_parent(parent: int | None = None) -> None:
    """Have the kernel kill this process when the one that started it is gone (Linux); at once if `parent` is already.

    Args:
        parent: the process that started this one, where that is known.
    """
    if sys.platform == "linux":
        death = 1  # PR_SET_PDEATHSIG of prctl(2)
        ctypes.CDLL(None).prctl(death, signal.SIGKILL)
    if parent is not None and os.getppid() != parent:
        os._exit(1)


def _starter() -> psutil.Process | None:
    """The `dvc` that runs this stage: the nearest ancestor without its DVC_STAGE, as a shell may stand between."""
    stage = os.environ.get("DVC_STAGE")
    if stage:
        with suppress(psutil.Error):
            for process in psutil.Process().parents():
                if process.environ().get("DVC_STAGE") != stage:
                    return process
    return None


STARTER = _starter()  # early: seconds of imports follow, in which it may be lost


def _end_with(starter: psutil.Process) -> None:
    """Stop this stage in good order when its `dvc` is gone, however that ended."""
    with suppress(psutil.Error):
        while starter.is_running() and starter.status() != psutil.STATUS_ZOMBIE:
            time.sleep(WATCH_SECONDS)
    signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGTERM)


def _uncaught(kind: type[BaseException], value: BaseException, trace: TracebackType | None) -> None:
    """Before `main`, while modules are imported: Ctrl-C is no fault either, and a Fault is a sentence."""
    if issubclass(kind, KeyboardInterrupt | Fault):
        print(STOPPED if kind is KeyboardInterrupt else value, file=sys.stderr)
    else:
        sys.__excepthook__(kind, value, trace)


sys.excepthook = _uncaught
for _stream in (sys.stdout, sys.stderr):
    if hasattr(_stream, "reconfigure"):
        _stream.reconfigure(errors="replace")  # where the user's locale has no such letter


def _sentence(fault: Exception) -> str:
    """What happened, and what to do where the disk is at fault."""
    if isinstance(fault, OSError) and fault.errno in REFUSALS:
        return f"{fault.filename or 'The disk'} takes no more ({fault.strerror}); {MEND}"
    return f"{type(fault).__name__}: {fault}"


def _logged(text: str) -> str:
    """Write what went wrong to paths.log(); where, in words, or nothing if even that cannot be written."""
    try:
        log = paths.log()
        log.parent.mkdir(parents=True, exist_ok=True)
        with log.open("a", encoding="utf-8") as file:
            file.write(f"{Path.cwd()}: {text.rstrip()}\n")
    except (OSError, Fault):
        return ""
    return f" (see {log})"


class Progress:
    """A bar with rate and ETA on a terminal; in a log, a line every LINE_SECONDS; and for `make watch` a file.

    Args:
        what: name of the work.
        total: units of work.
        unit: what is counted, in the plural.
    """

    def __init__(self, what: str, total: int, unit: str) -> None:
        self._what, self._total, self._unit = what, total, unit
        self._start = self._said = time.monotonic()
        self._console = Console(stderr=True)
        self._bar = Bar(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn(unit),
            TimeElapsedColumn(),
            TextColumn("{task.fields[note]}"),
            console=self._console,
            disable=not self._console.is_terminal,
        )
        self._task = self._bar.add_task(what, total=total, note="")
        self.done = 0

    def __enter__(self) -> "Progress":
        self._bar.start()
        watched.say(self._text(), now=True)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()
        watched.say(watched.BEGUN, now=True)
        if not self._console.is_terminal and kind is None:
            print(self._text(), file=sys.stderr, flush=True)

    def update(self, done: int, note: str = "") -> None:
        """Set the units done."""
        self.done = done
        text = ", ".join(part for part in (note, self._rate()) if part)
        self._bar.update(self._task, completed=done, note=text)
        watched.say(self._text(note))
        now = time.monotonic()
        if not self._console.is_terminal and now - self._said > LINE_SECONDS:
            self._said = now
            print(self._text(note), file=sys.stderr, flush=True)

    def _text(self, note: str = "") -> str:
        parts = (f"{self._what}: {self.done}/{self._total} {self._unit}", note, self._rate())
        return ", ".join(part for part in parts if part)

    def _rate(self) -> str:
        seconds = time.monotonic() - self._start
        if not self.done or seconds <= 0:
            return ""
        rate = self.done / seconds
        left = max(0.0, (self._total - self.done) / rate)
        return f"{rate:.0f}/s, {f'{left // 60:.0f} min {left % 60:.0f} s left' if left else f'{seconds:.0f} s'}"
