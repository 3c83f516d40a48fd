"""The body against the reference model's figures, left and right each from the reference, and its joints in motion."""

import mujoco
import numpy as np
import pytest

from mimo.settings import params
from mimo.world import body, scene
from mimo.world.physics import Worlds

TOTAL_MASS = 10.9049  # kg
MASSES = {
    "hip": 1.1584,
    "lower_body": 1.3245,
    "upper_body": 2.7598,
    "head": 1.7748,
    "eye": 0.00628,
    "upper_arm": 0.2684,
    "lower_arm": 0.1853,
    "hand": 0.05917,
    "fingers": 0.04817,
    "upper_leg": 0.7998,
    "lower_leg": 0.4501,
    "foot": 0.10337,
    "toes": 0.0231,
}
FIGURES = {  # degrees from, to; torque N m from, to; stiffness N m/rad; damping N m s/rad
    "shoulder1": (-28.0, 118.0, -1.8, 1.8, 0.09, 0.05),
    "shoulder2": (-84.0, 183.0, -2.75, 4.0, 0.11, 0.1),
    "shoulder3": (-99.0, 67.0, None, None, 0.12, 0.07),
    "elbow": (-146.0, 5.0, -3.6, 2.988, 0.13, 0.11),
    "hand1": (-90.0, 90.0, None, None, 0.22, 0.03),
    "hand2": (-92.0, 86.0, None, None, 0.33, 0.11),
    "hand3": (-53.0, 48.0, None, None, 0.38, 0.11),
    "fingers": (-160.0, 8.0, None, None, 0.017, 0.018),
    "hip1": (-133.0, 20.0, -8.0, 8.0, 1.72, 1.27),
    "hip2": (-51.0, 17.0, -6.24, 6.24, 3.51, 1.99),
    "hip3": (-32.0, 41.0, None, None, 2.16, 0.75),
    "knee": (-145.0, 4.0, -6.5, 10.0, 1.63, 0.53),
    "foot1": (-63.0, 32.0, None, None, 1.29, 0.6),
    "foot2": (-33.0, 31.0, None, None, 0.96, 0.37),
    "foot3": (-20.0, 30.0, None, None, 1.15, 0.38),
    "toes": (-60.0, 80.0, None, None, 0.106, 0.04),
}
PASSIVE = {  # friction N m; armature kg m²; the spring's angle at rest, degrees
    "shoulder1": (0.0009, 0.004, 0),
    "shoulder2": (0.0014, 0.004, 0),
    "shoulder3": (0.0008, 0.004, 0),
    "elbow": (0.03, 0.002, -20),
    "hand1": (0.007, 0.001, -20),
    "hand2": (0.007, 0.001, 0),
    "hand3": (0.007, 0.001, 0),
    "fingers": (0.0023, 0.0001, -40),
    "hip1": (0.08, 0.005, -10),
    "hip2": (0.062, 0.005, 0),
    "hip3": (0.027, 0.005, 0),
    "knee": (0.065, 0.003, -30),
    "foot1": (0.019, 0.003, -10),
    "foot2": (0.011, 0.0025, 0),
    "foot3": (0.012, 0.002, 0),
    "toes": (0.005, 0.0005, 0),
}
PAPER_TABLE = """
hip_lean1 hip_lean2 hip_rot1 hip_rot2 hip_bend1 hip_bend2
head1 head2 head3 left_eye1 left_eye2 left_eye3
right_eye1 right_eye2 right_eye3 right_shoulder1 right_shoulder2 right_shoulder3
left_shoulder1 left_shoulder2 left_shoulder3 right_elbow left_elbow right_hand1
right_hand2 right_hand3 left_hand1 left_hand2 left_hand3 right_fingers
left_fingers right_hip1 right_hip2 right_hip3 left_hip1 left_hip2
left_hip3 right_knee left_knee right_foot1 right_foot2 right_foot3
left_foot1 left_foot2 left_foot3 right_toes left_toes
"""


@pytest.fixture(scope="module")
def built() -> scene.Scene:
    p = params.load()
    return scene.build(p.world, p.protocol)


def test_the_proprioceptive_joints_are_the_papers_in_its_order() -> None:
    assert list(body.JOINTS) == PAPER_TABLE.split()
    assert len(body.JOINTS) == 47
    assert len(body.ACTUATED) == 12


def test_total_mass(built: scene.Scene) -> None:
    assert mujoco.mj_getTotalmass(built.model) - params.load().world.mobile_mass == pytest.approx(TOTAL_MASS, abs=1e-4)


