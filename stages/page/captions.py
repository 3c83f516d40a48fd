"""The page's figures and films: what they show, in words, and what they were made by."""

import base64
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mimo.science import analysis, judgement, summary
from mimo.settings.params import Params
from stages.base import console, origin, paths
from stages.base.numbers import number

KINDS = ("svg", "pdf", "png")  # of a figure's files
_RESULTS, _ENCODER, _FRAMES = str(paths.RESULTS), str(paths.ENCODER), str(paths.FRAMES)
_PANELS = (
    "A: MTL, RTL and Surprise reward. B: MTL and RTL combined with Surprise. C: CAIS and CAIS + Surprise reward, the "
    "attached limb against the others. D: Q value of MOVE of the rewards combined with Surprise, likewise. In A and B "
    "the reward is the mean over all twelve joints. Each reward has a strip of its own, since their sizes differ; in "
    "all, {gain:g} is one SD of a single reward under the resting policy, free mobile, rope attached. Q is shown as "
    "learned, in temperatures, without the bias on MOVE that acting adds. {seeds} In D, where at least a quarter of "
    "all joints are locked, always or never moving, the mean is of two kinds; there each seed has a thin line. What "
    "may puzzle: (1) CAIS rises in baseline, before there is a rope. All tables start alike, and drift apart by the "
    "noise that each happens to draw; paid for that, joints move more, until MOVE's table and that of p(h) are drawn "
    "from nearly the same steps. (2) As the rope comes or goes, CAIS of every limb rises: h lies elsewhere from then "
    "on, and until all tables have followed, p(h|MOVE) and p(h) are on their way. They learn from the last {memory} "
    "transitions; for as many steps after the rope is gone, some of these were made with it. (3) Joints that never "
    "move keep the table of MOVE as it was; their influence is then a measure of its age."
)
_PANELS_ALT = (
    "Curves over the steps of a run, the time with the rope shaded, in four panels: rewards in A to C, Q values of "
    "MOVE in D; {}. The table of results has the means."
)


@dataclass(frozen=True)
class Caption:
    """A figure's words; `data` are the files it shows, of those that its stage reads."""

    heading: str
    text: str
    alt: str
    data: tuple[str, ...] = ()
    paper: bool = False


CAPTIONS = {  # by file's name, in the page's order
    "fig1": Caption(
        "Figure 1. Setting",
        "A: the scene in third person, before anything moved, and a picture of the right eye while the rope is on; the "
        "eye does not see the red rope. B: what passes between agent and environment in an agent step. C: the phases "
        "in agent steps, and an agent step in physics updates. D: the torque of each joint without and with MOVE, "
        "whose direction is drawn at random; the joints of the limb with the rope in bold.",
        "Four panels: the simulated infant under the mobile, the loop between agent and world, the timing, and the "
        "table of torques.",
        (_FRAMES,),
        paper=True,
    ),
    "fig2": Caption(
        "Figure 2. Rewards",
        "All in one agent step under the resting policy, noisy mobile, rope on; its frames are among those recorded "
        "for the encoder. MTL: the mobile's path from above, from the ring to the dot, and its length so far. RTL: "
        "what the eye saw before and after; a line for each dimension of h, with a dot at its new value. CAIS: the "
        "table of p(h|MOVE) against that of p(h), in the dimension in which they differ most, and the influence of "
        "MOVE, which is the mean of such areas over all dimensions, for the three joints of each limb (hips or "
        "shoulders, then knee or elbow; filled: the limb with the rope). Surprise: the table of p(h|a), its mean, and "
        "the h that came, in the dimension in which the mean erred most; a line for each dimension from the mean to "
        "the h that came. CAIS and Surprise are those of the joint that CAIS paid most; the outcome models had learned "
        "from the other recorded worlds and from this world's earlier steps. Each reward is in its own units: it is "
        "scaled before it is paid, and before Surprise is added.",
        "Four panels, one for each reward: from what happened in one agent step to what each reward makes of it.",
        (_ENCODER, _FRAMES),
        paper=True,
    ),
    "fig3": Caption(
        "Figure 3. Free mobile",
        _PANELS,
        _PANELS_ALT.format("the mobile is moved by the infant alone"),
        (_RESULTS,),
        True,
    ),
    "fig4": Caption(
        "Figure 4. Noisy mobile", _PANELS, _PANELS_ALT.format("random forces move the mobile too"), (_RESULTS,), True
    ),
    "fig5": Caption(
        "Figure 5. Agent",
        "The Q network, which all joints share: what goes in, its layers with their sizes, and how an action comes of "
        "the values it gives. Below: what a residual layer does.",
        "Diagram of the agent's network, layer by layer, and of a residual layer.",
        paper=True,
    ),
    "burst": Caption(
        "The rope comes, the rope goes",
        "CAIS with Surprise and without, before and after the rope comes, and before and after "
        "it goes: reward, Q of both actions in temperatures, and P(MOVE). As Surprise is paid whatever a joint did, "
        "Q(NO_TORQUE) rises as Q(MOVE) does, and P(MOVE) follows their difference, with the bias on MOVE. Below: how "
        "much the attached limb's Q(MOVE) and P(MOVE) change as the rope goes, from so many steps before to as many "
        "after; dots are interquartile means over seeds, shades their {level:g} % intervals. The claims have windows "
        "of {minute} steps.",
        "Small panels of curves around the rope's coming and going, in both conditions; below them, the change of "
        "Q(MOVE) and of P(MOVE) against the window's length.",
        (_RESULTS,),
    ),
    "p_move": Caption(
        "Probability of moving",
        "P(MOVE) of the attached limb's three joints and of the other nine, for every reward and condition. {seeds} "
        "Where at least a quarter of all joints are locked, each seed has a thin line.",
        "P(MOVE) over the steps of a run, the attached limb against the others, a strip for each reward and condition.",
        (_RESULTS,),
    ),
    "influence": Caption(
        "Influence of MOVE",
        "Distance between p(h|MOVE) and p(h), per joint, wherever the outcome models were learned: the mean absolute "
        "difference of their tables, over the latent's dimensions. It is the 1-Wasserstein distance where the tables "
        "hold quantiles; with a Huber threshold above every error, as here, they hold expectiles. CAIS pays it only on "
        "steps on which the joint moves, so panel C also shows how often that was; this figure does not. Where joints "
        "never move, the table of MOVE is stale, and this distance is its age rather than an influence: with MTL + "
        "Surprise in noise, for one. {seeds}",
        "Influence over the steps of a run, the attached limb against the others, a strip for each reward and "
        "condition.",
        (_RESULTS,),
    ),
    "encoder": Caption(
        "Visual encoder",
        "Losses over the training, and at its end over frames kept from it.",
        "Reconstruction loss and CLTT loss, both falling over the iterations of the training.",
        (_ENCODER,),
    ),
    "reconstructions": Caption(
        "What the latent carries",
        "Frames that the encoder was not trained on: the first such step of the first world, in both conditions, with "
        "and without the rope. Top: what the eye saw. Middle: its reconstruction. Bottom: the reconstruction with the "
        "skip connections set to zero, so from h alone, all of the picture that the agent has; the decoder was not "
        "trained to do without them. A linear probe reads the mobile's position from h in such frames with an R² of "
        "{probe}.",
        "Twelve pictures of the mobile, three of each frame: as seen, as reconstructed, and from the latent alone.",
        (_ENCODER, _FRAMES),
    ),
}


