"""Sweeps: which runs are missing, and their computation in chunks by a crew.

A sweep is a grid of the paper's own runs, or one grid for each variant of a study.
"""

import itertools
import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np

from mimo.learning import experiment
from mimo.record import artifact, identity
from mimo.settings.params import Params
from mimo.vision import extractor
from mimo.world import protocol
from stages.base import console, paths, store
from stages.sweep import crew, scales
from stages.sweep.schedule import Chunk, Run, Schedule, of

SMALL = 500  # agent steps that this process computes sooner than Ray starts


@dataclass(frozen=True)
class Grid:
    """Which runs are wanted, and all that they are made with.

    Attributes:
        params: theirs.
        scales: of the rewards.
        encoder: the encoder's file.
        latent_sd: that the encoder was made with.
        cells: conditions and rewards.
        seeds: of each.
        donors: of yoked infants, by condition and the infant's seed; else there are none.
    """

    params: Params
    scales: Mapping[str, float]
    encoder: bytes
    latent_sd: float
    cells: tuple[tuple[str, str], ...]
    seeds: range
    donors: Mapping[tuple[str, int], experiment.Donor] = field(default_factory=dict)


Job = Mapping[str, Grid]  # a grid for each variant; the paper's own runs are those of ""


def grid(p: Params) -> Grid:
    """The paper's own runs."""
    cells = tuple(itertools.product(p.sweep.conditions, p.sweep.rewards))
    file = paths.ENCODER.read_bytes()
    return Grid(p, scales.read(paths.SCALES), file, p.encoder.latent_sd, cells, range(p.sweep.seeds))


def trained(held: artifact.Artifact, latent_sd: float, p: Params) -> extractor.Trained:
    """The encoder, made with `latent_sd`, for `p`: h's quantiles come in units of the `latent_sd` of `p`."""
    found = extractor.load(held)
    return replace(found, quantiles=found.quantiles * np.float32(p.encoder.latent_sd / latent_sd))


def complete(job: Job, size: int, workers: int | None) -> list[Run]:
    """Compute the runs that are missing, in chunks of at most `size`, by so many workers; returns all runs of the job.

    Raises:
        console.StageError: some failed; the others are kept.
    """
    all_runs = wanted(job)
    total, todo = len({run.digest for run in all_runs}), missing(all_runs)
    print(f"{total} runs, {total - len(todo)} of them in the store.", flush=True)
    failed = compute(job, todo, size, workers) if todo else []
    if failed:
        raise console.StageError("\n".join([*failed, f"{len(failed)} of {total} runs failed; the others are kept."]))
    return all_runs


def write_manifest(path: Path, listed: list[Run]) -> None:
    """List runs, with their content hashes, for stages.runs to publish."""
    entries = [asdict(run) | {"content": artifact.content(store.place(store.RUN, run.digest))} for run in listed]
    artifact.publish(f"{json.dumps(entries, indent=1)}\n".encode(), path)


def wanted(job: Job) -> list[Run]:
    """All runs of the job, by variant, condition, reward and seed."""
    sights = {file: seen(file) for file in {grid.encoder for grid in job.values()}}
    return [
        run
        for variant, grid in job.items()
        for condition, reward in grid.cells
        for run in runs_of(grid, sights[grid.encoder], variant, condition, reward, grid.seeds)
    ]


def seen(file: bytes) -> str:
    """What runs read of an encoder's file, as a hash."""
    return store.sight(artifact.from_bytes(file, store.ENCODER, source=paths.ENCODER))


def runs_of(
    grid: Grid, encoder_hash: str, variant: str, condition: str, reward: str, seeds: Iterable[int]
) -> list[Run]:
    """The runs of one cell, with the digests that the code on this machine gives them."""
    read = experiment.inputs(grid.params, condition, reward, encoder_hash, grid.scales)
    found = []
    for seed in seeds:
        donor = grid.donors.get((condition, seed))
        own = {**read, "seed": seed} | ({"donor": donor.content} if donor else {})
        found.append(Run(condition, reward, seed, identity.Digest(own), variant))
    return found


def missing(listed: list[Run]) -> list[Run]:
    """The runs that neither the store nor data/ holds, each digest once; those of data/ are taken into the store."""
    found = {}
    for run in listed:
        cell = (run.condition, run.reward, run.seed)
        published = [paths.run(*cell, run.variant), paths.run(*cell)]
        if run.digest not in found and not store.has(store.RUN, run.digest, elsewhere=published):
            found[run.digest] = run
    return list(found.values())


def compute(job: Job, todo: list[Run], size: int, workers: int | None) -> list[str]:
    """Compute all runs into the store.

    A chunk that fails is tried again seed by seed, so that one bad run costs no other.

    Args:
        job: what the runs need.
        todo: the runs.
        size: how many runs a chunk has at most.
        workers: how many; None for as many as there are CPUs, or none if there is little to compute; crew.SERIAL for
            this process, without Ray. The bytes are the same.

    Returns:
        A sentence for each run that failed.
    """
    total = sum(_steps(job, run) for run in todo)
    with console.Progress("Runs", total, "agent steps") as progress:
        tally = Tally(job, len(todo), progress)
        with crew.assembled(workers, total <= SMALL, tally.show) as team:
            return drive(job, Schedule(todo, size), team, tally)


