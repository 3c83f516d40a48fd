"""`python -m stages.figures`: reports/figures/*.svg and *.png, from the results, the encoder and its frames."""

import io
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import partial

import matplotlib as mpl
import numpy as np
import torch
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from mimo import analysis, artifact, collect, encoder, params
from stages import console, paths, store
from stages.results import phases_of
from stages.style import COLOURS, DASHES, OTHER_COLOUR, SHADES, STYLE

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
    "q_move": "Q(MOVE) (scaled units)",
    "move_probability": "P(MOVE)",
    "influence": "Influence of MOVE: W1 (h)",
}
PAPER = {"fig3": ("free", "Free mobile"), "fig4": ("noisy", "Noisy mobile")}


def main() -> None:
    """Draw every figure."""
    p = params.load()
    results, held = artifact.read(paths.RESULTS, store.RESULTS), artifact.read(paths.ENCODER, encoder.SCHEMA)
    frames = artifact.read(paths.FRAMES, store.FRAME)["frames"]
    for name, figure in drawn(p, results, held, frames):
        for kind, data in figure.items():
            artifact.publish(data, paths.FIGURES / f"{name}.{kind}")


def drawn(
    p: params.Params, results: artifact.Artifact, held: artifact.Artifact, frames: np.ndarray
) -> list[tuple[str, dict[str, bytes]]]:
    """Every figure's name and its files' bytes by kind, svg and png; a condition without runs has no figure.

    Args:
        p: for the encoder's shape, and which frames it was not trained on.
        results: the curves.
        held: the encoder.
        frames: (regime, world, step, 2, 128, 128, 3) uint8, as mimo.collect gives them.
    """
    conditions = _conditions(results)
    todo: list[tuple[str, Callable[[], Figure]]] = [
        (name, partial(_paper_figure, results, condition, title))
        for name, (condition, title) in PAPER.items()
        if condition in conditions
    ]
    todo += [
        ("p_move", partial(_multiples, results, "move_probability")),
        ("encoder", partial(_encoder, held)),
        ("reconstructions", partial(_reconstructions, p, held, frames)),
    ]
    if any("/influence/" in name for name in results.datasets):
        todo.append(("influence", partial(_multiples, results, "influence")))
    with mpl.rc_context():
        mpl.rcdefaults()  # whatever the user's own matplotlibrc says
        mpl.rcParams.update(STYLE)
        return [(name, _files(draw())) for name, draw in todo]


def _files(figure: Figure) -> dict[str, bytes]:
    """Without date or version, so that the same data give the same bytes."""
    FigureCanvasAgg(figure)
    files = {}
    for kind, metadata in (("svg", {"Date": None, "Creator": None}), ("png", {"Software": None})):
        buffer = io.BytesIO()
        figure.savefig(buffer, format=kind, metadata=metadata)
        files[kind] = buffer.getvalue()
    # A hundredth of a point is finer than any screen, and a file smaller by a quarter.
    files["svg"] = re.sub(rb' d="[^"]+"', lambda path: re.sub(rb"(\.\d\d)\d+", rb"\1", path[0]), files["svg"])
    return files


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
    figure = Figure(figsize=(10, 8), layout="constrained")
    figure.suptitle(f"{title}: {_legend_text(results)}", fontsize=10)
    top, bottom = figure.subfigures(2, 1, height_ratios=(1, 1.12), squeeze=False)[:, 0]
    grid = [part for row in (top, bottom) for part in row.subfigures(1, 2, squeeze=False)[0]]
    for part, (letter, text, curve, groups, rewards) in zip(grid, PANELS, strict=True):
        part.suptitle(f"{letter}   {text}", x=0.02, ha="left", fontsize=10, fontweight="bold")
        part.supylabel(AXES[curve], fontsize=9)
        strips = part.subplots(len(rewards), 1, sharex=True, squeeze=False)[:, 0]
        for ax, reward in zip(strips, rewards, strict=True):
            _strip(ax, results, (condition, reward, curve), groups)
            ax.set_title(analysis.label(reward), loc="left", pad=3)
        _name_phases(strips[0], phases_of(results))
        strips[-1].set_xlabel("agent step")
    _legend(bottom)
    return figure


def _multiples(results: artifact.Artifact, curve: str) -> Figure:
    """One curve, attached limb against the others: rewards down, conditions across."""
    conditions, rewards = _conditions(results), _rewards(results, curve)
    figure = Figure(figsize=(8, 1.25 * len(rewards) + 1.2), layout="constrained")
    figure.suptitle(f"{AXES[curve]}: {_legend_text(results)}", fontsize=10)
    grid = figure.subplots(len(rewards), len(conditions), sharex=True, sharey="row", squeeze=False)
    for row, reward in zip(grid, rewards, strict=True):
        for ax, condition in zip(row, conditions, strict=True):
            _strip(ax, results, (condition, reward, curve), analysis.GROUPS)
            if curve == "move_probability":
                ax.set_ylim(0, 1)
            ax.set_title(analysis.label(reward), loc="left", pad=3)
    for ax, condition in zip(grid[0], conditions, strict=True):
        _name_phases(ax, phases_of(results))
        ax.annotate(
            f"{condition.capitalize()} mobile", (0.5, 1), (0, 27), "axes fraction", "offset points", ha="center",
            fontweight="bold",
        )  # fmt: skip
    for ax in grid[-1]:
        ax.set_xlabel("agent step")
    figure.supylabel(AXES[curve], fontsize=9)
    _legend(figure)
    return figure


