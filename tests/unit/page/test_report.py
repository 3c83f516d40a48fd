"""The paper's page: all that it should say, and from where, as text; test_page.py opens it in a browser."""

import base64
import json
import os
import re
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from markupsafe import Markup

from mimo.science import judgement
from mimo.settings import params
from mimo.world import body
from stages import report
from stages.base import console, paths
from stages.page import captions, page, verdicts
from stages.page.constants import Constant
from stages.page.page import Made
from tests.unit.page.reading import Page, plain, rows
from tests.unit.reported import LENGTHS

ROOT = Path(__file__).parents[3]
VERSIONS = {"mujoco-core": "4", "torch": "2", "numpy": "2"}


@pytest.fixture
def made(project: Path) -> Made:
    return page.gathered(params.load())


@pytest.fixture
def html(project: Path) -> str:
    return paths.REPORT.read_text()


def shown(made: Made, constants: list[Constant] | None = None) -> str:
    """The page of `made`, as stages.report makes it."""
    return page.index(made, params.load().protocol, constants or [], Markup("<p>As we read it.</p>"), VERSIONS)


def test_the_page_holds_every_figure_and_links_to_its_files(made: Made, html: str):
    attributes = Page(html).attributes
    pictures = [value or "" for tag, name, value in attributes if (tag, name) == ("img", "src")]
    held = [base64.b64decode(picture.removeprefix("data:image/svg+xml;base64,")) for picture in pictures]
    drawn = {path.stem for path in paths.FIGURES.glob("*.svg")}
    assert len(drawn) >= 6
    assert held == [(paths.FIGURES / f"{name}.svg").read_bytes() for name in captions.CAPTIONS if name in drawn]
    links = {value for _, name, value in attributes if name == "href"}
    assert {f"figures/{path.name}" for path in paths.FIGURES.glob("*.*g")} <= links
    words = [value or "" for tag, name, value in attributes if (tag, name) == ("img", "alt")]
    assert len(words) == len(drawn)
    assert all(len(word) > 40 for word in words)


def test_the_page_is_the_same_in_a_locale_of_other_letters(copied: Path):
    """Text is UTF-8 whatever the user's locale; Python's own UTF-8 mode would hide it if it were not."""
    before = paths.REPORT.read_bytes()
    paths.REPORT.unlink()
    locale = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "PYTHONPATH": str(ROOT)}
    done = subprocess.run([sys.executable, "-m", "stages.report"], env=os.environ | locale, capture_output=True)
    assert done.returncode == 0, done.stderr
    assert paths.REPORT.read_bytes() == before


@pytest.mark.parametrize("path", [paths.REPORT, paths.STUDIES], ids=str)
def test_a_page_loads_nothing_but_films(path: Path, project: Path):
    html = path.read_text(encoding="utf-8")
    attributes = Page(html).attributes
    links = {value or "" for _, name, value in attributes if name in {"src", "href", "srcset", "data", "poster"}}
    assert {link[1:] for link in links if link.startswith("#")} <= set(re.findall(r'id="([^"]+)"', html))
    beside = {link for link in links if not link.startswith(("data:", "#"))} - {paths.PUBLISHED_ON.name}
    assert all((path.parent / link).is_file() for link in beside)
    assert {tag for tag, name, value in attributes if name == "src" and value in beside} <= {"video"}
    without = html.replace("http://www.w3.org/2000/svg", "")  # a name, not an address
    assert not re.search(r"https?:|url\((?!#)|@import|fetch|XMLHttp", re.sub(r"data:image[^\"]+", "", without))


def test_the_page_says_numbers_and_where_they_are_from(made: Made, html: str):
    text = plain(html)
    assert "0.81 ± 0.09" in text
    assert "2 of 2" in text
    assert text.count(made.metrics["results"]) == 8  # claims, tables, five figures, and the figures' origin
    assert "dvc repro figures" in text
    assert text.count("Line: mean over n = 2 seeds. Shaded: 1 SD over seeds.") == 4
    assert "learn from the last 200 transitions" in text
    assert "an R² of 0.99 (free, x), 0.99 (free, y), 0.99 (free, z), 0.99 (noisy, x)" in text
    assert page.versions(report.LOCK.read_text())["torch"] in text


def test_the_pages_lead_to_each_other(html: str):
    assert ("a", "href", paths.STUDIES.name) in Page(html).attributes
    assert ("a", "href", paths.REPORT.name) in Page(paths.STUDIES.read_text()).attributes


def test_constants_stand_below_their_sections(html: str):
    found = {row[0]: row[1] for row in rows(html, "constants")}
    assert found["attached_steps"] == str(LENGTHS["attached_steps"])
    assert found["seed"] == str(params.load().seed)


def test_every_joint_of_the_paper_is_on_the_page(html: str):
    text = " ".join(re.findall(r'<section id="joints">.*?</section>', html, re.DOTALL))
    limbs = {row[0]: row[1] for row in rows(html, "joints")}
    assert {f"{side}_{name}" for name in limbs for side in ("left", "right")} == set(body.JOINTS[body.FIXED :])
    assert {name for name, torques in limbs.items() if torques != "none"} == {j.split("_")[1] for j in body.ACTUATED}
    assert limbs["knee"] == "−6.5 or +10"
    assert all(name in text for name in body.JOINTS[: body.FIXED])


def test_every_file_behind_the_figures_is_named_with_its_digest(made: Made, html: str):
    origin = made.origins[0]
    found = {row[0]: row[1] for row in rows(html, "origin")}
    assert found["stages/figures.py"] == origin["code"]["stages/figures.py"]
    assert found["data/encoder.h5"] == made.metrics["encoder"]["content"]
    assert found["Code and parameters together"] == origin["digest"]


