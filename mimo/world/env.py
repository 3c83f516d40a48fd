"""`mimo/MIMoMobile-v0`: the paper's world as a Gymnasium environment, for learners of your own.

import gymnasium
import mimo.world.env  # registers it

env = gymnasium.make("mimo/MIMoMobile-v0", condition="noisy", limb="right_hand")
envs = gymnasium.make_vec("mimo/MIMoMobile-v0", num_envs=16)
"""

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
from mimo.world.protocol import JOINTS, phase, steps

CHANGED = ("limb", "baseline_steps", "attached_steps", "extinction_steps")  # fields of params.Protocol
VIEW = (480, 640)  # pixels of the third-person picture: height, width

Observation = dict[str, np.ndarray]


class Setting:
    """What both environments are made from: the scene, the protocol, the force, the spaces of one world.

    Args:
        condition: free or noisy.
        lengths: fields of params.Protocol to change; None for that of `settings`.
        settings: constants of the world; None for the published ones.

    Raises:
        ParamsError: a value does not hold.
    """

    def __init__(self, condition: str, lengths: dict[str, object], settings: Params | None) -> None:
        whole = settings or params.published()
        given = {name: value for name, value in lengths.items() if value is not None}
        self.protocol = params.checked(whole.protocol, given)
        if condition not in params.Conditions.model_fields:
            known = " or ".join(params.Conditions.model_fields)
            raise ParamsError(f"condition must be {known}; it is {condition!r}.")
        self.force = getattr(whole.conditions, condition).force
        self.rope_holds = whole.world.rope_holds
        self.scene = scene.build(whole.world, self.protocol)
        self.actions = spaces.MultiBinary(JOINTS)
        self.observations = spaces.Dict(
            {
                "proprioception": spaces.Box(-2 * np.pi, 2 * np.pi, (len(body.JOINTS),), np.float64),
                "vision": spaces.Box(0, 255, (SIZE, SIZE, 3), np.uint8),
            }
        )

    def moved(self, action: np.ndarray, worlds: int) -> np.ndarray:
        """(worlds, 12) bool, of actions (worlds, 12) 0 or 1.

        Raises:
            ValueError: they are no such actions.
        """
        given = np.asarray(action)
        if given.shape != (worlds, JOINTS) or not np.isin(given, (0, 1)).all():
            raise ValueError(f"An action is 12 numbers 0 or 1 for each world, {(worlds, JOINTS)}; it is {given!r}.")
        return given.astype(bool)

    def attached(self, step: int) -> bool:
        """Whether the rope is on in a step, counted from 0, if it always holds."""
        return step < steps(self.protocol) and phase(self.protocol, step) == "attached"

    def tied(self, step: int, draw: np.random.Generator) -> bool:
        """Whether it is on and holds: by chance, where `world.rope_holds` is below 1."""
        return self.attached(step) and (self.rope_holds >= 1 or bool(draw.random() < self.rope_holds))

    def info(self, step: int, path_length: float, centre: np.ndarray, attached: bool) -> dict[str, Any]:
        """What `info` holds after a step, counted from 0, of one world."""
        return {
            "mtl": float(path_length),
            "centre_of_mass": centre.copy(),
            "phase": phase(self.protocol, min(step, steps(self.protocol) - 1)),
            "attached": attached,
        }


class MIMoMobileEnv(gymnasium.Env[Observation, np.ndarray], gymnasium.utils.EzPickle):
    """One infant, one mobile; an episode is one experiment: baseline, attached, extinction (paper §2.4).

    Observation: `proprioception` (47,) joint angles in rad in the order of body.JOINTS, `vision` (128, 128, 3) uint8,
    the right eye's picture. Action: (12,) 0 or 1, MOVE or not for body.ACTUATED; the direction is random (paper §2.2).
    Reward: MTL, metres the mobile travelled (paper §3.3); the intrinsic rewards are the learner's own affair (see
    mimo.learning.rewards). `info`: `mtl` m, `centre_of_mass` (3,) m, `phase`, `attached`. Truncated at the end of
    extinction. Pickled, it is made anew from its arguments, and begins with `reset`.

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
        given = (condition, limb, baseline_steps, attached_steps, extinction_steps, render_mode, settings)
        gymnasium.utils.EzPickle.__init__(self, *given)
        lengths = (limb, baseline_steps, attached_steps, extinction_steps)
        self._setting = Setting(condition, dict(zip(CHANGED, lengths, strict=True)), settings)
        self._eye = Eye(self._setting.scene)
        self._view: mujoco.Renderer | None = None
        self._worlds: Worlds | None = None
        self._step = 0
        self.render_mode = render_mode
        self.action_space = self._setting.actions
        self.observation_space = self._setting.observations  # type: ignore[assignment]

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Back to rest, at the start of baseline; the same seed repeats everything that follows."""
        super().reset(seed=seed)
        self._step = 0
        self._worlds = Worlds(self._setting.scene, self._setting.protocol, self._setting.force, [self.np_random])
        return self._observe(self._worlds), self._setting.info(
            0, 0.0, self._worlds.centre_of_mass[0], self._setting.attached(0)
        )

    def step(self, action: np.ndarray) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """One agent step of 600 ms (paper §2.3).

        Raises:
            DivergedError: the physics diverged.
            ValueError: the action is not 12 numbers 0 or 1.
        """
        if self._worlds is None:
            raise gymnasium.error.ResetNeeded("call reset() before step()")
        positive = self.np_random.random((1, JOINTS)) < 0.5
        attached = self._setting.tied(self._step, self.np_random)
        outcome = self._worlds.step(self._setting.moved(np.asarray(action)[None], 1), positive, attached)
        info = self._setting.info(self._step, outcome.path_length[0], outcome.centre_of_mass[0], attached)
        self._step += 1
        truncated = self._step >= steps(self._setting.protocol)
        return self._observe(self._worlds), float(outcome.path_length[0]), False, truncated, info

    def render(self) -> np.ndarray | None:
        """The scene in third person, the rope drawn when attached; None unless render_mode is rgb_array."""
        if self.render_mode != "rgb_array" or self._worlds is None:
            return None
        model = self._setting.scene.model
        if self._view is None:
            self._view = runtime.renderer(model, *VIEW)
        data = mujoco.MjData(model)
        data.qpos[:] = self._worlds.qpos[0]
        mujoco.mj_forward(model, data)
        camera, option = mujoco.MjvCamera(), mujoco.MjvOption()
        camera.lookat[:], camera.distance, camera.azimuth, camera.elevation = (-0.05, 0, 0.2), 1.5, 130, -30
        option.tendongroup[:] = self._setting.attached(self._step)
        self._view.update_scene(data, camera, option)
        return runtime.drawn(self._view)

    def close(self) -> None:
        """Free the GL contexts.

        Raises:
            RenderError: another thread has drawn.
        """
        self._eye.close()
        if self._view is not None:
            runtime.close(self._view)

    def _observe(self, worlds: Worlds) -> Observation:
        return {"proprioception": worlds.proprioception()[0], "vision": self._eye.frames(worlds.qpos)[0]}


gymnasium.register(
    id="mimo/MIMoMobile-v0",
    entry_point="mimo.world.env:MIMoMobileEnv",
    vector_entry_point="mimo.world.vector_env:MIMoMobileVectorEnv",
)