def _strip(ax: Axes, results: artifact.Artifact, which: tuple[str, str, str], groups: Sequence[str]) -> None:
    """Mean over seeds with a band of 1 SD, for each group of joints; a line breaks at a phase's border."""
    phases = phases_of(results)
    for name, phase in phases.items():
        ax.axvspan(phase.start + 0.5, phase.stop + 0.5, color=SHADES[name], lw=0, zorder=0)
    ax.set_xlim(0.5, phases["extinction"].stop + 0.5)
    ax.yaxis.set_major_locator(MaxNLocator(4))
    condition, reward, curve = which
    colour = COLOURS.get(reward, OTHER_COLOUR)
    if f"{condition}/{reward}/{curve}/{groups[0]}" not in results.datasets:
        ax.set_yticks([])
        ax.text(0.5, 0.5, "not in this sweep", transform=ax.transAxes, ha="center", va="center", color=OTHER_COLOUR)
        return
    width = analysis.window(phases)
    for group in groups:
        smooth = analysis.smooth(results[f"{condition}/{reward}/{curve}/{group}"], phases, width)
        mean, sd = analysis.mean_sd(smooth)
        for phase in phases.values():
            # A third of the window apart nothing is lost, and the files stay small.
            shown = np.unique(np.append(np.arange(phase.start, phase.stop, max(1, width // 3)), phase.stop - 1))
            x, m, s = shown + 1, mean[shown], np.nan_to_num(sd[shown])
            ax.fill_between(x, m - s, m + s, color=colour, alpha=0.2, lw=0)
            ax.plot(x, m, color=colour, ls=DASHES[group])


def _name_phases(ax: Axes, phases: Mapping[str, slice]) -> None:
    """The phases' names, small, above the title line of the topmost strip."""
    for name, phase in phases.items():
        middle = (phase.start + phase.stop) / 2
        ax.annotate(name, (middle, 1), (0, 15), ("data", "axes fraction"), "offset points", ha="center", fontsize=7)


def _legend_text(results: artifact.Artifact) -> str:
    seeds, width = int(results.about["seeds"]), analysis.window(phases_of(results))
    many = "n = 1 seed" if seeds == 1 else f"n = {seeds} seeds; line: mean, shaded: ±1 SD over seeds"
    return many if width == 1 else f"{many}; moving average over {width} steps"


def _legend(figure: Figure | SubFigure) -> None:
    handles = [
        Line2D([], [], color="#333333", ls=DASHES["attached"], label="attached limb (A, B: all joints)"),
        Line2D([], [], color="#333333", ls=DASHES["others"], label="other limbs"),
        Patch(color=SHADES["attached"], label="rope attached"),
    ]
    if isinstance(figure, Figure):
        handles[0].set_label("attached limb")
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))


def _encoder(held: artifact.Artifact) -> Figure:
    """Both losses over the training, and what the held-out frames gave."""
    figure = Figure(figsize=(8, 3), layout="constrained")
    figure.suptitle("Visual encoder: loss of each training batch, and of held-out frames", fontsize=10)
    for ax, (name, title) in zip(
        figure.subplots(1, 2), (("reconstruction", "Reconstruction"), ("cltt", "CLTT")), strict=True
    ):
        curve = held.datasets[f"curves/{name}"]
        ax.plot(np.arange(1, len(curve.values) + 1), curve.values, color="#0072B2", label="training")
        if f"measures/{name}" in held.datasets:
            ax.axhline(float(held[f"measures/{name}"]), color="#D55E00", ls="--", label="held out, at the end")
        if name == "reconstruction":
            ax.set_yscale("log")
        ax.set_title(title, loc="left", fontweight="bold")
        ax.set_xlabel("iteration")
        ax.set_ylabel(f"loss ({curve.units})")
        ax.legend()
    return figure


def _reconstructions(p: params.Params, held: artifact.Artifact, frames: np.ndarray) -> Figure:
    """A frame of each regime that the encoder was not trained on, what it makes of it, and what it makes of h alone."""
    torch.set_num_threads(1)  # the same sums on every machine
    extract = encoder.Extractor(p.encoder, encoder.load(held))
    chosen = frames[:, 0, round(frames.shape[2] * (1 - p.collect.held_out)), 0]
    pictures = {
        "input": chosen,
        "reconstruction": extract.reconstruct(chosen),
        "from h alone": _from_latent(extract.net, chosen),
    }
    figure = Figure(figsize=(8, 6.3), layout="constrained")
    grid = figure.subplots(len(pictures), len(chosen), squeeze=False)
    for row, (name, images) in zip(grid, pictures.items(), strict=True):
        for ax, image in zip(row, images, strict=True):
            ax.imshow(image, interpolation="none")  # kept as its own pixels in the SVG
            ax.set(xticks=[], yticks=[])
            ax.spines[:].set_visible(False)
        row[0].set_ylabel(name)
    for ax, (condition, attached) in zip(grid[0], collect.REGIMES, strict=True):
        ax.set_title(f"{condition}, rope {'on' if attached else 'off'}")
    return figure


def _from_latent(net: encoder.UNet, frames: np.ndarray) -> np.ndarray:
    """Reconstructions of (N, 128, 128, 3) frames with the skip connections set to zero."""
    with torch.inference_mode():
        encoded = [net.encode(encoder.images(frame)) for frame in frames]
        decoded = torch.cat([net.decode(h, [torch.zeros_like(skip) for skip in skips]) for h, skips in encoded])
    return decoded.mul(255).round().clamp(0, 255).byte().permute(0, 2, 3, 1).numpy()


if __name__ == "__main__":
    sys.exit(console.main(main))
