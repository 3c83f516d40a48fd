"""Many worlds as one vector environment: what Gymnasium's own, of as many single environments, gives."""

from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from mimo.settings import params
from mimo.settings.files import ParamsError
from mimo.world.env import MIMoMobileEnv
from mimo.world.vector_env import MIMoMobileVectorEnv

SHORT: dict[str, Any] = {"condition": "noisy", "baseline_steps": 1, "attached_steps": 2, "extinction_steps": 1}
N, EPISODE = 3, 4


def rows(envs: Any, seed: Any, count: int) -> list[Any]:
    """What a reset and so many steps give, the same actions each time."""
    actions = np.random.default_rng(5).integers(0, 2, (count, N, 12))
    return [envs.reset(seed=seed), *(envs.step(action) for action in actions)]


def same(one: Any, other: Any) -> bool:
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(same(one[key], other[key]) for key in one)
    if isinstance(one, tuple):
        return len(one) == len(other) and all(map(same, one, other))
    found, expected = np.asarray(one), np.asarray(other)
    return found.shape == expected.shape and found.dtype == expected.dtype and bool((found == expected).all())


def test_a_rope_that_holds_in_some_steps_is_each_worlds_own() -> None:
    published = params.published()
    loose = params.changed(published, {"world.rope_holds": 0.5})
    long = SHORT | {"attached_steps": 20, "settings": loose}
    ours = MIMoMobileVectorEnv(N, **long)
    theirs = SyncVectorEnv([lambda: MIMoMobileEnv(**long)] * N)
    held = []
    for step, (found, expected) in enumerate(zip(rows(ours, 7, 22), rows(theirs, 7, 22), strict=True)):
        assert same(found, expected), step
        held.append(found[-1]["attached"])
    assert not np.any(held[:2] + held[-1:])
    share = np.array(held[2:-1]).mean(axis=0)
    assert len(set(map(bytes, np.array(held, bool).T))) == N
    assert (share > 0.1).all() and (share < 0.9).all()
    ours.close()
    theirs.close()


@pytest.mark.parametrize("seed", [7, [3, 1, 2]], ids=str)
@pytest.mark.parametrize("threads", [1, 2])
def test_it_is_the_single_environments_to_the_bit_also_beyond_the_end(seed: Any, threads: int) -> None:
    ours = MIMoMobileVectorEnv(N, threads, **SHORT)
    theirs = SyncVectorEnv([lambda: MIMoMobileEnv(**SHORT)] * N)
    for step, (found, expected) in enumerate(zip(rows(ours, seed, 7), rows(theirs, seed, 7), strict=True)):
        assert same(found, expected), step
    ours.close()
    theirs.close()


def test_gymnasium_makes_it() -> None:
    envs = gymnasium.make_vec("mimo/MIMoMobile-v0", num_envs=N, **SHORT)
    assert isinstance(envs, MIMoMobileVectorEnv)
    assert envs.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    assert envs.action_space.shape == (N, 12)
    seen, _ = envs.reset(seed=0)
    assert envs.observation_space.contains(seen)
    truncated = [envs.step(envs.action_space.sample())[3].tolist() for _ in range(2 * EPISODE)]
    assert [all(row) for row in truncated] == [step == EPISODE - 1 for step in range(2 * EPISODE)]
    envs.close()


def test_an_episode_after_the_end_is_another_one() -> None:
    envs = MIMoMobileVectorEnv(N, **SHORT)
    found = rows(envs, 0, 2 * EPISODE + 1)
    first, second = (np.stack([row[1] for row in found[start : start + EPISODE]]) for start in (1, EPISODE + 2))
    assert (first != second).any()
    assert not found[EPISODE + 1][1].any()  # the step that begins it pays nothing
    envs.close()


def test_what_cannot_be_is_refused() -> None:
    envs = MIMoMobileVectorEnv(N, **SHORT)
    with pytest.raises(gymnasium.error.ResetNeeded):
        envs.step(np.zeros((N, 12), bool))
    with pytest.raises(ValueError, match=r"^seed must be one number or 3; there are 2\.$"):
        envs.reset(seed=[1, 2])
    with pytest.raises(ValueError, match=r"^options must be empty; there is reset_mask\.$"):
        envs.reset(options={"reset_mask": np.ones(N, bool)})
    envs.reset()
    for actions in (np.zeros((N + 1, 12)), np.ones(12), np.full((N, 12), 2), np.full((N, 12), 0.5)):
        with pytest.raises(ValueError, match=r"^An action is 12 numbers 0 or 1 for each world, \(3, 12\); it is array"):
            envs.step(actions)
    with pytest.raises(ParamsError, match=r"^threads must be at least 1; it is 0\.$"):
        MIMoMobileVectorEnv(N, 0, **SHORT)
    envs.close()
