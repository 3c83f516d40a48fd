"""The rope comes, the rope goes, with Surprise and without: rewards, Q, P(MOVE), and windows of any length."""

from collections.abc import Mapping, Sequence
from itertools import product

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from mimo.record.artifact import Artifact
from mimo.science import analysis, judgement, summary
from stages.drawing.style import COLOURS, DASHES, GROUND, HEADING, INK, WIDTH, inset, note, page
from stages.sweep.curves import phases_of

REWARDS = ("cais", "cais_surprise")
ROWS = (
    ("reward", "Reward\n(scaled)"),
    ("q_move", "Q(MOVE) /\ntemperature"),
    ("q_rest", "Q(NO_TORQUE) /\ntemperature"),
    ("move_probability", "P(MOVE)"),
)
ONSETS = (("attached", "rope comes"), ("extinction", "rope goes"))
AROUND = 200  # steps before and after an onset
SMOOTHED = 10  # steps
WINDOWS = (10, 20, 30, 50, 75, 100, 150, 200)  # steps
ROW, LEFT, RIGHT, GAP = 25.0, 19.0, 1.0, 9.0  # mm


def draw(results: Artifact, conditions: Sequence[str]) -> Figure:
    """Four curves around both onsets; below, the change as the rope goes, over windows of any length."""
    height, column = ROW * len(ROWS) + 79, (WIDTH - LEFT - RIGHT) / (2 * len(conditions))
    figure, ax = page(height)
    phases = phases_of(results)
    seeds = int(results.about["seeds"])
    note(ax, (WIDTH / 2, height - 3), f"Mean over n = {seeds} seeds; moving average over {SMOOTHED} steps")
    for place, (condition, (phase, title)) in enumerate(product(conditions, ONSETS)):
        x = LEFT + place * column
        ax.text(x + (column - GAP) / 2, height - 9, f"{condition.capitalize()}: {title}", ha="center", **HEADING)
        for row, (curve, name) in enumerate(ROWS):
            axes = inset(figure, (x, height - 13 - (row + 1) * ROW + 5), column - GAP, ROW - 5)
            roped = (0.5, AROUND) if phase == "attached" else (-AROUND, 0.5)
            axes.axvspan(*roped, color=GROUND, lw=0, zorder=0)
            axes.set_xlim(-AROUND, AROUND)
            for reward, group in product(REWARDS, analysis.GROUPS):
                _around(axes, results, (condition, reward, f"{curve}/{group}"), phases, phase)
            axes.yaxis.set_major_locator(MaxNLocator(4))
            if row < len(ROWS) - 1:
                axes.tick_params(labelbottom=False)
            if not place:
                note(ax, (5, height - 13 - (row + 0.5) * ROW + 2.5), name, rotation=90)
        note(ax, (x + (column - GAP) / 2, 61), "steps from the onset")
    for place, (condition, curve) in enumerate(product(conditions, ("q_move", "move_probability"))):
        x = LEFT + place * column
        _stretched(inset(figure, (x, 17), column - GAP, 30), results, condition, curve, phases)
        title = "P(MOVE)" if curve == "move_probability" else "Q(MOVE) / temperature"
        note(ax, (x + (column - GAP) / 2, 50), f"{condition}: {title}")
        note(ax, (x + (column - GAP) / 2, 10), "window, steps")
    note(ax, (5, 32), "change as the\nrope goes", rotation=90)
    handles = [
        *(Line2D([], [], color=COLOURS[reward], label=summary.label(reward)) for reward in REWARDS),
        Line2D([], [], color=INK, ls=DASHES["attached"], label="attached limb"),
        Line2D([], [], color=INK, ls=DASHES["others"], label="other limbs"),
        Patch(color=GROUND, label="rope attached"),
    ]
    ax.legend(handles=handles, loc="lower center", ncols=len(handles))
    return figure


def _around(ax: Axes, results: Artifact, which: tuple[str, str, str], phases: Mapping[str, slice], phase: str) -> None:
    """A curve's mean over seeds around the onset of a phase; it breaks there."""
    condition, reward, curve = which
    name, onset = f"{condition}/{reward}/{curve}", phases[phase].start
    if name not in results.datasets:
        return
    mean, _ = summary.mean_sd(summary.smooth(results[name], phases, SMOOTHED))
    for first, last in ((max(0, onset - AROUND), onset), (onset, min(len(mean), onset + AROUND))):
        steps = np.arange(first, last)
        ax.plot(steps - onset + 1, mean[first:last], color=COLOURS[reward], ls=DASHES[curve.split("/")[1]], lw=0.8)


def _stretched(ax: Axes, results: Artifact, condition: str, curve: str, phases: Mapping[str, slice]) -> None:
    """The attached limb's change from a window before extinction to one of it, with its interval, by their length."""
    longest = min(
        phases["attached"].stop - phases["attached"].start, phases["extinction"].stop - phases["attached"].stop
    )
    windows = [width for width in WINDOWS if width <= longest]
    ax.axhline(0, color=INK, lw=0.5)
    for reward in REWARDS:
        name = f"{condition}/{reward}/{curve}/attached"
        if name not in results.datasets or not windows:
            continue
        effects = [summary.onset_change(results[name], phases, width) for width in windows]
        ax.plot(
            windows, [judgement.interquartile_mean(own) for own in effects], color=COLOURS[reward], marker=".", ms=3
        )
        if len(effects[0]) > 1:
            ends = np.array([judgement.interval(judgement.resampled(own), len(own)) for own in effects])
            ax.fill_between(windows, *ends.T, color=COLOURS[reward], alpha=0.2, lw=0)
    ax.yaxis.set_major_locator(MaxNLocator(5))
