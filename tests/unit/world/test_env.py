"""MIMoMobile-v0 as Gymnasium sees it."""

import pickle
import warnings
from collections.abc import Iterator
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from mimo.settings.files import ParamsError
from mimo.world.env import MIMoMobileEnv

SHORT: dict[str, Any] = {"baseline_steps": 2, "attached_steps": 3, "extinction_steps": 2}


@pytest.fixture
def env(request: pytest.FixtureRequest) -> Iterator[Any]:
    made = gymnasium.make("mimo/MIMoMobile-v0", **SHORT, **getattr(request, "param", {}))
    yield made
    made.close()


def episode(env: Any, seed: int) -> list[tuple[dict[str, np.ndarray], float, bool, dict[str, Any]]]:
    env.reset(seed=seed)
    rng = np.random.default_rng(1)
    rows: list[tuple[dict[str, np.ndarray], float, bool, dict[str, Any]]] = []
    while not rows or not rows[-1][2]:
        seen, reward, terminated, truncated, info = env.step(rng.integers(0, 2, 12))
        assert not terminated
        rows.append((seen, reward, truncated, info))
    return rows


@pytest.mark.parametrize(
    "env", [{"condition": "free"}, {"condition": "noisy", "render_mode": "rgb_array"}], indirect=True
)
def test_the_checker_is_content(env: Any) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env.unwrapped)


@pytest.mark.parametrize("env", [{"condition": "noisy", "limb": "right_hand"}], indirect=True)
def test_a_seeded_reset_repeats_exactly(env: Any) -> None:
    first, second, other = episode(env, 7), episode(env, 7), episode(env, 8)
    for (seen, reward, _, info), (again, reward_again, _, info_again) in zip(first, second, strict=True):
        assert (seen["vision"] == again["vision"]).all()
        assert seen["proprioception"].tobytes() == again["proprioception"].tobytes()
        assert reward == reward_again
        assert (info["centre_of_mass"] == info_again["centre_of_mass"]).all()
    assert any(one[1] != two[1] for one, two in zip(first, other, strict=True))


def test_phases_rope_and_end(env: Any) -> None:
    rows = episode(env, 0)
    assert [info["phase"] for *_, info in rows] == ["baseline"] * 2 + ["attached"] * 3 + ["extinction"] * 2
    assert [info["attached"] for *_, info in rows] == [False] * 2 + [True] * 3 + [False] * 2
    assert [truncated for _, _, truncated, _ in rows] == [False] * 6 + [True]
    mtl = [info["mtl"] for *_, info in rows]
    assert mtl == [reward for _, reward, _, _ in rows]
    assert max(mtl[:2]) < 1e-6 < max(mtl[2:5])


def test_observation_shapes(env: Any) -> None:
    seen, info = env.reset(seed=0)
    assert seen["proprioception"].shape == (47,)
    assert seen["vision"].shape == (128, 128, 3)
    assert seen["vision"].dtype == np.uint8
    assert info["centre_of_mass"].shape == (3,)


@pytest.mark.parametrize("env", [{"render_mode": "rgb_array"}], indirect=True)
def test_the_rope_is_drawn_in_third_person_while_attached(env: Any) -> None:
    env.reset(seed=0)

    def red(picture: np.ndarray) -> int:
        colour = picture.astype(int)
        return int(((colour[..., 0] > 60) & (colour[..., 1] < 25) & (colour[..., 2] < 25)).sum())

    shown = []
    for _ in range(3):
        env.step(np.zeros(12, int))
        picture = env.render()
        assert picture.shape == (480, 640, 3)
        shown.append(red(picture))
    # After the second step the third, attached, is due: the rope is on.
    assert shown[1] > shown[0] + 30


def test_bad_options_are_refused_in_a_sentence() -> None:
    with pytest.raises(ParamsError, match="limb must be 'left_foot'"):
        MIMoMobileEnv(limb="tail")  # type: ignore[arg-type]
    with pytest.raises(ParamsError, match="condition must be free or noisy"):
        MIMoMobileEnv(condition="windy")  # type: ignore[arg-type]
    with pytest.raises(ParamsError, match="attached_steps must be greater than 0"):
        MIMoMobileEnv(attached_steps=0)


def test_step_before_reset_is_refused() -> None:
    env = MIMoMobileEnv()
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(np.zeros(12))
    env.close()


def test_a_pickled_environment_is_an_equal_one() -> None:
    made = MIMoMobileEnv("noisy", "right_hand", **SHORT)
    before = episode(made, 3)
    again = pickle.loads(pickle.dumps(made))
    for one, other in zip(before, episode(again, 3), strict=True):
        assert (one[0]["vision"] == other[0]["vision"]).all()
        assert one[1:3] == other[1:3]
    made.close()
    again.close()