@pytest.mark.parametrize("part", MASSES)
def test_mass_of_every_body(built: scene.Scene, part: str) -> None:
    paired = part not in ("hip", "lower_body", "upper_body", "head")
    for name in [f"left_{part}", f"right_{part}"] if paired else [part]:
        assert built.model.body(name).mass[0] == pytest.approx(MASSES[part], abs=1e-5)


@pytest.mark.parametrize("joint", FIGURES)
@pytest.mark.parametrize("side", ["left", "right"])
def test_range_torque_stiffness_and_damping_of_every_joint(built: scene.Scene, side: str, joint: str) -> None:
    model = built.model
    low, high, weakest, strongest, stiffness, damping = FIGURES[joint]
    held = model.joint(f"{side}_{joint}")
    assert np.degrees(held.range) == pytest.approx([low, high])
    assert held.stiffness.flat[0] == pytest.approx(stiffness)
    assert held.damping.flat[0] == pytest.approx(damping)
    actuated = f"{side}_{joint}" in body.ACTUATED
    assert actuated == (weakest is not None)
    if actuated:
        motor = model.actuator(f"{side}_{joint}")
        assert motor.ctrlrange == pytest.approx([weakest, strongest])
        assert motor.gear[0] == 1.0
        assert motor.trnid[0] == held.id


@pytest.mark.parametrize("joint", PASSIVE)
@pytest.mark.parametrize("side", ["left", "right"])
def test_friction_armature_spring_and_limits_of_every_joint(built: scene.Scene, side: str, joint: str) -> None:
    friction, armature, rest = PASSIVE[joint]
    held, model = built.model.joint(f"{side}_{joint}"), built.model
    dof = held.dofadr[0]
    assert model.dof_frictionloss[dof] == pytest.approx(friction)
    assert model.dof_armature[dof] == pytest.approx(armature)
    assert np.degrees(model.qpos_spring[held.qposadr[0]]) == pytest.approx(rest)
    assert model.jnt_limited[held.id]
    assert model.jnt_solimp[held.id] == pytest.approx([0.98, 0.99, 0.001, 0.5, 1])
    assert model.jnt_solref[held.id] == pytest.approx([0.02, 1])


def test_left_is_the_mirror_image_of_right(built: scene.Scene) -> None:
    """Turn every right joint, and the left one alike: the bodies end up mirrored in the median plane."""
    model, data = built.model, mujoco.MjData(built.model)
    rng = np.random.default_rng(3)
    for joint in FIGURES:
        data.joint(f"right_{joint}").qpos = data.joint(f"left_{joint}").qpos = rng.uniform(-0.5, 0.5)
    mujoco.mj_kinematics(model, data)
    for part in ("upper_arm", "lower_arm", "hand", "fingers", "upper_leg", "lower_leg", "foot", "toes"):
        right, left = data.body(f"right_{part}").xipos, data.body(f"left_{part}").xipos
        assert left == pytest.approx(right * [1, -1, 1], abs=1e-5)


@pytest.mark.parametrize("positive", [True, False])
def test_every_torque_moves_its_joint(built: scene.Scene, positive: bool) -> None:
    """One world a joint, 200 ms of full torque in one direction; joints that lie at a stop move the other way only."""
    worlds = Worlds(built, params.load().protocol, 0.0, [np.random.default_rng(0)] * 12)
    before = worlds.proprioception()
    next(worlds.pieces(np.eye(12, dtype=bool), np.full((12, 12), positive), attached=False, cuts=[40]))
    turned = np.degrees(worlds.proprioception() - before)
    for world, name in enumerate(body.ACTUATED):
        own = turned[world, body.JOINTS.index(name)]
        if not positive and name.endswith("shoulder1"):
            assert abs(own) < 5  # at its lower stop
        else:
            assert own * (1 if positive else -1) > 5, name


def test_head_and_trunk_are_fixed(built: scene.Scene) -> None:
    assert built.model.nv == 32 + 3  # limbs and the mobile's ball joint
    for part in ("hip", "lower_body", "upper_body", "head", "left_eye", "right_eye"):
        assert built.model.body(part).weldid[0] == 0


@pytest.mark.parametrize("limb", body.LIMB_JOINTS)
def test_attached_names_three_joints_of_the_limb(limb: str) -> None:
    names = [name for name, own in zip(body.ACTUATED, body.attached(limb), strict=True) if own]
    assert len(names) == 3
    side, end = limb.split("_")
    joints = ("hip1", "hip2", "knee") if end == "foot" else ("shoulder1", "shoulder2", "elbow")
    assert set(names) == {f"{side}_{joint}" for joint in joints}