def drive(job: Job, schedule: Schedule, team: crew.Crew, tally: "Tally") -> list[str]:
    """Have the crew compute what is scheduled, and keep it; returns a sentence for each run that failed."""
    shared = team.share(job)
    failed: list[str] = []
    while True:
        while len(tally.flying) < team.room() and (chunk := schedule.next(team.workers())):
            team.start(chunk.name, work, shared, chunk)
            tally.start(chunk)
        if not tally.flying:
            return failed
        for name, outcome in team.ended():
            chunk = tally.end(name)
            if isinstance(outcome, Exception):
                failed += [] if schedule.apart(chunk) else [_reason(chunk, outcome)]
                continue
            for run, data in zip(chunk.runs, outcome.result, strict=True):
                store.keep(store.RUN, run.digest, data, outcome.machine)
            tally.finish(chunk)


def work(job: Job, chunk: Chunk, report: crew.Report) -> list[bytes]:
    """Train a chunk; returns the finished files."""
    first = chunk.runs[0]
    grid, condition, reward = job[first.variant], first.condition, first.reward
    held = artifact.from_bytes(grid.encoder, store.ENCODER)
    seeds = [run.seed for run in chunk.runs]
    if runs_of(grid, store.sight(held), first.variant, condition, reward, seeds) != list(chunk.runs):
        raise console.StageError("the code or the libraries changed after the sweep began; run it again")
    sight = trained(held, grid.latent_sd, grid.params)
    donors = [grid.donors[condition, seed] for seed in seeds] if grid.donors else []
    done = experiment.Experiment(grid.params, condition, reward, seeds, sight, grid.scales, donors).run(report)
    about = {"condition": condition, "reward": reward, "limb": grid.params.protocol.limb}
    return [
        artifact.to_bytes(store.RUN, run.digest, record, about | {"seed": run.seed})
        for run, record in zip(chunk.runs, done, strict=True)
    ]


def fill(
    schema: str, digests: Mapping[str, str], todo: Mapping[str, Callable[[], bytes]], workers: int | None
) -> Iterator[str]:
    """Have tasks make artifacts, by name, and keep each under its digest; its name comes when that is done."""
    if todo:
        for name, made in each(todo, workers):
            store.keep(schema, digests[name], made.result, made.machine)
            yield name


def each(todo: Mapping[str, Callable[[], bytes]], workers: int | None) -> Iterator[tuple[str, crew.Done]]:
    """Each task's name and what it gave, as soon as it is done.

    One task alone stays in this process: Ray would take longer to start than it saves.

    Raises:
        console.StageError: a task failed, by its name; those in flight are dropped.
    """
    with crew.assembled(workers, len(todo) == 1, lambda steps: None) as team:
        for name, task in todo.items():
            team.start(name, _call, task)
        left = set(todo)
        while left:
            for name, outcome in team.ended():
                if isinstance(outcome, Exception):
                    raise console.StageError(f"{name}: {crew.reason(outcome)[1]}") from outcome
                left.remove(name)
                yield name, outcome


def _call(task: Callable[[], bytes], report: crew.Report) -> bytes:
    return task()


class Tally:
    """Which chunks are in flight, and counts for the progress bar."""

    def __init__(self, job: Job, total: int, progress: console.Progress) -> None:
        self.flying: dict[str, Chunk] = {}
        self._job, self._progress = job, progress
        self._total, self._finished, self._steps = total, 0, 0

    def start(self, chunk: Chunk) -> None:
        """A chunk is handed out."""
        self.flying[chunk.name] = chunk

    def end(self, name: str) -> Chunk:
        """A chunk is in flight no more."""
        return self.flying.pop(name)

    def finish(self, chunk: Chunk) -> None:
        """A chunk is done."""
        self._finished += len(chunk.runs)
        self._steps += sum(_steps(self._job, run) for run in chunk.runs)
        self.show({})

    def show(self, doing: Mapping[str, int]) -> None:
        """Steps done of each chunk in flight, as far as that is known."""
        flying = sum(len(chunk.runs) for chunk in self.flying.values())
        steps = self._steps + sum(len(self.flying[name].runs) * done for name, done in doing.items())
        self._progress.update(steps, f"{self._finished}/{self._total} runs done, {flying} in flight")


def _steps(job: Job, run: Run) -> int:
    """Agent steps of a run."""
    return protocol.steps(job[run.variant].params.protocol)


def _reason(chunk: Chunk, fault: Exception) -> str:
    """What a worker raised, in a line that names the run."""
    cause, text = crew.reason(fault)
    return f"{of(chunk.runs[0])}{text}" if isinstance(cause, experiment.RunError) else f"{chunk.name}: {text}"
