"""Nothing is lost: the real pipeline, disturbed as it computes, goes on where it stopped and gives the same bytes."""

import os
import re
import shutil
import signal
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from tests.faults import harness
from tests.faults.conftest import Pipeline

STOPPED = "(?m)^Stopped; what was finished is kept.$"
Mount = Callable[[Path, str], Callable[[str], None]]

pytestmark = pytest.mark.timeout(600)


@pytest.fixture
def mount() -> Iterator[Mount]:
    """Mounts an empty file system of a given size until the test ends; returns what remounts it."""
    with ExitStack() as stack:

        def begin(folder: Path, size: str) -> Callable[[str], None]:
            try:
                return stack.enter_context(harness.tmpfs(folder, size))
            except PermissionError as fault:
                pytest.skip(f"nothing can be mounted here: {fault}")

        yield begin


# Workers, whose loss the sweep survives, and what stops it.


def test_lost_workers_then_ctrl_c_then_terminated(pipeline: Pipeline) -> None:
    """Workers that are killed, by `kill -9` and by the kernel as memory runs out, are replaced; a second repro is told.

    Ctrl-C, which a terminal sends to all, and `kill` stop the sweep; the next goes on where it stopped.
    """
    first = pipeline.start()
    kept = first.until_midway()
    first.workers()[0].kill()
    driver = first.driver()
    driver.suspend()  # so that the sweep surely outlives the second's attempt
    second = pipeline.start()
    assert second.end() != 0
    driver.resume()
    assert re.search(rf"\(PID {first.pid}\): .*repro", second.said), second.said
    assert "Traceback" not in second.said
    unlimited = ""
    try:
        with harness.memory_limit(2**19) as (move, killed):
            first.until(first.workers)
            move(first.workers()[0].pid)
            first.until(killed)
    except PermissionError as fault:
        unlimited = f"a worker was killed, but none runs out of memory: no control group can be made here: {fault}"
    assert kept.items() <= harness.finished(pipeline.project).items()
    kept = first.until_midway(more_than=len(harness.finished(pipeline.project)))
    os.killpg(first.pid, signal.SIGINT)
    kept = pipeline.stopped(first, STOPPED, kept)

    repro = pipeline.start()
    repro.until_midway(more_than=len(kept))
    assert f"{harness.RUNS} runs, {len(kept)} of them in the store." in repro.said
    repro.strike(signal.SIGTERM)
    kept = pipeline.stopped(repro, STOPPED, kept)
    pipeline.goes_on(kept)
    if unlimited:
        pytest.skip(unlimited)


# The driver, and `dvc repro` itself.


def test_a_driver_killed_as_it_writes_then_dvc_whose_orphan_the_next_waits_for(pipeline: Pipeline) -> None:
    """A run that is half-written bears a name of its own, and the next stage removes it; each whole one is noted."""
    noted = pipeline.project / ".work/provenance.jsonl"
    noted.unlink()
    repro = pipeline.start()
    kept = repro.until_midway()
    driver = repro.driver()
    repro.until(lambda: harness.parts(pipeline.project) or len(harness.finished(pipeline.project)) > len(kept))
    driver.kill()
    kept = pipeline.stopped(repro, "exited with (137|-9)", kept, but=harness.AGENTS)  # as the shell or DVC says it
    assert all(name.removesuffix(".h5") in noted.read_text() for name in kept)
    if not harness.parts(pipeline.project):  # it was done writing: leave what would else be left
        whole = (pipeline.runs / next(iter(kept))).read_bytes()
        part = pipeline.runs / f".{'0' * 64}.h5.0123456789abcdef.part"
        part.write_bytes(whole[: len(whole) // 2])
    for part in harness.parts(pipeline.project):
        os.utime(part, (0, 0))  # what is new may be another's, who uses the same store
    left = pipeline.project / "data/.scales.h5.0123456789abcdef.part"
    left.touch()

    first = pipeline.start()
    first.until_midway(more_than=len(kept))
    assert f"{harness.RUNS} runs, {len(kept)} of them in the store." in first.said
    assert not left.exists()
    driver = first.driver()
    driver.suspend()  # so that it surely outlives the start of the next
    first.strike(signal.SIGKILL)
    second = pipeline.start(workers=False)
    second.until(lambda: f"Waiting for process {driver.pid} (-m stages.train --workers 2)" in second.said)
    driver.resume()
    kept = pipeline.stopped(first, STOPPED, kept)
    pipeline.completes(second, kept)


# The disk: the driver alone writes to it, with workers or without.


def test_a_store_that_becomes_read_only(pipeline: Pipeline, mount: Mount) -> None:
    remount = mount(pipeline.runs, "1m")
    repro = pipeline.start(workers=False)
    kept = repro.until_some()
    remount("ro")
    kept = pipeline.stopped(repro, r"h5 could not be written \(Read-only file system\); free space or mend", kept)
    remount("rw")
    pipeline.goes_on(kept)


def test_a_read_only_folder_is_told_at_once(pipeline: Pipeline, mount: Mount) -> None:
    before = harness.digests(pipeline.project)
    mount(pipeline.project / ".work", "1m")("ro")
    pipeline.stopped(pipeline.start(), r"\.work/lock cannot be opened \(Read-only file system\); free space", {})
    assert harness.digests(pipeline.project) == before


def test_a_full_disk(pipeline: Pipeline, tmp_path: Path, mount: Mount) -> None:
    """All of the project lies on it, DVC's own files too."""
    mount(tmp_path / "disk", "64m")
    project = Path(shutil.copytree(pipeline.project, tmp_path / "disk/project"))
    small = Pipeline(project, pipeline.undisturbed)
    pipeline.started = small.started
    repro = small.start(workers=False)
    kept = repro.until_some()
    harness.fill(tmp_path / "disk/filler")
    kept = small.stopped(repro, "No space left on device", kept)
    (tmp_path / "disk/filler").unlink()
    small.goes_on(kept)


# What lies in the store.


def test_a_damaged_run_is_set_aside_and_computed_again_alone(computed: Pipeline) -> None:
    kept = harness.finished(computed.project)
    damaged = computed.runs / sorted(kept)[3]
    del kept[damaged.name]
    data = bytearray(damaged.read_bytes())
    data[len(data) // 2] ^= 1
    damaged.write_bytes(data)
    said = computed.goes_on(kept)
    assert f"It was set aside as .work/runs/{damaged.stem}.damaged and is computed again." in said
    assert damaged.with_suffix(".damaged").read_bytes() == data
