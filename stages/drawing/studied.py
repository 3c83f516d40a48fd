"""A study's figure, as SVG to stand in its page: a panel for each measure, effects in rows or along an axis.

Text stays text, ids begin with the study's name, and the same numbers give the same characters.
"""

import io
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from mimo.science.measures import Found, Measure
from stages.drawing.style import COLOURS, GROUND, HEADING, INK, OTHER_COLOUR, SMALL, STYLE, WIDTH, inset, note, page

ROW, GROUP = 3.3, 1.4  # mm: of a row, and more where a group begins
TOP, BOTTOM = 8.0, 13.0  # mm: titles, and ticks with units and a legend
NAMES, LABELS, GAP = 27.0, 29.0, 3.0  # mm: a group's name, a row's label, and what lies between panels
PLOT, LEFT = 46.0, 13.0  # mm: height of a panel along an axis, and its ticks
DASHES = ("-", (0, (3, 1.5)), ":")  # by condition
MARKERS = ("o", "s", "^")


@dataclass(frozen=True)
class Mark:
    """In a panel's row: an effect with its interval, the published one beside it, and dots for what it is made of."""

    own: Found
    published: Found | None = None
    dots: Sequence[float] = ()


@dataclass(frozen=True)
class Row:
    """A label, the reward whose colour it has, and by measure what is drawn; rows of one group stand together."""

    group: str
    label: str
    reward: str
    marks: Mapping[str, Mark]


@dataclass(frozen=True)
class Curve:
    """Effects by the axis' value, of a condition and reward; `label` is of both."""

    label: str
    condition: str
    reward: str
    points: Mapping[float, Found]


def in_rows(name: str, says: str, panels: Mapping[str, Measure], rows: Sequence[Row], legend: Sequence[str]) -> str:
    """Rows from the top; lines at 0 and where an effect begins to count.

    Args:
        name: of the study.
        says: what the figure shows, for those who do not see it.
        panels: measures by name, from left to right.
        rows: in order.
        legend: what own and published marks, and dots if there are any, are called.
    """
    return svg(name, says, lambda: _in_rows(panels, rows, legend))


def along(
    name: str,
    says: str,
    panels: Mapping[str, Measure],
    curves: Mapping[str, Sequence[Curve]],
    axis: str,
    standard: float,
) -> str:
    """Curves by measure over one axis, whose published value, `standard`, is marked; else as in `in_rows`."""
    return svg(name, says, lambda: _along(panels, curves, axis, standard))


def _in_rows(panels: Mapping[str, Measure], rows: Sequence[Row], legend: Sequence[str]) -> Figure:
    places, y = [], 0.0
    for before, row in zip((None, *rows), rows, strict=False):
        y += GROUP if before is not None and before.group != row.group else 0
        places.append(y)
        y += ROW
    height = TOP + y + BOTTOM
    figure, ax = page(height)
    for before, row, place in zip((None, *rows), rows, places, strict=False):
        middle = height - TOP - place - ROW / 2
        if row.group and (before is None or before.group != row.group):
            note(ax, (0, middle), row.group, ha="left", fontweight="bold")
        note(ax, (NAMES + LABELS - 1, middle), row.label, ha="right")
    across = (WIDTH - NAMES - LABELS) / max(1, len(panels))
    for number, (name, measure) in enumerate(panels.items()):
        left = NAMES + LABELS + number * across
        axes = inset(figure, (left, BOTTOM), across - GAP, y)
        axes.set(ylim=(max(y, ROW), 0), yticks=[])
        axes.spines["left"].set_visible(False)
        axes.xaxis.set_major_locator(MaxNLocator(4))
        borders(axes, measure, axes.axvline)
        for row, place in zip(rows, places, strict=True):
            if name in row.marks:
                _marked(axes, row.marks[name], place + ROW / 2, colour_of(row.reward))
        ax.text(left, height - 3, measure.title, va="center", **HEADING)
        note(ax, (left + (across - GAP) / 2, BOTTOM - 6.5), measure.unit)
    handles = [
        Line2D([], [], color=INK, marker="o", ms=3, label=legend[0]),
        Line2D([], [], color=OTHER_COLOUR, marker="D", ms=2.5, mfc="white", lw=0.6, label=legend[1]),
        Line2D([], [], color=INK, marker=".", ms=3, lw=0, alpha=0.5, label=legend[-1]),
    ]
    foot(ax, handles[: len(legend)])
    return figure


