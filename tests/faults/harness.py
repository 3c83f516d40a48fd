"""A real `dvc repro` to be disturbed: its processes, what it keeps, mounts and a memory limit that end with a test."""

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import psutil  # type: ignore[import-untyped]
import yaml

from mimo.record import artifact
from stages.base import store
from tests.pipeline import project as small

RUNS = 10  # of the sweep, tiny ones
PATIENCE = 240.0  # seconds; the sweep takes 15 on two idle cores
ENDING = 60.0  # seconds that Ray's daemons may take to end
AGENTS = ("ray::DashboardAgent", "ray::RuntimeEnvAgent")  # of a raylet that was killed: idle, and gone after a minute
CGROUP = Path("/sys/fs/cgroup")


class Repro:
    """`dvc repro TARGETS` in a session of its own, by which all processes below it are known, even orphans.

    `within` is the command that runs it on another host, `also` what its environment has besides.
    """

    def __init__(
        self, project: Path, *targets: str, within: Sequence[str] = (), also: Mapping[str, str] | None = None
    ) -> None:
        self.project, self._log = project, project.parent / f"repro-{time.monotonic_ns()}.log"
        # A process started in the background may have inherited SIGINT as ignored: hence `env`. DVC runs a stage by
        # SHELL; Debian's sh, unlike bash, stays between the two.
        path = os.pathsep.join((str(Path(sys.executable).parent), os.environ["PATH"]))
        environment = os.environ | dict(also or {}) | {"PATH": path, "SHELL": "/bin/sh"}
        with self._log.open("wb") as log:
            self._process = subprocess.Popen(
                [*within, "env", "--default-signal=INT", sys.executable, "-m", "dvc", "repro", *targets],
                cwd=project, env=environment, stdin=subprocess.DEVNULL,
                stdout=log, stderr=log, start_new_session=True,
            )  # fmt: skip
        self.pid = self._process.pid

    @property
    def said(self) -> str:
        return self._log.read_text(errors="replace")

    def living(self) -> list[psutil.Process]:
        """Every process of the session that runs."""
        found = []
        for process in psutil.process_iter(["name"]):
            with suppress(psutil.Error, ProcessLookupError, PermissionError):
                if os.getsid(process.pid) == self.pid and process.status() != psutil.STATUS_ZOMBIE:
                    found.append(process)
        return found

    def named(self, *words: str) -> list[psutil.Process]:
        """Those of them whose command line has all the words."""
        found = []
        for process in self.living():
            with suppress(psutil.Error):
                if all(word in " ".join(process.cmdline()) for word in words):
                    found.append(process)
        return found

    def driver(self) -> psutil.Process:
        """The stage that runs the sweep; a shell may stand between it and `dvc`, with the same words."""
        (found,) = (process for process in self.named("-m stages.train") if "python" in Path(process.exe()).name)
        return found

    def workers(self) -> list[psutil.Process]:
        """Ray's workers that compute a run just now."""
        return self.named("ray::_compute")

    def until(self, reached: Callable[[], Any]) -> None:
        """Wait, while it runs."""
        wait(lambda: self._process.poll() is not None or reached(), lambda: self.said)
        assert self._process.poll() is None, self.said

    def until_midway(self, more_than: int = 0) -> dict[str, tuple[int, int]]:
        """Wait until more than so many runs are finished and another is computed; returns the finished ones."""
        self.until(lambda: len(finished(self.project)) > more_than and self.workers())
        found = finished(self.project)
        assert len(found) < RUNS
        return found

    def until_some(self) -> dict[str, tuple[int, int]]:
        """Likewise, where it has no workers: until some runs are finished, but not all."""
        self.until(lambda: finished(self.project))
        found = finished(self.project)
        assert len(found) < RUNS
        return found

    def end(self, but: Collection[str] = ()) -> int:
        """Wait until it and all below it have ended, but for processes of those names; returns its exit code."""
        code = self._process.wait(PATIENCE)
        began = time.monotonic()
        wait(
            lambda: {process.info["name"] for process in self.living()} <= set(but), lambda: str(self.living()), ENDING
        )
        print(f"exit code {code}, and {time.monotonic() - began:.1f} s later nothing was left below it")
        return code

    def strike(self, signum: signal.Signals) -> None:
        """End `dvc repro` alone; what it started is not told."""
        self._process.send_signal(signum)
        self._process.wait(PATIENCE)

    def kill(self) -> None:
        """End whatever is left of it."""
        for process in self.living():
            with suppress(psutil.Error):
                process.kill()
        self._process.wait(ENDING)


