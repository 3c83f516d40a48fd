"""MIMo v1 (Mattern et al. 2024), the model of an 18-month-old, as a mujoco.MjSpec: head and trunk fixed, limbs free.

Figures of the reference model with mitten hands, in m, kg, N and rad unless a name says degrees. Body frames: x
forward (chest), y left, z up along the trunk while standing. The left limbs are the right ones mirrored in the median
plane; the reference sets its left hand 14 mm off that mirror image, ours does not.
"""

from dataclasses import dataclass
from math import radians

import mujoco
import numpy as np

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]

ABOUT_X: Quaternion = (0.707107, 0.707107, 0.0, 0.0)  # a quarter turn: along y
ABOUT_Y: Quaternion = (0.707107, 0.0, 0.707107, 0.0)  # a quarter turn: along x
UPRIGHT: Quaternion = (1.0, 0.0, 0.0, 0.0)
SHIRT, TROUSERS, WHITE, SKIN = (0.1, 0.5, 0.0, 1.0), (0.1, 0.1, 0.6, 1.0), (1.0, 1.0, 1.0, 1.0), (0.95, 0.8, 0.5, 1.0)
SMOOTH, GRIP, SOLE = (1.0, 0.005, 0.0002), (5.0, 0.02, 0.01), (2.0, 0.02, 0.01)  # friction

LIMIT = (0.98, 0.99, 0.001, 0.5, 1.0)  # MuJoCo's solimp of every joint's limits


@dataclass(frozen=True)
class Hinge:
    """A hinge joint; stiffness N m/rad, damping N m s/rad, friction N m, armature kg m², torque N m."""

    name: str
    axis: Vector
    degrees: tuple[float, float]
    stiffness: float = 0.0
    damping: float = 0.0
    friction: float = 0.0
    armature: float = 0.0
    rest_degrees: float = 0.0
    pos: Vector = (0.0, 0.0, 0.0)
    torque: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True)
class Shape:
    """A geom: type, size, place, mass, look; `contact` is (contype, conaffinity)."""

    kind: str
    size: Vector
    pos: Vector
    mass: float
    rgba: tuple[float, float, float, float]
    quat: Quaternion = UPRIGHT
    friction: Vector = SMOOTH
    contact: tuple[int, int] = (1, 1)


@dataclass(frozen=True)
class Part:
    """A body with its joints and shapes."""

    name: str
    parent: str
    pos: Vector
    shapes: tuple[Shape, ...]
    hinges: tuple[Hinge, ...] = ()
    quat: Quaternion = UPRIGHT


TRUNK = (
    Part("hip", "", (0, 0, 0), (Shape("capsule", (0.048, 0.043, 0), (-0.002, 0, 0.005), 1.1584, TROUSERS, ABOUT_X),)),
    Part(
        "lower_body",
        "hip",
        (0.002, 0, 0.076),
        (Shape("capsule", (0.053, 0.035, 0), (0.005, 0, -0.008), 1.3245, TROUSERS, ABOUT_X, contact=(0, 1)),),
    ),
    Part(
        "upper_body",
        "lower_body",
        (-0.002, 0, 0.091),
        (
            Shape("capsule", (0.052, 0.035, 0), (0.007, 0, -0.032), 1.0882, SHIRT, ABOUT_X),
            Shape("capsule", (0.048, 0.039, 0), (0.004, 0, 0.03), 0.9499, SHIRT, ABOUT_X),
            Shape("capsule", (0.041, 0.047, 0), (0, 0, 0.09), 0.7217, SHIRT, ABOUT_X),
        ),
    ),
    Part("head", "upper_body", (0, 0, 0.135), (Shape("sphere", (0.0735, 0, 0), (0.01, 0, 0.0735), 1.7748, WHITE),)),
)

