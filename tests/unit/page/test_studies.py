"""The studies' page: all that it should say, as text; test_page.py opens it in a browser."""

import json
from pathlib import Path
from typing import Any

import pytest

from stages import studies
from stages.base import console, numbers, paths
from stages.page import page, verdicts
from tests.unit.page.reading import Page, plain, rows
from tests.unit.reported import EFFECTS, SEEDS


@pytest.fixture
def html(project: Path) -> str:
    return paths.STUDIES.read_text()


@pytest.fixture
def claims(project: Path) -> dict[str, Any]:
    return json.loads(paths.CLAIMS.read_text())


def test_its_sections_are_those_of_the_studies_and_it_has_no_script(html: str):
    links = [value for tag, name, value in Page(html).attributes if (tag, name) == ("a", "href")]
    assert links == ["index.html", "#decides", "#fair", "#constants"]
    assert "<script" not in html
    assert "script-src" not in html


def test_the_effects_of_every_world_are_on_the_page(html: str):
    sizes = "0.80 0.00 0.25 | 0.05"
    assert rows(html, "fair") == [
        ["published", *[sizes] * 4, "3.0", "3.0", "0.14, −0.05"],
        ["heavy world.mobile_mass 0.3", *[sizes] * 4, "3.0", "3.0", "0.20, 0.00"],
    ]
    assert f"over {EFFECTS['steps']} agent steps" in plain(html)


def test_a_variants_verdicts_reach_the_page(html: str, claims: dict[str, Any]):
    text = plain(html)
    assert "gain_1: does it? rewards.gain 1.0 in place of 0.3" in text
    assert "heavy: does mass? world.mobile_mass 0.3 in place of 0.03" in text
    test = claims["claims"][0]["shown"]["tests"][0]
    said = f"{numbers.number(test['effect'], 3)} {verdicts.interval(test['interval'])} {test['verdict']}"
    assert rows(html, "decides")[0][1:] == [said, said, ""]  # here the variants' runs are the published ones
    assert f"gain_1<br>n = {SEEDS}" in html


def test_variants_stand_beside_the_published_runs(claims: dict[str, Any]):
    claim = claims["claims"][0]
    test = claim["shown"]["tests"][0]
    other = test | {"effect": -0.25, "interval": [-0.5, 0.25], "verdict": "fails"}
    own = {"asks": "does it?", "set": {"rewards.gain": 1.0}, "published": {"rewards.gain": 0.3}, "seeds": 5}
    variants = {
        "gain_1": own | {"claims": [claim | {"shown": {"tests": [other]}, "said": {"tests": []}, "besides": []}]},
        "other": own | {"claims": []},
    }
    html = page.studies(claims, variants, EFFECTS, [])
    assert "gain_1: does it? rewards.gain 1.0 in place of 0.3" in plain(html)
    region = "≥ 0.5, SD over steps"
    published = f"{numbers.number(test['effect'], 3)} {verdicts.interval(test['interval'])} {test['verdict']}"
    assert rows(html, "decides") == [[f"{test['says']} {region}", published, "−0.250 [−0.500, 0.250] fails", ""]]


def test_constants_are_those_of_the_studies(html: str):
    found = {row[0].replace("\u200b", ""): row[1:] for row in rows(html, "constants")}
    assert found["variants.gain_1"] == ["rewards.gain: 1.0", "ours", "does it?"]
    assert found["seeds"][0] == str(SEEDS)
    assert "dropped" in found
    assert "All of studies/params.yaml" in plain(html)


def test_the_page_is_the_same_bytes_again(copied: Path):
    before = paths.STUDIES.read_text()
    studies.main()
    assert paths.STUDIES.read_text() == before


@pytest.mark.parametrize("path", [paths.CLAIMS, paths.VARIANT_CLAIMS, paths.EFFECTS], ids=str)
def test_without_what_it_shows_it_says_what_to_do(path: Path, copied: Path):
    path.unlink()
    with pytest.raises(console.StageError, match=rf"{path} cannot be read .*; run `dvc repro"):
        studies.main()
