"""Sweeps: which runs are missing, and their computation in chunks, on Ray or in this process; all Ray code.

A sweep is a grid of the paper's own runs, or one grid for each variant of the params.
"""

import argparse
import itertools
import json
import logging
import os
import signal
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import ray

from mimo import artifact, encoder, experiment, identity, protocol, rewards
from mimo.params import Params
from stages import console, paths, store

POLL_SECONDS = 1.0
RETRIES = 3  # of a chunk whose worker died
STARTS = 3  # of Ray, at most
SMALL = 500  # agent steps that this process computes sooner than Ray starts
OBJECT_STORE = 256 * 2**20  # bytes: encoder and a few chunks' results
SERIAL = 0  # workers: none, this process computes


@dataclass(frozen=True)
class Run:
    """One run and its digest; `variant` is empty for the paper's own."""

    condition: str
    reward: str
    seed: int
    digest: str
    variant: str = ""


@dataclass(frozen=True)
class Chunk:
    """Runs of one cell that train in lock step."""

    runs: tuple[Run, ...]

    @property
    def name(self) -> str:
        """For people: variant, condition, reward and seeds."""
        first = self.runs[0]
        seeds = ", ".join(str(run.seed) for run in self.runs)
        return f"{_of(first)}{first.condition}, {first.reward}, seed {seeds}"


@dataclass(frozen=True)
class Grid:
    """Params, the reward scales that go with them, and which runs are wanted: `seeds` of each (condition, reward)."""

    params: Params
    scales: Mapping[str, float]
    cells: tuple[tuple[str, str], ...]
    seeds: int


@dataclass(frozen=True)
class Job:
    """All that chunks need besides their runs: the encoder's file, its `latent_sd`, a grid for each variant."""

    encoder: bytes
    latent_sd: float
    grids: Mapping[str, Grid]


def workers(program: str) -> int | None:
    """How many workers the command line asks for: SERIAL for --serial, None for one a CPU."""
    parser = argparse.ArgumentParser(prog=program, epilog="The bytes are the same in any case.")
    asked = parser.add_mutually_exclusive_group()
    asked.add_argument("--serial", action="store_true", help="in this process, without Ray")
    asked.add_argument("--workers", type=int, metavar="N", help="Ray workers on this machine (default: one a CPU)")
    given = parser.parse_args()
    if given.workers is not None and given.workers < 1:
        parser.error("--workers must be at least 1")
    return SERIAL if given.serial else given.workers


def grid(p: Params) -> Grid:
    """The paper's own runs."""
    return Grid(p, scales(paths.SCALES), tuple(itertools.product(p.sweep.conditions, p.sweep.rewards)), p.sweep.seeds)


def scales(path: Path, digest: str | None = None) -> dict[str, float]:
    """Each reward's scale."""
    return {name: float(data.values) for name, data in artifact.read(path, store.SCALE, digest).datasets.items()}


def trained(held: artifact.Artifact, latent_sd: float, p: Params) -> encoder.Trained:
    """The encoder, made with `latent_sd`, for `p`: h's quantiles come in units of the `latent_sd` of `p`."""
    found = encoder.load(held)
    return replace(found, quantiles=found.quantiles * np.float32(p.encoder.latent_sd / latent_sd))


def complete(job: Job, size: int, crew: int | None) -> list[Run]:
    """Compute the runs that are missing, in chunks of `size`, by `crew` workers; returns all runs of the job.

    Raises:
        console.StageError: some failed; the others are kept.
    """
    all_runs = wanted(job)
    total, todo = len({run.digest for run in all_runs}), missing(all_runs)
    print(f"{total} runs, {total - len(todo)} of them in the store.", flush=True)
    failed = compute(job, chunks(todo, size), crew) if todo else []
    if failed:
        raise console.StageError("\n".join([*failed, f"{len(failed)} of {total} runs failed; the others are kept."]))
    return all_runs


def write_manifest(path: Path, listed: list[Run]) -> None:
    """List runs, with their content hashes, for stages.runs to publish."""
    entries = [asdict(run) | {"content": artifact.content(store.place(store.RUN, run.digest))} for run in listed]
    artifact.publish(f"{json.dumps(entries, indent=1)}\n".encode(), path)


def wanted(job: Job) -> list[Run]:
    """All runs of the job, by variant, condition, reward and seed."""
    encoder_hash = store.sight(artifact.from_bytes(job.encoder, encoder.SCHEMA, source=paths.ENCODER))
    return [
        run
        for variant, grid in job.grids.items()
        for condition, reward in grid.cells
        for run in runs_of(job, encoder_hash, variant, condition, reward, range(grid.seeds))
    ]


