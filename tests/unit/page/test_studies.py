"""The studies' page: all that it should say, as text; test_page.py opens it in a browser."""

import json
import re
import shutil
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
import yaml

from mimo.science import components, judgement
from mimo.science.measures import MEASURES, Found
from mimo.settings.params import REWARDS
from mimo.settings.studies import PATH as SETTINGS
from mimo.settings.studies import Studies
from stages import studies
from stages.base import console, paths
from stages.page import compared, constants, page, studied
from tests.unit.page import fabricated
from tests.unit.page.reading import Page, plain, rows

ROOT = Path(__file__).resolve().parents[3]
SHIPPED = list(yaml.safe_load((ROOT / SETTINGS).read_text(encoding="utf-8"))["studies"])
ASKED: dict[str, dict[str, Any]] = {  # one study of each kind
    "dose": {
        "axis": "conditions.noisy.force",
        "measures": ["lead", "burst"],
        "cells": {"noisy": ["mtl", "cais"]},
        "variants": {f"n{force}": {"set": {"conditions.noisy.force": float(force)}} for force in (0, 80)},
    },
    "asking": {
        "cells": {"free": ["cais"], "noisy": ["cais"]},
        "variants": {
            "lost": {"asks": "does it lose?", "set": {"rewards.gain": 1.0}},
            "kept": {"asks": "does it keep?", "set": {"outcomes.memory": 500}},
        },
    },
    "drawn": {"variants": {f"draw{draw}": {"set": {"collect.draw": draw}} for draw in (1, 2, 3)}},
    "mapped": {
        "seeds": 2,
        "cells": {"free": ["mtl"], "noisy": ["cais"]},
        "variants": {
            "p": {
                "set": {},
                "points": 8,
                "over": {
                    "rewards.gain": {"low": 0.1, "high": 1.0, "log": True},
                    "rewards.scale": {"of": ["resting", "running"]},
                },
            }
        },
    },
    "other": {"cells": {"noisy": ["mtl", "cais"]}, "variants": {"tied": {"set": {"protocol.limb": "right_foot"}}}},
}  # fmt: skip
WORLD = {"attached": [0.8, -0.004, 0.25], "others": 0.05}
LATENT = {"attached": [0.03, 0.02, 0.04], "others": 0.01, "ratio": 3.0}
JOINTS = {"mtl": WORLD, "rtl": WORLD, "latent": LATENT}
EFFECTS = {
    "steps": 100,
    "worlds": {
        "published": {"set": {}, "free": JOINTS, "noisy": JOINTS, "phases": {"mtl": 0.14, "rtl": -0.05}},
        "heavy": {
            "set": {"world.mobile_mass": 0.3}, "free": JOINTS, "noisy": JOINTS, "phases": {"mtl": 0.2, "rtl": 0.0},
        },
    },
}  # fmt: skip


def effect(variant: str, cell: str, measure: str) -> float:
    """The lead is .2; without noise .4, at 80 N 0; `lost` loses it; a draw more is .1 more."""
    changed = {"n0": 0.4, "n80": 0.0, "lost": -0.2, "draw1": 0.3, "draw2": 0.4, "draw3": 0.5}
    return changed.get(variant, 0.2)


def computed(asked: Studies) -> dict[str, dict[str, Any]]:
    published = {"conditions.noisy.force": 40.0, "rewards.gain": 0.3}
    return {name: fabricated.made(study, effect, published) for name, study in asked.studies.items()}


