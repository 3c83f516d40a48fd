"""Many worlds as one Gymnasium vector environment, `gymnasium.make_vec("mimo/MIMoMobile-v0", num_envs=N)`."""

from collections.abc import Sequence
from typing import Any, ClassVar

import gymnasium
import joblib
import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from mimo.settings.files import ParamsError
from mimo.settings.params import Params
from mimo.settings.section import Condition, Limb
from mimo.world.env import CHANGED, Observation, Setting
from mimo.world.eye import Eye
from mimo.world.physics import Worlds
from mimo.world.protocol import JOINTS, steps


class MIMoMobileVectorEnv(VectorEnv[Observation, np.ndarray, np.ndarray]):
    """N infants in lock step, each with a mobile of its own: one C call advances all, by as many threads as there are.

    Each world gives the same bytes as MIMoMobileEnv, which says what observations, rewards and `info` are, would with
    the same seed. All episodes end together; the next step begins new ones, whatever its actions (Gymnasium's
    next-step autoreset).

    Args:
        num_envs: N.
        threads: that advance the physics; None for as many as there are CPUs, at most N.
        condition: as for MIMoMobileEnv, and so all that follow.
        limb: likewise.
        baseline_steps: likewise.
        attached_steps: likewise.
        extinction_steps: likewise.
        settings: likewise.

    Raises:
        ParamsError: as for MIMoMobileEnv.
    """

    metadata: ClassVar = {  # type: ignore[misc]
        "render_modes": [],
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        num_envs: int = 1,
        threads: int | None = None,
        condition: Condition = "free",
        limb: Limb = "left_foot",
        baseline_steps: int | None = None,
        attached_steps: int | None = None,
        extinction_steps: int | None = None,
        settings: Params | None = None,
    ) -> None:
        lengths = (limb, baseline_steps, attached_steps, extinction_steps)
        self._setting = Setting(condition, dict(zip(CHANGED, lengths, strict=True)), settings)
        self._eye = Eye(self._setting.scene)
        self._threads = min(num_envs, joblib.cpu_count()) if threads is None else threads
        if self._threads < 1:
            raise ParamsError(f"threads must be at least 1; it is {threads}.")
        self._worlds: Worlds | None = None
        self._generators: dict[int, np.random.Generator] = {}  # in the order of the worlds
        self._step = 0
        self.num_envs = num_envs
        self.single_action_space, self.single_observation_space = self._setting.actions, self._setting.observations
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """All back to rest, at the start of baseline.

        Args:
            seed: one for each, or the first of N in a row; a world that gets None goes on with its generator.
            options: nothing is known here; worlds cannot be reset apart.

        Raises:
            ValueError: another number of seeds, or an option.
        """
        if options:
            raise ValueError(f"options must be empty; there is {', '.join(options)}.")
        seeds = [seed + world for world in range(self.num_envs)] if isinstance(seed, int | np.integer) else seed
        seeds = [None] * self.num_envs if seeds is None else list(seeds)
        if len(seeds) != self.num_envs:
            raise ValueError(f"seed must be one number or {self.num_envs}; there are {len(seeds)}.")
        for world, own in enumerate(seeds):
            if own is not None or world not in self._generators:
                self._generators[world], _ = seeding.np_random(own)
        return self._begin()

    def step(self, actions: np.ndarray) -> tuple[Observation, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """One agent step of 600 ms (paper §2.3) of all worlds.

        Raises:
            DivergedError: the physics of one diverged.
            ValueError: the actions are not 12 numbers 0 or 1 for each world.
        """
        if self._worlds is None:
            raise gymnasium.error.ResetNeeded("call reset() before step()")
        last, never = steps(self._setting.protocol), np.zeros(self.num_envs, bool)
        if self._step == last:
            seen, infos = self._begin()
            return seen, np.zeros(self.num_envs), never, never.copy(), infos
        positive = np.stack([draw.random(JOINTS) for draw in self._generators.values()]) < 0.5
        attached = np.array([self._setting.tied(self._step, draw) for draw in self._generators.values()])
        outcome = self._worlds.step(self._setting.moved(actions, self.num_envs), positive, attached)
        infos = self._infos(outcome.path_length, outcome.centre_of_mass, attached)
        self._step += 1
        truncated = np.full(self.num_envs, self._step == last)
        return self._observe(self._worlds), outcome.path_length, never, truncated, infos

    def close_extras(self, **_: Any) -> None:
        """Free the GL context.

        Raises:
            RenderError: another thread has drawn.
        """
        self._eye.close()

    def _begin(self) -> tuple[Observation, dict[str, Any]]:
        setting, self._step = self._setting, 0
        draws = list(self._generators.values())
        worlds = self._worlds = Worlds(setting.scene, setting.protocol, setting.force, draws, self._threads)
        return self._observe(worlds), self._infos(
            np.zeros(self.num_envs), worlds.centre_of_mass, np.full(self.num_envs, setting.attached(0))
        )

    def _observe(self, worlds: Worlds) -> Observation:
        return {"proprioception": worlds.proprioception(), "vision": self._eye.frames(worlds.qpos)}

    def _infos(self, path_length: np.ndarray, centres: np.ndarray, attached: np.ndarray) -> dict[str, Any]:
        infos: dict[str, Any] = {}
        for world, own in enumerate(zip(path_length, centres, attached.tolist(), strict=True)):
            infos = self._add_info(infos, self._setting.info(self._step, *own), world)
        return infos
