"""`python -m stages.report`: reports/index.html, one page that holds all it shows.

From reports/metrics.json, claims.json, variants.json, effects.json and figures/, and params.yaml with its comments.
"""

import base64
import hashlib
import json
import re
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jinja2
import yaml

from mimo import analysis, artifact, params
from stages import console, paths, verdicts
from stages.numbers import number

TEMPLATE = Path(__file__).with_name("report.html.j2")
PARAMS = Path("params.yaml")
WINDOWS = {
    "baseline": "Baseline",
    "acquisition_early": "Early acquisition",
    "acquisition_late": "Late acquisition",
    "extinction_early": "Early extinction",
    "extinction_late": "Late extinction",
}
_PANELS = (
    "A: MTL, RTL and Surprise reward. B: MTL and RTL combined with Surprise. C: CAIS and CAIS + Surprise reward, the "
    "attached limb against the others. D: Q value of MOVE of the rewards combined with Surprise, likewise. In A and B "
    "the reward is the mean over all twelve joints. Each reward has a strip of its own, since their sizes differ; in "
    "all, {gain:g} is one SD of a single reward under the resting policy, free mobile, rope attached. Q is shown as "
    "learned, without the bias on MOVE that acting adds. The outcome models behind CAIS and Surprise learn from the "
    "last {memory} transitions; for as many steps after the rope is gone, some of these were made with it."
)
CAPTIONS = {  # by file name: heading, caption, where the data lie
    "fig1": (
        "Figure 1. Setting",
        "A: the scene in third person, before anything moved, and a picture of the right eye while the rope is on; the "
        "eye does not see the red rope. B: what passes between agent and environment in an agent step. C: the phases "
        "in agent steps, and an agent step in physics updates. D: the torque of each joint without and with MOVE, "
        "whose direction is drawn at random; the joints of the limb with the rope in bold.",
        "params",
    ),
    "fig2": (
        "Figure 2. Rewards",
        "All in one agent step under the resting policy, noisy mobile, rope on; its frames are among those recorded "
        "for the encoder. MTL: the mobile's path from above, from the ring to the dot, and its length so far. RTL: "
        "what the eye saw before and after; a line for each dimension of h, with a dot at its new value. CAIS: the "
        "table of p(h|MOVE) against that of p(h), in the dimension in which they differ most, and the influence of "
        "MOVE, which is the mean of such areas over all dimensions, for the three joints of each limb (hips or "
        "shoulders, then knee or elbow; filled: the limb with the rope). Surprise: the table of p(h|a), its mean, and "
        "the h that came, in the dimension in which the mean erred most; a line for each dimension from the mean to "
        "the h that came. CAIS and Surprise are those of the joint that CAIS paid most; the outcome models had "
        "learned from the other recorded worlds and from this world's earlier steps. Each reward is in its own units: "
        "it is scaled before it is paid, and before Surprise is added.",
        "encoder",
    ),
    "fig3": ("Figure 3. Free mobile", _PANELS, "results"),
    "fig4": ("Figure 4. Noisy mobile", _PANELS, "results"),
    "fig5": (
        "Figure 5. Agent",
        "The Q network, which all joints share: what goes in, its layers with their sizes, and how an action comes of "
        "the values it gives. Below: what a residual layer does.",
        "params",
    ),
    "p_move": (
        "Probability of moving",
        "P(MOVE) of the attached limb's three joints and of the other nine, for every reward and condition. "
        "Not a figure of the paper.",
        "results",
    ),
    "influence": (
        "Influence of MOVE",
        "Distance between p(h|MOVE) and p(h), per joint, wherever the outcome models were learned: the mean absolute "
        "difference of their tables, over the latent's dimensions. It is the 1-Wasserstein distance where the tables "
        "hold quantiles; with a Huber threshold above every error, as here, they hold expectiles. CAIS "
        "pays it only on steps on which the joint moves, so panel C also shows how often that was; this figure does "
        "not. Not a figure of the paper.",
        "results",
    ),
    "encoder": (
        "Visual encoder",
        "Losses over the training, and at its end over frames kept from it. Not a figure of the paper.",
        "encoder",
    ),
    "reconstructions": (
        "What the latent carries",
        "Frames that the encoder was not trained on: the first such step of the first world, in both conditions, with "
        "and without the rope. Top: what the eye saw. Middle: its reconstruction. Bottom: the reconstruction with the "
        "skip connections set to zero, so from h alone, all of the picture that the agent has; the decoder was not "
        "trained to do without them. A linear probe reads the mobile's position from h in such frames with an R² of "
        "{probe}. Not a figure of the paper.",
        "encoder",
    ),
}


@dataclass(frozen=True)
class Constant:
    """A line of params.yaml; `source` is paper, ours, or both."""

    key: str
    value: str
    source: str
    comment: str


@dataclass(frozen=True)
class Shown:
    """A figure on the page, its picture as a data URI."""

    name: str
    heading: str
    caption: str
    picture: str
    data: str
    content: str


def main() -> None:
    """Write the page."""
    p = params.load()
    metrics, claims = _read(paths.METRICS), _read(paths.CLAIMS)
    variants, effects = _read(paths.VARIANT_CLAIMS)["variants"], _read(paths.EFFECTS)
    html = page(metrics, claims, variants, effects, figures(metrics, paths.FIGURES, p), constants(PARAMS.read_text()))
    artifact.publish(html.encode(), paths.REPORT)


