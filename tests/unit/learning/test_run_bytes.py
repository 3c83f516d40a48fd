"""A run's bytes are its own, in any company and process; runs of one seed are paired."""

import hashlib
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from mimo.learning.experiment import Experiment
from mimo.record import identity, streams
from mimo.settings.params import Params
from mimo.vision.extractor import Trained
from mimo.world.physics import Worlds
from tests.unit.learning.recorded import ALL, STEPS, Records, Runs, file

SCRIPT = """
import hashlib, json, sys
from mimo.learning import experiment
from mimo.record import artifact
from mimo.settings import params
from mimo.vision import extractor
settings = params.Params.model_validate_json(sys.argv[1])
trained = extractor.load(artifact.read(sys.argv[2], extractor.SCHEMA))
scales = json.loads(sys.argv[3])
for reward in ("mtl", "cais_surprise"):
    record = experiment.Experiment(settings, "noisy", reward, [1, 0], trained, scales).run()[0]
    print(hashlib.sha256(artifact.to_bytes("run", "d" * 64, record)).hexdigest())
"""


@pytest.mark.parametrize(("made", "reward"), [("records", "mtl"), ("running", "cais_surprise")])
def test_the_same_bytes_in_any_company(made: str, reward: str, request: pytest.FixtureRequest) -> None:
    records: Records = request.getfixturevalue(made)
    three = [file(record) for record in records("noisy", reward, 0, 1, 2)]
    assert len(set(three)) == 3
    assert [file(record) for record in records("noisy", reward, 2, 0, 1)] == [three[2], three[0], three[1]]
    for seed in range(3):
        assert [file(record) for record in records("noisy", reward, seed)] == [three[seed]]


def test_the_same_bytes_in_another_process(
    tiny: Params, encoder_file: bytes, scales: dict[str, float], records: Records, tmp_path: Path
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
    control = Worlds._control
    met: list[np.ndarray] = []

    def spy(self: Worlds, moved: np.ndarray, positive: np.ndarray) -> np.ndarray:
        met.append(control(self, moved, positive))
        return met[-1]

    monkeypatch.setattr(Worlds, "_control", spy)
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