@dataclass(frozen=True)
class Shown:
    """A figure on the page: its picture as a data URI, links to its files by kind, content hashes of its data."""

    name: str
    heading: str
    text: str
    alt: str
    paper: bool
    picture: str
    files: dict[str, str]
    data: dict[str, str]


@dataclass(frozen=True)
class Film:
    """A film beside the page: whose run, its file, the picture before it plays, and its origin."""

    heading: str
    run: str
    file: str
    poster: str
    origin: dict[str, Any]


def figures(metrics: Mapping[str, Any], folder: Path, p: Params) -> list[Shown]:
    """Every figure of CAPTIONS that was drawn, in its order.

    Args:
        metrics: reports/metrics.json, for what captions say.
        folder: where the figures lie, below the page's folder.
        p: likewise.

    Raises:
        console.StageError: there is none.
    """
    said = {
        "gain": p.rewards.gain,
        "level": 100 * judgement.LEVEL,
        "minute": analysis.MINUTE,
        "limb": p.protocol.limb.replace("_", " "),
        "memory": p.outcomes.memory,
        "probe": _probe(metrics["encoder"]),
        "seeds": _seeds(metrics),
    }
    drawn = [name for name in CAPTIONS if (folder / f"{name}.svg").is_file()]
    if not drawn:
        raise console.StageError(f"{folder} has no figures; run `dvc repro figures`.")
    data = origin.read(folder / origin.NAME)["data"]
    shown = []
    for name in drawn:
        caption = CAPTIONS[name]
        picture = base64.b64encode((folder / f"{name}.svg").read_bytes()).decode()
        files = {kind: folder / f"{name}.{kind}" for kind in KINDS}
        shown.append(
            Shown(
                name,
                caption.heading,
                caption.text.format(**said),
                caption.alt,
                caption.paper,
                f"data:image/svg+xml;base64,{picture}",
                {kind: _beside(path) for kind, path in files.items() if path.is_file()},
                {path: data[path] for path in caption.data},
            )
        )
    return shown


def films(folder: Path, conditions: Iterable[str]) -> list[Film]:
    """The film of each condition that has one, with its poster; those of other conditions an earlier sweep left."""
    return [_film(folder / name) for name in conditions if (folder / f"{name}.mp4").is_file()]


def _film(path: Path) -> Film:
    heading = f"{path.name.capitalize()} mobile"
    told = origin.read(path.with_suffix(".json"))
    reward, _, seed = told["params"]["film"]["run"].partition("/seed-")
    run = f"{summary.label(reward)}, seed {int(seed)}"
    return Film(heading, run, _beside(path.with_suffix(".mp4")), _beside(path.with_suffix(".png")), told)


def _beside(path: Path) -> str:
    """As the page links to it."""
    return path.relative_to(paths.REPORT.parent).as_posix()


def _probe(measures: Mapping[str, Any]) -> str:
    """`r2_free_x` and its like, in words."""
    kinds = (name.split("_") for name in measures if name.startswith("r2_"))
    return ", ".join(f"{number(measures['_'.join(kind)])} ({kind[1]}, {kind[2]})" for kind in kinds)


def _seeds(metrics: Mapping[str, Any]) -> str:
    most = max(found["seeds"] for rewards in metrics["conditions"].values() for found in rewards.values())
    return "One seed, so no SD." if most == 1 else f"Line: mean over n = {most} seeds. Shaded: 1 SD over seeds."
