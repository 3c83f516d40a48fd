"""Curves and summaries, on arrays small enough to be worked by hand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mimo.science import analysis, summary
from mimo.world import body

LIMBS = {limb: body.attached(limb) for limb in body.LIMB_JOINTS}


def record(steps: int = 4) -> dict[str, np.ndarray]:
    """Joint j of step t has reward 100 t + j, and so on."""
    joints = 100.0 * np.arange(steps)[:, None] + np.arange(12.0)
    return {
        "reward": joints.astype(np.float32),
        "part/cais": (joints * 2).astype(np.float32),
        "influence": (joints * 3).astype(np.float32),
        "q": np.stack([joints, joints * 5], axis=-1).astype(np.float32),
        "move_probability": (joints / 1000).astype(np.float32),
        "path_length": np.arange(steps, dtype=np.float32),
        "latent_length": np.arange(steps, dtype=np.float32) * 7,
        "centre_of_mass": np.outer(np.arange(steps, dtype=np.float32) ** 2, [3, 4, 0]).astype(np.float32),
    }


def test_the_store_calls_an_encoder_as_it_calls_itself():
    from mimo.vision import extractor
    from stages.base import store

    assert store.ENCODER == extractor.SCHEMA


def test_curves_are_means_over_the_attached_limbs_joints_and_the_other_nine():
    mine = [body.ACTUATED.index(joint) for joint in ("left_hip1", "left_hip2", "left_knee")]
    others = [joint for joint in range(12) if joint not in mine]
    made = analysis.curves(record(), LIMBS, "left_foot")
    step = 3
    assert made["reward/attached"][step] == pytest.approx(300 + np.mean(mine))
    assert made["reward/others"][step] == pytest.approx(300 + np.mean(others))
    assert made["reward/all"][step] == pytest.approx(300 + 5.5)
    assert made["part/cais/attached"][step] == pytest.approx(2 * (300 + np.mean(mine)))
    assert made["influence/others"][step] == pytest.approx(3 * (300 + np.mean(others)))
    assert made["q_move/attached"][step] == pytest.approx(5 * (300 + np.mean(mine)))
    assert made["q_advantage/attached"][step] == pytest.approx(4 * (300 + np.mean(mine)))
    assert made["move_probability/attached"][step] == pytest.approx((300 + np.mean(mine)) / 1000)
    assert np.array_equal(made["limb/left_foot"], made["move_probability/attached"])
    assert made["path_length"].tolist() == [0, 1, 2, 3]
    assert made["latent_length"].tolist() == [0, 7, 14, 21]
    assert made["displacement"].tolist() == [0, 5, 15, 25]
    assert all(curve.shape == (4,) and curve.dtype == np.float32 for curve in made.values())


def test_curves_do_without_outcome_models():
    plain = {name: values for name, values in record().items() if name != "influence"}
    assert not any("influence" in name for name in analysis.curves(plain, LIMBS, "right_hand"))


def test_windows_of_the_papers_protocol():
    found = analysis.windows(analysis.phases(500, 1500, 500))
    assert {name: (w.start, w.stop) for name, w in found.items()} == {
        "baseline": (0, 500),
        "baseline_late": (250, 500),
        "baseline_end": (400, 500),
        "attached": (500, 2000),
        "acquisition_start": (500, 600),
        "acquisition_early": (500, 800),
        "acquisition_late": (1700, 2000),
        "acquisition_end": (1900, 2000),
        "extinction_early": (2000, 2100),
        "extinction_late": (2250, 2500),
    }


@given(st.integers(1, 700), st.integers(1, 700), st.integers(1, 700))
def test_windows_of_any_protocol_hold_a_step_and_stay_in_their_phase(baseline: int, attached: int, extinction: int):
    phases = analysis.phases(baseline, attached, extinction)
    for name, found in analysis.windows(phases).items():
        phase = phases[{"acquisition": "attached"}.get(name.split("_")[0], name.split("_")[0])]
        assert phase.start <= found.start < found.stop <= phase.stop


def test_smoothing_does_not_cross_a_phase_border():
    phases = analysis.phases(5, 2, 1)
    values = np.array([[0.0, 1, 2, 3, 4, 10, 20, 7]])
    assert summary.smooth(values, phases, 3).tolist() == [[0.5, 1, 2, 3, 3.5, 15, 15, 7]]
    assert summary.smooth(values, phases, 1).tolist() == values.tolist()


@given(st.integers(1, 30), st.integers(1, 12), st.integers(0, 99))
def test_smoothing_is_the_mean_of_the_steps_around(steps: int, width: int, seed: int):
    values = np.random.default_rng(seed).normal(size=(2, 3 * steps))
    phases = analysis.phases(steps, steps, steps)
    found = summary.smooth(values, phases, width)
    for phase in phases.values():
        for step in range(phase.start, phase.stop):
            around = slice(max(phase.start, step - (width - 1) // 2), min(phase.stop, step + width // 2 + 1))
            np.testing.assert_allclose(found[:, step], values[:, around].mean(axis=1), atol=1e-12)


def test_blocks_do_not_cross_a_phase_border():
    steps, means = summary.blocks(np.array([[1.0, 2, 3, 4, 6, 9]]), analysis.phases(3, 2, 1), 2)
    assert steps.tolist() == [1.5, 3, 4.5, 6]
    assert means.tolist() == [[1.5, 3, 5, 9]]


def test_mean_and_sd_are_over_seeds():
    mean, sd = summary.mean_sd(np.array([[1.0, 5], [3, 5]]))
    assert mean.tolist() == [2, 5]
    assert sd.tolist() == pytest.approx([2**0.5, 0])
    assert np.isnan(summary.mean_sd(np.ones((1, 2)))[1]).all()


def test_a_tie_does_not_make_a_limb_the_most_active():
    p = {"left_foot": np.array([0.5, 0.5, 0.2]), "left_hand": np.array([0.4, 0.5, 0.3])}
    assert summary.most_active(p, "left_foot").tolist() == [True, False, False]
    assert summary.most_active(p, "left_hand").tolist() == [False, False, True]


def test_a_cells_numbers():
    windows = analysis.windows(analysis.phases(2, 4, 2))
    attached = np.array([[0.2, 0.4, 0.5, 0.5, 0.8, 0.8, 0.6, 0.1], [0.3, 0.3, 0.5, 0.5, 0.6, 0.6, 0.6, 0.1]])
    others = np.full((2, 8), 0.3)
    stacked = {f"{curve}/{g}": v for curve in ("move_probability", "reward") for g, v in
               (("attached", attached), ("others", others))}  # fmt: skip
    stacked |= {"limb/left_foot": attached, "limb/right_foot": np.full((2, 8), 0.7)}
    found = summary.cell(stacked, windows, "left_foot")
    late = found["move_probability"]["acquisition_late"]
    assert late["attached"] == pytest.approx({"mean": 0.7, "sd": 0.02**0.5})
    assert late["others"] == pytest.approx({"mean": 0.3, "sd": 0.0}, abs=1e-9)
    assert late["difference"]["mean"] == pytest.approx(0.4)
    assert found["rise"] == pytest.approx({"mean": 0.4, "sd": 0.02**0.5})  # 0.5 - 0.0 and 0.3 - 0.0
    assert found["reward"]["extinction_early"]["attached"]["mean"] == pytest.approx(0.6)
    assert found["reward"]["extinction_late"]["attached"]["mean"] == pytest.approx(0.1)
    assert (found["most_active"], found["seeds"]) == (1, 2)
    assert "influence" not in found


def test_names_as_the_paper_writes_them():
    assert summary.label("rtl_surprise") == "RTL + Surprise"
    assert summary.label("novelty") == "Novelty"
