"""The studies' page: what it says of studies of each kind; test_page.py opens it in a browser."""

import json
import re
import shutil
from pathlib import Path
from typing import Any

import pytest
import yaml

from mimo.science.measures import MEASURES, Found
from mimo.settings.studies import PATH as SETTINGS
from mimo.settings.studies import Studies
from stages import studies
from stages.base import console, paths
from stages.page import compared, constants, studied
from tests.unit.page import fabricated
from tests.unit.page.kinds import ASKED, EFFECTS, computed, effect, written
from tests.unit.page.reading import Page, plain, rows, section

ROOT = Path(__file__).resolve().parents[3]

pytestmark = pytest.mark.usefixtures("few_resamples")


def test_every_study_has_its_section_and_a_line_in_short(html: str) -> None:
    links = [value for tag, name, value in Page(html).attributes if (tag, name) == ("a", "href")]
    own = [f"#study-{name}" for name in ASKED]
    assert links == ["index.html", "#short", *own, "#fair", "#explore", "#constants", *own]
    for name in ASKED:
        words = plain(section(html, f"study-{name}"))
        assert all(text in words for text in (f"Study {name}", "Does it?", "It does.", "Not here.", f"{name}.json"))


def test_each_id_is_unique_and_each_reference_leads_somewhere(html: str) -> None:
    attributes = Page(html).attributes
    ids = [value for _, name, value in attributes if name == "id"]
    assert len(ids) == len(set(ids))
    used = {value for _, name, value in attributes if name in {"href", "xlink:href"} and value and value[0] == "#"}
    used |= {f"#{name}" for name in re.findall(r"url\(#([^)]+)\)", html)}
    assert used <= {f"#{name}" for name in ids}


@pytest.mark.parametrize("there", [[], ["dose"], ["asking", "drawn"]])
def test_what_is_not_computed_is_left_out_and_named(
    there: list[str], asked: Studies, made: dict[str, dict[str, Any]]
) -> None:
    html = written(asked, {name: made[name] for name in there})
    words = plain(html)
    found = re.search(r"Not computed yet, and so not shown: (.*?)\.", words)
    assert found
    assert [name for name in ASKED if f"Study {name}" in found[1]] == [name for name in ASKED if name not in there]
    assert [name for name in ASKED if f'id="study-{name}"' in html] == [name for name in ASKED if name in there]
    assert ("<script" in html) == bool(there)


def test_when_all_is_computed_nothing_is_missing(html: str) -> None:
    assert "Not computed" not in html


def test_a_studys_effects_are_on_the_page_beside_the_published_ones(html: str) -> None:
    effects = [row for row in rows(html, "study-other") if row[0] in {"published", "tied"}]
    assert [row[:2] for row in effects] == [
        ["published", "noisy, MTL"], ["published", "noisy, CAIS"], ["tied", "noisy, MTL"], ["tied", "noisy, CAIS"],
    ]  # fmt: skip
    assert all(re.fullmatch(r"0\.(1|2)\d\d \[0\.\d{3}, 0\.\d{3}\]( change .*)?", row[2]) for row in effects)


def test_a_change_that_is_certain_is_marked_and_no_other(html: str) -> None:
    lost = [row[-1] for row in rows(html, "study-asking") if row[0] == "lost" and "CAIS" in row[1]]
    kept = [row[-1] for row in rows(html, "study-asking") if row[0] == "kept" and "CAIS" in row[1]]
    assert len(lost) == len(kept) == 2
    assert all("change −0." in text for text in lost)
    assert not any("change" in text for text in kept)


def test_tests_that_turn_are_told_and_no_others(html: str) -> None:
    words = plain(section(html, "study-asking"))
    assert (
        "1 of 2 variants turn some test’s verdict. From holds to fails, or back, of each the change that is largest by "
        "its interval’s width: lost, 2 of 2 tests" in words
    )
    assert "No test turns with kept" in words
    assert "holds → fails" in words


@pytest.mark.parametrize(
    ("bounds", "said"),
    [
        ((0.06, 0.2), compared.RISEN),
        ((-0.04, 0.04), compared.FLAT),
        ((0.01, 0.04), compared.FLAT),
        ((-0.2, -0.06), compared.FALLEN),
        ((0.04, 0.06), compared.OPEN),
        (None, compared.OPEN),
    ],
)
def test_a_state_is_where_the_whole_interval_lies(bounds: tuple[float, float] | None, said: str) -> None:
    assert compared.state(Found(0.1, bounds, 5, []), MEASURES["lead"]) == said


