"""The MIMo-Mobile scene: infant supine in a crib, mobile overhead, rope from a limb through a ring to the mobile.

World frame: x towards the feet, y to the infant's left, z up; the mattress is z = 0. The paper leaves mobile,
suspension and rope open: their constants are `params.World`, each with its reason.
"""

from dataclasses import dataclass

import mujoco
import numpy as np

from mimo.settings.params import Protocol, World
from mimo.world import body

HIP_HEIGHT = 0.065  # m; the head's back then touches the mattress
SUPINE = (0.7071067811865476, 0.0, -0.7071067811865476, 0.0)  # chest up, head towards -x
SETTLE_UPDATES = 4000  # 20 s: the shoulders creep for long

NEAR = 0.004  # m from the eye: what is nearer is not drawn, as in MIMo
EXTENT = 2.0  # m, the scene's

SEEN, UNSEEN = 0, 1  # geom groups: what the right eye can see, and the rest
ARMS = ("upper_arm", "lower_arm", "hand", "fingers")

TOYS = (  # place on the cross m, colour; unlike each other, so that the picture tells how the mobile hangs
    ((0.05, 0.0), (0.9, 0.1, 0.1, 1.0)),
    ((0.0, 0.05), (0.1, 0.8, 0.2, 1.0)),
    ((-0.05, 0.0), (0.15, 0.3, 1.0, 1.0)),
    ((0.0, -0.05), (1.0, 0.85, 0.1, 1.0)),
)


@dataclass(frozen=True)
class Scene:
    """A compiled scene.

    Attributes:
        model: the model; keyframe 0 is the infant at rest; the tendon `rope` is slack (stiffness 0) until attached.
        mobile: body id of the mobile.
        rope: tendon id of the rope.
        limb_joints: (32,) qpos addresses of body.JOINTS[15:], in that order.
        rope_stiffness: N/m when attached.
    """

    model: mujoco.MjModel
    mobile: int
    rope: int
    limb_joints: np.ndarray
    rope_stiffness: float

    def centre_of_mass(self, qpos: np.ndarray) -> np.ndarray:
        """The mobile's centre of mass (..., 3) in m, of generalised positions (..., nq)."""
        pivot, arm = self.model.body_pos[self.mobile], self.model.body_ipos[self.mobile]
        first = self.model.jnt_qposadr[self.model.body_jntadr[self.mobile]]
        w, turn = qpos[..., first, None], qpos[..., first + 1 : first + 4]  # a unit quaternion
        place: np.ndarray = pivot + arm + 2 * np.cross(turn, np.cross(turn, arm) + w * arm)
        return place


def build(world: World, protocol: Protocol) -> Scene:
    """Compile the scene for the protocol's limb: settle the infant, put the ring at the limb's resting end."""
    spec = _spec(world, protocol)
    rest = _settle(spec.compile())
    end = rest.site("limb").xpos.copy()
    spec.site("ring").pos = end
    length = float(np.linalg.norm(rest.site("mobile").xpos - end))
    spec.tendon("rope").springlength = (0.0, length + world.rope_slack)
    spec.add_key(name="rest", qpos=rest.qpos)
    model = spec.compile()
    addresses = np.array([model.joint(name).qposadr[0] for name in body.JOINTS[body.FIXED :]])
    return Scene(model, model.body("mobile").id, model.tendon("rope").id, addresses, world.rope_stiffness)


def _spec(world: World, protocol: Protocol) -> mujoco.MjSpec:
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.option.timestep = protocol.timestep
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    spec.option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    spec.option.iterations = 50
    spec.option.tolerance = 1e-10
    spec.visual.map.znear = NEAR / EXTENT  # MuJoCo counts it in units of the extent
    spec.stat.extent = EXTENT
    spec.default.geom.solref = (0.005, 1.0)
    spec.default.geom.solimp = (0.95, 0.99, 0.001, 0.5, 1.0)
    spec.worldbody.add_light(
        name="lamp", type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL, dir=(0.3, 0.2, 1.0), diffuse=(0.5, 0.5, 0.5)
    )
    body.add_to(spec, (0.0, 0.0, HIP_HEIGHT), SUPINE)
    _add_crib(spec)
    _add_mobile(spec, world)
    spec.body(protocol.limb).add_site(name="limb", group=UNSEEN)  # at the body's origin: ankle or wrist
    spec.worldbody.add_site(name="ring", group=UNSEEN)
    rope = spec.add_tendon(name="rope", stiffness=0.0, width=0.002, rgba=(0.9, 0.1, 0.1, 1.0), group=UNSEEN)
    for site in ("limb", "ring", "mobile"):
        rope.wrap_site(site)
    for geom in spec.geoms:
        arm = any(part in geom.parent.name for part in ARMS)
        geom.group = SEEN if arm or geom.parent.name == "mobile" else UNSEEN
    return spec


