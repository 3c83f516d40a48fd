"""Rewards against numbers worked by hand."""

import subprocess
import sys

import pytest
import torch

from mimo.learning import rewards
from mimo.learning.rewards import REWARDS, Reward, Transition, UnknownRewardError
from mimo.settings import params

JOINTS, LATENT = 12, 64


def settings(cais: str = "move", surprise: str = "taken") -> params.Rewards:
    pays = {"cais": {"pays": cais}, "surprise": {"pays": surprise}}
    return params.Rewards.model_validate({"gain": 0.3, "scale": "resting"} | pays)


def transition() -> Transition:
    """Two seeds. Seed 0 moved joints 0 and 5, seed 1 none; numbers are small and exact."""
    action = torch.zeros(2, JOINTS, dtype=torch.bool)
    action[0, [0, 5]] = True
    before, after = torch.zeros(2, LATENT), torch.zeros(2, LATENT)
    before[0, 0], after[0, 0], after[0, 1] = 1.0, 4.0, 4.0  # moved by (3, 4)
    after[1, :4] = 1.0  # moved by four ones
    influence = torch.stack([torch.arange(24.0), 100 + torch.arange(24.0)]).view(2, JOINTS, 2)
    expectation = after[:, None, :].repeat(1, JOINTS, 1)
    expectation[0, 3, 63] -= 5.0
    expectation[1, 11, :9] += 2.0
    return Transition(torch.tensor([0.25, 2.0]), before, after, action, influence, expectation)


def test_mtl_is_the_path_length_for_all_joints() -> None:
    assert torch.equal(REWARDS["mtl"](settings())(transition()), torch.tensor([[0.25] * JOINTS, [2.0] * JOINTS]))


def test_rtl_is_the_euclidean_step_of_the_latent() -> None:
    assert torch.equal(REWARDS["rtl"](settings())(transition()), torch.tensor([[5.0] * JOINTS, [2.0] * JOINTS]))


def test_cais_pays_move_alone() -> None:
    expected = torch.zeros(2, JOINTS)
    expected[0, 0], expected[0, 5] = 1.0, 11.0  # entry 2 * joint + 1
    assert torch.equal(REWARDS["cais"](settings("move"))(transition()), expected)


def test_cais_pays_the_action_taken() -> None:
    expected = torch.stack([torch.arange(0, 24, 2.0), torch.arange(100, 124, 2.0)])
    expected[0, 0], expected[0, 5] = 1.0, 11.0
    assert torch.equal(REWARDS["cais"](settings("taken"))(transition()), expected)


def test_surprise_is_each_joints_distance_from_its_expectation() -> None:
    expected = torch.zeros(2, JOINTS)
    expected[0, 3], expected[1, 11] = 5.0, 6.0
    assert torch.equal(REWARDS["surprise"](settings())(transition()), expected)


def test_surprise_may_pay_move_alone() -> None:
    seen = transition()
    seen.action[1, 11] = True
    expected = torch.zeros(2, JOINTS)
    expected[1, 11] = 6.0
    assert torch.equal(REWARDS["surprise"](settings(surprise="move"))(seen), expected)


@pytest.mark.parametrize("name", ["cais", "surprise"])
def test_a_reward_that_needs_outcomes_refuses_a_transition_without(name: str) -> None:
    whole = transition()
    bare = Transition(whole.path_length, whole.latent_before, whole.latent, whole.action)
    with pytest.raises(AssertionError, match="needs the"):
        REWARDS[name](settings())(bare)


@pytest.mark.parametrize("name", list(REWARDS))
def test_rewards_do_not_depend_on_the_stack(name: str) -> None:
    generator = torch.Generator().manual_seed(3)
    fields = {
        "path_length": torch.rand(7, generator=generator),
        "latent_before": torch.randn(7, LATENT, generator=generator),
        "latent": torch.randn(7, LATENT, generator=generator),
        "action": torch.rand(7, JOINTS, generator=generator) < 0.4,
        "influence": torch.rand(7, JOINTS, 2, generator=generator),
        "expectation": torch.randn(7, JOINTS, LATENT, generator=generator),
    }
    reward = REWARDS[name](settings())
    stack = reward(Transition(**fields))
    assert stack.shape == (7, JOINTS)
    for seed in range(7):
        alone = reward(Transition(**{key: value[seed : seed + 1].clone() for key, value in fields.items()}))
        assert torch.equal(alone[0], stack[seed])


def test_parts_follow_the_name() -> None:
    assert list(REWARDS)[:4] == ["mtl", "rtl", "cais", "surprise"]
    assert [part.name for part in rewards.parts("mtl_surprise", settings())] == ["mtl", "surprise"]
    assert [part.name for part in rewards.parts("cais", settings())] == ["cais"]
    needing = [name for name in ("mtl", "rtl", "cais", "surprise", "rtl_surprise") if rewards.needs_outcomes(name)]
    assert needing == ["cais", "surprise", "rtl_surprise"]


@pytest.mark.parametrize(("name", "part"), [("mtl_curiosity", "curiosity"), ("", ""), ("mtl_", "")])
def test_an_unknown_part_is_named_in_a_sentence(name: str, part: str) -> None:
    with pytest.raises(UnknownRewardError, match=f"'{part}': known are mtl, rtl, cais, surprise"):
        rewards.parts(name, settings())
    with pytest.raises(LookupError):
        rewards.needs_outcomes(name)


@pytest.mark.parametrize(("name", "fault"), [("mtl", "MTL has it already"), ("mtl_twice", "'_' joins")])
def test_a_name_that_cannot_be_used_is_refused(name: str, fault: str) -> None:
    known = list(REWARDS)
    with pytest.raises(ValueError, match=fault):
        type("Again", (Reward,), {"name": name})
    assert list(REWARDS) == known


def test_names_load_without_torch() -> None:
    code = "import sys, mimo.learning.rewards, mimo.settings.params; sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
