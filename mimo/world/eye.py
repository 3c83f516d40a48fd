"""The right eye's picture: 128x128 RGB, off screen; one renderer a process, frames identical across processes.

Only what the eye can see is drawn (geom group scene.SEEN: mobile and arms), without shadows, reflections, sky, haze and
smoothing: 1.5 ms of CPU a frame on Mesa instead of 190 ms. The rope is not drawn (paper fig. 1: invisible to MIMo).
"""

import mujoco
import numpy as np

from mimo.record import runtime
from mimo.world.scene import SEEN, Scene

SIZE = 128


class Eye:
    """Renders the right eye of any world of one scene. Close it, or use it in a with block.

    The GL context is made with the first picture: one made before a fork is of no use after it.
    """

    def __init__(self, scene: Scene) -> None:
        model = scene.model
        quality = model.vis.quality
        quality.offsamples, quality.shadowsize, quality.numslices, quality.numstacks = 0, 0, 12, 8
        self._model, self._data = model, mujoco.MjData(model)
        self._renderer: mujoco.Renderer | None = None
        self._camera = mujoco.MjvCamera()
        self._camera.type, self._camera.fixedcamid = mujoco.mjtCamera.mjCAMERA_FIXED, model.camera("right_eye").id
        self._option = mujoco.MjvOption()
        self._option.geomgroup[:] = 0
        self._option.geomgroup[SEEN] = 1
        self._option.tendongroup[:] = 0
        self._option.sitegroup[:] = 0

    def frames(self, qpos: np.ndarray) -> np.ndarray:
        """(N, 128, 128, 3) uint8 pictures of worlds at generalised positions `qpos` (N, nq).

        Raises:
            RenderError: there is no GL context to be had, or it is another thread's.
        """
        renderer = self._renderer = self._renderer or self._opened()
        frames = np.empty((len(qpos), SIZE, SIZE, 3), np.uint8)
        for frame, position in zip(frames, qpos, strict=True):
            self._data.qpos[:] = position
            mujoco.mj_kinematics(self._model, self._data)
            mujoco.mj_camlight(self._model, self._data)
            renderer.update_scene(self._data, self._camera, self._option)
            runtime.drawn(renderer, frame)
        return frames

    def close(self) -> None:
        """Free the GL context, if there is one."""
        if self._renderer is not None:
            runtime.close(self._renderer)

    def _opened(self) -> mujoco.Renderer:
        renderer = runtime.renderer(self._model, SIZE, SIZE)
        for flag in ("SHADOW", "REFLECTION", "SKYBOX", "HAZE"):
            renderer.scene.flags[getattr(mujoco.mjtRndFlag, f"mjRND_{flag}")] = False
        return renderer

    def __enter__(self) -> "Eye":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