def test_up_to_where_and_from_where_an_effect_counts() -> None:
    sure, unsure = Found(0.2, (0.1, 0.3), 5, []), Found(0.2, (0.0, 0.4), 5, [])
    line = compared.Line("noisy", "mtl", {0.0: sure, 5.0: sure, 10.0: unsure, 20.0: sure}, sure)
    assert (line.reaches(0.05), line.above(0.05)) == (5.0, [0.0, 5.0, 20.0])
    assert (line.reaches(0.5), line.above(0.5)) == (None, [])


def test_verdicts_told_are_of_claims_all_of_whose_cells_there_are(
    asked: Studies, made: dict[str, dict[str, Any]]
) -> None:
    own = json.loads(json.dumps(made["asking"]))
    free, noisy = own["variants"]["lost"]["claims"]
    noisy["complete"], free["said"]["verdict"] = False, "holds"
    found = studied.studied(asked.studies, {"asking": own}, fabricated.judged(effect))[0]
    assert found.judged("lost") == {"claim free/cais, as shown": "fails", "claim free/cais, as said": "holds"}
    assert found.judged("lost", tests=True) == {"claim free/cais, as shown: free/cais": "fails"}
    assert set(found.judged("kept").values()) == {"holds"}


def test_along_an_axis_the_trend_spans_it_and_has_the_published_point(html: str) -> None:
    words = plain(section(html, "study-dose"))
    assert "from 0 to 80" in words
    trend = next(row for row in rows(html, "study-dose") if row[0] == "noisy, CAIS")[1]
    assert re.match(r"−0\.(3|4)\d\d \[−0\.\d{3}, −0\.\d{3}\]", trend)


def test_encoders_share_of_the_variance_is_told(html: str) -> None:
    row = next(row for row in rows(html, "study-drawn") if row[0] == "free, CAIS" and len(row) == 7)
    between, seeds, rest, share = (float(text.split()[0]) for text in row[1:5])
    assert between == pytest.approx(0.129, abs=0.03)  # of .2, .3, .4 and .5
    assert max(seeds, rest) < 0.05
    assert share > 0.8
    assert "4 encoders" in plain(section(html, "study-drawn"))


def test_tests_that_turn_with_the_encoder_alone_are_told_there_and_beside_the_constants() -> None:
    asked = fabricated.studies(asking=ASKED["asking"], encoders=ASKED["drawn"])

    def lost(variant: str, cell: str, measure: str) -> float:
        return -0.2 if variant == "draw2" else 0.2

    html = written(asked, {name: fabricated.made(study, lost) for name, study in asked.studies.items()})
    assert "of 1: draw1 0, 0 outright; draw2 1, 1 outright; draw3 0, 0 outright." in plain(html)
    assert "from 0 to 1 of 1 tests turn: what turns no more" in plain(section(html, "study-asking"))


def test_a_share_of_a_variance_that_is_none_is_not_told() -> None:
    """Runs differ by some .02 in the lead; a tenth of what counts of it is .005, of a measure in h / 1000 .1."""
    study = ASKED["drawn"] | {"measures": ["lead", "influence"]}
    asked = fabricated.studies(drawn=study)
    html = written(asked, {"drawn": fabricated.made(asked.studies["drawn"], lambda *_: 0.2)})
    found = [row[4] for row in rows(html, "study-drawn") if row[0] == "free, CAIS" and len(row) == 7]
    assert found[0][0] == "0"
    assert found[1] == "–"


def test_verdicts_of_the_published_runs_are_those_of_the_same_seeds_alone() -> None:
    """Of 20 seeds the first five lead by .2, the others not at all."""
    claim = fabricated.claim("one", "free/cais", [0.2, 0.21, 0.22, 0.23, 0.24] + [0.0, 0.01, 0.02] * 5, 0.05, None)
    claim["said"] = {"tests": claim["shown"]["tests"] * 2}
    for first, word in ((0, "holds"), (5, "fails"), (2, "undecided"), (18, None)):
        asked = fabricated.studies(one={"variants": {"one": {"first": first}}})
        made = fabricated.made(asked.studies["one"], effect)
        made["variants"]["one"]["claims"] = [claim | {"complete": True, "said": claim["shown"]}]
        own = studied.studied(asked.studies, {"one": made}, {"claims": [claim]})[0]
        assert set(own.same_seeds.values()) == ({word} if word else set())


def test_every_study_has_a_figure_with_its_measures(html: str) -> None:
    for name in ASKED:
        part = section(html, f"study-{name}")
        assert part.count("<svg") == 1
        assert "Lead in P(MOVE)" in part.split("<svg")[1].split("</svg>")[0]


