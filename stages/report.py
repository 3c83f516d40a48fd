"""`python -m stages.report`: reports/index.html, one page that holds all it shows but the films, which lie beside it.

From what other stages left in reports/, params.yaml with its comments, and requirements.lock. Its words are in
stages/page/html/, captions in stages/page/captions.py.
"""

import base64
import hashlib
import json
import sys
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jinja2

from mimo.record import artifact
from mimo.science import analysis
from mimo.settings import params
from mimo.world import body
from stages.base import console, paths
from stages.base.numbers import number
from stages.drawing.style import COLOURS, OTHER_COLOUR
from stages.page import captions, origin, verdicts
from stages.page.constants import Constant, constants

HTML = Path(__file__).with_name("html")
LOCK = Path("requirements.lock")
WINDOWS = {
    "baseline": "Baseline",
    "acquisition_early": "Early acquisition",
    "acquisition_late": "Late acquisition",
    "extinction_early": "Early extinction",
    "extinction_late": "Late extinction",
}


@dataclass(frozen=True)
class Made:
    """What other stages left in reports/; each is the file of its name, parsed.

    `origins` has stages.page.origin's account of the figures, then of each film.
    """

    metrics: dict[str, Any]
    claims: dict[str, Any]
    variants: dict[str, Any]
    effects: dict[str, Any]
    explore: dict[str, Any]
    figures: list[captions.Shown]
    films: list[captions.Film]
    origins: list[dict[str, Any]]


def main() -> None:
    """Write the page."""
    p = params.load()
    html = page(gathered(p), p.protocol, constants(paths.PARAMS.read_text()), versions(LOCK.read_text()))
    artifact.publish(html.encode(), paths.REPORT)


def gathered(p: params.Params) -> Made:
    """What lies in reports/.

    Raises:
        console.StageError: something is missing or damaged.
    """
    metrics, films = _read(paths.METRICS), captions.films(paths.FILMS, p.sweep.conditions)
    return Made(
        metrics,
        _read(paths.CLAIMS),
        _read(paths.VARIANT_CLAIMS)["variants"],
        _read(paths.EFFECTS),
        _read(paths.EXPLORE),
        captions.figures(metrics, paths.FIGURES, p),
        films,
        [origin.read(paths.FIGURES / origin.NAME), *(film.origin for film in films)],
    )


def page(made: Made, protocol: params.Protocol, constants: list[Constant], versions: dict[str, str]) -> str:
    """The whole page as HTML.

    Args:
        made: what it shows; without variants or films, their sections are left out.
        protocol: for what is said of steps.
        constants: the lines of params.yaml.
        versions: of the locked environment.
    """
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(HTML),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters |= {"number": number, "spread": spread, "reward": analysis.label}
    environment.filters |= {f.__name__: f for f in (verdicts.effect, verdicts.interval, verdicts.region)}
    environment.filters |= {f.__name__: f for f in (verdicts.panels, verdicts.strip)}
    environment.globals["strip_width"] = verdicts.WIDTH
    script = (HTML / "explore.js").read_text()
    return environment.get_template("page.html.j2").render(
        vars(made),
        judged=made.claims,
        verdicts=Counter(claim["verdict"] for claim in made.claims["claims"]),
        compared=verdicts.compared(made.claims, made.variants),
        rows=[
            (condition, reward, found)
            for condition, rewards in made.metrics["conditions"].items()
            for reward, found in rewards.items()
        ],
        explored=_explored(made.explore),
        protocol=protocol,
        joints=joints(),
        fixed=body.JOINTS[: body.FIXED],
        constants=constants,
        versions=versions,
        windows=WINDOWS,
        results=paths.RESULTS,
        style=(HTML / "style.css").read_text(),
        script=script,
        script_hash=base64.b64encode(hashlib.sha256(script.encode()).digest()).decode(),
    )


@dataclass(frozen=True)
class Joint:
    """A hinge of a limb, right and left alike: N m when it moves, degrees, and where its spring rests."""

    name: str
    actuated: bool
    torque: tuple[float, float]
    degrees: tuple[float, float]
    rest: float


def joints() -> list[Joint]:
    """The limbs' joints (paper's appendix and fig. 1 D), in the order of the body."""
    return [
        Joint(
            hinge.name.removeprefix("right_"),
            hinge.name in body.ACTUATED,
            hinge.torque,
            hinge.degrees,
            hinge.rest_degrees,
        )
        for part in body.RIGHT
        for hinge in part.hinges
    ]


def versions(lock: str) -> dict[str, str]:
    """Versions by package, from the text of requirements.lock."""
    pinned = (line.split("==") for line in lock.splitlines() if "==" in line and not line.startswith("#"))
    return {name.split("[")[0]: version.strip() for name, version in pinned}


def spread(value: dict[str, float | None], digits: int = 2) -> str:
    """Mean ± SD, or the mean alone where one seed has no SD."""
    mean = number(value["mean"], digits)
    return mean if value["sd"] is None else f"{mean} ± {number(value['sd'], digits)}"


def _explored(explore: dict[str, Any]) -> dict[str, Any]:
    """What the explorer's script reads: the curves, and how to name and colour them."""
    conditions, rewards = (dict.fromkeys(name.split("/")[part] for name in explore["cells"]) for part in (0, 1))
    return explore | {
        "conditions": list(conditions),
        "rewards": {reward: analysis.label(reward) for reward in rewards},
        "colours": {reward: COLOURS.get(reward, OTHER_COLOUR) for reward in rewards},
    }


def _read(path: Path) -> dict[str, Any]:
    try:
        found: dict[str, Any] = json.loads(path.read_text())
    except (OSError, ValueError) as fault:
        reason = getattr(fault, "strerror", None) or fault
        raise console.StageError(f"{path} cannot be read ({reason}); run `dvc repro`.") from fault
    return found


if __name__ == "__main__":
    sys.exit(console.main(main))
