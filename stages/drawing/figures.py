"""Each figure of the report as SVG, PDF and PNG: the paper's 1 to 5, and ours."""

import io
import re
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from mimo.record import artifact
from mimo.science import analysis, summary
from mimo.settings import params
from mimo.vision import collect, encoder, extractor
from mimo.world import scene
from stages.drawing import burst, example, schematics, taxonomy
from stages.drawing.style import (
    COLOURS,
    DASHES,
    GROUND,
    HEADING,
    INK,
    OTHER_COLOUR,
    SMALL,
    STYLE,
    WIDTH,
    Place,
    heading,
    inset,
    note,
    page,
    picture,
)
from stages.sweep.curves import phases_of

PANELS = (  # title, axis, curve, groups of joints, rewards: the captions of the paper's figures 3 and 4
    ("A", "MTL, RTL and Surprise", "reward", ("all",), ("mtl", "rtl", "surprise")),
    ("B", "MTL and RTL combined with Surprise", "reward", ("all",), ("mtl_surprise", "rtl_surprise")),
    ("C", "CAIS and CAIS + Surprise", "reward", analysis.GROUPS, ("cais", "cais_surprise")),
    (
        "D",
        "Q(MOVE), combined with Surprise",
        "q_move",
        analysis.GROUPS,
        ("mtl_surprise", "rtl_surprise", "cais_surprise"),
    ),
)
AXES = {
    "reward": "Reward as paid (scaled units)",
    "q_move": "Q(MOVE) / temperature",
    "move_probability": "P(MOVE)",
    "influence": "Influence of MOVE: W1 (h)",
}
BEHAVIOUR, APART = ("q_move", "move_probability"), 0.25  # curves, and share of locked joints, with a line for each seed
METADATA: dict[str, Any] = {  # by kind of file: without date or version, so that the same data give the same bytes
    "svg": {"Date": None, "Creator": None},
    "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
    "png": {"Software": None},
}
PAPER = {"fig3": ("free", "Free mobile"), "fig4": ("noisy", "Noisy mobile")}


def plan(
    p: params.Params, results: artifact.Artifact, held: artifact.Artifact, frames: np.ndarray
) -> dict[str, Callable[[], Figure]]:
    """What draws each figure, by its name; a condition without runs has none.

    Args:
        p: all of params.yaml.
        results: the curves.
        held: the encoder.
        frames: (regime, world, step, 2, 128, 128, 3) uint8, as mimo.vision.collect gives them.
    """
    built, roped = scene.build(p.world, p.protocol), collect.REGIMES.index(("free", True))
    own: dict[str, Callable[[], Figure]] = {
        "fig1": lambda: schematics.setting(p, built, frames[roped, 0, 0, 0]),
        "fig2": lambda: taxonomy.rewards(p, example.take(p, held, frames, built)),
        "fig5": lambda: schematics.network(p),
        "burst": partial(burst.draw, results, _conditions(results)),
        "p_move": partial(_multiples, results, "move_probability"),
        "encoder": partial(_encoder, held),
        "reconstructions": partial(_reconstructions, p, held, frames),
    }
    if any("/influence/" in name for name in results.datasets):
        own["influence"] = partial(_multiples, results, "influence")
    conditions = _conditions(results)
    return own | {
        name: partial(_paper_figure, results, condition, title)
        for name, (condition, title) in PAPER.items()
        if condition in conditions
    }


def files(draw: Callable[[], Figure]) -> dict[str, bytes]:
    """A figure's files by kind, as in METADATA, whatever the user's own matplotlibrc says."""
    found = {}
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(STYLE)
        figure = draw()
        for kind, metadata in METADATA.items():
            buffer = io.BytesIO()
            figure.savefig(buffer, format=kind, metadata=metadata)
            found[kind] = buffer.getvalue()
    # A hundredth of a point is finer than any screen, and a file smaller by a quarter.
    found["svg"] = re.sub(rb' d="[^"]+"', lambda path: re.sub(rb"(\.\d\d)\d+", rb"\1", path[0]), found["svg"])
    return found


def _conditions(results: artifact.Artifact) -> list[str]:
    """Those that have runs, the paper's order."""
    found = {name.split("/")[0] for name in results.datasets}
    return [condition for condition, _ in PAPER.values() if condition in found]


def _rewards(results: artifact.Artifact, curve: str) -> list[str]:
    """Those that have runs with this curve, the paper's first, in its order."""
    found = {name.split("/")[1] for name in results.datasets if f"/{curve}/" in name}
    order = ("mtl", "rtl", "surprise", "cais", "mtl_surprise", "rtl_surprise", "cais_surprise")
    return [reward for reward in order if reward in found] + sorted(found - set(order))


