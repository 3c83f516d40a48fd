"""What a file in the rewards' folder is enough for."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml

from mimo.learning.experiment import inputs
from mimo.record import identity
from mimo.settings import params
from tests.unit.learning.test_rewards import PAPERS

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
t = rewards.Transition(np.float32([0.25, 2.0]), np.stack([h, h], axis=1), action)
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