@pytest.fixture(scope="module", autouse=True)
def _few_resamples() -> Iterator[None]:
    """Of the bootstrap: what the page says does not hang on an interval's third digit."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(judgement, "RESAMPLES", 1999)
        patch.setattr(components, "DRAWS", 1999)
        yield


@pytest.fixture(scope="module")
def asked() -> Studies:
    return fabricated.studies(**ASKED)


@pytest.fixture(scope="module")
def made(asked: Studies) -> dict[str, dict[str, Any]]:
    return computed(asked)


def written(asked: Studies, made: Mapping[str, dict[str, Any]]) -> str:
    explored = {name: fabricated.explored(asked.studies[name]) for name in made if name != "mapped"}
    return page.studies(asked, page.Beyond(dict(made), explored), fabricated.judged(effect), EFFECTS, [])


@pytest.fixture(scope="module")
def html(asked: Studies, made: dict[str, dict[str, Any]]) -> str:
    return written(asked, made)


def section(html: str, name: str) -> str:
    found = re.search(rf'<section id="{name}">.*?</section>', html, re.DOTALL)
    assert found
    return found[0]


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


@pytest.mark.parametrize("name", SHIPPED)
def test_every_shipped_study_is_answered_by_a_template_of_its_own(name: str) -> None:
    """Whatever its numbers, with one seed as with more."""
    asked = yaml.safe_load((ROOT / SETTINGS).read_text(encoding="utf-8"))["studies"][name]
    for cells in (asked["cells"], *(own.get("cells", {}) for own in asked["variants"].values())):
        for condition, rewards in cells.items():
            cells[condition] = [reward for reward in rewards if reward in REWARDS] or ["cais"]
    for seeds in (1, 3):
        study = fabricated.studies(**{name: asked | {"seeds": seeds}})
        made = {name: fabricated.made(study.studies[name], effect)}
        own = studied.studied(study.studies, made, fabricated.judged(effect))[0]
        assert own.answer == f"answers/{name}.html.j2"
        words = plain(section(written(study, made), f"study-{name}"))
        assert f"n = {seeds}" in words
        assert "nan" not in words.split()


@pytest.mark.parametrize("name", SHIPPED)
@pytest.mark.parametrize("change", [{"measures": ["path"]}, {"seeds": 25}], ids=["measures", "seeds"])
def test_a_shipped_study_that_a_user_changes_has_a_page_too(change: dict[str, Any], name: str) -> None:
    """Its own words where they are still true, else its kind's; nothing of a change from runs that there are not."""
    asked = yaml.safe_load((ROOT / SETTINGS).read_text(encoding="utf-8"))["studies"][name]
    study = fabricated.studies(**{name: asked | change})
    words = plain(section(written(study, {name: fabricated.made(study.studies[name], effect)}), f"study-{name}"))
    assert f"n = {change.get('seeds', asked['seeds'])}" in words
    if "seeds" in change:
        assert not re.search(
            "certainly another than|turns a verdict|turn some|against CAIS|rises by, same seeds", words
        )


def test_a_study_of_other_variants_than_its_words_are_about_has_a_page_too() -> None:
    asked = yaml.safe_load((ROOT / SETTINGS).read_text(encoding="utf-8"))["studies"]
    limbs = asked["limbs"] | {"variants": {"right_foot": asked["limbs"]["variants"]["right_foot"]}}
    own = {"map": {"variants": {"one": {}}}, "against": {}, "limbs": limbs}
    study = fabricated.studies(**own)
    html = written(study, {name: fabricated.made(it, effect) for name, it in study.studies.items()})
    assert [name for name in own if "n = 5" in plain(section(html, f"study-{name}"))] == list(own)


def test_a_force_from_which_the_lead_is_certain_is_told_though_none_below_is() -> None:
    """By noise's own words."""
    study = fabricated.studies(noise=ASKED["dose"])

    def lead(variant: str, cell: str, measure: str) -> float:
        return 0.0 if variant == "n0" and measure == "lead" else 0.2

    words = plain(section(written(study, {"noise": fabricated.made(study.studies["noise"], lead)}), "study-noise"))
    assert re.search(r"with MTL at 1, 80 N, but not below \(at 1 N 0\.\d\d \[", words)


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


def test_what_fresh_seeds_find_stands_beside_what_the_map_foretold() -> None:
    """Of a point in the upper half the map foretells that claim 1 holds, as shown, and fails, as said."""
    html = confirmed(same=True)
    words, found = told(html)
    assert "Verdicts: of 1 foretold to hold, found 1 to hold; of 1 foretold to fail, found 1 to hold." in words
    assert "Tests of which they are made: of 1 foretold to hold, found 1 undecided." in words
    assert re.search(r"Verdicts found to hold: 2 of 2 at p0\d, 2 of 2 at lone, 2 of 2 in the published runs", words)
    assert "of the same seeds; n = 3, fresh." in words
    assert found == [["1 one, as shown", "holds", "–", "–"], ["1 one, as said", "holds foretold fails", "–", "–"]]
    assert rows(html, "study-confirmed")[3] == ["claim noisy/cais, as said", "–", "holds foretold nothing", "holds"]


def test_a_point_of_other_values_was_foretold_nothing() -> None:
    words, found = told(confirmed(same=False))
    assert "foretold to hold" not in words
    assert [row[1] for row in found] == ["holds foretold nothing"] * 2


