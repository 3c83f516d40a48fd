"""A run's bytes are the same with any number of workers, in any order, in any chunk, with and without Ray."""

import itertools
import random
from functools import partial
from pathlib import Path

import pytest

from mimo.params import Params
from stages import crew, store, sweep
from stages.schedule import Chunk, Run, Schedule

SEEDS = 3
CASES = {  # workers, runs a chunk, what draws the order
    "one after the other here": (crew.SERIAL, 1, None),
    "all seeds in lock step, here": (crew.SERIAL, SEEDS, 1),
    "one worker, odd chunks": (1, 2, 2),
    "two workers, chunks of one": (2, 1, 3),
}


class Drawn(Schedule):
    """Hands out chunks of `size` in an order drawn by `seed`."""

    def __init__(self, todo: list[Run], size: int, seed: int) -> None:
        super().__init__(todo, 1)
        cells = itertools.groupby(todo, key=lambda run: (run.condition, run.reward))
        self._chunks = [Chunk(tuple(own)) for _, cell in cells for own in batched(list(cell), size)]
        random.Random(seed).shuffle(self._chunks)

    def next(self, workers: int) -> Chunk | None:
        return self._chunks.pop() if self._chunks else None


def batched(runs: list[Run], size: int) -> list[list[Run]]:
    return [runs[i : i + size] for i in range(0, len(runs), size)]


def test_workers_order_and_chunks_change_no_byte(
    tiny: Params,
    encoder_file: bytes,
    scales: dict[str, float],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parents[2]))  # for Ray's workers
    monkeypatch.delenv("RAY_ADDRESS", raising=False)
    cells = (("free", "rtl"), ("noisy", "cais_surprise"))
    job = sweep.Job(encoder_file, tiny.encoder.latent_sd, {"": sweep.Grid(tiny, scales, cells, SEEDS)})
    found: dict[str, dict[str, bytes]] = {}
    for name, (workers, size, order) in CASES.items():
        (tmp_path / name).mkdir()
        monkeypatch.chdir(tmp_path / name)
        monkeypatch.setattr(sweep, "Schedule", Schedule if order is None else partial(Drawn, seed=order))
        assert sweep.compute(job, sweep.missing(sweep.wanted(job)), size, workers) == []
        found[name] = {run.digest: store.place(store.RUN, run.digest).read_bytes() for run in sweep.wanted(job)}
    assert all(len(files) == len(cells) * SEEDS for files in found.values())
    for (one, files), (other, others) in itertools.pairwise(found.items()):
        assert files == others, f"{one}, and {other}"
