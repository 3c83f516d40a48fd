"""A run's bytes are the same with any number of workers, in any order, in any chunk, with and without Ray."""

import itertools
import random
from pathlib import Path

import pytest

from mimo.params import Params
from stages import store, sweep

SEEDS = 3
CASES = {  # workers, runs a chunk, what draws the order
    "one after the other here": (sweep.SERIAL, 1, None),
    "all seeds in lock step, here": (sweep.SERIAL, SEEDS, 1),
    "one worker, odd chunks": (1, 2, 2),
    "two workers, chunks of one": (2, 1, 3),
}


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
        chunks = sweep.chunks(sweep.missing(sweep.wanted(job)), size)
        if order is not None:
            random.Random(order).shuffle(chunks)
        assert sweep.compute(job, chunks, workers) == []
        found[name] = {run.digest: store.place(store.RUN, run.digest).read_bytes() for run in sweep.wanted(job)}
    assert all(len(files) == len(cells) * SEEDS for files in found.values())
    for (one, files), (other, others) in itertools.pairwise(found.items()):
        assert files == others, f"{one}, and {other}"
