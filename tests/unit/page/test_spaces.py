"""The studies' page: what it says of a map, and of the study that confirms its points."""

import json
import re
from typing import Any

import pytest

from mimo.settings.studies import Studies
from tests.unit.page import fabricated
from tests.unit.page.kinds import ASKED, computed, written
from tests.unit.page.reading import plain, rows, section

pytestmark = pytest.mark.usefixtures("few_resamples")


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
