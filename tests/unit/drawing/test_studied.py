"""A study's figure: what is drawn lies where its number says, and the SVG can stand in a page beside others."""

import re

import pytest

from mimo.science.measures import MEASURES, Found
from stages.drawing import studied

PANELS = {"lead": MEASURES["lead"], "burst": MEASURES["burst"]}
LEGEND = ("own", "published")


def found(effect: float, half: float | None = 0.02) -> Found:
    return Found(effect, None if half is None else (effect - half, effect + half), 5, [effect] * 5)


def rows(*effects: float) -> list[studied.Row]:
    return [
        studied.Row(f"group {number}", "noisy, CAIS", "cais", {"lead": studied.Mark(found(effect), found(0.0))})
        for number, effect in enumerate(effects)
    ]


def intervals(svg: str, colour: str) -> list[tuple[float, ...]]:
    """Ends, and height, of the bars of a colour: (x, x, y), points from the upper left."""
    shown = re.findall(
        rf'<path d="M ([\d.]+) ([\d.]+)\s+L ([\d.]+) [\d.]+\s+"[^>]*stroke: {colour}; stroke-width: 1.2', svg
    )
    return [(float(left), float(right), float(y)) for left, y, right in shown]


def test_a_larger_effect_lies_further_right_and_rows_go_down() -> None:
    svg = studied.in_rows("a", "says", PANELS, rows(0.1, 0.2, -0.1), LEGEND)
    first, second, third = intervals(svg, "#009e73")
    assert third[0] < first[0] < second[0]
    assert first[2] < second[2] < third[2]
    assert (second[0] - first[0]) / (first[1] - first[0]) == pytest.approx(0.1 / 0.04, rel=0.01)


def test_its_words_are_text() -> None:
    svg = studied.in_rows("a", 'says "it" & more', PANELS, rows(0.1), LEGEND)
    for text in ("group 0", "noisy, CAIS", "Lead in P(MOVE)", "Burst of the limb", "own", "published"):
        assert f">{text}<" in svg
    assert 'aria-label="says &quot;it&quot; &amp; more"' in svg


def test_ids_are_the_studys_own_and_the_same_numbers_give_the_same_characters() -> None:
    one, again, other = (studied.in_rows(name, "says", PANELS, rows(0.1), LEGEND) for name in ("a", "a", "b"))
    assert one == again
    assert all(name.startswith("a-") for name in re.findall(r'\bid="([^"]+)"', one))
    assert not set(re.findall(r'\bid="([^"]+)"', one)) & set(re.findall(r'\bid="([^"]+)"', other))
    assert "<style" not in one
    assert "<metadata" not in one


@pytest.mark.parametrize("effect", [found(0.1, None), found(float("nan"), None)])
def test_what_has_no_interval_or_is_no_number_has_no_bar(effect: Found) -> None:
    row = studied.Row("", "label", "cais", {"lead": studied.Mark(effect)})
    assert intervals(studied.in_rows("a", "says", PANELS, [row], LEGEND), "#009e73") == []


def test_along_an_axis_points_stand_in_its_order() -> None:
    curve = studied.Curve("noisy, MTL", "noisy", "mtl", {0.0: found(0.2), 40.0: found(0.1), 80.0: found(0.0)})
    svg = studied.along("a", "says", PANELS, {"lead": [curve]}, "force", 40.0)
    line = re.search(
        r'<path d="M ([\d.]+) ([\d.]+)\s+L ([\d.]+) ([\d.]+)\s+L ([\d.]+) ([\d.]+)\s+"[^>]*stroke: #0072b2', svg
    )
    assert line
    x0, y0, x1, y1, x2, y2 = (float(value) for value in line.groups())
    assert x0 < x1 < x2
    assert y0 < y1 < y2  # downwards, as pixels are counted
    assert x1 - x0 == pytest.approx(x2 - x1, rel=0.01)
    assert ">noisy, MTL<" in svg


def test_an_empty_study_draws_empty_panels() -> None:
    assert "<svg" in studied.along("a", "says", PANELS, {}, "force", 40.0)
    assert "<svg" in studied.in_rows("a", "says", PANELS, [], LEGEND)