def runs_of(job: Job, encoder_hash: str, variant: str, condition: str, reward: str, seeds: Iterable[int]) -> list[Run]:
    """The runs of one cell, with the digests that the code on this machine gives them."""
    grid = job.grids[variant]
    made_from = (experiment.inputs(grid.params, condition, reward, seed, encoder_hash, grid.scales) for seed in seeds)
    return [Run(condition, reward, read["seed"], identity.Digest(read), variant) for read in made_from]


def missing(listed: list[Run]) -> list[Run]:
    """The runs that neither the store nor data/ holds, each digest once; those of data/ are taken into the store."""
    found = {}
    for run in listed:
        cell = (run.condition, run.reward, run.seed)
        published = [paths.run(*cell, run.variant), paths.run(*cell)]
        if run.digest not in found and not store.has(store.RUN, run.digest, elsewhere=published):
            found[run.digest] = run
    return list(found.values())


def chunks(todo: list[Run], size: int) -> list[Chunk]:
    """Runs of one cell together, at most `size`.

    Low seeds of every cell come first, so that an early look sees all cells; then those with outcome models, which
    take longest.
    """
    cells: dict[tuple[str, str, str], list[Run]] = {}
    for run in todo:
        cells.setdefault((run.variant, run.condition, run.reward), []).append(run)
    found = [Chunk(tuple(cell[i : i + size])) for cell in cells.values() for i in range(0, len(cell), size)]
    return sorted(found, key=lambda chunk: (chunk.runs[0].seed, not rewards.needs_outcomes(chunk.runs[0].reward)))


def compute(job: Job, todo: list[Chunk], crew: int | None) -> list[str]:
    """Compute all chunks into the store.

    A chunk that fails is tried again seed by seed, so that one bad run costs no other.

    Args:
        job: what the chunks need.
        todo: the chunks.
        crew: how many workers; None for one a CPU, or none if there is little to compute; SERIAL for this process,
            without Ray. The bytes are the same.

    Returns:
        A sentence for each run that failed.
    """
    total = sum(_steps(job, chunk) for chunk in todo)
    here = crew == SERIAL or (crew is None and total <= SMALL)
    with console.Progress("Runs", total, "agent steps") as progress:
        return _serial(job, todo, progress) if here else _on_ray(job, todo, crew, progress)


def work(job: Job, chunk: Chunk, report: Callable[[int], None]) -> list[bytes]:
    """Train a chunk; returns the finished files."""
    first = chunk.runs[0]
    grid, condition, reward = job.grids[first.variant], first.condition, first.reward
    held = artifact.from_bytes(job.encoder, encoder.SCHEMA)
    seeds = [run.seed for run in chunk.runs]
    if runs_of(job, store.sight(held), first.variant, condition, reward, seeds) != list(chunk.runs):
        raise console.StageError("the code or the libraries changed after the sweep began; run it again")
    sight = trained(held, job.latent_sd, grid.params)
    done = experiment.Experiment(grid.params, condition, reward, seeds, sight, grid.scales).run(report)
    about = {"condition": condition, "reward": reward, "limb": grid.params.protocol.limb}
    return [
        artifact.to_bytes(store.RUN, run.digest, record, about | {"seed": run.seed})
        for run, record in zip(chunk.runs, done, strict=True)
    ]


def each(todo: Mapping[str, Callable[[], bytes]], crew: int | None) -> Iterator[tuple[str, bytes]]:
    """Each task's name and result as soon as it is done, from Ray or, one by one, from this process.

    One task alone stays in this process: Ray would take longer to start than it saves.

    Raises:
        console.StageError: a task failed, by its name; those in flight are dropped.
    """

    def result(name: str, get: Callable[..., Any], *given: Any) -> tuple[str, bytes]:
        try:
            return name, get(*given)
        except Exception as fault:
            raise console.StageError(f"{name}: {_logged(fault)[1]}") from fault

    if crew == SERIAL or len(todo) == 1:
        yield from (result(name, task) for name, task in todo.items())
        return
    with _local_ray(crew):
        flying = {_call.remote(task): name for name, task in todo.items()}
        while flying:
            (ready,), _ = ray.wait(list(flying))
            yield result(flying.pop(ready), ray.get, ready)


