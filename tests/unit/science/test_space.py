"""A map of a space whose claims hold where we put them."""

from collections.abc import Mapping

import numpy as np
import pytest
from scipy.stats import qmc

from mimo.science import judgement, space
from mimo.science.judgement import Cell, Claim, Curves, Measure
from mimo.science.space import Space

CELL, OTHER = ("noisy", "cais"), ("free", "mtl")
WINDOWS = {"baseline_late": slice(0, 2), "acquisition_late": slice(2, 4)}
RNG = np.random.default_rng(4)


def level(name: str, cell: Cell = CELL) -> Measure:
    """A curve's mean, in each seed."""
    return lambda curves, windows: np.asarray(curves[cell][name].mean(axis=1))


def claim(name: str, low: float, high: float, measure: str, cell: Cell = CELL, absent: bool = False) -> Claim:
    shown = judgement.Test(name, f"{name} says", (cell,), "unit", low, high, level(measure, cell), absent)
    return Claim(name, "§1", "…", "fig. 3 A", shown=(shown,), said=(shown,))


def cell(values: Mapping[str, float]) -> dict[str, np.ndarray]:
    """Curves (seed, step) at levels, with a little noise of two seeds."""
    return {
        name: np.full((2, 4), value) + (0.0 if name == "locked" else 0.02) * RNG.normal(size=(2, 1))
        for name, value in values.items()
    }


@pytest.fixture(scope="module")
def asked() -> Space:
    at = qmc.Sobol(3, rng=np.random.default_rng(0)).random_base2(6)
    at[:, 2] = np.where(at[:, 2] < 0.5, 0.25, 0.75)
    return Space(at, {2: (0.25, 0.75)}, np.array([0.9, 0.5, 0.75]))


@pytest.fixture(scope="module")
def found(asked: Space) -> dict:
    """`slope` is the first constant, `step` 1 where the third is high; joints are locked where the second is high."""
    curves: list[Curves] = [
        {
            CELL: cell(
                {"slope": x, "step": float(z > 0.5), "none": 0.0, "locked": y, "move_probability/attached": 0.0,
                 "move_probability/others": 0.0}
            ),
            OTHER: cell({"slope": 0.0, "locked": 0.0}),
        }
        for x, y, z in asked.points
    ]  # fmt: skip
    claims = [
        claim("slope", 0.75, np.inf, "slope"),
        claim("step", 0.5, np.inf, "step"),
        claim("no step", -np.inf, 0.5, "step"),
        claim("absent", -np.inf, 2.0, "slope", absent=True),
        claim("never", 5.0, np.inf, "slope"),
        claim("point", 0.0, 0.0, "none"),
        claim("lacking", 0.0, 1.0, "slope", ("free", "rtl")),
    ]
    published: Curves = {CELL: {name: np.full((20, 4), 0.9) for name in ("slope", "step", "none")}}
    return space.mapped(curves, published, WINDOWS, asked, claims, ["locked"])


def shares(found: dict, word: str) -> dict[str, float]:
    return {own["claim"]: own[word] for own in found["verdicts"] if own["group"] == "shown"}


def test_a_verdict_holds_in_the_share_of_the_space_where_its_tests_do(found: dict) -> None:
    """Less what five seeds, with an SD of .02, would leave open on either side of the border."""
    holds, fails = shares(found, "holds"), shares(found, "fails")
    assert holds.keys() == {"slope", "step", "no step", "absent", "never", "point"}
    assert holds["slope"] == pytest.approx(0.225, abs=0.02)
    assert fails["slope"] == pytest.approx(0.725, abs=0.02)
    assert [holds["step"], fails["step"]] == pytest.approx([0.5, 0.5], abs=0.02)
    assert (holds["never"], fails["never"]) == (0, 1)
    assert holds["point"] > 0.95  # five seeds could not tell it from 0


def test_where_joints_are_locked_what_does_not_happen_is_undecided(found: dict, asked: Space) -> None:
    (verdict, *_) = [own for own in found["verdicts"] if own["claim"] == "absent"]
    assert verdict["holds"] == pytest.approx(0.5, abs=0.03)
    assert verdict["fails"] == 0
    clear = np.abs(asked.points[:, 1] - 0.5) > 0.05
    expected = np.where(asked.points[:, 1] < 0.5, "holds", "undecided")
    assert (np.array(verdict["points"]) == expected)[clear].all()


def test_by_constant_it_says_where(found: dict) -> None:
    by = {own["claim"]: own["by"] for own in found["verdicts"] if own["group"] == "shown"}
    assert by["slope"][0] == pytest.approx([0, 0, 0, 0, 0, 0, 0.8, 1], abs=0.2)
    assert by["slope"][1] == pytest.approx([0.225] * 8, abs=0.06)
    assert by["step"][2] == pytest.approx([0, 1], abs=0.02)


