"""A map's figure, as SVG: by constant, main effects of each measure, and where each verdict holds."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from mimo.science.measures import Measure
from stages.drawing.studied import DASHES, borders, colour_of, foot, svg
from stages.drawing.style import GROUND, HEADING, INK, SMALL, WIDTH, inset, note, page

NAMES, SHARES = 34.0, 9.0  # mm: left of a verdict's row its name, right of it its share of the space
GAP = 1.6  # mm between columns
TOP, PLOT, BETWEEN, ROW, BOTTOM = (
    11.0,
    22.0,
    7.0,
    4.4,
    13.0,
)  # mm, from the top; BOTTOM has the ends of ranges, and a legend
FILL = "#7a9cc6"


@dataclass(frozen=True)
class Column:
    """A constant: its name in lines, the ends of its range or its few values, and where the published value lies."""

    name: str
    ticks: Sequence[str]
    few: bool
    published: float | None


@dataclass(frozen=True)
class Effect:
    """A cell's main effects: by constant, (place,) evenly over its range, or at each of its few values."""

    label: str
    condition: str
    reward: str
    main: Sequence[Sequence[float]]


@dataclass(frozen=True)
class Verdict:
    """Its share of the space and, by constant, of each stretch of its range, or at each of its few values."""

    label: str
    share: float
    by: Sequence[Sequence[float]]


def mapped(
    name: str,
    says: str,
    columns: Sequence[Column],
    panels: Mapping[str, Measure],
    effects: Mapping[str, Sequence[Effect]],
    verdicts: Sequence[Verdict],
) -> str:
    """A column for each constant; a row for each measure, then one for each verdict.

    Args:
        name: of the study.
        says: what the figure shows, for those who do not see it.
        columns: the constants.
        panels: measures by name.
        effects: of each measure's cells.
        verdicts: in order.
    """
    return svg(name, says, lambda: _mapped(columns, panels, effects, verdicts))


def _mapped(
    columns: Sequence[Column],
    panels: Mapping[str, Measure],
    effects: Mapping[str, Sequence[Effect]],
    verdicts: Sequence[Verdict],
) -> Figure:
    height = TOP + len(panels) * (PLOT + BETWEEN) + len(verdicts) * ROW + BOTTOM
    figure, ax = page(height)
    across = (WIDTH - NAMES - SHARES) / max(1, len(columns))
    lefts = [NAMES + place * across for place in range(len(columns))]
    conditions = list(dict.fromkeys(own.condition for found in effects.values() for own in found))
    for left, column in zip(lefts, columns, strict=True):
        note(ax, (left + (across - GAP) / 2, height - TOP / 2), column.name, fontweight="bold")
    y = height - TOP
    for name, measure in panels.items():
        y -= PLOT
        note(ax, (0, y + PLOT / 2), f"{measure.title}\n{measure.unit}", ha="left")
        _main(figure, y, lefts, across - GAP, columns, measure, effects.get(name, ()), conditions)
        y -= BETWEEN
    for verdict in verdicts:
        y -= ROW
        note(ax, (0, y + ROW / 2), verdict.label, ha="left")
        for left, column, shares in zip(lefts, columns, verdict.by, strict=True):
            _stretch(ax, left, y, across - GAP, shares, column.published)
        note(ax, (WIDTH, y + ROW / 2), f"{100 * verdict.share:.0f} %", ha="right")
    for left, column in zip(lefts, columns, strict=True):
        _ends(ax, left, y - 1.5, across - GAP, column)
    handles = {own.label: _line(own, conditions, label=own.label) for found in effects.values() for own in found}
    foot(ax, list(handles.values()), 4)
    ax.text(0, height - TOP / 2, "Main effects", va="center", **HEADING)
    return figure


def _main(
    figure: Figure,
    y: float,
    lefts: Sequence[float],
    width: float,
    columns: Sequence[Column],
    measure: Measure,
    effects: Sequence[Effect],
    conditions: Sequence[str],
) -> None:
    """One measure's panels, of one height."""
    held = [value for own in effects for values in own.main for value in values]
    low, high = min([0.0, *held]), max([measure.low if np.isfinite(measure.low) else 0.0, 0.0, *held])
    room = 0.05 * ((high - low) or 1.0)
    for place, (left, column) in enumerate(zip(lefts, columns, strict=True)):
        axes = inset(figure, (left, y), width, PLOT)
        axes.set(xlim=(0, 1), ylim=(low - room, high + room), xticks=[])
        axes.tick_params(labelleft=place == 0, length=1.5)
        if column.published is not None:
            axes.axvline(column.published, color=GROUND, lw=3, zorder=0)
        borders(axes, measure, axes.axhline)
        for own in effects:
            if own.main:
                axes.add_line(_line(own, conditions, *_places(own.main[place], column.few)))


def _places(values: Sequence[float], few: bool) -> tuple[list[float], list[float]]:
    """Evenly from end to end or, of a constant with few values, each in the middle of its stretch."""
    ends = (0.5 / len(values), 1 - 0.5 / len(values)) if few else (0.0, 1.0)
    return np.linspace(*ends, len(values)).tolist(), list(values)


def _line(own: Effect, conditions: Sequence[str], x: Any = (), y: Any = (), **more: Any) -> Line2D:
    return Line2D(x, y, color=colour_of(own.reward), ls=DASHES[conditions.index(own.condition) % 3], lw=0.8, **more)


def _stretch(
    ax: Axes, left: float, bottom: float, width: float, shares: Sequence[float], published: float | None
) -> None:
    """Shares of a verdict, from 0 to 1, along a constant's range."""
    tall = ROW - 1.0
    if published is not None:
        ax.plot(
            [left + published * width] * 2, [bottom, bottom + tall], color=GROUND, lw=3, solid_capstyle="butt", zorder=0
        )
    x = left + width * np.repeat(np.linspace(0, 1, len(shares) + 1), 2)[1:-1]
    ax.fill_between(x, bottom, bottom + tall * np.repeat(shares, 2), color=FILL, lw=0)
    ax.plot([left, left + width], [bottom] * 2, color=INK, lw=0.4)


def _ends(ax: Axes, left: float, y: float, width: float, column: Column) -> None:
    """The few values each in its stretch, in two rows so that they do not touch; or both ends."""
    for place, tick in enumerate(column.ticks):
        if column.few:
            at = left + width * (place + 0.5) / len(column.ticks)
            note(ax, (at, y - 2.2 * (place % 2)), tick, fontsize=SMALL - 1)
        else:
            note(ax, (left + width * place, y), tick, ha="right" if place else "left", fontsize=SMALL - 1)
