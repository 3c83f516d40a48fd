"""One run: what it records, and that its bytes are its own in any company."""

import hashlib
import subprocess
import sys
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from mimo.learning import rewards
from mimo.learning.agent import MOVE, Agents
from mimo.learning.experiment import Experiment, Record, RunError, Running, initial_quantiles
from mimo.learning.outcomes import Outcomes
from mimo.record import artifact, identity, streams
from mimo.settings import params
from mimo.settings.params import Params
from mimo.vision.encoder import Extractor, Trained
from mimo.world import scene
from mimo.world.eye import Eye
from mimo.world.physics import DivergedError, Worlds

P = params.load()
STEPS, ATTACHED = 10, range(3, 7)
ALL = ("mtl", "rtl", "cais", "surprise", "mtl_surprise", "rtl_surprise", "cais_surprise")
SHAPES = {
    "action": (STEPS, 12),
    "positive": (STEPS, 12),
    "centre_of_mass": (STEPS, 3),
    "path_length": (STEPS,),
    "latent_length": (STEPS,),
    "q": (STEPS, 12, 2),
    "move_probability": (STEPS, 12),
    "reward": (STEPS, 12),
}
SCRIPT = """
import hashlib, json, sys
from mimo.record import artifact; from mimo.vision import encoder; from mimo.learning import experiment; from mimo.settings import params
settings = params.Params.model_validate_json(sys.argv[1])
trained = encoder.load(artifact.read(sys.argv[2], encoder.SCHEMA))
scales = json.loads(sys.argv[3])
for reward in ("mtl", "cais_surprise"):
    record = experiment.Experiment(settings, "noisy", reward, [1, 0], trained, scales).run()[0]
    print(hashlib.sha256(artifact.to_bytes("run", "d" * 64, record)).hexdigest())
"""

RUNNING = params.checked(P.rewards, {"scale": "running"})

Runs = Callable[..., list[dict[str, np.ndarray]]]


def arrays(record: Record) -> dict[str, np.ndarray]:
    return {name: dataset.values for name, dataset in record.items()}


def file(record: Record) -> bytes:
    return artifact.to_bytes("run", "d" * 64, record)


@pytest.fixture(scope="module")
def records(tiny: Params, trained: Trained, scales: dict[str, float]) -> Callable[..., list[Record]]:
    """The records of (condition, reward, *seeds), computed once."""

    @cache
    def run(condition: str, reward: str, *seeds: int) -> list[Record]:
        return Experiment(tiny, condition, reward, seeds, trained, scales).run()

    return run


@pytest.fixture(scope="module")
def running(tiny: Params, trained: Trained) -> Callable[..., list[Record]]:
    """Likewise with running scales, so that no scale is given."""
    changed = tiny.model_copy(update={"rewards": RUNNING})

    @cache
    def run(condition: str, reward: str, *seeds: int) -> list[Record]:
        return Experiment(changed, condition, reward, seeds, trained, {}).run()

    return run


@pytest.fixture(scope="module")
def runs(records: Callable[..., list[Record]]) -> Runs:
    """Likewise, their arrays."""
    return lambda *key: [arrays(record) for record in records(*key)]


# What a run records.


@pytest.mark.parametrize("reward", ALL)
def test_names_shapes_types(reward: str, records: Callable[..., list[Record]]) -> None:
    parts = reward.split("_")
    shapes = SHAPES | {f"part/{part}": (STEPS, 12) for part in parts}
    if {"cais", "surprise"} & set(parts):
        shapes["influence"] = (STEPS, 12)
    for record in records("noisy", reward, 0, 1):
        assert {name: dataset.values.shape for name, dataset in record.items()} == shapes
        for name, dataset in record.items():
            assert dataset.values.dtype == (np.uint8 if name in ("action", "positive") else np.float32)
            assert np.isfinite(dataset.values).all()
            assert dataset.units
            assert len(dataset.axes.split(", ")) == dataset.values.ndim
            assert dataset.axes.startswith("step")
        for name in ("action", "positive"):
            assert set(np.unique(record[name].values)) == {0, 1}


def test_progress_counts_steps(tiny: Params, trained: Trained, scales: dict[str, float]) -> None:
    told: list[int] = []
    Experiment(tiny, "free", "mtl", [0, 1], trained, scales).run(told.append)
    assert told == list(range(1, STEPS + 1))