def _add_crib(spec: mujoco.MjSpec) -> None:
    """The mattress, solid as a plane without end, as in MIMo; what is to be looked at: its body, and rails."""
    plane, box = mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_BOX
    spec.worldbody.add_geom(name="mattress", type=plane, size=(1, 1, 1), rgba=(0, 0, 0, 0))

    def show(size: body.Vector, pos: body.Vector, rgba: tuple[float, float, float, float]) -> None:
        spec.worldbody.add_geom(type=box, size=size, pos=pos, rgba=rgba, contype=0, conaffinity=0)

    show((0.6, 0.4, 0.05), (-0.05, 0, -0.05), (0.85, 0.88, 0.95, 1))
    wood = (0.72, 0.53, 0.33, 1.0)
    for y in (-0.425, 0.425):  # beyond the fingers' reach
        for z in (-0.08, 0.32):
            show((0.62, 0.012, 0.02), (-0.05, y, z), wood)
        for x in np.linspace(-0.65, 0.55, 13):
            show((0.008, 0.008, 0.19), (float(x), y, 0.12), wood)


def _add_mobile(spec: mujoco.MjSpec, world: World) -> None:
    """A cross of four toys on a rod; a damped spring on its ball joint stands for the suspension."""
    eye = _eye_place()
    pivot = eye + np.array([world.mobile_forward, 0.0, world.mobile_height + world.rod_length])
    mobile = spec.worldbody.add_body(name="mobile", pos=pivot)
    lever = world.rod_length**2  # N/m at the mobile to N m/rad at the pivot
    mobile.add_joint(
        name="suspension",
        type=mujoco.mjtJoint.mjJNT_BALL,
        stiffness=world.suspension_stiffness * lever,
        damping=world.suspension_drag * lever,
    )
    look = {"contype": 0, "conaffinity": 0}
    wood, down = (0.75, 0.6, 0.4, 1.0), -world.rod_length
    mobile.add_geom(
        name="rod",
        type=mujoco.mjtGeom.mjGEOM_CYLINDER,
        fromto=(0, 0, 0, 0, 0, down),
        size=(0.003, 0, 0),
        mass=0,
        rgba=wood,
        **look,
    )
    box = mujoco.mjtGeom.mjGEOM_BOX
    mobile.add_geom(name="beam_x", type=box, size=(0.05, 0.004, 0.004), pos=(0, 0, down), mass=0, rgba=wood, **look)
    mobile.add_geom(name="beam_y", type=box, size=(0.004, 0.05, 0.004), pos=(0, 0, down), mass=0, rgba=wood, **look)
    for index, ((x, y), colour) in enumerate(TOYS):
        mobile.add_geom(
            name=f"toy{index}",
            type=mujoco.mjtGeom.mjGEOM_SPHERE if index % 2 else box,
            size=(0.018, 0.018, 0.018),
            pos=(x, y, down),
            mass=world.mobile_mass / len(TOYS),
            rgba=colour,
            **look,
        )
    mobile.add_site(name="mobile", pos=(0, 0, down), group=UNSEEN)


def _eye_place() -> np.ndarray:
    """(3,) world position of the right eye's camera, m."""
    spec = mujoco.MjSpec()
    body.add_to(spec, (0.0, 0.0, HIP_HEIGHT), SUPINE)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_camlight(model, data)
    place: np.ndarray = data.camera("right_eye").xpos.copy()
    return place


def _settle(model: mujoco.MjModel) -> mujoco.MjData:
    data = mujoco.MjData(model)
    for _ in range(SETTLE_UPDATES):
        mujoco.mj_step(model, data)
    return data
