"""The sweep: which runs are missing, and their computation in chunks, on Ray or in this process; all Ray code."""

import fcntl
import logging
import os
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any

import ray

from mimo import artifact, encoder, experiment, identity, protocol, rewards
from mimo.params import Params
from stages import console, paths, store

POLL_SECONDS = 1.0
RETRIES = 3  # of a chunk whose worker died
OBJECT_STORE = 256 * 2**20  # bytes: encoder and a few chunks' results


@dataclass(frozen=True)
class Run:
    """One run and its digest."""

    condition: str
    reward: str
    seed: int
    digest: str


@dataclass(frozen=True)
class Chunk:
    """Runs of one cell that train in lock step."""

    runs: tuple[Run, ...]

    @property
    def name(self) -> str:
        """For people: condition, reward and seeds."""
        first = self.runs[0]
        return f"{first.condition}, {first.reward}, seed {', '.join(str(run.seed) for run in self.runs)}"


@dataclass(frozen=True)
class Job:
    """What every chunk of a sweep needs besides its runs."""

    params: Params
    encoder: bytes
    scales: Mapping[str, float]


def runs(job: Job, encoder_hash: str) -> list[Run]:
    """All runs of the sweep, by condition, reward and seed."""
    sweep = job.params.sweep
    return [
        run
        for condition in sweep.conditions
        for reward in sweep.rewards
        for run in runs_of(job, encoder_hash, condition, reward, range(sweep.seeds))
    ]


def runs_of(job: Job, encoder_hash: str, condition: str, reward: str, seeds: Iterable[int]) -> list[Run]:
    """The runs of one cell, with the digests that the code on this machine gives them."""
    return [
        Run(
            condition,
            reward,
            seed,
            identity.digest(experiment.inputs(job.params, condition, reward, seed, encoder_hash, job.scales)),
        )
        for seed in seeds
    ]


def missing(wanted: list[Run]) -> list[Run]:
    """The runs that neither the store nor data/runs holds; those of data/runs are taken into the store."""
    return [
        run
        for run in wanted
        if not store.has(store.RUN, run.digest, elsewhere=[paths.run(run.condition, run.reward, run.seed)])
    ]


def chunks(wanted: list[Run], size: int) -> list[Chunk]:
    """Runs of one cell together, at most `size`.

    Low seeds of every cell come first, so that an early look sees all cells; then those with outcome models, which
    take longest.
    """
    cells: dict[tuple[str, str], list[Run]] = {}
    for run in wanted:
        cells.setdefault((run.condition, run.reward), []).append(run)
    found = [Chunk(tuple(cell[i : i + size])) for cell in cells.values() for i in range(0, len(cell), size)]
    return sorted(found, key=lambda chunk: (chunk.runs[0].seed, not rewards.needs_outcomes(chunk.runs[0].reward)))


def compute(job: Job, todo: list[Chunk], serial: bool) -> list[str]:
    """Compute all chunks into the store.

    A chunk that fails is tried again seed by seed, so that one bad run costs no other.

    Args:
        job: what all chunks share.
        todo: the chunks.
        serial: in this process, without Ray; the bytes are the same.

    Returns:
        A sentence for each run that failed.
    """
    steps = protocol.steps(job.params.protocol) * sum(len(chunk.runs) for chunk in todo)
    with _lock(), console.Progress("Runs", steps, "agent steps") as progress:
        return (_serial if serial else _on_ray)(job, todo, progress)


def work(job: Job, chunk: Chunk, report: Callable[[int], None]) -> list[bytes]:
    """Train a chunk; returns the finished files."""
    first = chunk.runs[0]
    held = artifact.from_bytes(job.encoder, encoder.SCHEMA)
    seeds = [run.seed for run in chunk.runs]
    if runs_of(job, held.content, first.condition, first.reward, seeds) != list(chunk.runs):
        raise console.StageError("the code or the libraries changed after the sweep began; run it again")
    trained = encoder.load(held)
    done = experiment.Experiment(job.params, first.condition, first.reward, seeds, trained, job.scales).run(report)
    about = {"condition": first.condition, "reward": first.reward, "limb": job.params.protocol.limb}
    return [
        artifact.to_bytes(store.RUN, run.digest, record, about | {"seed": run.seed})
        for run, record in zip(chunk.runs, done, strict=True)
    ]


class _Tally:
    """Counts for the progress bar."""

    def __init__(self, job: Job, todo: list[Chunk], progress: console.Progress) -> None:
        self._steps = protocol.steps(job.params.protocol)
        self._total, self._progress = sum(len(chunk.runs) for chunk in todo), progress
        self.finished = 0

    def show_one(self, chunk: Chunk, done: int) -> None:
        """Steps done of the only chunk in flight."""
        self.show({chunk: done})

    def show(self, doing: Mapping[Chunk, int]) -> None:
        """Steps done of each chunk in flight."""
        flying = sum(len(chunk.runs) for chunk in doing)
        steps = self.finished * self._steps + sum(len(chunk.runs) * done for chunk, done in doing.items())
        self._progress.update(steps, f"{self.finished}/{self._total} runs done, {flying} in flight")