def test_verdicts_that_hold_and_fail_together_are_counted(found: dict) -> None:
    """Of six claims, each twice, `never` fails everywhere; `slope`, `step`, `absent` and `point` hold at most."""
    for counts in found["together"].values():
        assert len(counts) == 13
        assert sum(counts) == pytest.approx(1)
    assert max(number for number, share in enumerate(found["together"]["holds"]) if share) == 8
    assert min(number for number, share in enumerate(found["together"]["fails"]) if share) == 4
    pairs = {frozenset(name.split(",")[0] for name in pair) for pair in found["apart"]}
    assert pairs == {frozenset({"step", "no step"})}


def test_points_are_ordered_by_the_verdicts_foretold(found: dict, asked: Space) -> None:
    met = np.sum([np.array(own["points"]) == "holds" for own in found["verdicts"]], axis=0)
    assert (np.diff(met[found["order"]]) <= 0).all()
    assert sorted(found["order"]) == list(range(64))
    assert asked.points[found["order"][0], 0] > 0.7


def test_each_test_has_its_effects_in_every_seed_and_its_surface(found: dict, asked: Space) -> None:
    own = next(test for test in found["tests"] if (test["claim"], test["group"]) == ("slope", "said"))
    assert np.array(own["seeds"]).mean(axis=1) == pytest.approx(asked.points[:, 0], abs=0.06)
    assert own["q2"] > 0.9
    assert own["shares"][0] > 0.9
    assert own["region"] == [0.75, None]
    assert len(own["pairs"]) == 3
    assert own["noise"] == pytest.approx(0.02, rel=0.3)


def test_the_published_effect_stands_beside_the_surface_there(found: dict) -> None:
    beside = {test["claim"]: test["published"] for test in found["tests"] if test["group"] == "shown"}
    surface, unknown, effect = beside["slope"]
    assert surface == pytest.approx(0.9, abs=0.03)
    assert 0 < unknown < 0.03
    assert effect == pytest.approx(0.9)
    assert beside["step"][0] == pytest.approx(1, abs=0.05)


def test_effects_far_beyond_a_border_do_not_bend_the_surface(asked: Space) -> None:
    """One point a thousand times as far: the border stays where it was, nearly."""

    def share(far: float) -> float:
        curves: list[Curves] = [
            {CELL: cell({"slope": far if place == 5 else x, "locked": 0.0})}
            for place, (x, _, _) in enumerate(asked.points)
        ]
        published: Curves = {CELL: {"slope": np.full((20, 4), far)}}
        made = space.mapped(curves, published, WINDOWS, asked, [claim("slope", 0.5, np.inf, "slope")], [])
        assert made["tests"][0]["published"][2] == pytest.approx(min(far, 2.5))  # four times the border beyond it
        return float(made["verdicts"][0]["holds"])

    assert share(1000.0) == pytest.approx(share(asked.points[5, 0]), abs=0.15)


def test_a_point_whose_effect_is_no_number_is_undecided(asked: Space) -> None:
    curves: list[Curves] = [
        {CELL: cell({"slope": np.nan if place == 5 else x, "locked": 0.0})}
        for place, (x, _, _) in enumerate(asked.points)
    ]
    made = space.mapped(curves, {}, WINDOWS, asked, [claim("slope", -5.0, np.inf, "slope")], [])
    (verdict, _) = made["verdicts"]
    assert [place for place, word in enumerate(verdict["points"]) if word != "holds"] == [5]


def test_without_a_surface_all_is_undecided(asked: Space) -> None:
    few = Space(asked.points[:7], asked.choices, None)
    curves: list[Curves] = [{CELL: cell({"slope": 1.0, "locked": 0.0})} for _ in range(7)]
    made = space.mapped(curves, {}, WINDOWS, few, [claim("slope", 0.5, np.inf, "slope")], [])
    assert [(own["holds"], own["fails"]) for own in made["verdicts"]] == [(0, 0)] * 2
    assert made["tests"][0]["q2"] is None


def test_measures_have_main_effects_in_every_cell(found: dict) -> None:
    locked = found["measures"]["locked"]
    assert locked.keys() == {"noisy/cais", "free/mtl"}
    assert locked["noisy/cais"]["main"][1] == pytest.approx(space.ALONG, abs=0.1)
    assert locked["noisy/cais"]["main"][2] == pytest.approx([0.5, 0.5], abs=0.1)
