"""The sweep: every run once, the same bytes with and without Ray, one bad run costing no other, one sweep at a time."""

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mimo import artifact
from mimo.encoder import SCHEMA
from mimo.params import Params
from stages import console, paths, store, sweep
from stages.sweep import Chunk, Job, Run

ROOT = Path(__file__).resolve().parents[2]
HOLD = """
import sys
from stages import sweep
with sweep._lock():
    print("held", flush=True)
    sys.stdin.read()
"""


@pytest.fixture(autouse=True)
def _away(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(ROOT))  # for Ray's workers
    monkeypatch.delenv("RAY_ADDRESS", raising=False)
    monkeypatch.delenv("FORCE_COLOR", raising=False)


@pytest.fixture
def job(tiny: Params, encoder_file: bytes, scales: dict[str, float]) -> Job:
    return Job(tiny, encoder_file, scales)


def wanted(job: Job) -> list[Run]:
    return sweep.runs(job, artifact.from_bytes(job.encoder, SCHEMA).content)


def kept() -> dict[str, bytes]:
    """The store's runs by digest."""
    return {path.stem: path.read_bytes() for path in (paths.STORE / "runs").glob("*")}


def write(run: Run, path: Path) -> None:
    artifact.write(path, store.RUN, run.digest, {"reward": artifact.Dataset(np.zeros(3), "1", "step")})


# Which runs, in which chunks.


def test_runs_are_all_of_the_sweep_in_order(job: Job) -> None:
    made = wanted(job)
    assert [(run.condition, run.reward, run.seed) for run in made] == [
        ("free", "mtl", 0), ("free", "mtl", 1), ("free", "cais", 0), ("free", "cais", 1)
    ]  # fmt: skip
    assert len({run.digest for run in made}) == 4
    more = job.params.sweep.model_copy(update={"seeds": 3, "conditions": ["noisy", "free"], "chunk": 7})
    wider = wanted(Job(job.params.model_copy(update={"sweep": more}), job.encoder, job.scales))
    assert len(wider) == 12
    assert set(made) <= set(wider)


CELLS = st.tuples(
    st.sampled_from(["free", "noisy"]), st.sampled_from(["mtl", "rtl", "cais", "surprise", "mtl_surprise"])
)
RUNS = st.dictionaries(CELLS, st.sets(st.integers(0, 12), min_size=1), max_size=8).map(
    lambda cells: [
        Run(condition, reward, seed, f"{condition}{reward}{seed}")
        for (condition, reward), seeds in cells.items()
        for seed in sorted(seeds)
    ]
)


@given(RUNS, st.integers(1, 6))
def test_chunks_cover_every_run_once(runs: list[Run], size: int) -> None:
    made = sweep.chunks(runs, size)
    assert sorted(run.digest for chunk in made for run in chunk.runs) == sorted(run.digest for run in runs)
    for chunk in made:
        assert 1 <= len(chunk.runs) <= size
        assert len({(run.condition, run.reward) for run in chunk.runs}) == 1
        assert [run.seed for run in chunk.runs] == sorted(run.seed for run in chunk.runs)
    cells = {(run.condition, run.reward) for run in runs}
    for cell in cells:
        sizes = [len(chunk.runs) for chunk in made if (chunk.runs[0].condition, chunk.runs[0].reward) == cell]
        assert sizes[:-1] == [size] * (len(sizes) - 1)


@given(RUNS, st.integers(1, 6))
def test_low_seeds_come_first_then_outcome_models(runs: list[Run], size: int) -> None:
    firsts = [chunk.runs[0] for chunk in sweep.chunks(runs, size)]
    ranks = [(run.seed, run.reward in ("mtl", "rtl")) for run in firsts]
    assert ranks == sorted(ranks)


def test_a_chunk_is_named_for_people() -> None:
    assert Chunk((Run("free", "mtl", 3, "a"), Run("free", "mtl", 4, "b"))).name == "free, mtl, seed 3, 4"


def test_missing_is_what_neither_store_nor_data_holds(job: Job) -> None:
    runs = wanted(job)
    assert sweep.missing(runs) == runs
    write(runs[0], store.place(store.RUN, runs[0].digest))
    write(runs[1], paths.run("free", "mtl", 1))
    write(runs[1], paths.run("free", "cais", 0))  # another run's file
    assert sweep.missing(runs) == runs[2:]
    assert set(kept()) == {runs[0].digest, runs[1].digest}
    paths.run("free", "mtl", 1).unlink()
    assert sweep.missing(runs) == runs[2:]
    assert sweep.missing([]) == []


# Computation.


