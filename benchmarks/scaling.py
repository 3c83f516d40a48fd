"""`make scaling`: how a sweep scales, from 1 to 1,000 workers and from 140 to 14,000 runs.

The scheduler is the real one (stages.sweep.sweep.drive): it hands out chunks, takes their files, and writes each into a
store on disk, with its fsync. The workers are simulated on a clock of their own, in which a chunk takes as long as one
was recorded to take (`--record` writes run_lengths.json), and all that the driver does takes as long as it does here.
Ray's own work is not in it.

Efficiency is the least time that any schedule could need, over the time that this one did. The least time is the
largest of: all work, at the price of full chunks, over the workers; the longest run alone; and, where there are more
runs than workers, the least that runs take which must share one.

Then, at the largest sweep: writing manifests, computing digests, DVC's hashing of the runs.
"""

import argparse
import heapq
import json
import os
import subprocess
import sys
import tempfile
import time
from collections import deque
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import psutil  # type: ignore[import-untyped]

from benchmarks.agent_step import untrained
from mimo.learning.experiment import Experiment
from mimo.learning.rewards import REWARDS
from mimo.record import artifact
from mimo.settings import params
from mimo.world import protocol
from stages.base import console, store
from stages.sweep import crew, sweep
from stages.sweep.schedule import Chunk, Run, Schedule

LENGTHS = Path(__file__).with_name("run_lengths.json")
WORKERS = (1, 2, 10, 100, 1000)
SEEDS = (10, 100, 1000)  # of each of the paper's 14 cells
STEPS = 40  # agent steps timed for a record
MIB = 2**20


def main() -> None:
    """Record, or simulate and print a table in Markdown."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--record", action="store_true", help="time chunks here, anew, instead")
    options = parser.parse_args()
    p = params.load()
    if options.record:
        LENGTHS.write_text(json.dumps(record(p), indent=1) + "\n")
        return
    lengths = json.loads(LENGTHS.read_text())
    file = a_run()
    print("| runs | workers | least | takes | efficiency | chunks | driver busy | driver's memory |")
    print("|---:|---:|---:|---:|---:|---:|---:|---:|")
    for seeds in SEEDS:
        runs = paper_runs(p, seeds)
        for workers in WORKERS:
            print(row(p, runs, workers, lengths, file), flush=True)
    print()
    for what, seconds in at_the_largest(p, file).items():
        print(f"- {what}: {seconds:.1f} s")


def record(p: params.Params) -> dict[str, dict[str, float]]:
    """Seconds of a whole chunk, by reward and number of runs; on one core, in noise."""
    found: dict[str, dict[str, float]] = {}
    steps = {"baseline_steps": STEPS // 4, "attached_steps": STEPS // 2, "extinction_steps": STEPS // 4}
    short = p.model_copy(update={"protocol": p.protocol.model_copy(update=steps)})
    for reward in p.sweep.rewards:
        for size in (1, p.sweep.chunk):
            began = time.perf_counter()
            scales = dict.fromkeys(REWARDS, 1.0)
            chunk = Experiment(short, "noisy", reward, range(size), untrained(p.encoder), scales)
            built = time.perf_counter()
            chunk.run(lambda steps: None)
            ran = time.perf_counter() - built
            whole = built - began + ran * protocol.steps(p.protocol) / STEPS
            found.setdefault(reward, {})[str(size)] = round(whole, 2)
    return found


def seconds_of(lengths: Mapping[str, Mapping[str, float]], reward: str, size: int) -> float:
    """How long a chunk takes: the records, and a straight line between them."""
    known = {int(number): seconds for number, seconds in lengths[reward].items()}
    return float(np.interp(size, sorted(known), [known[number] for number in sorted(known)]))


def paper_runs(p: params.Params, seeds: int) -> list[Run]:
    """The paper's cells with so many seeds; the digests are numbers."""
    cells = [(condition, reward) for condition in p.sweep.conditions for reward in p.sweep.rewards]
    return [
        Run(condition, reward, seed, f"{number:03d}{seed:061d}")
        for number, (condition, reward) in enumerate(cells)
        for seed in range(seeds)
    ]


def a_run() -> bytes:
    """A file of a run's size that does not compress away."""
    drawn = np.random.default_rng(0).random((2500, 12))
    data = {f"{i}": artifact.Dataset(drawn.astype(np.float32), "1", "step, joint") for i in range(3)}
    return artifact.to_bytes(store.RUN, "0" * 64, data)


