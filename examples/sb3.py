"""`python -m examples.sb3`: PPO of Stable-Baselines3 in place of the paper's agent, paid by an intrinsic reward.

Observation: `proprioception` (47,) rad and `latent` (64,), h of the eye's picture: the paper's state (§3.2).
Action: (12,) 0 or 1, MOVE or not: a MultiBinary space, which PPO and A2C take. DQN would need 2^12 numbered actions.
Reward: what the paper's agent is paid, but the mean over joints, as Stable-Baselines3 takes one number a step: a joint
is paid for all of them. `info["rewards"]` has the twelve.

An episode is one experiment: baseline, attached, extinction. PPO learns through many of them, where the infant has one;
the outcome models behind CAIS and Surprise start each of them anew.
"""

import argparse
import sys
from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from stable_baselines3 import PPO

from mimo.learning import rewards
from mimo.learning.experience import Perception, untaught
from mimo.record import artifact
from mimo.settings import params
from mimo.settings.errors import Fault
from mimo.settings.params import Params
from mimo.settings.section import Condition
from mimo.vision import extractor
from mimo.vision.extractor import Extractor, Trained
from mimo.world import body
from mimo.world.env import MIMoMobileEnv, Observation

ROLLOUT, BATCH = 250, 50  # agent steps: between PPO's updates, a tenth of an experiment; of each gradient


class Intrinsic(gymnasium.Wrapper[Observation, np.ndarray, Observation, np.ndarray]):
    """mimo/MIMoMobile-v0 with h for the picture, and an intrinsic reward for its own.

    `info` has, besides that of the environment, `rewards`: (12,) what each joint earned, as the paper's agent is paid.

    Args:
        env: mimo/MIMoMobile-v0.
        settings: all of params.yaml.
        reward: a reward's name, or several joined by "_".
        trained: the encoder.
        scales: by reward name, the SD by which it is divided.
        condition: of `env`.

    Raises:
        UnknownRewardError: a part is no reward's name.
        Fault: params.yaml asks for what another learner cannot give: its P(MOVE), or pictures within a step.
    """

    def __init__(
        self,
        env: MIMoMobileEnv,
        settings: Params,
        reward: str,
        trained: Trained,
        scales: Mapping[str, float],
        condition: Condition,
    ) -> None:
        super().__init__(env)
        seen: Any = env.observation_space
        self._settings, self._trained, self._condition = settings, trained, condition
        self._extract, self._needs_outcomes = Extractor(settings.encoder, trained), rewards.needs_outcomes(reward)
        self._reward, self._scales = reward, scales
        self._terms = rewards.parts(reward, settings.rewards)
        if self._needs_outcomes and settings.outcomes.marginal == "policy":
            raise Fault("PPO has no P(MOVE) that p(h) could be mixed by: set outcomes.marginal to `table`.")
        if rewards.frames(self._terms) > 1:
            raise Fault("The environment shows one picture a step: set rewards.rtl.frames to 1.")
        latent = spaces.Box(-np.inf, np.inf, (settings.encoder.latent,), np.float32)
        self.observation_space = spaces.Dict({"proprioception": seen["proprioception"], "latent": latent})  # type: ignore[assignment]

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """A new experiment, with new outcome models, and rewards that have learned nothing."""
        seen, info = self.env.reset(seed=seed, options=options)
        self._terms = rewards.parts(self._reward, self._settings.rewards, lambda name: self.np_random.spawn(1))
        # A stream of its own: the mobile's noise is the same with every reward.
        outcomes = None
        if self._needs_outcomes:
            outcomes = untaught(self._settings, self._trained, self._condition, self.np_random.spawn(1))
        self._perception = Perception(self._extract, seen["vision"][None], outcomes, self._terms)
        self._joints = seen["proprioception"][None]
        return self._observation(seen), info

    def step(self, action: np.ndarray) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """One agent step; the reward as mimo.learning.experiment pays it, mean over the joints."""
        seen, mtl, terminated, truncated, info = self.env.step(action)
        moved = np.asarray(action, bool)[None]
        path = np.array([float(mtl)])
        transition = self._perception.transition(moved, path, seen["vision"][None], proprioception=self._joints)
        self._joints = seen["proprioception"][None]
        gain = self._settings.rewards.gain
        paid = np.sum(
            [gain * part.weight / self._scales[part.name] * part(transition)[0] for part in self._terms], axis=0
        )
        info["rewards"] = paid
        return self._observation(seen), float(paid.mean()), terminated, truncated, info

    def _observation(self, seen: Observation) -> Observation:
        return {"proprioception": seen["proprioception"], "latent": self._perception.latent[0]}


def main(arguments: list[str] | None = None) -> None:
    """Learn; then say how often the joints moved with the rope on, in an experiment more."""
    parser = argparse.ArgumentParser(prog="python -m examples.sb3", description=__doc__.splitlines()[0])
    parser.add_argument("--reward", default="cais", help="a name, or several joined by _ (default: %(default)s)")
    parser.add_argument("--condition", default="noisy", help="free or noisy (default: %(default)s)")
    parser.add_argument("--steps", type=int, default=25_000, help="agent steps to learn in (default: %(default)s)")
    options = parser.parse_args(arguments)
    try:
        settings = params.load()
        env = environment(settings, options.condition, options.reward)
    except Fault as fault:
        sys.exit(str(fault))
    gamma = settings.agent.gamma
    model = PPO("MultiInputPolicy", env, n_steps=ROLLOUT, batch_size=BATCH, gamma=gamma, seed=0, device="cpu")
    model.learn(options.steps)
    often = moving(model, env)
    env.close()
    limb = body.attached(settings.protocol.limb)
    print(f"With the rope on, the limb's joints moved in {often[limb].mean():.0%} of the steps, "
          f"the others in {often[~limb].mean():.0%}.")  # fmt: skip


def environment(settings: Params, condition: Condition, reward: str) -> Intrinsic:
    """The world of params.yaml, seen by the published encoder, with the reward scaled as published.

    Raises:
        Fault: there is no such condition, no scale for the reward, or an artifact is missing or cannot be trusted.
    """
    trained = extractor.load(artifact.read("data/encoder.h5", extractor.SCHEMA))
    scales = artifact.read("data/scales.h5", "scale")
    env = MIMoMobileEnv(condition, settings.protocol.limb, settings=settings)
    own = {name: float(scales[name]) for name in reward.split("_")}
    return Intrinsic(env, settings, reward, trained, own, condition)


def moving(model: PPO, env: Intrinsic) -> np.ndarray:
    """(12,) share of the steps with the rope on in which each joint moved, in one experiment."""
    moved: list[np.ndarray] = []
    ended = False
    seen, _ = env.reset(seed=0)
    while not ended:
        action, _ = model.predict(seen)
        seen, _, _, ended, info = env.step(action)
        if info["attached"]:
            moved.append(action)
    often: np.ndarray = np.mean(moved, axis=0)
    return often


if __name__ == "__main__":
    main()