def test_the_rope_is_on_in_the_attached_phase_alone(
    tiny: Params, trained: Trained, scales: dict[str, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[bool] = []
    step = Worlds.step

    def spy(self: Worlds, torque: np.ndarray, attached: bool) -> Any:
        told.append(attached)
        return step(self, torque, attached)

    monkeypatch.setattr(Worlds, "step", spy)
    Experiment(tiny, "free", "mtl", [0], trained, scales).run()
    assert told == [index in ATTACHED for index in range(STEPS)]


def test_a_free_mobile_moves_only_when_pulled(runs: Runs) -> None:
    for record in runs("free", "mtl", 0, 1, 2):
        path, centre = record["path_length"], record["centre_of_mass"].astype(float)
        assert path[:3].max() < 1e-8
        assert path[ATTACHED].min() > 1e-5
        assert path[ATTACHED].sum() > 0.003
        away = np.linalg.norm(centre[6:] - centre[0], axis=1)
        assert (np.diff(away) < 0).all()  # let go, it returns
    for record in runs("noisy", "mtl", 0, 1, 2):
        assert record["path_length"].min() > 0.01


# A run's bytes are its own.


@pytest.mark.parametrize(("made", "reward"), [("records", "mtl"), ("running", "cais_surprise")])
def test_the_same_bytes_in_any_company(made: str, reward: str, request: pytest.FixtureRequest) -> None:
    records: Callable[..., list[Record]] = request.getfixturevalue(made)
    three = [file(record) for record in records("noisy", reward, 0, 1, 2)]
    assert len(set(three)) == 3
    assert [file(record) for record in records("noisy", reward, 2, 0, 1)] == [three[2], three[0], three[1]]
    for seed in range(3):
        assert [file(record) for record in records("noisy", reward, seed)] == [three[seed]]


def test_the_same_bytes_in_another_process(
    tiny: Params, encoder_file: bytes, scales: dict[str, float], records: Callable[..., list[Record]], tmp_path: Path
) -> None:
    (tmp_path / "encoder.h5").write_bytes(encoder_file)
    text = identity.canonical(scales).decode()
    command = [sys.executable, "-c", SCRIPT, tiny.model_dump_json(), str(tmp_path / "encoder.h5"), text]
    there = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
    here = [records("noisy", reward, 0, 1, 2)[1] for reward in ("mtl", "cais_surprise")]
    assert there == [hashlib.sha256(file(record)).hexdigest() for record in here]


@pytest.mark.parametrize("condition", streams.CONDITIONS)
def test_rewards_are_paired(condition: str, runs: Runs) -> None:
    """For the same seed every reward meets the same torque directions, and the same chances to act."""
    first = [runs(condition, reward, 0, 1)[1] for reward in ALL]
    for record in first:
        assert (record["positive"] == first[0]["positive"]).all()
        assert (record["q"][0] == first[0]["q"][0]).all()
        assert (record["action"][0] == first[0]["action"][0]).all()
    assert (runs(condition, "mtl", 0, 1)[0]["positive"] != first[0]["positive"]).any()


def test_rewards_meet_the_same_noise(
    tiny: Params, trained: Trained, scales: dict[str, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    control = Worlds.control
    met: list[np.ndarray] = []

    def spy(self: Worlds, torque: np.ndarray) -> np.ndarray:
        met.append(control(self, torque))
        return met[-1]

    monkeypatch.setattr(Worlds, "control", spy)
    forces = []
    for reward in ("mtl", "cais_surprise"):
        met.clear()
        Experiment(tiny, "noisy", reward, [0, 1], trained, scales).run()
        forces.append(np.stack(met)[..., 12:])
    assert forces[0].shape[:3] == (STEPS, 2, 120)
    assert forces[0].tobytes() == forces[1].tobytes()
    assert (forces[0][:, 0] != forces[0][:, 1]).any()
    assert np.linalg.norm(forces[0], axis=-1) == pytest.approx(np.full((STEPS, 2, 120), 40.0))


def test_seeds_and_conditions_differ(runs: Runs) -> None:
    for name in ("positive", "q", "action"):
        drawn = [runs(condition, "mtl", 0, 1, 2)[seed][name] for condition in streams.CONDITIONS for seed in range(3)]
        assert len({array.tobytes() for array in drawn}) == 6


# What is recorded fits together.


@pytest.mark.parametrize("reward", ALL)
@pytest.mark.parametrize("condition", streams.CONDITIONS)
def test_the_reward_is_gain_over_scale_of_its_parts(
    condition: str, reward: str, runs: Runs, tiny: Params, scales: dict[str, float]
) -> None:
    for record in runs(condition, reward, 0, 1):
        total = sum(0.3 / scales[part] * record[f"part/{part}"].astype(float) for part in reward.split("_"))
        assert tiny.rewards.gain == 0.3
        assert record["reward"] == pytest.approx(total, rel=1e-6)
        assert record["reward"].std() > 0


def test_running_against_all_so_far() -> None:
    values = np.random.default_rng(0).exponential(size=(5, 3, 12)) * [[[1e-3], [1], [1e3]]] + 7  # step, seed, joint
    values[:2, 2] = 0.1  # equal until the third step
    taken, shown = Running(3), values.astype(np.float32)
    for step in range(5):
        given = taken(torch.from_numpy(shown[step]))
        assert given.dtype == torch.float32
        for seed in range(3):
            so_far = shown[: step + 1, seed].astype(float)
            wanted = (so_far[-1] - so_far.mean()) / so_far.std() if seed < 2 or step > 1 else np.zeros(12)
            assert given[seed].numpy() == pytest.approx(wanted, rel=1e-6, abs=1e-6)


def test_running_by_hand() -> None:
    taken, row = Running(1), torch.ones(1, 12)
    assert taken(0 * row).tolist() == [[0.0] * 12]
    assert taken(2 * row).tolist() == [[1.0] * 12]  # mean 1, SD 1
    assert taken(4 * row)[0].numpy() == pytest.approx(np.full(12, 1.5**0.5))  # mean 2, variance (4 + 0 + 4) / 3
    assert taken(float("nan") * row).isnan().all()  # not hidden


@pytest.mark.parametrize("value", [0.0, 0.1, 1e-20, 3e7])
def test_running_gives_nothing_for_a_constant(value: float) -> None:
    taken = Running(2)
    for _ in range(100):
        assert not taken(torch.full((2, 1), value).expand(2, 12)).any()


@pytest.mark.parametrize("reward", ALL)
def test_with_running_scales_the_reward_is_gain_times_standardised_parts(
    reward: str, running: Callable[..., list[Record]]
) -> None:
    for record in map(arrays, running("noisy", reward, 0, 1)):
        for step in range(STEPS):
            so_far = [record[f"part/{part}"][: step + 1].astype(float) for part in reward.split("_")]
            total = sum(0.3 * (part[-1] - part.mean()) / (part.std() or np.inf) for part in so_far)
            assert record["reward"][step] == pytest.approx(total, rel=1e-5, abs=1e-6)
        assert record["reward"].std() > 0


@pytest.mark.parametrize("condition", streams.CONDITIONS)
def test_the_parts_are_what_they_say(condition: str, runs: Runs) -> None:
    for record in runs(condition, "mtl_surprise", 0, 1):
        assert (record["part/mtl"] == record["path_length"][:, None]).all()
    for record in runs(condition, "rtl", 0, 1):
        assert (record["part/rtl"] == record["latent_length"][:, None]).all()
        assert record["latent_length"][list(ATTACHED)].min() > 0
    for record in runs(condition, "cais", 0, 1):  # rewards.cais.pays is move
        assert (record["part/cais"] == np.where(record["action"], record["influence"], 0)).all()
        assert record["influence"][1:].max() > 0


@pytest.mark.parametrize("condition", streams.CONDITIONS)
def test_actions_follow_the_policy_and_its_stream(condition: str, runs: Runs, tiny: Params) -> None:
    for seed, record in enumerate(runs(condition, "cais_surprise", 0, 1, 2)):
        policy, direction = (
            streams.generator(tiny.seed, condition, seed, purpose) for purpose in ("policy", "direction")
        )
        chance, side = (np.stack([draw.random(12) for _ in range(STEPS)]) for draw in (policy, direction))
        assert (record["action"] == (chance < record["move_probability"])).all()
        assert (record["positive"] == (side < 0.5)).all()


def test_the_policy_is_softmax_of_q_with_bias_and_temperature(runs: Runs) -> None:
    for record in runs("noisy", "cais_surprise", 0, 1, 2):
        q = record["q"].astype(float)
        rest, move = np.exp(q[..., 0] / 0.3), np.exp((q[..., 1] - 0.2) / 0.3)
        assert record["move_probability"] == pytest.approx(move / (rest + move), rel=1e-5)


@pytest.mark.parametrize("seed", [0, 2])
@pytest.mark.parametrize(("condition", "reward"), [("free", "rtl_surprise"), ("noisy", "cais_surprise")])
def test_a_run_is_what_a_plain_loop_makes_of_its_actions(
    condition: str, reward: str, seed: int, runs: Runs, tiny: Params, trained: Trained
) -> None:
    """World, eye, agent and outcome models in the paper's order (fig. 1B), fed with recorded actions and rewards."""
    record = runs(condition, reward, 0, 1, 2)[seed]
    draw = partial(streams.generator, tiny.seed, condition, seed)
    built = scene.build(tiny.world, tiny.protocol)
    worlds = Worlds(built, tiny.protocol, {"free": 0.0, "noisy": 40.0}[condition], [draw("noise")])
    extract = Extractor(tiny.encoder, trained)
    outcomes = Outcomes(tiny.outcomes, initial_quantiles(tiny, trained), [draw("memory")])
    agents = Agents(tiny.agent, 47 + 64, [draw("weights")])
    with Eye(built) as eye:
        h = extract(eye.frames(worlds.qpos))
        state = torch.cat([torch.from_numpy(worlds.proprioception()).float(), h], dim=1)
        for step in range(STEPS):
            assert agents.values(state).numpy().tobytes() == record["q"][step].tobytes()
            moved, positive = (record[name][step][None].astype(bool) for name in ("action", "positive"))
            action = torch.from_numpy(moved)
            influence, expected = outcomes.influence(), outcomes.expectation(action)
            assert (influence[0, :, MOVE].numpy() == record["influence"][step]).all()
            seen = worlds.step(worlds.torque(moved, positive), attached=step in ATTACHED)
            assert (seen.centre_of_mass[0].astype(np.float32) == record["centre_of_mass"][step]).all()
            assert seen.path_length[0].astype(np.float32) == record["path_length"][step]
            before, h = h, extract(eye.frames(worlds.qpos))
            assert record["latent_length"][step] == pytest.approx(torch.linalg.norm(h - before).item(), rel=1e-5)
            surprise = torch.linalg.norm(h[:, None] - expected, dim=-1)[0]
            assert record["part/surprise"][step] == pytest.approx(surprise.numpy(), rel=1e-5)
            outcomes.update(action, h)
            last, state = state, torch.cat([torch.from_numpy(seen.proprioception).float(), h], dim=1)
            agents.update(last, action, torch.from_numpy(record["reward"][step][None]), state)


def test_outcome_models_start_at_the_quantiles_of_h(tiny: Params, trained: Trained, runs: Runs) -> None:
    start = initial_quantiles(tiny, trained)
    assert start.shape == (64, 49)
    assert start.dtype == torch.float32
    # 0.02, 0.04, ...: every second of the kept 0.01, 0.02, ...
    assert start.numpy() == pytest.approx(trained.quantiles[:, 1::2], abs=1e-6)
    for record in runs("noisy", "cais", 0, 1):
        assert not record["influence"][0].any()  # all tables alike


# Faults.


def test_a_reward_that_is_not_finite_stops_the_run(tiny: Params, trained: Trained, scales: dict[str, float]) -> None:
    broken = scales | {"surprise": 1e-320}
    with pytest.raises(
        RunError, match=r"^noisy, mtl_surprise, seed 5 stopped at step 1: the TD error of seed 5 is not"
    ):
        Experiment(tiny, "noisy", "mtl_surprise", [5], trained, broken).run()
    Experiment(tiny, "noisy", "mtl", [5], trained, broken).run()


def test_the_seed_at_fault_is_named(
    tiny: Params, trained: Trained, scales: dict[str, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[int] = []

    def nan_for_the_second_seed_in_the_third_step(self: rewards.MTL, t: rewards.Transition) -> torch.Tensor:
        calls.append(1)
        reward = torch.zeros(t.action.shape)
        reward[1, 4] = torch.nan if len(calls) == 3 else 0
        return reward

    monkeypatch.setattr(rewards.MTL, "__call__", nan_for_the_second_seed_in_the_third_step)
    told: list[int] = []
    with pytest.raises(RunError, match=r"^free, mtl, seeds 4, 7 stopped at step 3: the TD error of seed 7 is not"):
        Experiment(tiny, "free", "mtl", [4, 7], trained, scales).run(told.append)
    assert told == [1, 2]


def test_diverged_physics_stop_the_run(
    tiny: Params, trained: Trained, scales: dict[str, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    def diverge(*_: object) -> None:
        raise DivergedError("the physics of world 1 of 2 diverged")

    monkeypatch.setattr(Worlds, "_check", diverge)
    with pytest.raises(RunError, match=r"^free, rtl, seeds 0, 3 stopped at step 1: the physics of world 1"):
        Experiment(tiny, "free", "rtl", [0, 3], trained, scales).run()