def _paper_figure(results: artifact.Artifact, condition: str, title: str) -> Figure:
    """Four panels as in the paper's captions; in each, a strip for each reward, since their sizes differ."""
    figure, ax = page(156.0)
    note(ax, (WIDTH / 2, 153), f"{title}: {_legend_text(results)}")
    tops = {"A": (0, 149), "B": (91, 149), "C": (0, 78), "D": (91, 78)}
    for letter, text, curve, groups, rewards in PANELS:
        x, top = tops[letter]
        heading(ax, (x + 1, top), letter, text)
        strips = _stack(figure, (x + 14, top - 10), 71, 51, len(rewards))
        for strip, reward in zip(strips, rewards, strict=True):
            _strip(strip, results, (condition, reward, curve), groups)
            strip.text(0, 1.03, summary.label(reward), transform=strip.transAxes)
        _name_phases(strips[0], phases_of(results), 11.5)
        note(ax, (x + 3, top - 35), AXES[curve], rotation=90)
        note(ax, (x + 14 + 71 / 2, top - 67.5), "agent step")
    _legend(ax, "attached limb (A, B: all joints)")
    return figure


def _multiples(results: artifact.Artifact, curve: str) -> Figure:
    """One curve, attached limb against the others: rewards down, conditions across."""
    conditions, rewards = _conditions(results), _rewards(results, curve)
    height, width = 21.0 * len(rewards), (WIDTH - 12) / len(conditions)
    figure, ax = page(height + 29)
    note(ax, (WIDTH / 2, height + 26), f"{AXES[curve]}: {_legend_text(results)}")
    grid = [
        _stack(figure, (18 + width * column, height + 15), width - 11, height, len(rewards))
        for column in range(len(conditions))
    ]
    for condition, strips in zip(conditions, grid, strict=True):
        for strip, first, reward in zip(strips, grid[0], rewards, strict=True):
            if strip is not first:
                strip.sharey(first)
                strip.tick_params(labelleft=False)
            _strip(strip, results, (condition, reward, curve), analysis.GROUPS)
            if curve == "move_probability":
                strip.set_ylim(0, 1)
        _name_phases(strips[0], phases_of(results), 3)
        middle = float(strips[0].get_position().intervalx.mean()) * WIDTH
        ax.text(middle, height + 20, f"{condition.capitalize()} mobile", ha="center", **HEADING)
        note(ax, (middle, 8.5), "agent step")
    for strip, reward in zip(grid[0], rewards, strict=True):
        middle = float(strip.get_position().intervaly.mean()) * (height + 29)
        note(ax, (5, middle), summary.label(reward).replace(" + ", "\n+ "), rotation=90)
    _legend(ax, "attached limb")
    return figure


def _stack(figure: Figure, corner: Place, width: float, height: float, count: int) -> list[Axes]:
    """Axes one below the other from an upper left corner on a page, a line of text apart, in mm.

    They share the horizontal axis, which is numbered on the last.
    """
    (x, top), gap = corner, 5.0
    each = (height - gap * (count - 1)) / count
    axes = [inset(figure, (x, top - each - row * (each + gap)), width, each) for row in range(count)]
    for ax in axes[:-1]:
        ax.sharex(axes[-1])
        ax.tick_params(labelbottom=False)
    return axes


