"""One run: what it records, how that fits together, and what stops it."""

from functools import partial
from typing import Any

import numpy as np
import pytest

from mimo.learning import rewards
from mimo.learning.agent import Agents
from mimo.learning.experience import initial_quantiles
from mimo.learning.experiment import Experiment, RunError
from mimo.learning.outcomes import Outcomes
from mimo.record import streams
from mimo.settings import params
from mimo.settings.params import Params
from mimo.vision.extractor import Extractor, Trained
from mimo.world import scene
from mimo.world.eye import Eye
from mimo.world.physics import DivergedError, Tied, Worlds
from mimo.world.protocol import MOVE
from tests.unit.learning.recorded import ALL, ATTACHED, STEPS, Records, Runs, arrays

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


@pytest.mark.parametrize("reward", ALL)
def test_names_shapes_types(reward: str, records: Records) -> None:
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
    told: list[Tied] = []
    advance = Worlds._advance

    def spy(self: Worlds, control: np.ndarray, attached: Tied) -> Any:
        told.append(attached)
        return advance(self, control, attached)

    monkeypatch.setattr(Worlds, "_advance", spy)
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


@pytest.mark.parametrize("reward", ["surprise", "rtl_surprise"])
def test_surprise_is_paid_times_its_weight(
    reward: str, runs: Runs, tiny: Params, trained: Trained, scales: dict[str, float]
) -> None:
    half = params.changed(tiny, {"rewards.surprise.weight": 0.5})
    shares = {"rtl": 1.0, "surprise": 0.5}
    for ours, record in zip(
        runs("noisy", reward, 0, 1), Experiment(half, "noisy", reward, [0, 1], trained, scales).run(), strict=True
    ):
        found = arrays(record)
        total = sum(
            0.3 * shares[part] / scales[part] * found[f"part/{part}"].astype(float) for part in reward.split("_")
        )
        assert found["reward"] == pytest.approx(total, rel=1e-6)
        assert (found["part/surprise"][0] == ours["part/surprise"][0]).all()  # what it is, is in its own units
        if reward == "surprise":
            assert found["reward"][0] == pytest.approx(0.5 * ours["reward"][0].astype(float), rel=1e-6)
        assert (found["q"][2] != ours["q"][2]).any()
    running = params.changed(half, {"rewards.scale": "running"})
    found = arrays(Experiment(running, "noisy", "surprise", [0], trained, {}).run()[0])
    for step, paid in enumerate(found["reward"]):
        so_far = found["part/surprise"][: step + 1].astype(float)
        assert paid == pytest.approx(0.15 * (so_far[-1] - so_far.mean()) / (so_far.std() or np.inf), rel=1e-4, abs=1e-6)


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


# The other readings of the paper: docs/readings.md.
READINGS: list[tuple[str, object]] = [
    ("outcomes.action", "limb"),
    ("outcomes.batches", "shared"),
    ("outcomes.marginal", "policy"),
    ("outcomes.start", "zero"),
    ("agent.bias_in_target", True),
    ("rewards.rtl.frames", 4),
]


@pytest.mark.parametrize("seed", [0, 2])
@pytest.mark.parametrize(("condition", "reward"), [("free", "rtl_surprise"), ("noisy", "cais_surprise")])
def test_a_run_is_what_a_plain_loop_makes_of_its_actions(
    condition: str, reward: str, seed: int, runs: Runs, tiny: Params, trained: Trained
) -> None:
    live_again(tiny, condition, seed, runs(condition, reward, 0, 1, 2)[seed], trained)


@pytest.mark.parametrize(("key", "value"), READINGS)
def test_so_it_is_with_each_other_reading(
    key: str, value: object, runs: Runs, tiny: Params, trained: Trained, scales: dict[str, float]
) -> None:
    other = params.changed(tiny, {key: value})
    (record,) = Experiment(other, "noisy", "rtl_surprise", [1], trained, scales).run()
    live_again(other, "noisy", 1, arrays(record), trained)
    ours = runs("noisy", "rtl_surprise", 0, 1)[1]
    assert any(ours[name].tobytes() != dataset.values.tobytes() for name, dataset in record.items())


def live_again(tiny: Params, condition: str, seed: int, record: dict[str, np.ndarray], trained: Trained) -> None:
    """World, eye, agent and outcome models in the paper's order (fig. 1B), fed with recorded actions and rewards."""
    draw = partial(streams.generator, tiny.seed, condition, seed)
    built = scene.build(tiny.world, tiny.protocol)
    worlds = Worlds(built, tiny.protocol, {"free": 0.0, "noisy": 40.0}[condition], [draw("noise")])
    extract = Extractor(tiny.encoder, trained)
    outcomes = Outcomes(tiny.outcomes, initial_quantiles(tiny, trained, condition), [draw("memory")])
    agents = Agents(tiny.agent, 47 + 64, [draw("weights")])
    with Eye(built) as eye:
        h = extract(eye.frames(worlds.qpos))
        state = np.concatenate([worlds.proprioception().astype(np.float32), h], axis=1)
        for step in range(STEPS):
            assert agents.values(state).tobytes() == record["q"][step].tobytes()
            moved, positive = (record[name][step][None].astype(bool) for name in ("action", "positive"))
            influence = outcomes.influence(record["move_probability"][step][None])
            expected = outcomes.expectation(moved)
            assert (influence[0, :, MOVE] == record["influence"][step]).all()
            before, way, path = h, 0.0, 0.0
            cuts = {1: (), 4: (30, 60, 90)}[tiny.rewards.rtl.frames]
            for seen in worlds.pieces(moved, positive, step in ATTACHED, cuts):
                last, h = h, extract(eye.frames(worlds.qpos))
                way, path = way + float(np.linalg.norm(h - last)), path + seen.path_length[0]
            assert (seen.centre_of_mass[0].astype(np.float32) == record["centre_of_mass"][step]).all()
            assert np.float32(path) == record["path_length"][step]
            assert record["latent_length"][step] == pytest.approx(np.linalg.norm(h - before), rel=1e-5)
            if "part/rtl" in record:
                assert record["part/rtl"][step] == pytest.approx(np.full(12, way), rel=1e-5)
            surprise = np.linalg.norm(h[:, None] - expected, axis=-1)[0]
            assert record["part/surprise"][step] == pytest.approx(surprise, rel=1e-5)
            outcomes.update(moved, h)
            state = np.concatenate([seen.proprioception.astype(np.float32), h], axis=1)
            agents.update(moved, record["reward"][step][None], state)


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

    def nan_for_the_second_seed_in_the_third_step(self: rewards.Reward, t: rewards.Transition) -> np.ndarray:
        calls.append(1)
        reward = np.zeros(t.action.shape, np.float32)
        reward[1, 4] = np.nan if len(calls) == 3 else 0
        return reward

    monkeypatch.setattr(rewards.REWARDS["mtl"], "__call__", nan_for_the_second_seed_in_the_third_step)
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
