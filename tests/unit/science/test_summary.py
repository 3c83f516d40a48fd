"""Figures' lines and tables' numbers, worked by hand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mimo.science import analysis, summary

LENGTHS = (200, 500, 100)  # five minutes of the rope
WINDOWS = analysis.windows(analysis.phases(*LENGTHS))


def moved(baseline: float, *minutes: float) -> np.ndarray:
    """(1, step): these shares of each minute's steps with movement; none in extinction."""
    return (
        np.concatenate([np.arange(100) < round(100 * rate) for rate in (baseline, baseline, *minutes, 0)])[None] * 1.0
    )


def met(baseline: float, *minutes: float) -> bool:
    windows = analysis.windows(analysis.phases(200, 100 * len(minutes), 100))
    return bool(summary.learned(moved(baseline, *minutes), windows)[0])


def test_names_as_the_paper_writes_them():
    assert [summary.label(name) for name in ("cais", "rtl_surprise", "novelty", "kl_rnd", "progress")] == [
        "CAIS",
        "RTL + Surprise",
        "Novelty",
        "CAIS by Gaussian KL + RND",
        "Learning progress",
    ]


def test_figures_smooth_over_a_hundredth_of_the_run():
    assert summary.window(analysis.phases(500, 1500, 500)) == 25
    assert summary.window(analysis.phases(3, 4, 3)) == 1


def test_smoothing_does_not_cross_a_phase_border():
    phases = analysis.phases(5, 2, 1)
    values = np.array([[0.0, 1, 2, 3, 4, 10, 20, 7]])
    assert summary.smooth(values, phases, 3).tolist() == [[0.5, 1, 2, 3, 3.5, 15, 15, 7]]
    assert summary.smooth(values, phases, 1).tolist() == values.tolist()


