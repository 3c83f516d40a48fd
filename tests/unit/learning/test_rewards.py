"""Rewards against numbers worked by hand."""

import subprocess
import sys
from typing import Any

import numpy as np
import pytest

from mimo.learning import rewards
from mimo.learning.rewards import REWARDS, Reward, Transition, UnknownRewardError
from mimo.settings import params

JOINTS, LATENT = 12, 64
PAPERS = ("cais", "mtl", "rtl", "surprise")


def settings(cais: str = "move", surprise: str = "taken", frames: int = 1) -> params.Rewards:
    own = {"cais": {"pays": cais}, "surprise": {"pays": surprise, "weight": 1.0}, "rtl": {"frames": frames}}
    return params.checked(params.load().rewards, own)


def made(name: str, **own: Any) -> Reward:
    """The reward of that name, with such constants."""
    (reward,) = rewards.parts(name, settings(**own))
    return reward


def transition() -> Transition:
    """Two seeds. Seed 0 moved joints 0 and 5, seed 1 none; numbers are small and exact."""
    action = np.zeros((2, JOINTS), bool)
    action[0, [0, 5]] = True
    before, after = np.zeros((2, 2, LATENT), np.float32)
    before[0, 0], after[0, 0], after[0, 1] = 1.0, 4.0, 4.0  # moved by (3, 4)
    after[1, :4] = 1.0  # moved by four ones
    influence = np.stack([np.arange(24), 100 + np.arange(24)]).reshape(2, JOINTS, 2).astype(np.float32)
    expectation = after[:, None].repeat(JOINTS, axis=1)
    expectation[0, 3, 63] -= 5.0
    expectation[1, 11, :9] += 2.0
    latents = np.stack([before, after], axis=1)
    return Transition(np.array([0.25, 2.0], np.float32), latents, action, influence, expectation)


def same(found: np.ndarray, expected: Any) -> bool:
    return found.dtype == np.float32 and found.shape == np.shape(expected) and bool((found == expected).all())


def test_mtl_is_the_path_length_for_all_joints() -> None:
    assert same(made("mtl")(transition()), [[0.25] * JOINTS, [2.0] * JOINTS])


def test_rtl_is_the_euclidean_step_of_the_latent() -> None:
    assert same(made("rtl")(transition()), [[5.0] * JOINTS, [2.0] * JOINTS])


def on_the_way() -> Transition:
    """Four pictures of a step: h goes 3, 4, back, and by (3, 4); in the other seed it stays until the end."""
    h = np.zeros((2, 5, LATENT), np.float32)
    h[0, 1, 0], h[0, 2, :2], h[0, 3, 0], h[0, 4, :2] = 3, (3, 4), 3, (6, 4)
    h[1, 4, 9] = 2
    whole = transition()
    return Transition(whole.path_length, h, whole.action)


def test_rtl_may_be_the_way_from_picture_to_picture() -> None:
    assert same(made("rtl", frames=4)(on_the_way()), [[16.0] * JOINTS, [2.0] * JOINTS])
    assert same(made("rtl", frames=2)(on_the_way()), [[8.0] * JOINTS, [2.0] * JOINTS])
    ends = np.float32(np.sqrt(52))
    assert same(made("rtl")(on_the_way()), [[ends] * JOINTS, [2.0] * JOINTS])  # others need the pictures between
    with pytest.raises(AssertionError, match=r"^RTL needs 4 pictures of a step$"):
        made("rtl", frames=4)(transition())


def test_rewards_say_how_many_pictures_of_a_step_they_need() -> None:
    assert [rewards.frames(rewards.parts(name, settings(frames=4))) for name in ("mtl", "rtl", "rtl_surprise")] == [
        1, 4, 4
    ]  # fmt: skip
    assert rewards.frames(rewards.parts("rtl_surprise", settings())) == 1
    assert rewards.frames([]) == 1
    with pytest.raises(
        rewards.RewardError, match=r"^rewards that are paid together ask for 3 and 4 pictures a step\.$"
    ):
        rewards.frames([made("rtl", frames=4), made("mtl"), made("rtl", frames=3)])


def test_cais_pays_move_alone() -> None:
    expected = np.zeros((2, JOINTS))
    expected[0, 0], expected[0, 5] = 1.0, 11.0  # entry 2 * joint + 1
    assert same(made("cais", cais="move")(transition()), expected)


def test_cais_pays_the_action_taken() -> None:
    expected = np.stack([np.arange(0, 24, 2.0), np.arange(100, 124, 2.0)])
    expected[0, 0], expected[0, 5] = 1.0, 11.0
    assert same(made("cais", cais="taken")(transition()), expected)


def test_surprise_is_each_joints_distance_from_its_expectation() -> None:
    expected = np.zeros((2, JOINTS))
    expected[0, 3], expected[1, 11] = 5.0, 6.0
    assert same(made("surprise")(transition()), expected)


def test_surprise_may_pay_move_alone() -> None:
    seen = transition()
    seen.action[1, 11] = True
    expected = np.zeros((2, JOINTS))
    expected[1, 11] = 6.0
    assert same(made("surprise", surprise="move")(seen), expected)


