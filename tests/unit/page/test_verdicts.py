"""Claims and tests as the page words and draws them."""

import pytest

from stages.page import verdicts

TEST = {"seeds": [0.1, 0.3], "effect": 0.2, "interval": [0.1, 0.3], "region": [0.05, None]}


@pytest.mark.parametrize(
    ("ends", "text"),
    [
        ([0.05, None], "≥ 0.05"),
        ([None, -0.5], "≤ −0.5"),
        ([-0.2, 0.2], "within ±0.2"),
        ([0.0, None], "≥ 0"),
        ([-0.1, 0.3], "−0.1 to 0.3"),
        ([0.0, 0.0], "no difference"),
    ],
)
def test_regions_in_words(ends: list[float | None], text: str) -> None:
    assert verdicts.region(ends) == text


def test_intervals_in_words() -> None:
    assert verdicts.interval([-0.5, 0.1234]) == "[−0.500, 0.123]"
    assert verdicts.interval(None) == "–"
    assert verdicts.interval([None, None]) == "–"


@pytest.mark.parametrize(
    ("text", "pieces"),
    [
        ("fig. 3 A", [("fig. ", ""), ("3 A", "fig3")]),
        ("figs. 3 C, 4 C", [("figs. ", ""), ("3 C", "fig3"), (", ", ""), ("4 C", "fig4")]),
        ("fig. 4 A, D", [("fig. ", ""), ("4 A, D", "fig4")]),
    ],
)
def test_panels_name_their_figures(text: str, pieces: list[tuple[str, str]]) -> None:
    assert verdicts.panels(text) == pieces


def test_a_strip_keeps_order_and_stays_inside() -> None:
    line = verdicts.strip(TEST)
    assert line is not None
    assert line.interval is not None
    assert 0 < line.zero < line.region[0] < line.seeds[0] < line.effect < line.seeds[1] < line.region[1]
    assert line.region[1] == verdicts.WIDTH
    assert line.interval == tuple(line.seeds)
    assert line.seeds[1] == verdicts.WIDTH - verdicts.MARGIN


def test_a_strip_of_one_seed_or_of_none() -> None:
    one = verdicts.strip(TEST | {"seeds": [0.2], "interval": None})
    assert one is not None
    assert (one.interval, len(one.seeds)) == (None, 1)
    unsure = verdicts.strip(TEST | {"seeds": [0.2, None, 0.2, 0.2], "interval": [None, None]})
    assert unsure is not None
    assert (unsure.interval, len(unsure.seeds)) == (None, 3)
    assert verdicts.strip(TEST | {"seeds": [None, None], "effect": None}) is None