class _Tally:
    """Counts for the progress bar."""

    def __init__(self, job: Job, todo: list[Chunk], progress: console.Progress) -> None:
        self._job, self._progress = job, progress
        self._total, self._finished, self._steps = sum(len(chunk.runs) for chunk in todo), 0, 0

    def finish(self, chunk: Chunk) -> None:
        """A chunk is done."""
        self._finished += len(chunk.runs)
        self._steps += _steps(self._job, chunk)

    def show_one(self, chunk: Chunk, done: int) -> None:
        """Steps done of the only chunk in flight."""
        self.show({chunk: done})

    def show(self, doing: Mapping[Chunk, int]) -> None:
        """Steps done of each chunk in flight."""
        flying = sum(len(chunk.runs) for chunk in doing)
        steps = self._steps + sum(len(chunk.runs) * done for chunk, done in doing.items())
        self._progress.update(steps, f"{self._finished}/{self._total} runs done, {flying} in flight")


def _steps(job: Job, chunk: Chunk) -> int:
    """Agent steps of all runs of a chunk."""
    return protocol.steps(job.grids[chunk.runs[0].variant].params.protocol) * len(chunk.runs)


def _of(run: Run) -> str:
    """How a run's name begins."""
    return f"{run.variant}: " if run.variant else ""


def _keep(chunk: Chunk, files: list[bytes]) -> None:
    for run, data in zip(chunk.runs, files, strict=True):
        store.keep(store.RUN, run.digest, data)


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
        tally.finish(chunk)
        tally.show({})
    return failed


@ray.remote(num_cpus=0, max_restarts=-1)
class _Board:
    """Where workers write how far they are."""

    def __init__(self) -> None:
        console.die_with_parent()
        self._steps: dict[str, int] = {}

    def put(self, chunk: str, steps: int) -> None:
        self._steps[chunk] = steps

    def get(self) -> dict[str, int]:
        return self._steps


@ray.remote(num_cpus=1, max_retries=RETRIES)
def _remote(job: Job, chunk: Chunk, board: Any) -> list[bytes]:
    console.die_with_parent()  # when the driver was killed, Ray lets a worker live for another minute
    last = 0.0

    def report(done: int) -> None:
        nonlocal last
        if time.monotonic() - last > POLL_SECONDS:
            last = time.monotonic()
            board.put.remote(chunk.name, done)

    return work(job, chunk, report)


@ray.remote(num_cpus=1, max_retries=RETRIES)
def _call(task: Callable[[], bytes]) -> bytes:
    console.die_with_parent()
    return task()


def _on_ray(job: Job, todo: list[Chunk], crew: int | None, progress: console.Progress) -> list[str]:
    tally, failed = _Tally(job, todo, progress), []
    with _local_ray(crew):
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
                tally.finish(chunk)
            try:
                done = ray.get(board.get.remote(), timeout=10 * POLL_SECONDS)
            except (ray.exceptions.RayError, TimeoutError):
                continue  # the board is lost or slow: that costs the bar a moment, not the sweep
            tally.show({chunk: done[chunk.name] for chunk in flying.values() if chunk.name in done})
    return failed


@contextmanager
def _local_ray(crew: int | None = None) -> Iterator[None]:
    """A Ray for this process, on loopback (see stages/__init__.py), without dashboard; it ends with the block."""
    if os.environ.get("RAY_ADDRESS"):
        raise console.StageError("RAY_ADDRESS is set, but this version computes on one machine only; unset it.")
    on_sigterm = signal.getsignal(signal.SIGTERM)
    try:
        for left in reversed(range(STARTS)):
            try:
                ray.init(
                    address="local",
                    num_cpus=crew,
                    include_dashboard=False,
                    log_to_driver=False,
                    logging_level=logging.ERROR,
                    object_store_memory=OBJECT_STORE,
                )
                break
            except Exception as fault:  # on a machine under load its daemons may miss Ray's own time limit
                ray.shutdown()
                if not left:
                    said = "Ray did not start; run it again when the machine is less busy, or with --serial"
                    raise console.StageError(f"{said} ({_logged(fault)[1]}).") from fault
        signal.signal(signal.SIGTERM, on_sigterm)  # Ray puts one of its own in place
        yield
    finally:
        ray.shutdown()


def _reason(chunk: Chunk, fault: Exception) -> str:
    """What a worker raised, in a line that names the run."""
    cause, text = _logged(fault)
    return f"{_of(chunk.runs[0])}{text}" if isinstance(cause, experiment.RunError) else f"{chunk.name}: {text}"


def _logged(fault: Exception) -> tuple[BaseException, str]:
    """What a worker raised and its last line; all of it goes to the log."""
    with suppress(OSError):  # a disk that takes no log must not hide what happened
        paths.LOG.parent.mkdir(exist_ok=True)
        with paths.LOG.open("a") as log:
            log.write(f"{fault}\n")
    cause = getattr(fault, "cause", None) or fault
    return cause, (str(cause).strip().splitlines() or [type(cause).__name__])[-1]