@pytest.mark.parametrize("name", ["cais", "surprise"])
def test_a_reward_that_needs_outcomes_refuses_a_transition_without(name: str) -> None:
    whole = transition()
    bare = Transition(whole.path_length, whole.latents, whole.action)
    with pytest.raises(AssertionError, match="needs the"):
        made(name)(bare)


def steps(seeds: int, count: int, frames: int = 1) -> list[dict[str, np.ndarray]]:
    """Fields of `count` transitions with all that any reward reads."""
    generator = np.random.default_rng(3)
    return [
        {
            "path_length": generator.random(seeds, np.float32),
            "latents": generator.standard_normal((seeds, frames + 1, LATENT), np.float32),
            "action": generator.random((seeds, JOINTS)) < 0.4,
            "influence": generator.random((seeds, JOINTS, 2), np.float32),
            "expectation": generator.standard_normal((seeds, JOINTS, LATENT), np.float32),
            "tables": generator.standard_normal((seeds, 25, 9, LATENT), np.float32),
            "proprioception": generator.standard_normal((seeds, 47), np.float32),
            "probability": generator.random((seeds, JOINTS), np.float32),
        }
        for _ in range(count)
    ]


@pytest.mark.parametrize(("name", "frames"), [*((name, 1) for name in REWARDS), ("rtl", 4), ("rtl", 12)])
def test_rewards_do_not_depend_on_the_stack(name: str, frames: int) -> None:
    """Nor do those that learn as they go, over some steps."""
    own, seen = settings(frames=frames), steps(7, 6, frames)

    def paid(seeds: range) -> list[np.ndarray]:
        terms = rewards.parts(name, own, lambda _: [np.random.default_rng((5, seed)) for seed in seeds])
        taken = slice(seeds.start, seeds.stop)
        told = [Transition(**{key: value[taken].copy() for key, value in fields.items()}) for fields in seen]
        return [rewards.paid(terms, t)[0] for t in told]

    stack = paid(range(7))
    assert all(found.shape == (7, JOINTS) for found in stack)
    assert any(found.any() for found in stack)
    for seed in range(7):
        for alone, together in zip(paid(range(seed, seed + 1)), stack, strict=True):
            assert same(alone[0], together[seed])


class Odd:
    """A reward as its author may get it wrong."""

    name = "odd"

    def __init__(self, given: Any) -> None:
        self.given = given

    def __call__(self, t: Transition) -> Any:
        return self.given


@pytest.mark.parametrize(
    "given", [np.zeros((2, 1)), np.zeros(JOINTS), 0.5, np.zeros((2, JOINTS), complex), None], ids=str
)
def test_what_is_no_reward_is_refused_by_name(given: Any) -> None:
    with pytest.raises(
        rewards.RewardError, match=r"^reward odd must give numbers \(2, 12\), one a joint of each seed;"
    ):
        rewards.paid([Odd(given)], transition())  # type: ignore[list-item]


@pytest.mark.parametrize("number", [1, True, 0.1])
def test_whatever_numbers_a_reward_gives_are_paid_in_single_precision(number: float) -> None:
    (paid,) = rewards.paid([Odd(np.full((2, JOINTS), number))], transition())  # type: ignore[list-item]
    assert same(paid, np.full((2, JOINTS), np.float32(number)))


def test_parts_follow_the_name() -> None:
    assert tuple(name for name in REWARDS if name in PAPERS) == PAPERS
    assert [part.name for part in rewards.parts("mtl_surprise", settings())] == ["mtl", "surprise"]
    assert [part.name for part in rewards.parts("cais", settings())] == ["cais"]
    needing = [name for name in (*PAPERS, "rtl_surprise") if rewards.needs_outcomes(name)]
    assert needing == ["cais", "surprise", "rtl_surprise"]
    assert {name for name, kind in REWARDS.items() if kind.needs_tables} == {"means", "kl", "energy", "mmd"}
    assert {name for name in REWARDS if rewards.needs_outcomes(name)} == {
        "cais", "surprise", "means", "kl", "energy", "mmd", "progress"
    }  # fmt: skip


@pytest.mark.parametrize(("name", "part"), [("mtl_curiosity", "curiosity"), ("", ""), ("mtl_", "")])
def test_an_unknown_part_is_named_in_a_sentence(name: str, part: str) -> None:
    with pytest.raises(UnknownRewardError, match=f"'{part}': known are {', '.join(REWARDS)}"):
        rewards.parts(name, settings())
    with pytest.raises(LookupError):
        rewards.needs_outcomes(name)
    with pytest.raises(LookupError):
        rewards.modules(name)


@pytest.mark.parametrize(
    ("name", "fault"),
    [
        ("mtl", "MTL has it already"),
        ("mtl_twice", "'_' joins"),
        ("gain", "means something else"),
        ("copy", "means something else"),
    ],
)
def test_a_name_that_cannot_be_used_is_refused(name: str, fault: str) -> None:
    known = list(REWARDS)
    with pytest.raises(ValueError, match=fault):
        type("Again", (Reward,), {"name": name})
    assert list(REWARDS) == known


def test_a_run_needs_no_torch() -> None:
    code = "import sys, mimo.learning.experiment; sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_the_modules_of_a_name_are_the_files_of_its_parts() -> None:
    assert rewards.modules("mtl_surprise") == ["mimo.learning.rewards.mtl", "mimo.learning.rewards.surprise"]
