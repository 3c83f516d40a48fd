"""A rope that holds in some steps alone (`world.rope_holds`): how much control an infant has."""

from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from mimo.learning.experiment import Experiment, Record
from mimo.learning.replay import Replay, replay
from mimo.record import artifact, streams
from mimo.record.artifact import Artifact
from mimo.record.identity import Digest
from mimo.settings import params
from mimo.settings.params import Params
from mimo.vision.extractor import Extractor, Trained
from mimo.world import scene
from mimo.world.eye import Eye
from tests.unit.learning.recorded import ATTACHED, STEPS, Records, Runs, arrays, file

HALF = 0.5
Slack = Callable[..., list[Record]]  # of how often the rope holds, condition, reward, seeds


@pytest.fixture(scope="module")
def slack(tiny: Params, trained: Trained, scales: dict[str, float]) -> Slack:
    @cache
    def run(holds: float, condition: str, reward: str, *seeds: int) -> list[Record]:
        changed = params.changed(tiny, {"world.rope_holds": holds})
        return Experiment(changed, condition, reward, seeds, trained, scales).run()

    return run


@pytest.mark.parametrize(("condition", "reward"), [("free", "mtl"), ("noisy", "cais_surprise")])
def test_a_rope_that_always_holds_is_the_papers(condition: str, reward: str, slack: Slack, records: Records) -> None:
    """Also drawn for in every step: nothing but the draws is another."""
    for ours, always, drawn in zip(
        records(condition, reward, 0, 1),
        slack(1.0, condition, reward, 0, 1),
        slack(1 - 1e-12, condition, reward, 0, 1),
        strict=True,
    ):
        assert file(always) == file(ours)
        assert drawn.keys() - ours.keys() == {"attached"}
        assert drawn["attached"].values.tolist() == [step in ATTACHED for step in range(STEPS)]
        assert file({name: drawn[name] for name in ours}) == file(ours)


@pytest.mark.parametrize(("condition", "reward"), [("free", "mtl"), ("noisy", "cais_surprise")])
def test_a_rope_that_never_holds_is_a_baseline_without_end(
    condition: str, reward: str, slack: Slack, tiny: Params, trained: Trained, scales: dict[str, float], runs: Runs
) -> None:
    lengths = {"protocol.baseline_steps": STEPS, "protocol.attached_steps": 1, "protocol.extinction_steps": 1}
    baseline = Experiment(params.changed(tiny, lengths), condition, reward, [0, 1], trained, scales).run()
    for seed, (never, loose) in enumerate(zip(slack(0.0, condition, reward, 0, 1), baseline, strict=True)):
        assert not never["attached"].values.any()
        for name, dataset in loose.items():
            assert never[name].values.tobytes() == dataset.values[:STEPS].tobytes()
        moved = runs(condition, reward, 0, 1)[seed]["centre_of_mass"]
        assert (never["centre_of_mass"].values[3:] != moved[3:]).any(axis=1).all()
        if condition == "free":
            assert never["path_length"].values.max() < 1e-8


@pytest.mark.parametrize("condition", streams.CONDITIONS)
def test_the_rope_follows_its_stream_in_the_attached_phase_alone(condition: str, slack: Slack, tiny: Params) -> None:
    """The same for every reward of a seed."""
    drawn = []
    for seed in range(3):
        stream = streams.generator(tiny.seed, condition, seed, "rope")
        holds = np.array([stream.random() < HALF for _ in range(STEPS)])
        drawn.append([bool(holds[step]) and step in ATTACHED for step in range(STEPS)])
    for reward in ("mtl", "cais_surprise"):
        found = slack(HALF, condition, reward, 0, 1, 2)
        assert [record["attached"].values.tolist() for record in found] == drawn
        for record in found:
            assert record["attached"].values.dtype == np.uint8
            assert (record["attached"].units, record["attached"].axes) == ("1 = the rope holds", "step")
    assert 0 < np.mean([row[3:7] for row in drawn]) < 1


def test_a_free_mobile_is_pulled_while_the_rope_holds_alone(slack: Slack) -> None:
    pulled = 0
    for record in map(arrays, slack(HALF, "free", "mtl", 0, 1, 2)):
        held, path = record["attached"] > 0, record["path_length"]
        for step in range(1, STEPS):
            if held[step] and not held[:step].any():
                assert path[:step].max() < 1e-8
                assert path[step] > 1e-5
                pulled += 1
        away = np.linalg.norm(record["centre_of_mass"].astype(float) - record["centre_of_mass"][0], axis=1)
        loose = ~held[1:] & (away[:-1] > 1e-4)
        assert (away[1:][loose] < away[:-1][loose]).all()  # let go, it returns
    assert pulled


def test_the_share_of_steps_is_as_asked(tiny: Params, trained: Trained, scales: dict[str, float]) -> None:
    """Over 320 draws, of SD 0.026."""
    lengths = {"protocol.baseline_steps": 1, "protocol.attached_steps": 20, "protocol.extinction_steps": 1}
    asked = params.changed(tiny, lengths | {"world.rope_holds": 0.3})
    found = [
        arrays(record)["attached"] for record in Experiment(asked, "free", "mtl", range(16), trained, scales).run()
    ]
    assert not any(attached[0] or attached[-1] for attached in found)
    assert np.mean([attached[1:-1] for attached in found]) == pytest.approx(0.3, abs=0.1)
    assert len({attached.tobytes() for attached in found}) == 16


def test_the_same_bytes_in_any_company(slack: Slack) -> None:
    three = [file(record) for record in slack(HALF, "noisy", "cais_surprise", 0, 1, 2)]
    assert [file(record) for record in slack(HALF, "noisy", "cais_surprise", 2, 0)] == [three[2], three[0]]
    assert [file(record) for record in slack(HALF, "noisy", "cais_surprise", 1)] == [three[1]]


@pytest.mark.parametrize("condition", streams.CONDITIONS)
def test_a_replay_ties_the_rope_when_the_run_did(
    condition: str, slack: Slack, tiny: Params, trained: Trained, tmp_path: Path
) -> None:
    """To the bit; by the phase alone it comes to other numbers."""
    record = slack(HALF, condition, "cais_surprise", 0, 1, 2)[1]
    attached = record["attached"].values[list(ATTACHED)]
    assert attached.any()
    assert not attached.all()

    def lived(held: Record, digest: Digest | str = "d" * 64) -> Replay:
        about: artifact.About = {"condition": condition, "reward": "cais_surprise", "limb": "left_foot", "seed": 1}
        run: Artifact = artifact.from_bytes(artifact.to_bytes("run", digest, held, about), "run")
        return replay(tiny, run, built, eye, Extractor(tiny.encoder, trained), {4, STEPS - 1})

    built = scene.build(tiny.world, tiny.protocol)
    with Eye(built) as eye:
        again = lived(record)
        by_phase = lived({name: dataset for name, dataset in record.items() if name != "attached"})
        with pytest.raises(ValueError, match=r"^A yoked infant's run cannot be lived through again"):
            lived(record, Digest({"donor": "d" * 64}))
    for name in ("centre_of_mass", "path_length", "latent_length"):
        assert again.record[name].values.tobytes() == record[name].values.tobytes()
        assert by_phase.record[name].values.tobytes() != record[name].values.tobytes()
