"""The paper's figure 2: what each reward is computed from and how, in one agent step that did happen."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mimo.science import summary
from mimo.settings import params
from mimo.world import body
from mimo.world.protocol import MOVE
from stages.drawing.example import Example
from stages.drawing.style import (
    COLOURS,
    GROUND,
    INK,
    OTHER_COLOUR,
    SMALL,
    arrow,
    box,
    heading,
    inset,
    note,
    page,
    picture,
)

ROW = 38.0  # mm
ROWS = {  # from top to bottom: title, formula
    "mtl": ("Mobile trajectory length", r"$\sum\,\Vert c_k - c_{k-1} \Vert$"),
    "rtl": ("Representation trajectory length", r"$\Vert h_t - h_{t-1} \Vert$"),
    "cais": ("Causal action influence score", r"$W_1(\,p(h|a),\; p(h)\,)$"),
    "surprise": ("Surprise", r"$\Vert h_t - E[h|a] \Vert$"),
}
LEFT, MIDDLE = (12.0, 32.0), (75.0, 42.0)  # columns of plots: left edge and width, mm


def rewards(p: params.Params, shown: Example) -> Figure:
    """Figure 2: MTL, RTL, CAIS and Surprise of one step, and how Surprise joins the others.

    CAIS and Surprise are shown for the joint that CAIS paid most.

    Args:
        p: for the timing and the attached limb.
        shown: the step.
    """
    figure, ax = page(ROW * len(ROWS))
    joint = int(shown.rewards["cais"].argmax())
    lows = {name: ROW * (len(ROWS) - 1 - row) for row, name in enumerate(ROWS)}
    for name, (title, _) in ROWS.items():
        heading(ax, (1, lows[name] + ROW - 1), "", title)
    _mtl(figure, lows["mtl"], p, shown)
    _rtl(figure, ax, lows["rtl"], shown)
    _cais(figure, lows["cais"], p, shown, joint)
    _surprise(figure, lows["surprise"], shown, joint)
    _sums(ax, lows, shown, joint)
    return figure


def _plot(figure: Figure, column: tuple[float, float], low: float) -> Axes:
    return inset(figure, (column[0], low + 8), column[1], 22)


def _mtl(figure: Figure, low: float, p: params.Params, shown: Example) -> None:
    colour, protocol = COLOURS["mtl"], p.protocol
    way = 1000 * (shown.path - shown.path[0])
    ax = _plot(figure, LEFT, low)
    ax.plot(way[:, 0], way[:, 1], color=colour, lw=0.7)
    ax.plot(*way[0, :2], "o", mfc="white", mec=colour, ms=3.5)
    ax.plot(*way[-1, :2], "o", color=colour, ms=3.5)
    ax.set_aspect("equal", adjustable="datalim")
    ax.set(xlabel="towards the feet (mm)", ylabel="to the left (mm)")
    ax = _plot(figure, MIDDLE, low)
    length = np.append(0, np.linalg.norm(np.diff(way, axis=0), axis=1).cumsum())
    time = 1000 * protocol.timestep * np.arange(len(length))
    ax.axvspan(0, time[protocol.torque_updates], color=GROUND, lw=0)
    ax.text(time[protocol.torque_updates] / 2, 0.9, "torque", transform=ax.get_xaxis_transform(), ha="center")
    ax.plot(time, length, color=colour)
    ax.plot(time[-1], length[-1], "o", color=colour, ms=3.5, clip_on=False)
    ax.set(xlim=(0, time[-1]), ylim=(0, None), xlabel="time in the step (ms)", ylabel="travelled (mm)")


def _rtl(figure: Figure, page: Axes, low: float, shown: Example) -> None:
    for x, frame, symbol in zip((4, 28), shown.frames, ("$h_{t-1}$", "$h_t$"), strict=True):
        picture(inset(figure, (x, low + 11), 20, 20), frame)
        note(page, (x + 10, low + 8.5), f"encoder → {symbol}")
    before, after = (h[0] for h in (shown.transition.latent_before, shown.transition.latent))
    _dimensions(_plot(figure, MIDDLE, low), COLOURS["rtl"], before, after, "$h_{t-1}$ to $h_t$")


def _cais(figure: Figure, low: float, p: params.Params, shown: Example, joint: int) -> None:
    colour, given = COLOURS["cais"], shown.conditional[joint, MOVE]
    dimension = int(np.abs(given - shown.marginal).mean(axis=1).argmax())
    ax = _plot(figure, LEFT, low)
    ax.plot(shown.marginal[dimension], shown.levels, color=INK, ls="--", label="$p(h)$")
    ax.plot(given[dimension], shown.levels, color=colour, label="$p(h|$MOVE$)$")
    ax.fill_betweenx(shown.levels, shown.marginal[dimension], given[dimension], color=colour, alpha=0.25, lw=0)
    _levels(ax, dimension)
    assert shown.transition.influence is not None
    influence = shown.transition.influence[0, :, MOVE]
    ax = _plot(figure, MIDDLE, low)
    for group, (limb, joints) in enumerate(body.LIMB_JOINTS.items()):
        values = [influence[body.ACTUATED.index(name)] for name in joints]
        places = group * (len(joints) + 1) + np.arange(len(joints))
        ax.bar(places, values, color=colour if limb == p.protocol.limb else "white", edgecolor=colour, lw=0.8)
        ax.text(places.mean(), -0.06, limb.replace("_", "\n"), transform=ax.get_xaxis_transform(), ha="center",
                va="top", fontsize=SMALL)  # fmt: skip
    ax.set(xticks=[], ylabel="$W_1$ of MOVE")


def _surprise(figure: Figure, low: float, shown: Example, joint: int) -> None:
    colour, action = COLOURS["surprise"], int(shown.transition.action[0, joint])
    assert shown.transition.expectation is not None
    expected, found = shown.transition.expectation[0, joint], shown.transition.latent[0]
    dimension = int(np.abs(found - expected).argmax())
    ax = _plot(figure, LEFT, low)
    ax.plot(shown.conditional[joint, action, dimension], shown.levels, color=COLOURS["cais"], label="$p(h|a)$")
    ax.axvline(expected[dimension], color=OTHER_COLOUR, ls="--", label="$E[h|a]$")
    ax.axvline(found[dimension], color=colour, label="$h_t$")
    _levels(ax, dimension)
    _dimensions(_plot(figure, MIDDLE, low), colour, expected, found, "$E[h|a]$ to $h_t$")


def _levels(ax: Axes, dimension: int) -> None:
    ax.set(ylim=(0, 1), yticks=(0, 0.5, 1), xlabel=f"$h$, dimension {dimension + 1}", ylabel="level $\\tau$")
    ax.legend(loc="center left", bbox_to_anchor=(0.98, 0.5), handlelength=1, borderaxespad=0, handletextpad=0.4)


def _dimensions(ax: Axes, colour: str, before: np.ndarray, after: np.ndarray, what: str) -> None:
    """Two latents (latent,): in each dimension a line from the first to a dot at the second."""
    places = np.arange(1, len(before) + 1)
    ax.vlines(places, before, after, color=colour, lw=1)
    ax.plot(places, after, "o", color=colour, ms=1.5)
    ax.set(xlim=(0, len(before) + 1), xlabel="dimension of $h$", ylabel=what)


def _sums(ax: Axes, lows: Mapping[str, float], shown: Example, joint: int) -> None:
    """What the step gives, and how Surprise joins the other rewards."""
    x, line, beside = 138.0, 153.0, 167.0
    for name, (_, formula) in ROWS.items():
        y, value = lows[name] + 14, shown.rewards[name][joint]
        number = f"{1000 * value:.0f} mm, for all joints" if name == "mtl" else f"{value:.3g}, for all joints"
        if name in {"cais", "surprise"}:
            number = f"{value:.3g}, for {body.ACTUATED[joint]}"
        ax.text(x, y + 12, f"{formula}\n= {number}", ha="center", va="center", linespacing=1.6)
        box(ax, (x, y), (22, 8), summary.label(name), edge=COLOURS[name])
        if name != "surprise":
            both = f"{name}_surprise"
            box(ax, (beside, y), (22, 8), summary.label(both).replace(" + ", "\n+ "), edge=COLOURS[both])
            arrow(ax, (x + 11, y + 1.5), (beside - 11, y + 1.5))
            arrow(ax, (line, y - 1.5), (beside - 11, y - 1.5))
    start, end = lows["surprise"] + 14, lows["mtl"] + 12.5
    ax.plot((x + 11, line, line), (start, start, end), color=INK, lw=0.8)
