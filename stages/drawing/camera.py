"""The infant under the mobile in third person, for film and figure 1: the real scene, in light for readers."""

import copy
from contextlib import closing
from dataclasses import dataclass

import mujoco
import numpy as np
from matplotlib.colors import to_rgb

from mimo.record import runtime
from mimo.world import body
from mimo.world.scene import ARMS, Scene

LEGS = ("upper_leg", "lower_leg", "foot", "toes")
SHIRT, SHORTS, SKIN, WOOD, SHEET = (
    (0.86, 0.88, 0.92), (0.55, 0.62, 0.72), (0.96, 0.80, 0.66), (0.80, 0.68, 0.52), (0.90, 0.92, 0.96)
)  # fmt: skip
CLOTHES = {body.SHIRT: SHIRT, body.TROUSERS: SHORTS, body.WHITE: SKIN, body.SKIN: SKIN}
WALL = (0.47, 0.50, 0.53, 0.99)  # not opaque, so that no shadow is computed on it: a fifth of the time
WALL_DISTANCE, WALL_SIZE = 4.0, 6.0  # m
RING = (0.3, 0.3, 0.3, 1.0)
ROPE_WIDTH = 0.005  # m; the scene's 2 mm are less than a pixel
STILL = 640  # pixels a side
FINER = 2  # pixels drawn for one shown, each way: smooth edges without multisampling, which drivers do differently


@dataclass(frozen=True)
class Place:
    """Where the camera stands: what it looks at, in m, how far from it, in m, and at what angles, in degrees.

    `wall` is whether there is a wall behind the scene; else what is behind is black.
    """

    look_at: tuple[float, float, float]
    distance: float
    azimuth: float
    elevation: float
    view_angle: float
    wall: bool


FROM_THE_LEFT = Place((0.02, 0.0, 0.22), 1.2, 255.0, -11.0, 35.0, True)
FROM_THE_FEET = Place((0.0, 0.0, 0.27), 1.5, 206.0, -34.0, 45.0, False)


class Camera:
    """Renders worlds of one scene. Close it: contextlib.closing does so after a block.

    Args:
        scene: left as it is; what is drawn is a copy.
        limb: what the rope is tied to; the camera is on its side.
        colour: of that limb, as matplotlib names it.
        size: height and width in pixels.
        place: where it stands if the limb is a left one; else mirrored.
    """

    def __init__(
        self, scene: Scene, limb: str, colour: str, size: tuple[int, int], place: Place = FROM_THE_LEFT
    ) -> None:
        side, end = limb.split("_")
        mirror = 1 if side == "left" else -1
        self._model = copy.copy(scene.model)
        self._data = mujoco.MjData(self._model)
        self._light(mirror, size, place)
        self._dress(side, ARMS if end == "hand" else LEGS, colour, mirror)
        self._camera = mujoco.MjvCamera()
        self._camera.lookat[:], self._camera.distance = place.look_at, place.distance
        self._camera.azimuth, self._camera.elevation = mirror * place.azimuth, place.elevation
        self._wall = place.wall
        self._option = mujoco.MjvOption()
        self._renderer = runtime.renderer(self._model, *size)
        self._renderer.scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = False

    def picture(self, qpos: np.ndarray, attached: bool) -> np.ndarray:
        """(height, width, 3) uint8: the world at generalised positions `qpos` (nq,), with rope and ring if attached."""
        self._data.qpos[:] = qpos
        mujoco.mj_forward(self._model, self._data)
        self._option.tendongroup[:] = self._option.sitegroup[:] = attached  # the rope, and the ring it runs through
        self._renderer.update_scene(self._data, self._camera, self._option)
        if self._wall:
            self._hang_wall(self._renderer.scene)
        return runtime.drawn(self._renderer)

    def close(self) -> None:
        """Free the GL context."""
        runtime.close(self._renderer)

    def _light(self, mirror: int, size: tuple[int, int], place: Place) -> None:
        """A lamp above, where the scene's own shines from below for the eye."""
        model, visual = self._model, self._model.vis
        visual.global_.offheight, visual.global_.offwidth = size
        visual.global_.fovy = place.view_angle
        visual.quality.shadowsize = 1024
        visual.quality.offsamples = 4 if place.wall else 0  # where there is none, edges would take on its black
        visual.quality.numslices, visual.quality.numstacks, visual.quality.numquads = 16, 8, 1
        visual.map.shadowclip, visual.map.znear = 0.7, 0.01  # the latter 2 cm: depths are then told apart
        visual.headlight.ambient[:], visual.headlight.diffuse[:], visual.headlight.specular[:] = 0.45, 0.2, 0.0
        lamp = model.light("lamp").id
        model.light_pos[lamp], model.light_dir[lamp] = (-0.2, 0.4 * mirror, 1.5), (0.25, -0.35 * mirror, -0.9)
        model.light_diffuse[lamp], model.light_specular[lamp] = 0.5, 0.05

    def _dress(self, side: str, limb: tuple[str, ...], colour: str, mirror: int) -> None:
        """Soft colours, the limb in its own; the rail that would stand before the camera goes."""
        model = self._model
        model.tendon_width[:] = ROPE_WIDTH
        model.site_rgba[:, 3] = 0
        ring = model.site("ring").id
        model.site_rgba[ring], model.site_size[ring] = RING, 0.011
        held = {f"{side}_{part}" for part in limb}
        for geom in range(model.ngeom):
            name, rgba, (_, y, _) = (
                model.body(model.geom_bodyid[geom]).name,
                model.geom_rgba[geom],
                model.geom_pos[geom],
            )
            if name == "world":
                rgba[:3] = WOOD if y else SHEET
                rgba[3] *= y * mirror <= 0
            elif name in held:
                rgba[:3] = to_rgb(colour)
            elif name != "mobile":
                rgba[:3] = next(new for old, new in CLOTHES.items() if np.allclose(rgba, old))

    @staticmethod
    def _hang_wall(scene: mujoco.MjvScene) -> None:
        """A background: MuJoCo's own is black where the model has no sky."""
        camera = scene.camera[0]
        ahead, up = np.array(camera.forward), np.array(camera.up)
        axes = np.stack([np.cross(ahead, up), up, -ahead], axis=1)
        wall = scene.geoms[scene.ngeom]
        mujoco.mjv_initGeom(
            wall,
            mujoco.mjtGeom.mjGEOM_BOX,
            np.array([WALL_SIZE, WALL_SIZE, 0.01]),
            np.array(camera.pos) + WALL_DISTANCE * ahead,
            axes.ravel(),
            np.array(WALL, np.float32),
        )
        wall.emission, wall.specular = 1.0, 0.0
        scene.ngeom += 1


def still(scene: Scene, limb: str, colour: str) -> np.ndarray:
    """(STILL, STILL, 3) uint8: the scene at rest, with the rope the infant does not see, on white (paper fig. 1A)."""
    with closing(Camera(scene, limb, colour, (FINER * STILL, FINER * STILL), FROM_THE_FEET)) as camera:
        pixels = camera.picture(scene.model.key_qpos[0], attached=True)
    pixels[~pixels.any(axis=2)] = 255  # nothing but what is behind everything is black
    shown: np.ndarray = pixels.reshape(STILL, FINER, STILL, FINER, 3).mean(axis=(1, 3)).round().astype(np.uint8)
    return shown
