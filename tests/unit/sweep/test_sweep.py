"""Sweeps: every run once, one bad run costing no other. On Ray: tests/pipeline/test_same_bytes.py."""

import itertools
import json
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from mimo.learning import experiment
from mimo.record import artifact, identity
from mimo.settings.params import Params
from mimo.vision import extractor
from mimo.vision.extractor import SCHEMA, Trained
from mimo.world import protocol
from stages.base import console, paths, store
from stages.sweep import crew, sweep
from stages.sweep.schedule import Chunk, Run
from stages.sweep.sweep import Grid, Job

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture(autouse=True)
def _away(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(ROOT))  # for Ray's workers
    monkeypatch.delenv("RAY_ADDRESS", raising=False)
    monkeypatch.delenv("FORCE_COLOR", raising=False)


def grid(p: Params, scales: dict[str, float], encoder: bytes) -> Grid:
    """The sweep of `p`, as stages.train asks for it."""
    cells = tuple(itertools.product(p.sweep.conditions, p.sweep.rewards))
    return Grid(p, scales, encoder, p.encoder.latent_sd, cells, range(p.sweep.seeds))


@pytest.fixture
def job(tiny: Params, encoder_file: bytes, scales: dict[str, float]) -> Job:
    return {"": grid(tiny, scales, encoder_file)}


def changed(p: Params, section: str, **values: object) -> Params:
    return p.model_copy(update={section: getattr(p, section).model_copy(update=values)})


def test_a_runs_digest_is_that_of_its_own_inputs(job: Job, tiny: Params, scales: dict[str, float]) -> None:
    made = sweep.runs_of(job[""], "e" * 64, "", "free", "cais", (3, 0, 11))
    assert [run.seed for run in made] == [3, 0, 11]
    for run in made:
        inputs = experiment.inputs(tiny, "free", "cais", "e" * 64, scales) | {"seed": run.seed}
        assert run.digest == identity.Digest(inputs)
        assert isinstance(run.digest, identity.Digest)
        assert run.digest.inputs == inputs


def with_variants(job: Job) -> Job:
    """`job` and two variants: `same` changes nothing, `greedy` the gain, so that it shares no run."""
    own = job[""]
    greedy = replace(own, params=changed(own.params, "rewards", gain=1.0), cells=(("free", "mtl"),))
    return {"": own, "a/same": replace(own, cells=(("free", "cais"),)), "a/greedy": greedy}


def kept() -> dict[str, bytes]:
    """The store's runs by digest."""
    return {path.stem: path.read_bytes() for path in (paths.store() / "runs").glob("*")}


def write(run: Run, path: Path) -> None:
    artifact.write(path, store.RUN, run.digest, {"reward": artifact.Dataset(np.zeros(3), "1", "step")})


# Which runs, in which chunks.


def test_runs_are_all_of_the_sweep_in_order(job: Job) -> None:
    made = sweep.wanted(job)
    assert [(run.condition, run.reward, run.seed) for run in made] == [
        ("free", "mtl", 0), ("free", "mtl", 1), ("free", "cais", 0), ("free", "cais", 1)
    ]  # fmt: skip
    assert len({run.digest for run in made}) == 4
    own = job[""]
    wider = replace(own, cells=(("noisy", "mtl"), ("noisy", "cais"), *own.cells), seeds=range(3))
    more = sweep.wanted({"": wider})
    assert len(more) == 12
    assert set(made) <= set(more)


def test_variants_share_the_runs_that_their_change_does_not_reach(job: Job) -> None:
    runs = sweep.wanted(with_variants(job))
    assert [(run.variant, run.reward, run.seed) for run in runs[4:]] == [
        ("a/same", "cais", 0), ("a/same", "cais", 1), ("a/greedy", "mtl", 0), ("a/greedy", "mtl", 1)
    ]  # fmt: skip
    assert [run.digest for run in runs[4:6]] == [run.digest for run in runs[2:4]]
    assert sweep.missing(runs) == [*runs[:4], *runs[6:]]


def test_missing_is_what_neither_store_nor_data_holds(job: Job) -> None:
    runs = sweep.wanted(job)
    assert sweep.missing(runs) == runs
    write(runs[0], store.place(store.RUN, runs[0].digest))
    write(runs[1], paths.run("free", "mtl", 1))
    write(runs[1], paths.run("free", "cais", 0))  # another run's file
    assert sweep.missing(runs) == runs[2:]
    greedy = sweep.wanted(with_variants(job))[6:]
    write(greedy[0], paths.run("free", "mtl", 0, "a/greedy"))
    assert sweep.missing(greedy) == greedy[1:]
    assert sweep.missing([replace(runs[1], variant="a/same")]) == []
    store.place(store.RUN, greedy[0].digest).unlink()
    assert set(kept()) == {runs[0].digest, runs[1].digest}
    paths.run("free", "mtl", 1).unlink()
    assert sweep.missing(runs) == runs[2:]
    assert sweep.missing([]) == []


