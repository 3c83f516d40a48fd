"""The scene in third person, at rest, with the rope that the infant does not see (paper fig. 1A)."""

import copy

import mujoco
import numpy as np

from mimo.record import runtime
from mimo.world.scene import Scene

PIXELS = 640  # a side
FINER = 2  # pixels drawn for one shown, each way: smooth edges without multisampling, which drivers do differently
AZIMUTH, ELEVATION, DISTANCE, LOOK_AT = 206.0, -34.0, 1.5, (0.0, 0.0, 0.27)  # degrees, m: from beyond the feet
ROPE_WIDTH = 0.003  # m
AMBIENT, HEADLIGHT, LAMP, LAMP_TOWARDS = 0.45, 0.25, 0.42, (-0.3, 0.35, -1.0)  # the scene's own lamp is for the eye


def draw(built: Scene) -> np.ndarray:
    """(PIXELS, PIXELS, 3) uint8, on white."""
    model = copy.copy(built.model)
    model.vis.global_.offwidth = model.vis.global_.offheight = PIXELS * FINER
    model.vis.quality.offsamples = 0
    model.vis.headlight.ambient[:], model.vis.headlight.diffuse[:] = AMBIENT, HEADLIGHT
    model.vis.headlight.specular[:] = 0
    model.light_dir[:], model.light_diffuse[:] = LAMP_TOWARDS, LAMP
    model.tendon_width[built.rope] = ROPE_WIDTH
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    camera, option = mujoco.MjvCamera(), mujoco.MjvOption()
    camera.azimuth, camera.elevation, camera.distance, camera.lookat[:] = AZIMUTH, ELEVATION, DISTANCE, LOOK_AT
    option.geomgroup[:] = option.tendongroup[:] = 1
    option.sitegroup[:] = 0
    with runtime.renderer(model, PIXELS * FINER, PIXELS * FINER) as renderer:
        renderer.update_scene(data, camera, option)
        pixels = renderer.render()
    pixels[~pixels.any(axis=2)] = 255  # behind everything is black, and nothing else is under ambient light
    shown: np.ndarray = pixels.reshape(PIXELS, FINER, PIXELS, FINER, 3).mean(axis=(1, 3)).round().astype(np.uint8)
    return shown
