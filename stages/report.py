"""`python -m stages.report`: reports/index.html, one page that holds all it shows.

From reports/metrics.json, reports/figures/ and params.yaml with its comments.
"""

import base64
import json
import re
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jinja2
import yaml

from mimo import analysis, artifact, params
from stages import console, paths

TEMPLATE = Path(__file__).with_name("report.html.j2")
PARAMS = Path("params.yaml")
MISSING = "–"
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
    "learned, without the bias on MOVE that acting adds. The outcome models draw on the last transitions "
    "(outcomes.memory), so CAIS and Surprise still know the rope for a while after it is gone."
)
CAPTIONS = {  # by file name: heading, caption, where the data lie
    "fig3": ("Figure 3. Free mobile", _PANELS, "results"),
    "fig4": ("Figure 4. Noisy mobile", _PANELS, "results"),
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
    try:
        metrics = json.loads(paths.METRICS.read_text())
    except (OSError, ValueError) as fault:
        reason = getattr(fault, "strerror", None) or fault
        raise console.StageError(f"{paths.METRICS} cannot be read ({reason}); run `dvc repro`.") from fault
    html = page(metrics, figures(metrics, paths.FIGURES, p.rewards.gain), constants(PARAMS.read_text()))
    artifact.publish(html.encode(), paths.REPORT)


def page(metrics: dict[str, Any], shown: list[Shown], constants: list[Constant]) -> str:
    """The whole page as HTML."""
    environment = jinja2.Environment(
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters |= {"number": number, "spread": spread, "reward": analysis.label}
    template = environment.from_string(TEMPLATE.read_text())
    rows = [
        (condition, reward, found)
        for condition, rewards in metrics["conditions"].items()
        for reward, found in rewards.items()
    ]
    return template.render(
        metrics=metrics, rows=rows, figures=shown, constants=constants, windows=WINDOWS, results=paths.RESULTS
    )


def figures(metrics: dict[str, Any], folder: Path, gain: float) -> list[Shown]:
    """Every figure of CAPTIONS that was drawn, in its order.

    Args:
        metrics: for the content hashes of the data behind.
        folder: where the SVG files lie.
        gain: `rewards.gain` of params.yaml.
    """
    data = {"results": (paths.RESULTS, metrics["results"]), "encoder": (paths.ENCODER, metrics["encoder"]["content"])}
    shown = []
    for name, (heading, caption, source) in CAPTIONS.items():
        path = folder / f"{name}.svg"
        if not path.is_file():
            continue
        picture = f"data:image/svg+xml;base64,{base64.b64encode(path.read_bytes()).decode()}"
        behind, content = data[source]
        text = caption.format(gain=gain) + (f" {_seeds(metrics)}" if source == "results" else "")
        shown.append(Shown(name, heading, text, picture, str(behind), content))
    if not shown:
        raise console.StageError(f"{folder} has no figures; run `dvc repro figures`.")
    return shown


def constants(text: str) -> list[Constant]:
    """Every constant of params.yaml with the comment on its line.

    Args:
        text: params.yaml.
    """
    root = yaml.compose(text)
    assert root is not None  # mimo.params has checked the file
    return _constants(root, text.splitlines(), ())


def number(value: float | None, digits: int = 2) -> str:
    """`value` with `digits` decimals, or a dash; a true minus sign, never -0."""
    if value is None:
        return MISSING
    text = f"{value:.{digits}f}"
    if float(text) == 0:
        text = text.lstrip("-")
    return text.replace("-", "−")


def spread(value: dict[str, float | None], digits: int = 2) -> str:
    """Mean ± SD, or the mean alone where one seed has no SD."""
    mean = number(value["mean"], digits)
    return mean if value["sd"] is None else f"{mean} ± {number(value['sd'], digits)}"


def _seeds(metrics: dict[str, Any]) -> str:
    most = max(found["seeds"] for rewards in metrics["conditions"].values() for found in rewards.values())
    return "One seed, so no SD." if most == 1 else f"Line: mean over n = {most} seeds. Shaded: 1 SD over seeds."


def _constants(node: yaml.Node, lines: list[str], above: tuple[str, ...]) -> list[Constant]:
    found = []
    assert isinstance(node, yaml.MappingNode)
    for key, value in node.value:
        name = (*above, key.value)
        if isinstance(value, yaml.MappingNode):
            found += _constants(value, lines, name)
            continue
        sequence = isinstance(value, yaml.SequenceNode)
        text = ", ".join(item.value for item in value.value) if sequence else value.value
        # A list over several lines ends where the next key begins: its comment, if any, is beside its own key.
        end = key.end_mark if sequence and not value.flow_style else value.end_mark
        _, mark, comment = lines[end.line][end.column :].partition("#")
        comment = comment.strip() if mark else ""
        sources = [
            kind
            for kind, sign in (("paper", r"\bpaper (§|fig|appendix)"), ("ours", r"\bours:"))
            if re.search(sign, comment)
        ]
        found.append(Constant(".".join(name), text, " and ".join(sources), comment))
    return found


if __name__ == "__main__":
    sys.exit(console.main(main))