def _keep(chunk: Chunk, files: list[bytes]) -> None:
    for run, data in zip(chunk.runs, files, strict=True):
        artifact.publish(data, store.place(store.RUN, run.digest))


def _apart(chunk: Chunk) -> list[Chunk]:
    return [Chunk((run,)) for run in chunk.runs] if len(chunk.runs) > 1 else []


def _serial(job: Job, todo: list[Chunk], progress: console.Progress) -> list[str]:
    tally, failed, pending = _Tally(job, todo, progress), [], list(todo)
    while pending:
        chunk = pending.pop(0)
        try:
            files = work(job, chunk, partial(tally.show_one, chunk))
        except Exception as fault:
            pending[:0] = (alone := _apart(chunk))
            failed += [] if alone else [_reason(chunk, fault)]
            continue
        _keep(chunk, files)
        tally.finished += len(chunk.runs)
        tally.show({})
    return failed


@ray.remote(num_cpus=0, max_restarts=-1)
class _Board:
    """Where workers write how far they are."""

    def __init__(self) -> None:
        self._steps: dict[str, int] = {}

    def put(self, chunk: str, steps: int) -> None:
        self._steps[chunk] = steps

    def get(self) -> dict[str, int]:
        return self._steps


@ray.remote(num_cpus=1, max_retries=RETRIES)
def _remote(job: Job, chunk: Chunk, board: Any) -> list[bytes]:
    last = 0.0

    def report(done: int) -> None:
        nonlocal last
        if time.monotonic() - last > POLL_SECONDS:
            last = time.monotonic()
            board.put.remote(chunk.name, done)

    return work(job, chunk, report)


def _on_ray(job: Job, todo: list[Chunk], progress: console.Progress) -> list[str]:
    tally, failed = _Tally(job, todo, progress), []
    try:
        _start_ray()
        board, shared = _Board.remote(), ray.put(job)  # type: ignore[attr-defined]
        flying: dict[Any, Chunk] = {_remote.remote(shared, chunk, board): chunk for chunk in todo}
        while flying:
            ready, _ = ray.wait(list(flying), timeout=POLL_SECONDS)
            for reference in ready:
                chunk = flying.pop(reference)
                try:
                    files = ray.get(reference)
                except ray.exceptions.RayError as fault:
                    alone = _apart(chunk)
                    flying |= {_remote.remote(shared, single, board): single for single in alone}
                    failed += [] if alone else [_reason(chunk, fault)]
                    continue
                _keep(chunk, files)
                tally.finished += len(chunk.runs)
            try:
                done = ray.get(board.get.remote(), timeout=10 * POLL_SECONDS)
            except (ray.exceptions.RayError, TimeoutError):
                continue  # the board is lost or slow: that costs the bar a moment, not the sweep
            tally.show({chunk: done[chunk.name] for chunk in flying.values() if chunk.name in done})
    finally:
        ray.shutdown()
    return failed


def _start_ray() -> None:
    """A local Ray for this process, on loopback (see stages/__init__.py), without dashboard."""
    if os.environ.get("RAY_ADDRESS"):
        raise console.StageError("RAY_ADDRESS is set, but this version computes on one machine only; unset it.")
    ray.init(
        address="local",
        include_dashboard=False,
        log_to_driver=False,
        logging_level=logging.ERROR,
        object_store_memory=OBJECT_STORE,
    )


def _reason(chunk: Chunk, fault: Exception) -> str:
    """What a worker raised, in a line that names the run; all of it goes to the log."""
    paths.LOG.parent.mkdir(exist_ok=True)
    with paths.LOG.open("a") as log:
        log.write(f"{fault}\n")
    cause = getattr(fault, "cause", None) or fault
    text = (str(cause).strip().splitlines() or [type(cause).__name__])[-1]
    return text if isinstance(cause, experiment.RunError) else f"{chunk.name}: {text}"


@contextmanager
def _lock() -> Iterator[None]:
    """One sweep at a time on one store; the lock goes with its process, however that ends."""
    path = paths.STORE / "sweep.lock"
    path.parent.mkdir(exist_ok=True)
    with path.open("a+") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            file.seek(0)
            raise console.StageError(
                f"Another sweep (process {file.read().strip() or '?'}) works on {paths.STORE}; wait for it to end."
            ) from None
        file.truncate(0)
        file.write(str(os.getpid()))
        file.flush()
        yield
