"""Rewards against numbers worked by hand, and what a file in their folder is enough for."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from mimo.learning import rewards
from mimo.learning.experiment import inputs
from mimo.learning.rewards import REWARDS, Reward, Transition, UnknownRewardError
from mimo.record import identity
from mimo.settings import params

JOINTS, LATENT = 12, 64


PAPERS = ("cais", "mtl", "rtl", "surprise")


def settings(cais: str = "move", surprise: str = "taken") -> params.Rewards:
    pays = {"cais": {"pays": cais}, "surprise": {"pays": surprise}}
    return params.checked(params.load().rewards, pays)


def made(name: str, **pays: str) -> Reward:
    """The reward of that name, with what these pay."""
    (reward,) = rewards.parts(name, settings(**pays))
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


@pytest.mark.parametrize("name", list(REWARDS))
def test_rewards_do_not_depend_on_the_stack(name: str) -> None:
    generator = np.random.default_rng(3)
    fields = {
        "path_length": generator.random(7, np.float32),
        "latent_before": generator.standard_normal((7, LATENT), np.float32),
        "latent": generator.standard_normal((7, LATENT), np.float32),
        "action": generator.random((7, JOINTS)) < 0.4,
        "influence": generator.random((7, JOINTS, 2), np.float32),
        "expectation": generator.standard_normal((7, JOINTS, LATENT), np.float32),
    }
    reward = made(name)
    stack = reward(Transition(**fields))
    assert stack.shape == (7, JOINTS)
    for seed in range(7):
        alone = reward(Transition(**{key: value[seed : seed + 1].copy() for key, value in fields.items()}))
        assert same(alone[0], stack[seed])


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


# A file in the folder.

NOVELTY = '''
"""How new a path is."""

from typing import Annotated

from pydantic import Field

from mimo.learning.rewards.mtl import MTL
from mimo.settings.section import Section


class Novelty(MTL):
    """MTL, weighed."""

    name = "novelty"

    class Constants(Section):
        """`weight`: of a metre."""

        weight: Annotated[float, Field(ge=0, le=9)]

    def __call__(self, t):
        """See Reward."""
        return self.constants.weight * super().__call__(t)
'''
PAID = """
import numpy as np
from mimo.learning import rewards
from mimo.settings import params
p = params.load("with.yaml")
action, h = np.zeros((2, 12), bool), np.zeros((2, 64), np.float32)
t = rewards.Transition(np.float32([0.25, 2.0]), h, h, action)
parts = rewards.parts("mtl_novelty", p.rewards)
assert [part(t)[:, 3].tolist() for part in parts] == [[0.25, 2.0], [1.0, 8.0]]
for file in ("params.yaml", "heavy.yaml"):
    try:
        params.load(file)
    except params.ParamsError as error:
        print(error)
"""
DIGESTS = """
import json, sys
from pathlib import Path
from mimo.learning.experiment import inputs
from mimo.record import identity
from mimo.settings import params
p, scales = params.load("with.yaml"), json.loads(sys.argv[1])
found = []
for edited in (None, "novelty", "mtl", "surprise", "reward"):
    path = Path(f"mimo/learning/rewards/{edited}.py")
    before = path.read_text() if edited else ""
    if edited:
        path.write_text(before + "\\nEDITED = True\\n")
    found.append({name: identity.Digest(inputs(p, "free", name, "e", scales)) for name in scales})
    if edited:
        path.write_text(before)
print(json.dumps(found))
"""


@pytest.fixture
def extended(tmp_path: Path) -> Path:
    """A copy of the package with one more file, params.yaml as it is, and as it must be: with a weight of 4, or 10."""
    top = identity.ROOT
    shutil.copytree(top / "mimo", tmp_path / "mimo", ignore=shutil.ignore_patterns("__pycache__"))
    (tmp_path / "mimo/learning/rewards/novelty.py").write_text(NOVELTY)
    shutil.copy(top / "params.yaml", tmp_path)
    whole: dict[str, Any] = yaml.safe_load((top / "params.yaml").read_text())
    whole["sweep"]["rewards"] += ["novelty", "rtl_novelty"]
    for name, weight in (("with", 4.0), ("heavy", 10.0)):
        whole["rewards"]["novelty"] = {"weight": weight}
        (tmp_path / f"{name}.yaml").write_text(yaml.safe_dump(whole))
    return tmp_path


def own_path(folder: Path) -> dict[str, str]:
    return os.environ | {"PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}


def said(folder: Path, script: str, *arguments: str) -> str:
    """What a script says in a process whose package is that of `folder`."""
    done = subprocess.run(
        [sys.executable, "-c", script, *arguments], cwd=folder, env=own_path(folder), capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_a_file_in_the_folder_is_a_reward_with_a_section_of_its_own(extended: Path) -> None:
    assert said(extended, PAID).splitlines() == [
        "params.yaml: rewards.novelty is missing.",
        "heavy.yaml: rewards.novelty.weight must be less than or equal to 9; it is 10.0.",
    ]


FAULTS = {
    "class Zeal(:": "SyntaxError: ",
    "import nowhere": "ModuleNotFoundError: No module named 'nowhere'",
    "from mimo.learning.rewards import Reward\n\nclass Zeal(Reward):\n    pass": "AttributeError: ",
    "from mimo.learning.rewards import Reward\n\nclass Zeal(Reward):\n    name = 'mtl'": "ValueError: Zeal.name",
}


@pytest.mark.parametrize("source", FAULTS)
def test_a_file_that_cannot_be_used_is_named_in_a_sentence(source: str, tmp_path: Path) -> None:
    shutil.copytree(identity.ROOT / "mimo", tmp_path / "mimo", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(identity.ROOT / "stages", tmp_path / "stages", ignore=shutil.ignore_patterns("__pycache__"))
    (tmp_path / "mimo/learning/rewards/zeal.py").write_text(source)
    done = subprocess.run(
        [sys.executable, "-m", "stages.claims"], cwd=tmp_path, env=own_path(tmp_path), capture_output=True, text=True
    )
    assert done.returncode == 1
    assert done.stderr.startswith(f"mimo/learning/rewards/zeal.py cannot be used: {FAULTS[source]}"), done.stderr
    assert "Traceback" not in done.stderr


def test_a_reward_may_use_the_papers_actions(tmp_path: Path) -> None:
    shutil.copytree(identity.ROOT / "mimo", tmp_path / "mimo", ignore=shutil.ignore_patterns("__pycache__"))
    text = NOVELTY.replace("from typing", "from mimo.world.protocol import JOINTS, MOVE\nfrom typing")
    (tmp_path / "mimo/learning/rewards/novelty.py").write_text(text)
    assert said(tmp_path, "from mimo.learning import rewards; print(list(rewards.REWARDS))").count("novelty") == 1


def test_a_runs_digest_is_of_its_own_rewards_files_alone(extended: Path, scales: dict[str, float]) -> None:
    """Novelty inherits from MTL, so that MTL's file is its own too; all have what a reward is."""
    here = {name: identity.Digest(inputs(params.load(), "free", name, "e", scales)) for name in PAPERS}
    added, *edited = json.loads(said(extended, DIGESTS, json.dumps(scales | {"novelty": 0.1})))
    assert list(added) == [*scales, "novelty"]
    assert {name: added[name] for name in PAPERS} == here
    assert [{name for name in added if after[name] != added[name]} for after in edited] == [
        {"novelty"}, {"mtl", "novelty"}, {"surprise"}, {*PAPERS, "novelty"}
    ]  # fmt: skip