def _strip(ax: Axes, results: artifact.Artifact, which: tuple[str, str, str], groups: Sequence[str]) -> None:
    """Mean over seeds with a band of 1 SD, for each group of joints; a line breaks at a phase's border.

    Where a mean hides joints that always move and others that always rest, each seed of the first group is a thin line.
    """
    phases = phases_of(results)
    roped = phases["attached"]
    ax.axvspan(roped.start + 0.5, roped.stop + 0.5, color=GROUND, lw=0, zorder=0)
    ax.set_xlim(0.5, phases["extinction"].stop + 0.5)
    ax.yaxis.set_major_locator(MaxNLocator(4))
    condition, reward, curve = which
    colour = COLOURS.get(reward, OTHER_COLOUR)
    if f"{condition}/{reward}/{curve}/{groups[0]}" not in results.datasets:
        ax.tick_params(left=False, labelleft=False)
        ax.text(0.5, 0.5, "not in this sweep", transform=ax.transAxes, ha="center", va="center", color=OTHER_COLOUR)
        return
    width = summary.window(phases)
    own = results[f"{condition}/{reward}/{curve}/{groups[0]}"]
    if curve in BEHAVIOUR and _locked(results, f"{condition}/{reward}/locked", phases) >= APART:
        for line in summary.smooth(own, phases, width):
            for phase in phases.values():
                shown = np.arange(phase.start, phase.stop, width)
                ax.plot(shown + 1, line[shown], color=colour, lw=0.3, alpha=0.6)
    for group in groups:
        smooth = summary.smooth(results[f"{condition}/{reward}/{curve}/{group}"], phases, width)
        mean, sd = summary.mean_sd(smooth)
        for phase in phases.values():
            # A third of the window apart nothing is lost, and the files stay small.
            shown = np.unique(np.append(np.arange(phase.start, phase.stop, max(1, width // 3)), phase.stop - 1))
            x, m, s = shown + 1, mean[shown], np.nan_to_num(sd[shown])
            ax.fill_between(x, m - s, m + s, color=colour, alpha=0.2, lw=0)
            ax.plot(x, m, color=colour, ls=DASHES[group])


def _locked(results: artifact.Artifact, name: str, phases: Mapping[str, slice]) -> float:
    """Share of locked joints late in the phase in which it is greatest."""
    windows = analysis.windows(phases)
    late = [windows[window] for window in ("baseline_late", "acquisition_late", "extinction_late")]
    return max(float(results[name][:, window].mean()) for window in late)


def _name_phases(ax: Axes, phases: Mapping[str, slice], above: float) -> None:
    """The phases' names, small, so many points above a strip."""
    for name, phase in phases.items():
        place = (phase.start + phase.stop) / 2, 1
        ax.annotate(name, place, (0, above), ("data", "axes fraction"), "offset points", ha="center", fontsize=SMALL)


def _legend_text(results: artifact.Artifact) -> str:
    seeds, width = int(results.about["seeds"]), summary.window(phases_of(results))
    many = "n = 1 seed" if seeds == 1 else f"n = {seeds} seeds; line: mean, shaded: ±1 SD over seeds"
    return many if width == 1 else f"{many}; moving average over {width} steps"


def _legend(ax: Axes, attached: str) -> None:
    """At the foot of a page, what its lines and shades mean."""
    handles = [
        Line2D([], [], color=INK, ls=DASHES["attached"], label=attached),
        Line2D([], [], color=INK, ls=DASHES["others"], label="other limbs"),
        Patch(color=GROUND, label="rope attached"),
    ]
    ax.legend(handles=handles, loc="lower center", ncols=len(handles))


def _encoder(held: artifact.Artifact) -> Figure:
    """Both losses over the training, and what the held-out frames gave."""
    figure, page_ax = page(62.0)
    note(page_ax, (WIDTH / 2, 59), "Visual encoder: loss of each training batch, and of held-out frames")
    for x, name, title in ((16, "reconstruction", "Reconstruction"), (106, "cltt", "CLTT")):
        heading(page_ax, (x, 55), "", title)
        ax = inset(figure, (x, 11), 68, 38)
        curve = held.datasets[f"curves/{name}"]
        ax.plot(np.arange(1, len(curve.values) + 1), curve.values, color=INK, label="training")
        if f"measures/{name}" in held.datasets:
            value = float(held[f"measures/{name}"])
            ax.axhline(value, color=OTHER_COLOUR, ls="--", label="held out, at the end")
        if name == "reconstruction":
            ax.set_yscale("log")
        ax.set(xlabel="iteration", ylabel=f"loss ({curve.units})")
        ax.legend()
    return figure


def _reconstructions(p: params.Params, held: artifact.Artifact, frames: np.ndarray) -> Figure:
    """A frame of each regime that the encoder was not trained on, what it makes of it, and what it makes of h alone."""
    net = encoder.frozen(p.encoder, extractor.load(held).weights)
    chosen = frames[:, 0, round(frames.shape[2] * (1 - p.collect.held_out)), 0]
    pictures = {
        "input": chosen,
        "reconstruction": encoder.reconstruct(net, chosen),
        "from h alone": encoder.reconstruct(net, chosen, skips=False),
    }
    side, height = 42.0, 136.0
    figure, ax = page(height)
    for row, (name, images) in enumerate(pictures.items()):
        low = height - 6 - (row + 1) * (side + 1)
        note(ax, (3, low + side / 2), name, rotation=90)
        for column, image in enumerate(images):
            picture(inset(figure, (7 + column * (side + 1), low), side, side), image)
    for column, (condition, attached) in enumerate(collect.REGIMES):
        note(ax, (7 + column * (side + 1) + side / 2, height - 3), f"{condition}, rope {'on' if attached else 'off'}")
    return figure
