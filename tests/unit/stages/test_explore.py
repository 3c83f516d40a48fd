"""Stage explore: what the page's script unpacks is what the runs hold, to the precision it says."""

import json
from pathlib import Path

import numpy as np
import pytest

from mimo.record import artifact
from mimo.settings import params
from mimo.world import body
from stages import explore
from stages.base import numbers, paths, store
from tests.unit.reported import SEEDS


def unpacked(packed: dict, shape: tuple[int, ...]) -> np.ndarray:
    """As explore.js does."""
    digits = np.array([numbers.PACKED.index(letter) for letter in packed["text"]]).reshape(*shape, 2)
    return packed["low"] + (digits @ [64, 1]) / numbers.LEVELS * (packed["high"] - packed["low"])


@pytest.mark.parametrize("values", [np.linspace(-3, 7, 60).reshape(3, 4, 5), np.full((2, 2), 0.25), np.zeros(1)])
def test_what_is_packed_comes_back_to_half_a_level(values: np.ndarray) -> None:
    packed = numbers.packed(values)
    assert len(packed["text"]) == 2 * values.size
    half = (packed["high"] - packed["low"]) / numbers.LEVELS / 2
    assert np.abs(unpacked(packed, values.shape) - values).max() <= half + 1e-6


def test_every_run_is_there_joint_by_joint_in_blocks_of_steps(project: Path) -> None:
    found = json.loads(paths.EXPLORE.read_text())
    assert found["steps"] == list(range(1, 81))  # blocks of one step: the project's runs are short
    assert found["phases"] == {"baseline": [1, 20], "attached": [21, 60], "extinction": [61, 80]}
    assert [joint for joint, on in zip(found["joints"], found["attached"], strict=True) if on] == [
        "left_hip1", "left_hip2", "left_knee",
    ]  # fmt: skip
    assert len(found["cells"]) == 14
    temperature = params.load().agent.temperature
    shape = (SEEDS, len(body.ACTUATED), 80)
    for seed in range(SEEDS):
        run = artifact.read(paths.run("noisy", "rtl_surprise", seed), store.RUN)
        cell = found["cells"]["noisy/rtl_surprise"]
        for curve, values in (
            ("move_probability", run["move_probability"]),
            ("q_move", run["q"][..., 1] / temperature),
        ):
            got = unpacked(cell[curve], shape)[seed]
            assert np.abs(got - values.T).max() <= np.ptp(values) / 1000


def test_a_blocks_value_is_the_mean_of_its_steps(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mimo.science.summary.window", lambda phases: 8)
    written = {}
    monkeypatch.setattr("stages.base.numbers.write", lambda made, path: written.update(made))
    explore.main()
    assert written["steps"] == [4.5, 12.5, 18.5, *np.arange(24.5, 60, 8), 64.5, 72.5, 78.5]
    run = artifact.read(paths.run("free", "cais", 1), store.RUN)
    got = unpacked(written["cells"]["free/cais"]["reward"], (SEEDS, len(body.ACTUATED), len(written["steps"])))
    assert got[1, 5, 2] == pytest.approx(run["reward"][16:20, 5].mean(), abs=0.002)
    assert got[1, 5, 3] == pytest.approx(run["reward"][20:28, 5].mean(), abs=0.002)