def test_ray_and_this_process_give_the_same_bytes_and_the_same_faults(
    job: Job, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """One run at a time here, two in lock step on Ray; Surprise cannot be computed, the others can."""
    rewards = job.params.sweep.model_copy(update={"rewards": ["mtl", "cais", "surprise"]})
    job = Job(job.params.model_copy(update={"sweep": rewards}), job.encoder, {**job.scales, "surprise": 1e-320})
    runs = wanted(job)
    good = {run.digest for run in runs if run.reward != "surprise"}
    files, faults = [], []
    for serial, size in ((True, 1), (False, 2)):
        (tmp_path / str(size)).mkdir()
        monkeypatch.chdir(tmp_path / str(size))
        faults.append(sorted(sweep.compute(job, sweep.chunks(runs, size), serial)))
        files.append(kept())
        assert set(files[-1]) == good
        assert [run.reward for run in sweep.missing(runs)] == ["surprise", "surprise"]
        assert "Runs: " in capsys.readouterr().err
    assert files[0] == files[1]
    assert faults[0] == faults[1]
    for seed, fault in enumerate(faults[0]):
        assert fault.startswith(f"free, surprise, seed {seed} ")
        assert "stopped at step 1" in fault
        assert "\n" not in fault
    assert len(faults[0]) == 2
    for run in runs[:4]:
        held = artifact.from_bytes(files[0][run.digest], store.RUN, run.digest)
        assert held.about == {"condition": "free", "reward": run.reward, "limb": "left_foot", "seed": run.seed}
        assert len(held["reward"]) == 10


def test_chunks_of_one_and_of_two_are_the_same_bytes(job: Job, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    files = []
    for size in (1, 2):
        (tmp_path / str(size)).mkdir()
        monkeypatch.chdir(tmp_path / str(size))
        assert sweep.compute(job, sweep.chunks(wanted(job), size), serial=True) == []
        files.append(kept())
    assert len(files[0]) == 4
    assert files[0] == files[1]


def test_one_bad_seed_costs_no_other(job: Job, monkeypatch: pytest.MonkeyPatch) -> None:
    tried: list[str] = []

    def work(job: Job, chunk: Chunk, report: object) -> list[bytes]:
        tried.append(chunk.name)
        if any(run.reward == "mtl" and run.seed == 1 for run in chunk.runs):
            raise FloatingPointError("it slipped")
        return [run.digest.encode() for run in chunk.runs]

    monkeypatch.setattr(sweep, "work", work)
    runs = wanted(job)
    assert sweep.compute(job, sweep.chunks(runs, 2), serial=True) == ["free, mtl, seed 1: it slipped"]
    assert set(kept()) == {runs[0].digest, runs[2].digest, runs[3].digest}
    assert sorted(tried) == ["free, cais, seed 0, 1", "free, mtl, seed 0", "free, mtl, seed 0, 1", "free, mtl, seed 1"]


def test_an_interrupt_keeps_what_is_finished(job: Job, monkeypatch: pytest.MonkeyPatch) -> None:
    def work(job: Job, chunk: Chunk, report: object) -> list[bytes]:
        if kept():
            raise KeyboardInterrupt
        return [run.digest.encode() for run in chunk.runs]

    monkeypatch.setattr(sweep, "work", work)
    runs = wanted(job)
    with pytest.raises(KeyboardInterrupt):
        sweep.compute(job, sweep.chunks(runs, 1), serial=True)
    assert len(kept()) == 1
    assert sweep.compute(job, [], serial=True) == []  # the lock went with it


# One sweep at a time.


@pytest.fixture
def other() -> Iterator["subprocess.Popen[str]"]:
    """Another process that holds the store's lock."""
    command = [sys.executable, "-c", HOLD]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "held\n"
        yield process
        process.kill()


def test_a_second_sweep_is_refused(other: "subprocess.Popen[str]", job: Job) -> None:
    with pytest.raises(console.StageError, match=rf"process {other.pid}\) works on \.work; wait"):
        sweep.compute(job, [], serial=True)
    with pytest.raises(console.StageError, match=rf"process {other.pid}\)"):  # the refusal did not wipe the name
        sweep.compute(job, [], serial=False)
    other.kill()
    other.wait()
    assert sweep.compute(job, [], serial=True) == []


def test_a_cluster_is_refused_in_a_sentence(job: Job, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RAY_ADDRESS", "127.0.0.1:6379")
    with pytest.raises(console.StageError, match="RAY_ADDRESS is set"):
        sweep.compute(job, sweep.chunks(wanted(job), 1), serial=False)
    assert not kept()