def test_a_film_is_shown_with_its_poster_and_origin(copied: Path):
    without = shown(page.gathered(params.load()))
    assert "<video" not in without
    assert 'href="#film"' not in without
    paths.FILMS.mkdir()
    for name in ("free.mp4", "free.png"):
        (paths.FILMS / name).touch()
    origin = {"stage": "film@free", "command": "dvc repro film@free", "digest": "d" * 64}
    told = {"code": {}, "params": {"film": {"run": "cais_surprise/seed-003"}}, "data": {"a.h5": "c" * 64}}
    (paths.FILMS / "free.json").write_text(json.dumps(origin | told))
    found = Page(shown(page.gathered(params.load())))
    assert "Free mobile: CAIS + Surprise, seed 3" in found.text
    film = {name: value for tag, name, value in found.attributes if tag == "video"}
    assert (film["src"], film["poster"], film["preload"]) == ("film/free.mp4", "film/free.png", "none")
    assert f"Made by dvc repro film@free Data, content hash a.h5 {'c' * 64}" in " ".join(found.text.split())


def test_the_page_is_the_same_bytes_again(copied: Path):
    before = paths.REPORT.read_text()
    report.main()
    assert paths.REPORT.read_text() == before


def test_without_figures_the_report_says_what_to_do(made: Made, tiny: params.Params, tmp_path: Path):
    with pytest.raises(console.StageError, match="run `dvc repro figures`"):
        captions.figures(made.metrics, tmp_path, tiny)


def test_without_claims_the_report_says_what_to_do(copied: Path):
    paths.CLAIMS.unlink()
    with pytest.raises(console.StageError, match=r"reports/claims\.json cannot be read .*; run `dvc repro`"):
        report.main()


def test_what_a_name_holds_is_escaped(made: Made):
    html = shown(made, [Constant("a", "<script>", "", "& more")])
    assert "&lt;script&gt;" in html
    assert "&amp; more" in html


def test_every_claim_stands_on_the_page_with_its_tests(made: Made, html: str):
    claims = made.claims["claims"]
    assert len(verdicts.primary(claims)) > 70
    expected = [[claim["name"], *(said(claim[group]) for group in judgement.GROUPS)] for claim in claims]
    for claim in claims:
        tests = list(verdicts.tests(claim))
        expected += [[test["says"], "" if group == "besides" else word(test)] for group, test in tests]
        expected += [
            [test["says"], test["margins"]["0.75"], test["verdict"], test["margins"]["1.25"]]
            for group, test in tests
            if group != "besides"
        ]
    found = rows(html, "claims")
    assert [row[: len(wanted)] for row, wanted in zip(found, expected, strict=True)] == expected
    text = plain(html)
    for claim in made.claims["claims"]:
        assert f"{claim['says']} Paper {claim['section']}, {claim['panel']}" in text
    assert html.index('id="claims"') < html.index('id="results"')
    assert '<a href="#fig3">3 C</a>, <a href="#fig4">4 C</a>' in html


def word(judged: Mapping[str, Any]) -> str:
    return judged["verdict"] + (" saturated" if judged["saturated"] else "")


def said(group: dict[str, Any]) -> str:
    return word(group) + (f" Holm: {group['holm']}" if group["holm"] != group["verdict"] else "")


def test_the_page_says_whether_the_verdicts_were_registered(made: Made, html: str):
    assert "These verdicts are exploratory: reports/registered.json cannot be read." in plain(html)
    standing = {"confirmatory": True, "seed": 7, "before": [5], "at": "2026-01-02 03:04 UTC"}
    text = plain(shown(replace(made, claims=made.claims | {"registration": standing})))
    assert "constants and the root seed 7 were registered in git at 2026-01-02 03:04 UTC, before the first" in text
    assert "was made; others have root seeds 5." in text


def test_a_saturated_test_says_so(made: Made):
    claim = made.claims["claims"][0]
    test = claim["shown"]["tests"][0] | {"verdict": "undecided", "saturated": True, "locked": 0.96}
    judged = claim | {"shown": {"verdict": "undecided", "holm": "undecided", "saturated": True, "tests": [test]}}
    found = rows(shown(replace(made, claims=made.claims | {"claims": [judged]})), "claims")
    assert found[0][1] == found[1][1] == "undecided saturated"
    assert next(row for row in found if "96 %" in row[-1])[0] == test["says"]


def test_readings_are_on_the_page_as_a_table(html: str):
    sections = [row[0] for row in rows(html, "readings")]
    assert "§3.3, §4.1" in sections
    assert "<h3>What is not blind</h3>" in html


def test_a_tests_row_says_effect_interval_region_unit_and_seeds(made: Made, html: str):
    claim = next(claim for claim in made.claims["claims"] if claim["name"].startswith("9"))
    test = next(test for test in claim["said"]["tests"] if test["name"] == "free_cais_surprise_p")
    row = next(row for row in rows(html, "claims") if row[0] == test["says"])
    assert row == [test["says"], "holds", "0.562", "[0.500, 0.625]", "≥ 0.05 P(MOVE)", "2", ""]
    assert "<title>0.500, 0.625</title>" in html


def test_without_a_figure_no_claim_points_to_it(made: Made):
    links = [value for _, name, value in Page(shown(replace(made, figures=[]))).attributes if name == "href"]
    assert "#claims" in links
    assert "#fig3" not in links