@given(st.integers(1, 30), st.integers(1, 12), st.integers(0, 99))
def test_smoothing_is_the_mean_of_the_steps_around(steps: int, width: int, seed: int):
    values = np.random.default_rng(seed).normal(size=(2, 3 * steps))
    phases = analysis.phases(steps, steps, steps)
    found = summary.smooth(values, phases, width)
    for phase in phases.values():
        for step in range(phase.start, phase.stop):
            around = slice(max(phase.start, step - (width - 1) // 2), min(phase.stop, step + width // 2 + 1))
            np.testing.assert_allclose(found[:, step], values[:, around].mean(axis=1), atol=1e-12)


def test_blocks_do_not_cross_a_phase_border():
    steps, means = summary.blocks(np.array([[1.0, 2, 3, 4, 6, 9]]), analysis.phases(3, 2, 1), 2)
    assert steps.tolist() == [1.5, 3, 4.5, 6]
    assert means.tolist() == [[1.5, 3, 5, 9]]


def test_mean_and_sd_are_over_seeds():
    mean, sd = summary.mean_sd(np.array([[1.0, 5], [3, 5]]))
    assert mean.tolist() == [2, 5]
    assert sd.tolist() == pytest.approx([2**0.5, 0])
    assert np.isnan(summary.mean_sd(np.ones((1, 2)))[1]).all()


def test_onset_change_is_from_the_ropes_last_steps_to_as_many_of_extinctions_first():
    values = np.array([[9.0, 9, 1, 3, 4, 8, 9], [9, 9, 5, 5, 5, 3, 9]])
    phases = analysis.phases(1, 3, 3)
    assert summary.onset_change(values, phases, 1).tolist() == [1, 0]
    assert summary.onset_change(values, phases, 2).tolist() == [4, -1]


def test_a_tie_does_not_make_a_limb_the_most_active():
    p = {"left_foot": np.array([0.5, 0.5, 0.2]), "left_hand": np.array([0.4, 0.5, 0.3])}
    assert summary.most_active(p, "left_foot").tolist() == [True, False, False]
    assert summary.most_active(p, "left_hand").tolist() == [False, False, True]


@pytest.mark.parametrize(
    ("minutes", "expected"),
    [
        ((0.4, 0.4, 0.4, 0.4, 0.4), False),
        ((0.4, 0.8, 0.8, 0.4, 0.4), True),  # two that follow one another
        ((0.8, 0.4, 0.8, 0.4, 0.4), True),  # two of three
        ((0.4, 0.4, 0.4, 0.8, 0.8), True),  # the last
        ((0.8, 0.4, 0.4, 0.8, 0.4), False),  # two of four
        ((0.4, 0.8, 0.4, 0.4, 0.4), False),  # one
        ((0.75, 0.4, 0.75, 0.4, 0.4), True),  # one and a half times the baseline exactly
        ((0.74, 0.4, 0.75, 0.4, 0.4), False),
    ],
)
def test_learned_is_one_and_a_half_times_the_baseline_in_two_of_three_minutes(
    minutes: tuple[float, ...], expected: bool
):
    assert met(0.5, *minutes) == expected


def test_a_limb_that_never_moves_has_not_learned():
    assert not met(0, 0, 0, 0)
    assert met(0, 0.01, 0.01, 0)


def test_exactly_one_and_a_half_times_is_enough_whatever_floats_make_of_it():
    assert met(0.2, 0.3, 0.3, 0.1)


def test_learned_needs_three_minutes_of_the_rope():
    assert met(0.5, 1, 1, 1)
    assert not met(0.5, 1, 1)


def test_learned_passes_over_a_last_minute_cut_short():
    windows = analysis.windows(analysis.phases(200, 350, 100))
    found = moved(0.5, 0.4, 0.4, 0.8, 1)  # of the fourth minute there is half
    assert not summary.learned(np.concatenate([found[:, :550], found[:, -100:]], axis=1), windows)[0]


def test_learned_reads_neither_extinction_nor_another_seed():
    found = np.concatenate([moved(0.5, 0.4, 0.4, 0.4, 0.4, 0.8), moved(0.5, 0.8, 0.8, 0.4, 0.4, 0.4)])
    found[0, -100:] = 1
    assert summary.learned(found, WINDOWS).tolist() == [False, True]


def test_a_cells_numbers():
    windows = analysis.windows(analysis.phases(2, 4, 2))
    attached = np.array([[0.2, 0.4, 0.5, 0.5, 0.8, 0.8, 0.6, 0.1], [0.3, 0.3, 0.5, 0.5, 0.6, 0.6, 0.6, 0.1]])
    others = np.full((2, 8), 0.3)
    groups = {"attached": attached, "others": others}
    stacked = {f"{curve}/{g}": v for curve in ("move_probability", "reward") for g, v in groups.items()}
    stacked |= {"limb/left_foot": attached, "limb/right_foot": np.full((2, 8), 0.7)}
    stacked |= {"moved/left_foot": attached, "moved/right_foot": others, "locked": attached}
    found = summary.cell(stacked, windows, "left_foot")
    late = found["move_probability"]["acquisition_late"]
    assert late["attached"] == pytest.approx({"mean": 0.7, "sd": 0.02**0.5})
    assert late["others"] == pytest.approx({"mean": 0.3, "sd": 0.0}, abs=1e-9)
    assert late["difference"]["mean"] == pytest.approx(0.4)
    assert found["rise"] == pytest.approx({"mean": 0.4, "sd": 0.02**0.5})  # 0.5 - 0.0 and 0.3 - 0.0
    assert found["reward"]["extinction_early"]["attached"]["mean"] == pytest.approx(0.6)
    assert found["reward"]["extinction_late"]["attached"]["mean"] == pytest.approx(0.1)
    assert found["locked"] == pytest.approx(
        {"baseline": 0.3, "acquisition_early": 0.5, "acquisition_late": 0.7, "extinction_early": 0.6,
         "extinction_late": 0.1}
    )  # fmt: skip
    assert (found["most_active"], found["seeds"]) == (1, 2)
    assert "influence" not in found


def test_a_cells_learners_are_counted_limb_by_limb():
    still = moved(0.5, 0.5, 0.5, 0.5, 0.5, 0.5)
    learner = moved(0.5, 0.9, 0.9, 0.5, 0.5, 0.5)
    shares = {
        "left_foot": np.concatenate([learner, learner, learner, still]),
        "right_foot": np.concatenate([learner, still, still, still]),
        "left_hand": np.concatenate([still] * 4),
    }
    flat = np.full((4, sum(LENGTHS)), 0.5)
    stacked = {f"{curve}/{group}": flat for curve in ("move_probability", "reward") for group in analysis.GROUPS}
    stacked |= {f"limb/{limb}": flat for limb in shares} | {f"moved/{limb}": of for limb, of in shares.items()}
    found = summary.cell(stacked | {"locked": flat}, WINDOWS, "left_foot")
    assert found["learned"] == {"attached": 0.75, "others": 0.125}


def test_one_seed_has_no_sd():
    flat = np.full((1, sum(LENGTHS)), 0.5)
    names = ("limb/left_foot", "moved/left_foot", "limb/left_hand", "moved/left_hand", "locked")
    stacked = {f"{curve}/{group}": flat for curve in ("move_probability", "reward") for group in analysis.GROUPS}
    assert summary.cell(stacked | dict.fromkeys(names, flat), WINDOWS, "left_foot")["rise"] == {"mean": 0, "sd": None}
