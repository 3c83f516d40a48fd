"""What docs/guide.md says is done, block by block: edits in copies of the small project, Python beside its results.

All start from the project of tests/pipeline/conftest.py.
"""

import json
import re
import sys
from pathlib import Path
from typing import Any

import gymnasium
import h5py
import numpy as np
import pytest
import yaml
from gymnasium.utils.env_checker import check_env
from stable_baselines3.common import env_checker

from examples import sb3
from mimo.record import artifact
from mimo.settings import params, studies
from mimo.settings.errors import Fault
from mimo.world import body
from tests.pipeline.project import digests, done, ran, repro, stored

ROOT = Path(__file__).parents[2]
GUIDE = (ROOT / "docs/guide.md").read_text()
STAGES = """
import importlib, pathlib, sys
for line in ("collect", "encoder", "calibrate", "train --serial", "runs", "analyse"):
    module, *given = line.split()
    for manifest in sorted(pathlib.Path("data/manifests").glob("*.json")) if module == "runs" else [""]:
        sys.argv = [module, *given, *filter(None, [str(manifest)])]
        importlib.import_module(f"stages.{module}").main()
"""

pytestmark = pytest.mark.timeout(900)


def blocks(section: str, language: str) -> list[str]:
    """The code blocks of a language under a heading of the guide."""
    (text,) = re.findall(rf"^## {section}\n(.*?)(?=^## |\Z)", GUIDE, re.M | re.S)
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.M | re.S)


def test_no_block_goes_without_a_test() -> None:
    tested = {
        "A reward": ["python", "yaml"],
        "A study": ["yaml"],
        "A condition": ["yaml", "diff"],
        "Your own learner": ["python", "python"],
        "Reading an artifact": ["python", "python"],
        "One constant, and what follows": ["sh"],
        "Citing": ["bibtex"],  # is for reading
    }
    sections = re.split(r"^## (.*)\n", GUIDE, flags=re.M)
    found = {
        name: re.findall(r"^```(\w+)\n", text, re.M) for name, text in zip(sections[1::2], sections[2::2], strict=True)
    }
    assert found == tested
    assert "```" not in sections[0]


def lay(values: dict[str, Any], over: dict[str, Any]) -> dict[str, Any]:
    """Settings laid over others, section by section."""
    return over | {
        key: lay(value, over.get(key, {})) if isinstance(value, dict) else value for key, value in values.items()
    }


def set_params(project: Path, block: str) -> None:
    values = yaml.safe_load(block)
    path = project / (studies.PATH if set(values) <= set(studies.Studies.model_fields) else "params.yaml")
    path.write_text(yaml.safe_dump(lay(values, yaml.safe_load(path.read_text())), sort_keys=False))


def replace(project: Path, block: str) -> None:
    """What a block in the form of a diff says: the lines with - become those with + that follow."""
    for name, changes in re.findall(r"^--- (\S+)\n(.*?)(?=^--- |\Z)", block, re.M | re.S):
        path = project / name
        for old, new in re.findall(r"((?:^-.*\n)+)((?:^\+.*\n)+)", changes, re.M):
            before, after = (re.sub("^[-+]", "", lines, flags=re.M) for lines in (old, new))
            assert path.read_text().count(before) == 1, f"{name} has not once:\n{before}"
            path.write_text(path.read_text().replace(before, after))


def test_a_reward_and_a_variant_compute_their_runs_alone(project: Path) -> None:
    """A comment in the learner, besides, computes nothing."""
    before, runs = stored(project), digests(project, "data/runs")
    same = digests(project, ".work/scales", "data/variants")
    agent = project / "mimo/learning/agent.py"
    agent.write_text(agent.read_text() + "\n# A comment.\n")
    (reward,) = blocks("A reward", "python")
    (project / "mimo/learning/rewards/stillness.py").write_text(reward)
    set_params(project, blocks("A reward", "yaml")[0])
    set_params(project, blocks("A study", "yaml")[0])
    (commands,) = blocks("One constant, and what follows", "sh")
    first, *others = commands.splitlines()
    assert first == "dvc repro"
    said = repro(
        project, "claims", "studies/dvc.yaml:compare@own", "studies/dvc.yaml:compare@breeze"
    )  # figures and page besides would take seconds, and are not looked at
    assert "6 runs, 4 of them in the store." in said
    assert "3 runs, 3 of them in the store." in said
    assert "10 runs, 0 of them in the store." in said
    assert {"calibrate", "train", "studies:vary@own", "studies:vary@breeze"} <= ran(said)
    assert len(stored(project) - before) == 2 + 10
    assert digests(project, ".work/scales", "data/variants").items() >= same.items()
    after = digests(project, "data/runs")
    assert {name: after[name] for name in runs} == runs
    assert {"data/runs/free/stillness/seed-000.h5", "data/runs/noisy/stillness/seed-000.h5"} == set(after) - set(runs)
    with h5py.File(project / "data/runs/free/stillness/seed-000.h5") as run:
        assert (run["part/stillness"][:, 7] == -run["path_length"][:]).all()
    assert json.loads((project / "reports/studies/breeze.json").read_text())["variants"]["n10"]["set"] == {
        "conditions.noisy.force": 10.0
    }
    changed, came = (done(project, *line.split()) for line in others)
    assert "studies.breeze.variants" in changed
    assert re.search(r"lead-noisy\.json +stillness +- ", came)