def confirmed(same: bool) -> str:
    """The page of a study with the first point that a map names, and with a variant that is none of its points.

    Args:
        same: whether the point has the map's values.
    """
    asked = fabricated.studies(map=ASKED["mapped"])
    mapped = computed(asked)
    point = first_of(written(asked, mapped), "study-map")
    there = mapped["map"]["variants"][point]["set"] if same else {"rewards.gain": 0.9}
    own = {point: {"first": 2, "set": there}, "lone": {"first": 2, "cells": {"noisy": ["cais"]}}}
    asked = fabricated.studies(map=ASKED["mapped"], confirmed={"seeds": 3, "variants": own})
    made = computed(asked)
    for claim in made["confirmed"]["variants"][point]["claims"]:
        claim["name"] = "1 one"
        claim["shown"]["tests"][0] |= {"name": "own", "verdict": "undecided"}
    return written(asked, made)


def told(html: str) -> tuple[str, list[list[str]]]:
    """What that says of the confirmed point: in words, and in rows of the table."""
    found = [row for row in rows(html, "study-confirmed") if row[0].startswith("1 one")]
    return plain(section(html, "study-confirmed")), found


def test_along_an_axis_the_trend_spans_it_and_has_the_published_point(html: str) -> None:
    words = plain(section(html, "study-dose"))
    assert "from 0 to 80" in words
    trend = next(row for row in rows(html, "study-dose") if row[0] == "noisy, CAIS")[1]
    assert re.match(r"−0\.(3|4)\d\d \[−0\.\d{3}, −0\.\d{3}\]", trend)


def test_a_map_says_where_each_verdict_holds_and_where_all_do(html: str) -> None:
    words = plain(section(html, "study-mapped"))
    for said in (
        "No place was found where all 2 verdicts hold: at most 1 are foretold to, in 50 % of the space.",
        "Nowhere is none foretold to fail.",
        "In a part of it: 1 one, as shown (50 %).",
        "In nine tenths or more these fail: 1 one, as said (100 %).",
        "2 of 2 tests are foretold at points left out",
        "Of those the largest single share is gain’s in 2.",
        "1 of 2 effects of the published runs lie within two SD of the surface, where 2 would if surfaces knew",
        "hardly ever at one place: 1 one, as shown with 1 one, as said.",
        "Points with most, foretold by the seeds that draw the map: p00 (1 of 2 verdicts, 1 of 2 tests)",
    ):
        assert said.replace("p00", first_of(html)) in words, said


def first_of(html: str, name: str = "study-mapped") -> str:
    return next(row[0] for row in rows(html, name) if re.fullmatch(r"p0\d", row[0]))


def test_a_maps_tables_have_its_verdicts_tests_and_points(html: str) -> None:
    found = [row for row in rows(html, "study-mapped") if row[0].startswith(("1 one", "free, CAIS: lead"))]
    shares, own = "gain 0.60, scale 0.10, gain x scale 0.05", ["free, CAIS: lead"]
    assert found == [
        ["1 one, as shown", "0.50", "0.30", "0.20", "4", "free, CAIS: lead: 0.50, Q² 0.70", shares],
        ["1 one, as said", "0.00", "1.00", "0.00", "0", "free, CAIS: lead: 0.00, Q² 0.70", shares],
        [*own, "1 one, as shown", "≥ 0.05", "P(MOVE)", "0.50", "0.30", "0.70", "0.90", "0.10 ± 0.02, 0.13", shares],
        [*own, "1 one, as said", "≥ 0.05", "P(MOVE)", "0.00", "1.00", "0.70", "0.90", "0.10 ± 0.02, 0.15", shares],
    ]  # fmt: skip
    points = [row for row in rows(html, "study-mapped") if re.fullmatch(r"p0\d", row[0])]
    assert [row[1] for row in points] == ["1"] * 4 + ["0"] * 4
    assert all((float(row[3]) > 0.316) == (row[1] == "1") for row in points)
    assert {row[4] for row in points} == {"resting", "running"}


def test_a_surface_that_foretells_nothing_tells_no_constant(asked: Studies, made: dict[str, dict[str, Any]]) -> None:
    own = json.loads(json.dumps(made["mapped"]))
    for test in own["space"]["tests"]:
        test["q2"] = 0.2
    words = plain(section(written(asked, {"mapped": own}), "study-mapped"))
    assert "0 of 2 tests are foretold at points left out" in words
    assert "gain 0.60" not in words
    assert "largest single share is" not in words


def test_a_maps_figure_has_a_column_for_each_constant_and_a_row_for_each_verdict(html: str) -> None:
    drawn = section(html, "study-mapped").split("<svg")[1].split("</svg>")[0]
    for text in ("gain", "scale", "0.1", "1", "resting", "running", "1 as shown", "50 %", "0 %", "free, MTL"):
        assert f">{text}<" in drawn, text


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