def wait(reached: Callable[[], Any], otherwise: Callable[[], str], seconds: float = PATIENCE) -> None:
    """Until `reached`; if that takes too long, the test fails with what `otherwise` says."""
    end = time.monotonic() + seconds
    while not reached():
        assert time.monotonic() < end, otherwise()
        time.sleep(0.02)


def forget(project: Path) -> None:
    """As if train had never run, but for the store: neither data/ nor dvc.lock nor DVC's run cache knows of it."""
    for folder in ("data/runs", "data/manifests"):
        shutil.rmtree(project / folder)
    for known in (project / ".dvc/cache/runs").glob("*/*/*"):
        if "stages.train" in known.read_text():
            shutil.rmtree(known.parent)
    lock = project / "dvc.lock"
    whole = yaml.load(lock.read_text(), yaml.CSafeLoader)
    del whole["stages"]["train"]
    lock.write_text(yaml.dump(whole, Dumper=yaml.CSafeDumper, sort_keys=False))


def digests(project: Path) -> dict[str, str]:
    """SHA-256 of every file of data/ and of the store's runs, but for damaged ones that were set aside."""
    found = small.digests(project, "data", ".work/runs")
    return {name: digest for name, digest in found.items() if not name.endswith(".damaged")}


def finished(project: Path) -> dict[str, tuple[int, int]]:
    """Each finished run in the store, with what changes when it is written again."""
    found = {}
    for path in (project / ".work/runs").glob("*.h5"):
        if not path.name.startswith("."):
            about = path.stat()
            found[path.name] = (about.st_ino, about.st_mtime_ns)
    return found


def parts(project: Path) -> list[Path]:
    """What a killed process left half-written, under a name of its own."""
    return [path for folder in ("data", ".work", "reports") for path in (project / folder).rglob(".*.part")]


def assert_whole(project: Path) -> None:
    """No file bears a final name and is not whole."""
    for path in (project / ".work/runs").glob("*.h5"):
        if not path.name.startswith("."):
            artifact.read(path, store.RUN, path.stem)
    for path in (project / "data/runs").rglob("seed-*.h5"):
        artifact.read(path, store.RUN)


@contextmanager
def tmpfs(folder: Path, size: str) -> Iterator[Callable[[str], None]]:
    """A file system of that size at `folder`; yields what remounts it with other options.

    Raises:
        PermissionError: this process may not mount.
    """
    folder.mkdir(parents=True, exist_ok=True)
    command = ["mount", "-t", "tmpfs", "-o", f"size={size}", "faults", str(folder)]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        raise PermissionError(done.stderr.strip())

    def remount(options: str) -> None:
        subprocess.run(["mount", "-o", f"remount,{options}", str(folder)], check=True)

    try:
        yield remount
    finally:
        subprocess.run(["umount", "--lazy", str(folder)], check=True)


def fill(file: Path) -> None:
    """Write until the disk takes no more."""
    with file.open("wb", buffering=0) as opened, suppress(OSError):
        while opened.write(b"\0" * 4096):
            pass


@contextmanager
def memory_limit(size: int) -> Iterator[tuple[Callable[[int], None], Callable[[], int]]]:
    """A control group of `size` bytes; yields what moves a process there, and how many the kernel killed in it.

    Raises:
        PermissionError: this process may not make one.
    """
    first = (CGROUP / "memory/memory.limit_in_bytes").exists()
    group = (CGROUP / "memory" if first else CGROUP) / f"faults-{os.getpid()}"
    try:
        group.mkdir()
    except OSError as fault:
        raise PermissionError(str(fault)) from fault
    try:
        limit, events = ("memory.limit_in_bytes", "memory.oom_control") if first else ("memory.max", "memory.events")
        if not (group / limit).exists():
            raise PermissionError(f"{group} has no {limit}")
        (group / limit).write_text(str(size))
        if not first:
            (group / "memory.swap.max").write_text("0")

        def killed() -> int:
            lines = (line.split() for line in (group / events).read_text().splitlines())
            return int(dict(lines).get("oom_kill", 0))

        def move(pid: int) -> None:
            (group / "cgroup.procs").write_text(str(pid))

        yield move, killed
    finally:
        wait(lambda: not (group / "cgroup.procs").read_text(), lambda: f"{group} is not empty", ENDING)
        group.rmdir()