class _Simulated:
    """A crew on a clock of its own, to which the time that the driver really takes is added."""

    def __init__(self, workers: int, seconds: Callable[[Chunk], float], file: bytes) -> None:
        self.clock, self.busy, self.chunks, self.memory = 0.0, 0.0, 0, 0
        self._workers, self._seconds, self._file = workers, seconds, file
        self._free = workers
        self._queue: deque[Chunk] = deque()
        self._flying: list[tuple[float, int, Chunk]] = []
        self._last = time.perf_counter()

    def workers(self) -> int:
        return self._workers

    def room(self) -> int:
        return crew.room(self._workers)

    def share(self, value: Any) -> Any:
        return value

    def start(self, name: str, function: Callable[..., Any], *given: Any) -> None:
        self._tick()
        self._queue.append(given[-1])
        self.chunks += 1
        if self._free:
            self._free -= 1
            self._begin(self.clock)

    def ended(self) -> list[tuple[str, crew.Done | Exception]]:
        self._tick()
        self.memory = max(self.memory, psutil.Process().memory_info().rss)
        self.clock = max(self.clock, self._flying[0][0])
        found: list[tuple[str, crew.Done | Exception]] = []
        while self._flying and self._flying[0][0] <= self.clock:
            end, _, chunk = heapq.heappop(self._flying)
            found.append((chunk.name, crew.Done([self._file] * len(chunk.runs))))
            if self._queue:
                self._begin(end)  # Ray hands out what waits, without the driver
            else:
                self._free += 1
        self._last = time.perf_counter()
        return found

    def _begin(self, when: float) -> None:
        chunk = self._queue.popleft()
        heapq.heappush(self._flying, (when + self._seconds(chunk), self.chunks, chunk))

    def _tick(self) -> None:
        """The driver has been at work since it was last here."""
        now = time.perf_counter()
        self.clock += now - self._last
        self.busy += now - self._last
        self._last = now


def row(p: params.Params, runs: list[Run], workers: int, lengths: Mapping[str, Any], file: bytes) -> str:
    """One simulated sweep."""
    before = psutil.Process().memory_info().rss
    with tempfile.TemporaryDirectory(dir=".") as folder:
        os.chdir(folder)
        try:
            team = _Simulated(workers, lambda c: seconds_of(lengths, c.runs[0].reward, len(c.runs)), file)
            job = {"": sweep.Grid(p, {}, b"", 1.0, (), range(0))}
            tally = sweep.Tally(job, len(runs), Silent())
            failed = sweep.drive(job, Schedule(runs, p.sweep.chunk), team, tally)
            assert not failed
            assert len(list(Path(".work/runs").iterdir())) == len(runs)
        finally:
            os.chdir("..")
    least = least_time(runs, workers, lengths, p.sweep.chunk)
    cells = (
        f"{len(runs):,}", f"{workers:,}", duration(least), duration(team.clock), f"{least / team.clock:.2f}",
        f"{team.chunks:,}", f"{team.busy / team.clock:.1%}", f"{(team.memory - before) / MIB:+.0f} MiB",
    )  # fmt: skip
    return f"| {' | '.join(cells)} |"


class Silent(console.Progress):
    """No bar: its lines would stand in the table."""

    def __init__(self) -> None:
        super().__init__("Runs", 1, "agent steps")

    def update(self, done: int, note: str = "") -> None:
        """Nothing."""


def least_time(runs: list[Run], workers: int, lengths: Mapping[str, Any], size: int) -> float:
    """Seconds that any schedule needs at least."""

    @cache
    def shares(together: int) -> list[float]:
        """Of each run, the longest first, where so many train in lock step."""
        return sorted((seconds_of(lengths, run.reward, together) / together for run in runs), reverse=True)

    bounds = [sum(shares(size)) / workers, shares(1)[0]]
    # Of the first k * workers + 1 runs, some worker has k + 1, at best the shortest of them, and in lock step.
    return max(
        bounds
        + [
            sum(shares(min(k + 1, size))[k * workers - k : k * workers + 1])
            for k in range(1, 1 + (len(runs) - 1) // workers)
        ]
    )


def duration(seconds: float) -> str:
    """For people."""
    for size, unit in ((3600, "h"), (60, "min")):
        if seconds >= 10 * size:
            return f"{seconds / size:.0f} {unit}"
    return f"{seconds:.0f} s"


def at_the_largest(p: params.Params, file: bytes) -> dict[str, float]:
    """Seconds of what else grows with the runs."""
    runs = paper_runs(p, SEEDS[-1])
    found = {}
    wide = p.model_copy(update={"sweep": p.sweep.model_copy(update={"seeds": SEEDS[-1]})})
    cells = tuple({(run.condition, run.reward) for run in runs})
    own = sweep.Grid(wide, dict.fromkeys(REWARDS, 1.0), b"", 1.0, cells, range(SEEDS[-1]))

    def timed(what: str, work: Callable[[], object]) -> None:
        began = time.perf_counter()
        work()
        found[f"{what} of {len(runs):,} runs"] = time.perf_counter() - began

    def digests() -> None:
        for cell in own.cells:
            sweep.runs_of(own, "0" * 64, "", *cell, own.seeds)

    def manifests() -> None:
        for cell in own.cells:
            sweep.write_manifest(
                Path(f"manifests/{'-'.join(cell)}.json"), [run for run in runs if (run.condition, run.reward) == cell]
            )

    timed("digests", digests)
    with tempfile.TemporaryDirectory(dir=".") as folder:
        os.chdir(folder)
        try:
            for run in runs:
                path = store.place(store.RUN, run.digest)
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(file)
            timed("manifests", manifests)
            dvc = [sys.executable, "-m", "dvc"]
            subprocess.run([*dvc, "init", "-q", "--no-scm"], check=True)
            for run in runs:  # unlike the others, or DVC would store but one
                own_file = Path("data") / run.condition / run.reward / f"{run.seed}.h5"
                own_file.parent.mkdir(parents=True, exist_ok=True)
                own_file.write_bytes(file + run.digest.encode())
            timed("DVC's hashing", lambda: subprocess.run([*dvc, "add", "-q", "--no-commit", "data"], check=True))
        finally:
            os.chdir("..")
    return found


if __name__ == "__main__":
    main()