def page(
    metrics: dict[str, Any],
    claims: dict[str, Any],
    variants: dict[str, Any],
    effects: dict[str, Any],
    shown: list[Shown],
    constants: list[Constant],
) -> str:
    """The whole page as HTML.

    Args:
        metrics: reports/metrics.json.
        claims: reports/claims.json.
        variants: those of reports/variants.json by name; without any, their section is left out.
        effects: reports/effects.json.
        shown: the figures.
        constants: the lines of params.yaml.
    """
    environment = jinja2.Environment(
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters |= {"number": number, "spread": spread, "reward": analysis.label}
    environment.filters |= {f.__name__: f for f in (verdicts.effect, verdicts.interval, verdicts.region)}
    environment.filters |= {f.__name__: f for f in (verdicts.panels, verdicts.strip)}
    template = environment.from_string(TEMPLATE.read_text())
    rows = [
        (condition, reward, found)
        for condition, rewards in metrics["conditions"].items()
        for reward, found in rewards.items()
    ]
    return template.render(
        metrics=metrics,
        judged=claims,
        variants=variants,
        effects=effects,
        compared=verdicts.compared(claims, variants),
        rows=rows,
        figures=shown,
        constants=constants,
        windows=WINDOWS,
        results=paths.RESULTS,
        strip_width=verdicts.WIDTH,
    )


def figures(metrics: dict[str, Any], folder: Path, p: params.Params) -> list[Shown]:
    """Every figure of CAPTIONS that was drawn, in its order.

    Args:
        metrics: for the content hashes of the data behind.
        folder: where the SVG files lie.
        p: for what captions say of it.
    """
    data = {"results": (paths.RESULTS, metrics["results"]), "encoder": (paths.ENCODER, metrics["encoder"]["content"])}
    data["params"] = (PARAMS, hashlib.sha256(PARAMS.read_bytes()).hexdigest())
    said = {"gain": p.rewards.gain, "memory": p.outcomes.memory, "probe": _probe(metrics["encoder"])}
    shown = []
    for name, (heading, caption, source) in CAPTIONS.items():
        path = folder / f"{name}.svg"
        if not path.is_file():
            continue
        picture = f"data:image/svg+xml;base64,{base64.b64encode(path.read_bytes()).decode()}"
        behind, content = data[source]
        text = caption.format(**said) + (f" {_seeds(metrics)}" if source == "results" else "")
        shown.append(Shown(name, heading, text, picture, str(behind), content))
    if not shown:
        raise console.StageError(f"{folder} has no figures; run `dvc repro figures`.")
    return shown


def constants(text: str) -> list[Constant]:
    """Every constant of params.yaml with the comment on its line, every variant with what it asks.

    Args:
        text: params.yaml.
    """
    root = yaml.compose(text)
    assert root is not None  # mimo.params has checked the file
    return _constants(root, text.splitlines(), ())


def spread(value: dict[str, float | None], digits: int = 2) -> str:
    """Mean ± SD, or the mean alone where one seed has no SD."""
    mean = number(value["mean"], digits)
    return mean if value["sd"] is None else f"{mean} ± {number(value['sd'], digits)}"


def _read(path: Path) -> dict[str, Any]:
    try:
        found: dict[str, Any] = json.loads(path.read_text())
    except (OSError, ValueError) as fault:
        reason = getattr(fault, "strerror", None) or fault
        raise console.StageError(f"{path} cannot be read ({reason}); run `dvc repro`.") from fault
    return found


def _probe(measures: dict[str, Any]) -> str:
    """`r2_free_x` and its like, in words."""
    kinds = (name.split("_") for name in measures if name.startswith("r2_"))
    return ", ".join(f"{number(measures['_'.join(kind)])} ({kind[1]}, {kind[2]})" for kind in kinds)


def _seeds(metrics: dict[str, Any]) -> str:
    most = max(found["seeds"] for rewards in metrics["conditions"].values() for found in rewards.values())
    return "One seed, so no SD." if most == 1 else f"Line: mean over n = {most} seeds. Shaded: 1 SD over seeds."


def _constants(node: yaml.Node, lines: list[str], above: tuple[str, ...]) -> list[Constant]:
    found = []
    assert isinstance(node, yaml.MappingNode)
    for key, value in node.value:
        name = (*above, key.value)
        if above == ("sweeps", "variants"):
            own = {part.value: node for part, node in value.value}
            text = ", ".join(f"{changed.value}: {_text(node)}" for changed, node in own["set"].value)
            found.append(Constant(".".join(name), text, "ours", own["asks"].value))
            continue
        if isinstance(value, yaml.MappingNode):
            found += _constants(value, lines, name)
            continue
        # A list over several lines ends where the next key begins: its comment, if any, is beside its own key.
        end = key.end_mark if isinstance(value, yaml.SequenceNode) and not value.flow_style else value.end_mark
        _, mark, comment = lines[end.line][end.column :].partition("#")
        comment = comment.strip() if mark else ""
        sources = [
            kind
            for kind, sign in (("paper", r"\bpaper (§|fig|appendix)"), ("ours", r"\bours:"))
            if re.search(sign, comment)
        ]
        found.append(Constant(".".join(name), _text(value), " and ".join(sources), comment))
    return found


def _text(value: yaml.Node) -> str:
    return ", ".join(item.value for item in value.value) if isinstance(value, yaml.SequenceNode) else str(value.value)


if __name__ == "__main__":
    sys.exit(console.main(main))
