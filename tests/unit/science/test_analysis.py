"""Phases, windows and curves, on arrays small enough to be worked by hand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mimo.science import analysis
from mimo.world import body
from mimo.world.protocol import MOVE, NO_TORQUE

LIMBS = {limb: body.attached(limb) for limb in body.LIMB_JOINTS}
MINE = [body.ACTUATED.index(joint) for joint in ("left_hip1", "left_hip2", "left_knee")]
OTHERS = [joint for joint in range(12) if joint not in MINE]
STEP = 3


def record(steps: int = 4) -> dict[str, np.ndarray]:
    """Joint j of step t has reward 100 t + j, and so on; in each step t, the first t joints move."""
    joints = 100.0 * np.arange(steps)[:, None] + np.arange(12.0)
    q = np.empty((steps, 12, 2), np.float32)
    q[..., NO_TORQUE], q[..., MOVE] = joints, joints * 5
    return {
        "reward": joints.astype(np.float32),
        "part/cais": (joints * 2).astype(np.float32),
        "influence": (joints * 3).astype(np.float32),
        "q": q,
        "move_probability": (joints / 1000).astype(np.float32),
        "action": np.where(np.arange(12) < np.arange(steps)[:, None], MOVE, NO_TORQUE).astype(np.int8),
        "path_length": np.arange(steps, dtype=np.float32),
        "latent_length": np.arange(steps, dtype=np.float32) * 7,
        "centre_of_mass": np.outer(np.arange(steps, dtype=np.float32) ** 2, [3, 4, 0]).astype(np.float32),
    }


def curves(temperature: float = 1.0, **changes: np.ndarray) -> dict[str, np.ndarray]:
    return analysis.curves(record() | changes, LIMBS, "left_foot", temperature)


def test_phases_follow_one_another():
    assert analysis.phases(5, 15, 4) == {"baseline": slice(0, 5), "attached": slice(5, 20), "extinction": slice(20, 24)}


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
        "extinction": (2000, 2500),
        "extinction_early": (2000, 2100),
        "extinction_late": (2250, 2500),
    }


@given(st.integers(1, 700), st.integers(1, 700), st.integers(1, 700))
def test_windows_of_any_protocol_hold_a_step_and_stay_in_their_phase(baseline: int, attached: int, extinction: int):
    phases = analysis.phases(baseline, attached, extinction)
    for name, found in analysis.windows(phases).items():
        part = name.split("_")[0]
        phase = phases[{"acquisition": "attached"}.get(part, part)]
        assert phase.start <= found.start < found.stop <= phase.stop


def test_curves_are_means_over_the_attached_limbs_joints_and_the_other_nine():
    made = curves()
    assert made["reward/attached"][STEP] == pytest.approx(300 + np.mean(MINE))
    assert made["reward/others"][STEP] == pytest.approx(300 + np.mean(OTHERS))
    assert made["reward/all"][STEP] == pytest.approx(300 + 5.5)
    assert made["part/cais/attached"][STEP] == pytest.approx(2 * (300 + np.mean(MINE)))
    assert made["influence/others"][STEP] == pytest.approx(3 * (300 + np.mean(OTHERS)))
    assert made["move_probability/attached"][STEP] == pytest.approx((300 + np.mean(MINE)) / 1000)
    assert np.array_equal(made["limb/left_foot"], made["move_probability/attached"])
    assert made["path_length"].tolist() == [0, 1, 2, 3]
    assert made["latent_length"].tolist() == [0, 7, 14, 21]
    assert all(curve.shape == (4,) and curve.dtype == np.float32 for curve in made.values())


def test_q_is_in_temperatures_and_nothing_else_is():
    made, warm = curves(), curves(temperature=0.25)
    assert made["q_rest/attached"][STEP] == pytest.approx(300 + np.mean(MINE))
    assert made["q_move/others"][STEP] == pytest.approx(5 * (300 + np.mean(OTHERS)))
    for name, curve in made.items():
        np.testing.assert_allclose(warm[name], curve * (4 if name.startswith("q_") else 1), err_msg=name)


def test_one_temperature_more_of_q_move_is_one_more_of_the_log_odds():
    temperature = 0.3
    q = np.zeros((4, 12, 2), np.float32)
    q[..., MOVE] = np.array([-0.6, 0.0, 0.3, 0.9])[:, None]
    p = 1 / (1 + np.exp(-q[..., MOVE] / temperature))
    made = curves(temperature, q=q, move_probability=p)
    odds = made["move_probability/attached"] / (1 - made["move_probability/attached"])
    np.testing.assert_allclose(made["q_move/attached"] - made["q_rest/attached"], np.log(odds), rtol=1e-5)


def test_locked_is_the_share_of_joints_that_all_but_surely_rest_or_move():
    p = np.full((4, 12), 0.5, np.float32)
    p[0, :3] = [0.019, 0.981, 1.0]
    p[1, :3] = [0.021, 0.979, 0.9]
    p[2] = 0.0
    assert curves(move_probability=p)["locked"].tolist() == [0.25, 0, 1, 0]


def test_moved_is_the_share_of_a_limbs_joints_that_moved():
    action = np.full((4, 12), NO_TORQUE, np.int8)
    action[1, MINE[0]] = action[2, MINE] = MOVE
    made = curves(action=action)
    assert made["moved/left_foot"].tolist() == pytest.approx([0, 1 / 3, 1, 0])
    assert {name: made[name].any() for name in made if name.startswith("moved/")} == {
        f"moved/{limb}": limb == "left_foot" for limb in LIMBS
    }


def test_displacement_is_straight_from_the_end_of_a_step_to_that_of_the_next():
    assert curves()["displacement"].tolist() == [0, 5, 15, 25]
    there_and_back = np.array([[0, 0, 1], [0, 0, 4], [0, 0, 1], [0, 0, 1]], np.float32)
    assert curves(centre_of_mass=there_and_back)["displacement"].tolist() == [0, 3, 3, 0]


def test_curves_do_without_outcome_models():
    plain = {name: values for name, values in record().items() if name != "influence"}
    made = analysis.curves(plain, LIMBS, "right_hand", 1.0)
    assert set(made) == set(curves()) - {"influence/attached", "influence/others"}