RIGHT = (
    Part(
        "right_eye", "head", (0.07, -0.0245, 0.067375), (Shape("sphere", (0.01125, 0, 0), (0, 0, 0), 0.006275, WHITE),)
    ),
    Part(
        "right_upper_arm",
        "upper_body",
        (-0.005, -0.105, 0.093),
        (Shape("capsule", (0.024, 0.0536, 0), (0, 0, 0.0536), 0.2684, WHITE),),
        (
            Hinge(
                "right_shoulder1",
                (0, 0.242536, -0.970143),
                (-28, 118),
                0.09,
                0.05,
                0.0009,
                0.004,
                0,
                (0, -0.024, 0),
                (-1.8, 1.8),
            ),
            Hinge("right_shoulder2", (-1, 0, 0), (-84, 183), 0.11, 0.1, 0.0014, 0.004, torque=(-2.75, 4.0)),
            Hinge("right_shoulder3", (0, 0, -1), (-99, 67), 0.12, 0.07, 0.0008, 0.004, torque=(-2.5, 1.6)),
        ),
        (0.087156, 0.996195, 0, 0),
    ),
    Part(
        "right_lower_arm",
        "right_upper_arm",
        (0, 0, 0.1076),
        (Shape("capsule", (0.023, 0.037, 0), (0, 0, 0.037), 0.1853, SKIN),),
        (Hinge("right_elbow", (0, -1, 0), (-146, 5), 0.13, 0.11, 0.03, 0.002, -20, torque=(-3.6, 2.988)),),
    ),
    Part(
        "right_hand",
        "right_lower_arm",
        (0, -0.007, 0.087),
        (
            Shape("box", (0.0281, 0.01, 0.0208), (0.005, 0, 0.0208), 0.04315, SKIN),
            Shape("cylinder", (0.0102, 0.0278, 0), (0.005, 0, 0.0416), 0.01602, SKIN, ABOUT_Y),
        ),
        (
            Hinge("right_hand1", (0, 0, -1), (-90, 90), 0.22, 0.03, 0.007, 0.001, -20, (0, 0.007, 0), (-0.7, 0.7)),
            Hinge("right_hand2", (-1, 0, 0), (-92, 86), 0.33, 0.11, 0.007, 0.001, torque=(-1.24, 0.7068)),
            Hinge("right_hand3", (0, 1, 0), (-53, 48), 0.38, 0.11, 0.007, 0.001, torque=(-0.8265, 0.95)),
        ),
    ),
    Part(
        "right_fingers",
        "right_hand",
        (0, 0, 0.0416),
        (
            Shape("box", (0.0228, 0.01, 0.0207), (0, 0, 0.0207), 0.03494, SKIN, friction=GRIP),
            Shape("cylinder", (0.0102, 0.023, 0), (0, 0, 0.0414), 0.01323, SKIN, ABOUT_Y, GRIP),
        ),
        (Hinge("right_fingers", (-1, 0, 0), (-160, 8), 0.017, 0.018, 0.0023, 0.0001, -40, torque=(-0.69, 0.2277)),),
    ),
    Part(
        "right_upper_leg",
        "hip",
        (0.005, -0.051, -0.007),
        (Shape("capsule", (0.037, 0.0625, 0), (0, 0, -0.0645), 0.7998, WHITE, contact=(2, 3)),),
        (
            Hinge("right_hip1", (0, 1, 0), (-133, 20), 1.72, 1.27, 0.08, 0.005, -10, torque=(-8.0, 8.0)),
            Hinge("right_hip2", (1, 0, 0), (-51, 17), 3.51, 1.99, 0.062, 0.005, torque=(-6.24, 6.24)),
            Hinge("right_hip3", (0, 0, -1), (-32, 41), 2.16, 0.75, 0.027, 0.005, torque=(-2.655, 3.54)),
        ),
    ),
    Part(
        "right_lower_leg",
        "right_upper_leg",
        (0, 0, -0.135),
        (
            Shape("capsule", (0.029, 0.044, 0), (0, 0, -0.044), 0.3341, SKIN),
            Shape("capsule", (0.021, 0.028, 0), (0, 0, -0.134), 0.116, SKIN),
        ),
        (Hinge("right_knee", (0, -1, 0), (-145, 4), 1.63, 0.53, 0.065, 0.003, -30, torque=(-6.5, 10.0)),),
    ),
    Part(
        "right_foot",
        "right_lower_leg",
        (0, 0, -0.177),
        (
            Shape("cylinder", (0.0249, 0.0099, 0), (-0.016, 0, 0), 0.03219, SKIN),
            Shape("box", (0.035, 0.025, 0.01), (0.019, 0, 0), 0.0585, SKIN, friction=SOLE),
            Shape("cylinder", (0.0099, 0.0248, 0), (0.054, 0, 0), 0.01268, SKIN, ABOUT_X, SOLE),
        ),
        (
            Hinge("right_foot1", (0, -1, 0), (-63, 32), 1.29, 0.6, 0.019, 0.003, -10, (0, 0, 0.015), (-3.78, 1.89)),
            Hinge("right_foot2", (1, 0, 0), (-33, 31), 0.96, 0.37, 0.011, 0.0025, 0, (0, 0, 0.015), (-1.0556, 1.16)),
            Hinge("right_foot3", (0, 0, 1), (-20, 30), 1.15, 0.38, 0.012, 0.002, 0, (0, 0, 0.015), (-1.2, 1.2)),
        ),
    ),
    Part(
        "right_toes",
        "right_foot",
        (0.054, 0, 0),
        (
            Shape("box", (0.007, 0.0249, 0.0099), (0.007, 0, 0), 0.01084, SKIN, friction=SOLE),
            Shape("cylinder", (0.01, 0.025, 0), (0.014, 0, 0), 0.01226, SKIN, ABOUT_X, SOLE),
        ),
        (Hinge("right_toes", (0, -1, 0), (-60, 80), 0.106, 0.04, 0.005, 0.0005, torque=(-0.33, 0.099)),),
    ),
)

_FIXED = tuple(
    """
    hip_lean1 hip_lean2 hip_rot1 hip_rot2 hip_bend1 hip_bend2 head1 head2 head3
    left_eye1 left_eye2 left_eye3 right_eye1 right_eye2 right_eye3
    """.split()  # noqa: SIM905
)
_LIMBS = tuple(
    """
    right_shoulder1 right_shoulder2 right_shoulder3 left_shoulder1 left_shoulder2 left_shoulder3
    right_elbow left_elbow right_hand1 right_hand2 right_hand3 left_hand1 left_hand2 left_hand3
    right_fingers left_fingers right_hip1 right_hip2 right_hip3 left_hip1 left_hip2 left_hip3
    right_knee left_knee right_foot1 right_foot2 right_foot3 left_foot1 left_foot2 left_foot3
    right_toes left_toes
    """.split()  # noqa: SIM905
)

