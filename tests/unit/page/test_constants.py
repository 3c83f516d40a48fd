"""The pages' tables of constants, and numbers as people write them."""

from pathlib import Path

import numpy as np
import pytest

from mimo.settings import studies
from stages.base import numbers, paths
from stages.page import constants, page

ROOT = Path(__file__).resolve().parents[3]


def test_constants_with_their_comments():
    lines = (
        "seed: 3 # ours: any",
        "a:",
        "  b: [1, 2] # m. paper §2.1; ours: more",
        "  c: '#no'",
        "  d:",
        "  - x",
        "  - y",
        "e: 1.0 # paper appendix",
        "studies:",
        "  s:",
        "    title: A title",
        "    seeds: 5 # ours: few",
        "    variants:",
        "      f: {asks: 'why?', set: {a.b: [1, 2], e: 2.0}, cells: {free: [mtl]}}",
        "      g: {set: {}, yoked: cais}",
    )
    assert constants.constants("\n".join(lines)) == [
        constants.Constant("seed", "3", "ours", "ours: any"),
        constants.Constant("a.b", "1, 2", "paper and ours", "m. paper §2.1; ours: more"),
        constants.Constant("a.c", "#no", "", ""),
        constants.Constant("a.d", "x, y", "", ""),
        constants.Constant("e", "1.0", "paper", "paper appendix"),
        constants.Constant("studies.s.seeds", "5", "ours", "ours: few"),
        constants.Constant("studies.s.variants.f", "a.b: 1, 2, e: 2.0", "ours", "why?"),
        constants.Constant("studies.s.variants.g", "yoked: cais", "ours", ""),
    ]


@pytest.mark.parametrize("file", [paths.PARAMS, studies.PATH], ids=str)
def test_every_constant_says_its_source(file: Path):
    found = constants.constants((ROOT / file).read_text())
    assert len(found) > 12
    assert [constant.key for constant in found if not constant.source] == []


def test_numbers_as_people_write_them():
    assert numbers.number(-0.001) == "0.00"
    assert numbers.number(-0.26) == "−0.26"
    assert numbers.number(None) == "–"
    assert page.spread({"mean": 0.5, "sd": None}) == "0.50"
    assert numbers.rounded({"a": [1, 0.12345678], "b": -0.0, "c": np.float64("nan"), "d": float("-inf")}) == {
        "a": [1, 0.123457], "b": 0.0, "c": None, "d": None,
    }  # fmt: skip