def _marked(ax: Axes, mark: Mark, y: float, colour: str) -> None:
    """The published mark is thin and just below; effects that are no numbers have none."""
    if mark.dots:
        ax.plot(mark.dots, [y - 1.2] * len(mark.dots), ".", color=colour, ms=2.5, alpha=0.6, mew=0)
    for found, at, look in (
        (
            mark.published,
            y + 0.8,
            {"color": OTHER_COLOUR, "marker": "D", "ms": 2, "mfc": "white", "mew": 0.5, "lw": 0.6},
        ),
        (mark.own, y - 0.5, {"color": colour, "marker": "o", "ms": 3, "mew": 0, "lw": 1.2}),
    ):
        if found is not None and np.isfinite(found.effect):
            ax.plot(found.interval or (), (at, at) if found.interval else (), color=look["color"], lw=look["lw"])
            ax.plot([found.effect], [at], **{**look, "lw": 0})  # type: ignore[arg-type]


def _along(panels: Mapping[str, Measure], curves: Mapping[str, Sequence[Curve]], axis: str, standard: float) -> Figure:
    height = TOP + PLOT + BOTTOM + 4
    figure, ax = page(height)
    across = WIDTH / max(1, len(panels))
    conditions = list(dict.fromkeys(curve.condition for own in curves.values() for curve in own))
    handles: dict[str, Line2D] = {}
    for number, (name, measure) in enumerate(panels.items()):
        left = LEFT + number * across
        axes = inset(figure, (left, BOTTOM + 4), across - LEFT - GAP, PLOT)
        axes.axvline(standard, color=GROUND, lw=4, zorder=0)
        axes.yaxis.set_major_locator(MaxNLocator(5))
        borders(axes, measure, axes.axhline)
        held = curves.get(name, ())
        width = max((np.ptp(list(curve.points)) for curve in held), default=1.0) or 1.0
        for place, curve in enumerate(held):
            look = conditions.index(curve.condition)
            values = np.array(list(curve.points)) + (place - (len(held) - 1) / 2) * 0.008 * width  # side by side
            colour, found = colour_of(curve.reward), list(curve.points.values())
            for x, own in zip(values, found, strict=True):
                if own.interval:
                    axes.plot((x, x), own.interval, color=colour, lw=0.8, alpha=0.7)
            axes.plot(
                values,
                [own.effect for own in found],
                color=colour,
                ls=DASHES[look % 3],
                marker=MARKERS[look % 3],
                ms=2.5,
            )
            handles.setdefault(
                curve.label,
                Line2D([], [], color=colour, ls=DASHES[look % 3], marker=MARKERS[look % 3], ms=2.5, label=curve.label),
            )
        ax.text(left, height - 3, measure.title, va="center", **HEADING)
        note(ax, (left + (across - LEFT - GAP) / 2, BOTTOM - 2.5), axis)
        note(ax, (left - LEFT + 2, BOTTOM + 4 + PLOT / 2), measure.unit, rotation=90)
    foot(ax, list(handles.values()))
    return figure


def borders(ax: Axes, measure: Measure, line: object) -> None:
    """Zero, and the ends of the region where an effect counts."""
    assert callable(line)
    line(0, color=INK, lw=0.5, zorder=0)
    for end in (measure.low, measure.high):
        if np.isfinite(end) and end:
            line(end, color=INK, lw=0.5, ls=(0, (1, 2)), zorder=0)


def foot(ax: Axes, handles: list[Line2D], columns: int = 6) -> None:
    """At the foot of the page."""
    ax.legend(
        handles=handles, loc="lower center", ncols=min(columns, max(1, len(handles))), fontsize=SMALL, borderpad=0
    )


def colour_of(reward: str) -> str:
    """The reward's."""
    return COLOURS.get(reward, OTHER_COLOUR)


def svg(name: str, says: str, draw: object) -> str:
    """The element alone, whatever the user's own matplotlibrc says; it is as wide as there is room."""
    assert callable(draw)
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(STYLE | {"svg.fonttype": "none", "svg.hashsalt": name})
        buffer = io.StringIO()
        draw().savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>\s*", "", text, flags=re.DOTALL)
    text = re.sub(r"<!--.*?-->\s*|<style[^>]*>.*?</style>", "", text, flags=re.DOTALL)
    text = re.sub(r'\bid="', f'id="{name}-', text)
    text = re.sub(r'(url\(#|href="#)', rf"\1{name}-", text)
    text = re.sub(r' d="[^"]+"', lambda path: re.sub(r"(\.\d\d)\d+", r"\1", path[0]), text)
    text = re.sub(r' xmlns(:\w+)?="[^"]*"| (width|height)="[^"]*pt"| version="[^"]*"', "", text, count=0)
    label = says.replace("&", "&amp;").replace('"', "&quot;").replace("<", "&lt;")
    return text.replace("<svg", f'<svg role="img" aria-label="{label}"', 1).replace("xlink:href", "href")