JOINTS: tuple[str, ...] = (*_FIXED, *_LIMBS)
"""The 47 proprioceptive joints in the order of the paper's table; the first 15 are fixed at angle 0."""

FIXED = len(_FIXED)

ACTUATED: tuple[str, ...] = tuple(
    name for name in _LIMBS if name.endswith(("shoulder1", "shoulder2", "elbow", "hip1", "hip2", "knee"))
)
"""The paper's 12 actuated joints, bold in its table, in the same order."""

LIMB_JOINTS: dict[str, tuple[str, ...]] = {
    f"{side}_{end}": tuple(f"{side}_{joint}" for joint in joints)
    for side in ("left", "right")
    for end, joints in (("foot", ("hip1", "hip2", "knee")), ("hand", ("shoulder1", "shoulder2", "elbow")))
}
"""The three actuated joints that move each limb's end."""


def attached(limb: str) -> np.ndarray:
    """(12,) bool: which of ACTUATED belong to `limb`."""
    return np.array([joint in LIMB_JOINTS[limb] for joint in ACTUATED])


def add_to(spec: mujoco.MjSpec, pos: Vector, quat: Quaternion) -> None:
    """Add the infant to `spec`, its hip at `pos`, turned by `quat`, with one motor (gear 1, N m) for each of ACTUATED.

    Contact filters stop at welded bodies, so thigh-pelvis and upper arm-trunk pairs are excluded by name; without that
    hips and shoulders jam.
    """
    parts = [part for right in RIGHT for part in (right, mirrored(right))]
    for part in (*TRUNK, *parts):
        parent = spec.body(part.parent) if part.parent else spec.worldbody
        place, turn = (part.pos, part.quat) if part.parent else (pos, quat)
        body = parent.add_body(name=part.name, pos=place, quat=turn)
        for hinge in part.hinges:
            _add_hinge(body, hinge)
        for index, shape in enumerate(part.shapes):
            _add_shape(body, shape, f"{part.name}{index}")
    spec.body("right_eye").add_camera(name="right_eye", pos=(0.01125, 0, 0), quat=(0.5, 0.5, -0.5, -0.5), fovy=60)
    torques = {hinge.name: hinge.torque for part in parts for hinge in part.hinges}
    for name in ACTUATED:
        motor = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT, ctrlrange=torques[name])
        motor.set_to_motor()
        motor.ctrllimited = True
    for side in ("left", "right"):
        for limb, trunk in (("upper_leg", ("hip", "lower_body")), ("upper_arm", ("upper_body",))):
            for body in trunk:
                spec.add_exclude(bodyname1=f"{side}_{limb}", bodyname2=body)


def mirrored(part: Part) -> Part:
    """The left counterpart of a right part: y changes sign, turns and hinge axes (axial vectors) in x and z do."""
    return Part(
        _left(part.name),
        _left(part.parent),
        _flip(part.pos),
        tuple(
            Shape(s.kind, s.size, _flip(s.pos), s.mass, s.rgba, _flip_turn(s.quat), s.friction, s.contact)
            for s in part.shapes
        ),
        tuple(
            Hinge(_left(h.name), (-h.axis[0], h.axis[1], -h.axis[2]), h.degrees, h.stiffness, h.damping, h.friction,
                  h.armature, h.rest_degrees, _flip(h.pos), h.torque)
            for h in part.hinges
        ),
        _flip_turn(part.quat),
    )  # fmt: skip


def _left(name: str) -> str:
    return name.replace("right_", "left_")


def _flip(vector: Vector) -> Vector:
    return (vector[0], -vector[1], vector[2])


def _flip_turn(quat: Quaternion) -> Quaternion:
    return (quat[0], -quat[1], quat[2], -quat[3])


def _add_hinge(body: mujoco.MjsBody, hinge: Hinge) -> None:
    body.add_joint(
        name=hinge.name,
        type=mujoco.mjtJoint.mjJNT_HINGE,
        axis=hinge.axis,
        pos=hinge.pos,
        limited=True,
        range=[radians(angle) for angle in hinge.degrees],
        stiffness=hinge.stiffness,
        damping=hinge.damping,
        frictionloss=hinge.friction,
        armature=hinge.armature,
        springref=radians(hinge.rest_degrees),
        solimp_limit=LIMIT,
    )


def _add_shape(body: mujoco.MjsBody, shape: Shape, name: str) -> None:
    body.add_geom(
        name=name,
        type=getattr(mujoco.mjtGeom, f"mjGEOM_{shape.kind.upper()}"),
        size=shape.size,
        pos=shape.pos,
        quat=shape.quat,
        mass=shape.mass,
        rgba=shape.rgba,
        friction=shape.friction,
        contype=shape.contact[0],
        conaffinity=shape.contact[1],
    )
