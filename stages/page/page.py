"""The report's pages: reports/index.html of the paper, reports/studies.html of what goes beyond it.

Each is one file that holds all it shows but the films, which lie beside it, from what other stages left in reports/.
The words are in html/, captions in captions.py.
"""

import base64
import hashlib
import json
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jinja2
from markdown_it import MarkdownIt
from markupsafe import Markup

from mimo.science import analysis, judgement, summary
from mimo.settings import params
from mimo.settings import studies as settings
from mimo.world import body
from stages.base import console, origin, paths
from stages.base.numbers import number
from stages.drawing.style import COLOURS, OTHER_COLOUR
from stages.page import captions, compared, figured, studied, verdicts
from stages.page.constants import Constant

HTML = Path(__file__).with_name("html")
PAPER = (  # sections: each has a template of its name
    ("film", "Film"),
    ("claims", "Claims"),
    ("figures", "Figures"),
    ("explore", "Explore"),
    ("results", "Results"),
    ("readings", "Readings"),
    ("latent", "Encoder and scales"),
    ("joints", "Joints and torques"),
    ("constants", "Constants"),
    ("origin", "Origin"),
)
STUDIES = (  # sections: the studies' own come after the first
    ("short", "In short"),
    ("fair", "Is the question fair?"),
    ("explore", "Explore"),
    ("constants", "Constants"),
)
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

    `origins` has stages.base.origin's account of the figures, then of each film.
    """

    metrics: dict[str, Any]
    claims: dict[str, Any]
    explore: dict[str, Any]
    figures: list[captions.Shown]
    films: list[captions.Film]
    origins: list[dict[str, Any]]


@dataclass(frozen=True)
class Beyond:
    """What came of the studies, by name: reports/studies/NAME.json and reports/studies/explore/NAME.json, parsed."""

    made: dict[str, dict[str, Any]]
    explore: dict[str, dict[str, Any]]


def gathered_studies(names: Iterable[str]) -> Beyond:
    """What lies in reports/studies/ of the studies of these names; one that is not computed yet is left out.

    Raises:
        console.StageError: something is damaged.
    """
    made, explore = (
        {name: read(top / f"{name}.json") for name in names if (top / f"{name}.json").exists()}
        for top in (paths.STUDIES_NUMBERS, paths.STUDIES_EXPLORE)
    )
    return Beyond(made, explore)


def gathered(p: params.Params) -> Made:
    """What lies in reports/.

    Raises:
        console.StageError: something is missing or damaged.
    """
    metrics, films = read(paths.METRICS), captions.films(paths.FILMS, p.sweep.conditions)
    return Made(
        metrics,
        read(paths.CLAIMS),
        read(paths.EXPLORE),
        captions.figures(metrics, paths.FIGURES, p),
        films,
        [origin.read(paths.FIGURES / origin.NAME), *(film.origin for film in films)],
    )


def index(
    made: Made, protocol: params.Protocol, constants: list[Constant], readings: Markup, versions: dict[str, str]
) -> str:
    """The paper's page as HTML.

    Args:
        made: what it shows; without films, their section is left out.
        protocol: for what is said of steps.
        constants: the lines of params.yaml.
        readings: of the paper, as HTML.
        versions: of the locked environment.
    """
    return _rendered(
        "index.html.j2",
        [(name, title) for name, title in PAPER if name != "film" or made.films],
        vars(made)
        | {
            "judged": made.claims,
            "verdicts": {
                group: Counter(claim[group]["verdict"] for claim in made.claims["claims"]) for group in judgement.GROUPS
            },
            "margins": verdicts.MARGINS,
            "locked": analysis.LOCKED,
            "readings": readings,
            "tests": verdicts.primary(made.claims["claims"]),
            "rows": [
                (condition, reward, found)
                for condition, rewards in made.metrics["conditions"].items()
                for reward, found in rewards.items()
            ],
            "explored": [_explored(made.explore, "", ("condition", "reward"))],
            "protocol": protocol,
            "joints": joints(),
            "fixed": body.JOINTS[: body.FIXED],
            "constants": constants,
            "file": paths.PARAMS,
            "versions": versions,
            "windows": WINDOWS,
            "results": paths.RESULTS,
        }
        | _script(),
    )


def studies(
    beyond: settings.Studies, found: Beyond, claims: dict[str, Any], effects: dict[str, Any], constants: list[Constant]
) -> str:
    """The studies' page as HTML.

    Args:
        beyond: studies/params.yaml.
        found: what came of the studies; those that it lacks are named and left out.
        claims: reports/claims.json, which the variants are compared with.
        effects: reports/studies/effects.json.
        constants: the lines of studies/params.yaml.
    """
    shown = studied.studied(beyond.studies, found.made, claims)
    first, *rest = STUDIES
    explored = {
        own.name: _explored(found.explore[own.name], own.study.title, ("variant", "condition", "reward"))
        for own in shown
        if found.explore.get(own.name, {}).get("cells")
    }
    sections = [
        first,
        *((f"study-{own.name}", own.study.title) for own in shown),
        *(section for section in rest if section[0] != "explore" or explored),
    ]
    return _rendered(
        "studies.html.j2",
        sections,
        {
            "judged": claims,
            "studied": {f"study-{own.name}": own for own in shown},
            "missing": [study.title for name, study in beyond.studies.items() if name not in found.made],
            "figures": {own.name: figured.figure(own) for own in shown},
            "effects": effects,
            "explored": list(explored.values()),
            "constants": constants,
            "file": settings.PATH,
        }
        | _script(bool(explored)),
    )


def _rendered(template: str, sections: Iterable[tuple[str, str]], values: dict[str, Any]) -> str:
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(HTML),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters |= {"number": number, "spread": spread, "reward": summary.label}
    environment.filters |= {f.__name__: f for f in (verdicts.effect, verdicts.interval, verdicts.region)}
    environment.filters |= {"found": compared.effect, "listed": studied.listed, "state": compared.state}
    environment.filters |= {f.__name__: f for f in (verdicts.panels, verdicts.strip, verdicts.refuted)}
    environment.globals["strip_width"] = verdicts.WIDTH
    style, level = (HTML / "style.css").read_text(encoding="utf-8"), f"{100 * values['judged']['level']:g}\u00a0%"
    return environment.get_template(template).render(values, sections=list(sections), style=style, level=level)


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


def prose(text: str) -> Markup:
    """A Markdown file of the project, less its first heading, as a part of a section of the page."""
    body = MarkdownIt("commonmark").enable("table").render(text.partition("\n")[2])
    wide = '<div class="wide" role="group" aria-label="Table" tabindex="0"><table>'
    for own, ours in (("h2>", "h3>"), ("<table>", wide), ("</table>", "</table></div>")):
        body = body.replace(own, ours)
    return Markup(body)  # noqa: S704 the file is the project's own


def versions(lock: str) -> dict[str, str]:
    """Versions by package, from the text of requirements.lock."""
    pinned = (line.split("==") for line in lock.splitlines() if "==" in line and not line.startswith("#"))
    return {name.split("[")[0]: version.strip() for name, version in pinned}


def spread(value: dict[str, float | None], digits: int = 2) -> str:
    """Mean ± SD, or the mean alone where one seed has no SD."""
    mean = number(value["mean"], digits)
    return mean if value["sd"] is None else f"{mean} ± {number(value['sd'], digits)}"


def _script(wanted: bool = True) -> dict[str, str]:
    """The explorer's, and by what the browser knows it."""
    script = (HTML / "explore.js").read_text(encoding="utf-8") if wanted else ""
    return {"script": script, "script_hash": base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()}


def _explored(explore: dict[str, Any], title: str, parts: tuple[str, ...]) -> dict[str, Any]:
    """What the explorer's script reads: the curves, what their names are made of, and how to name and colour them."""
    rewards = dict.fromkeys(name.split("/")[-1] for name in explore["cells"])
    return explore | {
        "title": title,
        "parts": parts,
        "labels": {reward: summary.label(reward) for reward in rewards},
        "colours": {reward: COLOURS.get(reward, OTHER_COLOUR) for reward in rewards},
    }


def read(path: Path) -> dict[str, Any]:
    """A file of reports/, parsed.

    Raises:
        console.StageError: it is missing or damaged.
    """
    try:
        found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as fault:
        reason = getattr(fault, "strerror", None) or fault
        raise console.StageError(f"{path} cannot be read ({reason}); run {paths.made_by(path)}.") from fault
    return found
