"""A run's bytes are the same with any number of workers, in any order, in any chunk, with and without a real Ray.

Nor does a run that fails cost another; and while it computes, Ray is private.
"""

import itertools
import random
from ipaddress import ip_address
from pathlib import Path

import psutil  # type: ignore[import-untyped]
import pytest

from mimo.record import artifact
from mimo.settings.params import Params
from stages.base import console, paths, store
from stages.sweep import crew, sweep
from stages.sweep.schedule import Chunk, Run, Schedule

SEEDS = 3
CASES = {  # workers, runs a chunk, what draws the order
    "one after the other here": (crew.SERIAL, 1, None),
    "all seeds in lock step, here": (crew.SERIAL, SEEDS, 1),
    "one worker, odd chunks": (1, 2, 2),
    "two workers, chunks of one": (2, 1, 3),
}


class Drawn(Schedule):
    """Hands out chunks of `size` in an order drawn by `seed`; what failed is handed out again as ever."""

    def __init__(self, todo: list[Run], size: int, seed: int) -> None:
        super().__init__([], size)
        cells = itertools.groupby(todo, key=lambda run: (run.condition, run.reward))
        self._drawn = [Chunk(tuple(own)) for _, cell in cells for own in batched(list(cell), size)]
        random.Random(seed).shuffle(self._drawn)

    def next(self, workers: int) -> Chunk | None:
        return self._drawn.pop() if self._drawn else super().next(workers)


def batched(runs: list[Run], size: int) -> list[list[Run]]:
    return [runs[i : i + size] for i in range(0, len(runs), size)]


def listening() -> list[str]:
    """Addresses at which this process's children, and theirs, listen."""
    children = {process.pid for process in psutil.Process().children(recursive=True)}
    found = (
        each.laddr.ip for each in psutil.net_connections("inet") if each.status == "LISTEN" if each.pid in children
    )
    return [ip.removeprefix("::ffff:") for ip in found]


def test_workers_order_and_chunks_change_no_byte(
    tiny: Params,
    encoder_file: bytes,
    scales: dict[str, float],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Surprise cannot be computed, with its scale."""
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parents[2]))  # for Ray's workers
    monkeypatch.delenv("RAY_ADDRESS", raising=False)
    cells = (("free", "rtl"), ("noisy", "cais"), ("free", "surprise"))
    wrong = {**scales, "surprise": 1e-320}
    job = {"": sweep.Grid(tiny, wrong, encoder_file, tiny.encoder.latent_sd, cells, range(SEEDS))}
    runs = sweep.wanted(job)
    found: dict[str, tuple[dict[str, bytes], list[str]]] = {}
    for name, (workers, size, order) in CASES.items():
        (tmp_path / name).mkdir()
        monkeypatch.chdir(tmp_path / name)
        with console.Progress("Runs", 1, "agent steps") as progress:
            tally = sweep.Tally(job, len(runs), progress)
            with crew.assembled(workers, False, tally.show) as team:
                schedule = Schedule(runs, size) if order is None else Drawn(runs, size, order)
                faults = sweep.drive(job, schedule, team, tally)
                if workers:
                    addresses = listening()
                    assert len(addresses) >= 4  # the control store, raylet, object manager and a worker at least
                    assert all(ip_address(address).is_loopback for address in addresses)
        found[name] = ({path.stem: path.read_bytes() for path in (paths.store() / "runs").iterdir()}, sorted(faults))
    for (one, here), (other, there) in itertools.pairwise(found.items()):
        assert here == there, f"{one}, and {other}"
    files, faults = here
    assert set(files) == {run.digest for run in runs if run.reward != "surprise"}
    for run in runs[: 2 * SEEDS]:
        held = artifact.from_bytes(files[run.digest], store.RUN, run.digest)
        about = {"condition": run.condition, "reward": run.reward, "limb": "left_foot", "seed": run.seed}
        assert held.about == about
    assert len(faults) == SEEDS
    for seed, fault in enumerate(faults):
        assert fault.startswith(f"free, surprise, seed {seed} ")
        assert "stopped at step 1" in fault
        assert "\n" not in fault