def other_encoder(trained: Trained, folder: Path) -> bytes:
    """An encoder with other weights' quantiles, and so another sight."""
    other = replace(trained, quantiles=2 * trained.quantiles)
    extractor.save(other, folder / "other.h5", "o" * 64, {})
    return (folder / "other.h5").read_bytes()


def test_a_grid_with_an_encoder_of_its_own_shares_no_run(job: Job, trained: Trained, tmp_path: Path) -> None:
    own = replace(job[""], encoder=other_encoder(trained, tmp_path))
    runs = sweep.wanted({**job, "a/draw": own, "a/same": job[""]})
    assert {run.digest for run in runs[4:8]}.isdisjoint(run.digest for run in runs[:4])
    assert [run.digest for run in runs[8:]] == [run.digest for run in runs[:4]]


def test_a_yoked_run_depends_on_whose_mobile_it_is(job: Job, tiny: Params) -> None:
    steps = protocol.steps(tiny.protocol)
    act = np.zeros((steps, 12), bool)
    donors = {("free", seed): experiment.Donor(f"{seed}", 9, act, act) for seed in range(2)}
    cells = (("free", "mtl"),)
    alone, yoked, others = (
        sweep.wanted({"": replace(job[""], cells=cells, donors=given)})
        for given in ({}, donors, {("free", seed): replace(donors["free", seed], content="x") for seed in range(2)})
    )
    assert len({run.digest for runs in (alone, yoked, others) for run in runs}) == 6
    for run in yoked:
        assert isinstance(run.digest, identity.Digest)
        assert run.digest.inputs["donor"] == f"{run.seed}"


# Computation.


def test_a_variants_latent_is_that_of_its_own_params(tiny: Params, trained: Trained, job: Job) -> None:
    held, latent_sd = artifact.from_bytes(job[""].encoder, SCHEMA), job[""].latent_sd
    wide = changed(tiny, "encoder", latent_sd=2 * tiny.encoder.latent_sd)
    assert np.array_equal(sweep.trained(held, latent_sd, tiny).quantiles, trained.quantiles)
    assert np.array_equal(sweep.trained(held, latent_sd, wide).quantiles, 2 * trained.quantiles)


def test_tasks_come_with_their_names_and_a_fault_by_its_name() -> None:
    tasks: dict[str, Callable[[], bytes]] = {name: partial(str.encode, name) for name in ("one", "two")}
    found: list[tuple[str, bytes]] = []
    with pytest.raises(console.StageError, match=r"^bad: .*no-such"):
        found.extend(
            (name, made.result)
            for name, made in sweep.each(tasks | {"bad": partial(str.encode, "bad", "no-such")}, crew.SERIAL)
        )
    assert found == [("one", b"one"), ("two", b"two")]


def test_a_manifest_lists_what_the_store_holds(job: Job) -> None:
    runs = sweep.wanted(with_variants(job))[6:]
    for run in runs:
        write(run, store.place(store.RUN, run.digest))
    path = Path("data/some/greedy.json")
    sweep.write_manifest(path, runs)
    content = artifact.content(store.place(store.RUN, runs[0].digest))
    assert json.loads(path.read_text(encoding="utf-8")) == [
        {"variant": "a/greedy", "condition": "free", "reward": "mtl", "seed": run.seed, "digest": run.digest,
         "content": content} for run in runs
    ]  # fmt: skip


def test_one_bad_seed_costs_no_other(job: Job, monkeypatch: pytest.MonkeyPatch) -> None:
    tried: list[str] = []

    def work(job: Job, chunk: Chunk, report: object) -> list[bytes]:
        tried.append(chunk.name)
        if any(run.reward == "mtl" and run.seed == 1 for run in chunk.runs):
            raise FloatingPointError("it slipped")
        return [run.digest.encode() for run in chunk.runs]

    monkeypatch.setattr(sweep, "work", work)
    runs = sweep.wanted(job)
    assert sweep.compute(job, runs, 2, crew.SERIAL) == ["free, mtl, seed 1: it slipped"]
    assert set(kept()) == {runs[0].digest, runs[2].digest, runs[3].digest}
    assert sorted(tried) == ["free, cais, seed 0, 1", "free, mtl, seed 0", "free, mtl, seed 0, 1", "free, mtl, seed 1"]


def test_an_interrupt_keeps_what_is_finished(job: Job, monkeypatch: pytest.MonkeyPatch) -> None:
    def work(job: Job, chunk: Chunk, report: object) -> list[bytes]:
        if kept():
            raise KeyboardInterrupt
        return [run.digest.encode() for run in chunk.runs]

    monkeypatch.setattr(sweep, "work", work)
    runs = sweep.wanted(job)
    with pytest.raises(KeyboardInterrupt):
        sweep.compute(job, runs, 1, crew.SERIAL)
    assert len(kept()) == 1
    assert sweep.compute(job, [], 1, crew.SERIAL) == []
