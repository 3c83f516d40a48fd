"""`MIMoMobile-v0`: the paper's world as a Gymnasium environment, for learners of your own.

import gymnasium
env = gymnasium.make("mimo.world.env:MIMoMobile-v0", condition="noisy", limb="right_hand")
"""

from pathlib import Path
from typing import Any, ClassVar

import gymnasium
import mujoco
import numpy as np
from gymnasium import spaces

from mimo.record import runtime
from mimo.settings import params
from mimo.settings.files import ParamsError
from mimo.settings.params import Params
from mimo.settings.section import Condition, Limb
from mimo.world import body, scene
from mimo.world.eye import SIZE, Eye
from mimo.world.physics import Worlds
from mimo.world.protocol import phase, steps

PARAMS = Path(__file__).parents[2] / "params.yaml"
VIEW = (480, 640)  # pixels of the third-person picture: height, width

Observation = dict[str, np.ndarray]


class MIMoMobileEnv(gymnasium.Env[Observation, np.ndarray]):
    """One infant, one mobile; an episode is one experiment: baseline, attached, extinction (paper §2.4).

    Observation: `proprioception` (47,) joint angles in rad in the order of body.JOINTS, `vision` (128, 128, 3) uint8,
    the right eye's picture. Action: (12,) 0 or 1, MOVE or not for body.ACTUATED; the direction is random (paper §2.2).
    Reward: MTL, metres the mobile travelled (paper §3.3); the intrinsic rewards are the learner's own affair (see
    mimo.learning.rewards). `info`: `mtl` m, `centre_of_mass` (3,) m, `phase`, `attached`. Truncated at the end of
    extinction.

    Args:
        condition: free or noisy.
        limb: what the rope is tied to.
        baseline_steps: agent steps of the phase; None for that of params.yaml, and so the next two.
        attached_steps: likewise.
        extinction_steps: likewise.
        render_mode: None, or rgb_array for a third-person picture (480, 640, 3) uint8.
        settings: constants of the world; None for the project's params.yaml.

    Raises:
        ParamsError: a phase is shorter than one step, or another value does not hold.
    """

    metadata: ClassVar = {  # type: ignore[misc]
        "render_modes": ["rgb_array"],
        "render_fps": 2,
    }

    def __init__(
        self,
        condition: Condition = "free",
        limb: Limb = "left_foot",
        baseline_steps: int | None = None,
        attached_steps: int | None = None,
        extinction_steps: int | None = None,
        render_mode: str | None = None,
        settings: Params | None = None,
    ) -> None:
        whole = settings or params.load(PARAMS)
        lengths: dict[str, object] = {
            "limb": limb,
            "baseline_steps": baseline_steps,
            "attached_steps": attached_steps,
            "extinction_steps": extinction_steps,
        }
        given = {name: value for name, value in lengths.items() if value is not None}
        self._protocol = params.checked(whole.protocol, given)
        if condition not in params.Conditions.model_fields:
            known = " or ".join(params.Conditions.model_fields)
            raise ParamsError(f"condition must be {known}; it is {condition!r}.")
        self._force = getattr(whole.conditions, condition).force
        self._scene = scene.build(whole.world, self._protocol)
        self._eye = Eye(self._scene)
        self._view: mujoco.Renderer | None = None
        self._worlds: Worlds | None = None
        self._step = 0
        self.render_mode = render_mode
        self.action_space = spaces.MultiBinary(len(body.ACTUATED))
        self.observation_space = spaces.Dict(  # type: ignore[assignment]
            {
                "proprioception": spaces.Box(-2 * np.pi, 2 * np.pi, (len(body.JOINTS),), np.float64),
                "vision": spaces.Box(0, 255, (SIZE, SIZE, 3), np.uint8),
            }
        )

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Back to rest, at the start of baseline; the same seed repeats everything that follows."""
        super().reset(seed=seed)
        self._step = 0
        self._worlds = Worlds(self._scene, self._protocol, self._force, [self.np_random])
        return self._observe(self._worlds), self._info(0.0, self._worlds.centre_of_mass[0])

    def step(self, action: np.ndarray) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """One agent step of 600 ms (paper §2.3).

        Raises:
            DivergedError: the physics diverged.
        """
        if self._worlds is None:
            raise gymnasium.error.ResetNeeded("call reset() before step()")
        positive = self.np_random.random((1, len(body.ACTUATED))) < 0.5
        outcome = self._worlds.step(np.asarray(action, dtype=bool)[None], positive, self._attached())
        mtl, info = float(outcome.path_length[0]), self._info(outcome.path_length[0], outcome.centre_of_mass[0])
        self._step += 1
        return self._observe(self._worlds), mtl, False, self._step >= steps(self._protocol), info

    def render(self) -> np.ndarray | None:
        """The scene in third person, the rope drawn when attached; None unless render_mode is rgb_array."""
        if self.render_mode != "rgb_array" or self._worlds is None:
            return None
        if self._view is None:
            self._view = runtime.renderer(self._scene.model, *VIEW)
        data = mujoco.MjData(self._scene.model)
        data.qpos[:] = self._worlds.qpos[0]
        mujoco.mj_forward(self._scene.model, data)
        camera, option = mujoco.MjvCamera(), mujoco.MjvOption()
        camera.lookat[:], camera.distance, camera.azimuth, camera.elevation = (-0.05, 0, 0.2), 1.5, 130, -30
        option.tendongroup[:] = self._attached()
        self._view.update_scene(data, camera, option)
        return runtime.drawn(self._view)

    def close(self) -> None:
        """Free the GL contexts."""
        self._eye.close()
        if self._view is not None:
            runtime.close(self._view)

    def _attached(self) -> bool:
        return self._step < steps(self._protocol) and phase(self._protocol, self._step) == "attached"

    def _observe(self, worlds: Worlds) -> Observation:
        return {"proprioception": worlds.proprioception()[0], "vision": self._eye.frames(worlds.qpos)[0]}

    def _info(self, path_length: float, centre: np.ndarray) -> dict[str, Any]:
        step = min(self._step, steps(self._protocol) - 1)
        return {
            "mtl": float(path_length),
            "centre_of_mass": centre.copy(),
            "phase": phase(self._protocol, step),
            "attached": self._attached(),
        }


gymnasium.register(id="MIMoMobile-v0", entry_point="mimo.world.env:MIMoMobileEnv")