def test_a_third_condition_is_seen_learned_in_and_analysed(project: Path) -> None:
    set_params(project, blocks("A condition", "yaml")[0])
    set_params(project, "sweep: {rewards: [mtl]}\nfilm: {run: mtl/seed-000}")
    (edits,) = blocks("A condition", "diff")
    replace(project, edits)
    done(project, sys.executable, "-c", STAGES)
    frames = artifact.read(project / "data/frames.h5", "frame")
    assert str(frames.about["regimes"]).endswith("noisy, attached; breezy, detached; breezy, attached")
    paths = {}
    for name in ("free", "noisy", "breezy"):
        run = artifact.read(project / f"data/runs/{name}/mtl/seed-000.h5", "run")
        assert run.about["condition"] == name
        paths[name] = run["path_length"].mean()
    assert paths["free"] < paths["breezy"] < paths["noisy"]
    assert "breezy" in json.loads((project / "reports/metrics.json").read_text())["conditions"]


@pytest.fixture
def beside(published: tuple[Path, str], monkeypatch: pytest.MonkeyPatch) -> Path:
    """The small project as the working folder, to be read only."""
    monkeypatch.chdir(published[0])
    return published[0]


def test_the_learners_blocks_run(beside: Path, capsys: pytest.CaptureFixture[str]) -> None:
    alone, paid = blocks("Your own learner", "python")
    found: dict[str, Any] = {}
    exec(alone, found)
    assert found["model"].num_timesteps == 20
    exec(paid, found)
    assert found["model"].num_timesteps == 20
    assert capsys.readouterr().out == "(64,) (12,)\n"


def test_an_artifact_is_read_as_the_guide_says(beside: Path, capsys: pytest.CaptureFixture[str]) -> None:
    one, every = blocks("Reading an artifact", "python")
    held = artifact.read("data/runs/noisy/cais/seed-000.h5", "run")
    found: dict[str, Any] = {}
    exec(one, found)
    assert (found["p_move"].to_numpy() == held["move_probability"]).all()
    said = capsys.readouterr().out
    assert said.startswith(f"run {held.digest} {held.content}\n")
    assert "\npath_length (11,) m step\n" in said
    exec(every, found)
    tidy = found["p_move"].set_index(["condition", "reward", "seed", "step", "joint"])["p_move"]
    assert len(tidy) == 4 * 11 * 12
    assert tidy["noisy", "cais", 0, 7, body.ACTUATED[3]] == held["move_probability"][7, 3]


# The example.


@pytest.mark.parametrize("reward", ["rtl", "mtl_cais_surprise"])
def test_the_checkers_are_content(beside: Path, reward: str) -> None:
    env = sb3.environment(params.load(), "noisy", reward)
    check_env(env, skip_render_check=True)
    env_checker.check_env(env)
    env.close()


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [("outcomes.marginal", "policy", "set outcomes.marginal"), ("rewards.rtl.frames", 4, "set rewards.rtl.frames")],
)
def test_a_reading_that_another_learner_cannot_serve_is_refused(beside: Path, key: str, value: Any, said: str) -> None:
    with pytest.raises(Fault, match=said):
        sb3.environment(params.changed(params.load(), {key: value}), "noisy", "rtl_cais")


def test_the_bare_environment_suits_stable_baselines() -> None:
    env = gymnasium.make("mimo.world.env:mimo/MIMoMobile-v0")
    env_checker.check_env(env)
    env.close()


def test_the_wrapper_pays_as_the_paper_does(beside: Path) -> None:
    settings, scales = params.load(), artifact.read("data/scales.h5", "scale")
    rest, move = np.zeros(12, int), np.eye(12, dtype=int)[4]
    with sb3.environment(settings, "free", "mtl_cais") as env:
        env.reset(seed=3)
        for _ in range(settings.protocol.baseline_steps + 2):
            _, reward, _, _, info = env.step(rest)
            mtl = settings.rewards.gain / float(scales["mtl"]) * info["mtl"]
            assert info["rewards"] == pytest.approx(np.full(12, mtl))  # CAIS pays no joint at rest
        assert mtl > 0
        _, reward, _, _, info = env.step(move)
        mtl = settings.rewards.gain / float(scales["mtl"]) * info["mtl"]
        assert info["rewards"][rest == move] == pytest.approx(np.full(11, mtl))
        assert info["rewards"][4] > mtl
        assert reward == pytest.approx(info["rewards"].mean())


def test_the_example_learns_and_says_who_moved(beside: Path, capsys: pytest.CaptureFixture[str]) -> None:
    sb3.main(["--reward", "cais_surprise", "--condition", "noisy", "--steps", "250"])
    said = capsys.readouterr().out
    found = re.fullmatch(
        r"With the rope on, the limb's joints moved in (\d+)% of the steps, the others in (\d+)%\.\n", said
    )
    assert found and all(0 < int(share) < 100 for share in found.groups())


@pytest.mark.parametrize(
    ("arguments", "fault"),
    [
        (("--reward", "curiosity"), r"data/scales\.h5 has no dataset 'curiosity'; it has .*cais, .*mtl"),
        (("--condition", "windy"), "condition must be free or noisy; it is 'windy'"),
    ],
)
def test_what_is_not_there_is_refused_in_a_sentence(beside: Path, arguments: tuple[str, str], fault: str) -> None:
    with pytest.raises(SystemExit, match=fault):
        sb3.main([*arguments])