def test_one_seed_gives_no_interval_and_a_page_nevertheless() -> None:
    asked = fabricated.studies(**{name: own | {"seeds": 1} for name, own in ASKED.items()})
    html = written(asked, computed(asked))
    assert all(f'id="study-{name}"' in html for name in ASKED)
    assert "nan" not in html.lower()
    assert next(row[2] for row in rows(html, "study-other") if row[0] == "tied").count("[") == 0


def test_effects_that_are_no_numbers_are_dashes(asked: Studies, made: dict[str, dict[str, Any]]) -> None:
    other = json.loads(json.dumps(made["other"]))
    other["variants"]["tied"]["cells"]["noisy/mtl"]["lead"][0] = None
    html = written(asked, {"other": other})
    assert [row[2] for row in rows(html, "study-other") if row[:2] == ["tied", "noisy, MTL"]] == ["–"]


def test_the_explorers_data_are_the_studies(html: str) -> None:
    blocks = re.findall(r'<script type="application/json" class="explored">(.*?)</script>', html, re.DOTALL)
    found = [json.loads(block) for block in blocks]
    assert [one["title"] for one in found] == [f"Study {name}" for name in ASKED if name != "mapped"]
    assert set(found[0]["cells"]) == {f"n{force}/noisy/{reward}" for force in (0, 80) for reward in ("mtl", "cais")}
    assert found[0]["parts"] == ["variant", "condition", "reward"]


def test_the_effects_of_every_world_are_on_the_page(html: str) -> None:
    sizes = "0.80 0.00 0.25 | 0.05"
    assert rows(html, "fair") == [
        ["published", *[sizes] * 4, "3.0", "3.0", "0.14, −0.05"],
        ["heavy world.mobile_mass 0.3", *[sizes] * 4, "3.0", "3.0", "0.20, 0.00"],
    ]
    assert "over 100 agent steps" in plain(html)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, asked: Studies, made: dict[str, dict[str, Any]]) -> Path:
    """A project of settings and reports alone, as working directory."""
    monkeypatch.chdir(tmp_path)
    shutil.copy(ROOT / paths.PARAMS, paths.PARAMS)
    settings = fabricated.written(**ASKED).model_dump(exclude_defaults=True, mode="json")
    reports: dict[Path, Any] = {paths.CLAIMS: fabricated.judged(effect), paths.EFFECTS: EFFECTS}
    reports |= {paths.STUDIES_NUMBERS / f"{name}.json": own for name, own in made.items()}
    reports |= {paths.STUDIES_EXPLORE / f"{name}.json": fabricated.explored(asked.studies[name]) for name in made}
    SETTINGS.parent.mkdir()
    SETTINGS.write_text(yaml.safe_dump(settings, sort_keys=False), encoding="utf-8")
    for path, values in reports.items():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(values), encoding="utf-8")
    return tmp_path


def test_the_stage_writes_the_page_of_what_lies_there_the_same_bytes_again(folder: Path, html: str) -> None:
    studies.main()
    written = paths.STUDIES.read_text(encoding="utf-8")
    assert section(written, "study-dose") == section(html, "study-dose")
    found = {row[0].replace("\u200b", ""): row[1:] for row in rows(written, "constants")}
    assert found["asking.variants.lost"] == ["rewards.gain: 1.0", "ours", "does it lose?"]
    studies.main()
    assert paths.STUDIES.read_text(encoding="utf-8") == written


def test_the_stage_leaves_out_a_study_without_numbers(folder: Path) -> None:
    (paths.STUDIES_NUMBERS / "dose.json").unlink()
    studies.main()
    html = paths.STUDIES.read_text(encoding="utf-8")
    assert "not shown: Study dose." in plain(html)


@pytest.mark.parametrize("path", [paths.CLAIMS, paths.EFFECTS], ids=str)
def test_without_what_it_shows_it_says_what_to_do(path: Path, folder: Path) -> None:
    path.unlink()
    with pytest.raises(console.StageError, match=rf"{path} cannot be read .*; run `dvc repro"):
        studies.main()


def test_damaged_numbers_are_told(folder: Path) -> None:
    (paths.STUDIES_NUMBERS / "dose.json").write_text("{")
    with pytest.raises(console.StageError, match=r"dose\.json cannot be read"):
        studies.main()


def test_constants_are_those_of_the_studies() -> None:
    found = {constant.key: constant for constant in constants.constants((ROOT / SETTINGS).read_text())}
    assert found["studies.noise.variants.n5"].value == "conditions.noisy.force: 5.0"
    assert "studies.noise.title" not in found
