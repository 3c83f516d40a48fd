"""What an output says it was made by."""

import json
from pathlib import Path

import numpy as np
import pytest
import yaml

from mimo.record import artifact, identity
from mimo.record.artifact import Dataset
from stages.base import console, origin

TARGET = Path("reports/drawn.json")
DATA = Path("data/all.h5")
CODE = {
    "stages/draw.py": '"""Draws."""\nlines = 3\n',
    "mimo/world/body.py": "limbs = 4\n",
    "mimo/world/notes.txt": "any",
}


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A project of one stage, which reads an artifact; its code is a file and a folder."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(identity, "ROOT", tmp_path)
    stage = {"params": ["seed", "agent", "world.mass"], "deps": [str(DATA), "stages/draw.py", "mimo/world"]}
    Path("dvc.yaml").write_text(yaml.safe_dump({"stages": {"draw": stage}}), encoding="utf-8")
    Path("params.yaml").write_text(
        "seed: 1 # any\nagent: {gamma: 0.1}\nworld: {mass: 2.0, length: 3.0}\n", encoding="utf-8"
    )
    for name, text in CODE.items():
        Path(name).parent.mkdir(parents=True, exist_ok=True)
        Path(name).write_text(text, encoding="utf-8")
    write_data(1)
    return tmp_path


def write_data(value: int) -> str:
    return artifact.write(DATA, "run", "made by a test", {"x": Dataset(np.array([value]), "1", "i")})


def written() -> dict:
    origin.write("draw@free", TARGET, [DATA])
    return origin.read(TARGET)


def test_it_names_command_code_params_and_data(here: Path) -> None:
    made = written()
    assert (made["stage"], made["command"]) == ("draw@free", "dvc repro draw@free")
    assert made["params"] == {"seed": 1, "agent": {"gamma": 0.1}, "world.mass": 2.0}
    assert [*made["code"]] == ["stages/draw.py", "mimo/world"]
    assert made["code"]["stages/draw.py"] == identity.syntax(here / "stages/draw.py")
    assert made["data"] == {str(DATA): artifact.read(DATA, "run").content}
    before = TARGET.read_bytes()
    assert written() == made
    assert TARGET.read_bytes() == before


@pytest.mark.parametrize(
    ("file", "text", "changes"),
    [
        ("stages/draw.py", '"""Draws lines."""\nlines = 3  # enough\n', set()),
        ("stages/draw.py", "lines = 4\n", {"code", "digest"}),
        ("mimo/world/body.py", "limbs = 4  # enough\n", set()),
        ("mimo/world/body.py", "limbs = 5\n", {"code", "digest"}),
        ("mimo/world/eye.py", "", {"code", "digest"}),
        ("mimo/world/notes.txt", "others", set()),
        ("params.yaml", "seed: 2\nagent: {gamma: 0.1}\nworld: {mass: 2.0, length: 3.0}\n", {"params", "digest"}),
        ("params.yaml", "seed: 1\nagent: {gamma: 0.1}\nworld: {mass: 2.0, length: 4.0}\n", set()),
    ],
)
def test_it_changes_with_what_counts(here: Path, file: str, text: str, changes: set[str]) -> None:
    before = written()
    Path(file).write_text(text, encoding="utf-8")
    after = written()
    assert {key for key in after if after[key] != before[key]} == changes


def test_it_changes_with_the_data(here: Path) -> None:
    before, content = written(), write_data(2)
    assert written() == before | {"data": {str(DATA): content}}


@pytest.mark.parametrize("text", [None, "{"])
def test_without_it_the_reader_says_what_to_do(tmp_path: Path, text: str | None) -> None:
    if text:
        (tmp_path / origin.NAME).write_text(text)
    with pytest.raises(console.StageError, match=r"origin\.json is missing or damaged; run `dvc repro`"):
        origin.read(tmp_path / origin.NAME)


def test_what_is_published_says_all_that_its_stage_depends_on() -> None:
    root = Path(__file__).parents[3]
    stages = yaml.safe_load((root / "dvc.yaml").read_text())["stages"]
    made_from = yaml.safe_load((root / "dvc.lock").read_text())["stages"]["figures"]["deps"]
    if {dep["path"] for dep in made_from} != set(stages["figures"]["deps"]):
        pytest.skip("the published results are of earlier code, as dvc.lock says")
    found = [
        json.loads(path.read_text())
        for folder in ("figures", "film")
        for path in (root / "reports" / folder).glob("*.json")
    ]
    assert found
    for made in found:
        stage = stages[made["stage"].partition("@")[0]]
        assert [*made["code"]] == [dep for dep in stage["deps"] if dep.startswith(origin.CODE)]
        assert len(made["data"]) == len(stage["deps"]) - len(made["code"])
        assert [*made["params"]] == stage["params"]
