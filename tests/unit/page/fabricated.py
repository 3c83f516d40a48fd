"""Studies and numbers as stages.compare writes them, whose effects are known."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from mimo.science import judgement
from mimo.science.measures import MEASURES, summed
from mimo.settings import params
from mimo.settings import studies as settings
from mimo.settings.studies import Studies, Study
from stages.base import numbers

Effect = Callable[[str, str, str], float]  # of a variant ("published" is one), a cell and a measure
LEVEL, SEEDS = 0.95, 20
PARAMS = params.load(Path(__file__).resolve().parents[3] / "params.yaml")
PAPER = ("mtl", "rtl", "cais", "surprise", "mtl_surprise", "rtl_surprise", "cais_surprise")
EFFECTS = {"steps": 700, "dropped": 20, "worlds": 4, "alternatives": {"heavy": {"world.mobile_mass": 0.3}}}


def spread(variant: str, cell: str, measure: str, effect: Effect, seeds: int, sd: float = 0.02) -> list[float]:
    """An effect in every seed, with the same noise in every variant and some of its own."""

    def noise(*key: str) -> np.ndarray:
        return np.random.default_rng(list("/".join(key).encode())).normal(size=seeds)

    values = effect(variant, cell, measure) + sd * (noise(cell, measure) + 0.5 * noise(variant, cell, measure))
    return [float(f"{value:.6g}") for value in values]


def claim(name: str, cell: str, seeds: list[float], low: float | None, high: float | None) -> dict[str, Any]:
    """A claim with one test, of the lead in a cell."""
    found = summed(seeds)
    ends = -np.inf if low is None else low, np.inf if high is None else high
    test = {
        "name": name, "says": f"{cell.replace('/', ', ')}: lead", "cells": [cell], "unit": "P(MOVE)",
        "region": [low, high], "effect": found.effect, "interval": found.interval and list(found.interval), "p": 0.01,
        "n": found.n, "seeds": seeds, "verdict": judgement.verdict(found.interval, *ends), "margins": {},
        "locked": 0.0, "saturated": False, "holm": "undecided",
    }  # fmt: skip
    judged = {"verdict": test["verdict"], "holm": "undecided", "saturated": False}
    return {
        "name": f"claim {name}", "section": "§1", "says": "…", "panel": "fig. 3 A", "complete": True,
        "shown": judged | {"tests": [test]}, "said": judged | {"tests": []}, "besides": [],
    }  # fmt: skip


def claims(cells: Mapping[str, Mapping[str, list[float]]]) -> list[dict[str, Any]]:
    """That the lead is at least .05 in each cell."""
    return [claim(cell, cell, effects["lead"], 0.05, None) for cell, effects in cells.items() if "lead" in effects]


def paper(effect: Effect) -> dict[str, dict[str, list[float]]]:
    """Effects of the published runs."""
    return {
        cell: {name: spread("published", cell, name, effect, SEEDS) for name in MEASURES}
        for cell in (f"{condition}/{reward}" for condition in ("free", "noisy") for reward in PAPER)
    }


def judged(effect: Effect) -> dict[str, Any]:
    """As reports/claims.json."""
    return {"results": "0" * 64, "level": LEVEL, "claims": claims(paper(effect))}


def made(study: Study, effect: Effect, published: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """As reports/studies/NAME.json."""
    variants = {}
    for name, own in study.variants.items():
        cells = {
            f"{condition}/{reward}": {
                measure: spread(name, f"{condition}/{reward}", measure, effect, study.seeds) for measure in MEASURES
            }
            for condition, reward in study.pairs(name)
        }
        probe = {f"r2_{condition}_{axis}": 0.9 for condition in ("free", "noisy") for axis in "xyz"}
        variants[name] = {
            "set": own.set,
            "published": {key: (published or {}).get(key, 1.0) for key in own.set},
            "seeds": study.seeds,
            "cells": cells,
            "probe": probe if any(key.startswith("collect") for key in own.set) else {},
            "claims": [] if study.space else claims(cells),
        }
    found = {"results": "1" * 64, "published": "2" * 64, "level": LEVEL, "variants": variants, "paper": paper(effect)}
    return found | ({"space": space(study)} if study.space else {})


def space(study: Study) -> dict[str, Any]:
    """A map on which claim 1 holds, as shown, in the upper half of the first constant; as said it fails everywhere."""
    keys, points = list(study.space), len(study.variants)
    first = [study.space[keys[0]].share(own.set[keys[0]]) >= 0.5 for own in study.variants.values()]
    shares = [0.6, 0.1, *[0.0] * (len(keys) - 2)]
    fit = {"q2": 0.7, "ceiling": 0.9, "noise": 0.1, "shares": shares, "pairs": [[0, 1, 0.05]]}
    words = {"shown": ["holds" if met else "fails" for met in first], "said": ["fails"] * points}
    share = {"shown": {"holds": 0.5, "fails": 0.3}, "said": {"holds": 0.0, "fails": 1.0}}
    bins = [len(own.of or ()) or 8 for own in study.space.values()]
    by = [[float(one >= bins[0] / 2) for one in range(bins[0])], *([0.5] * count for count in bins[1:])]
    tests = [
        fit | share[group] | {
            "claim": "1 one", "group": group, "name": "own", "says": "free, CAIS: lead", "unit": "P(MOVE)",
            "region": [0.05, None], "seeds": [[0.1] * study.seeds] * points, "points": words[group],
            "published": [0.1, 0.02, 0.13 if group == "shown" else 0.15],
        }
        for group in ("shown", "said")
    ]  # fmt: skip
    cells = {f"{condition}/{reward}" for name in study.variants for condition, reward in study.pairs(name)}
    main = [[0.0, 0.1] if own.of else [0.0] * 4 + [0.2] * 5 for own in study.space.values()]
    return {
        "tests": tests,
        "measures": {name: {cell: {"main": main} for cell in sorted(cells)} for name in study.measures},
        "verdicts": [
            {"claim": "1 one", "group": group, "points": words[group], "by": held} | share[group]
            for group, held in (("shown", by), ("said", [[0.0] * count for count in bins]))
        ],
        "together": {"holds": [0.5, 0.5, 0.0], "fails": [0.0, 0.7, 0.3]},
        "apart": [["1 one, as shown", "1 one, as said"]],
        "order": sorted(range(points), key=lambda place: (not first[place], place)),
    }  # fmt: skip


def explored(study: Study) -> dict[str, Any]:
    """As reports/studies/explore/NAME.json: in seed s, P(MOVE) of the limb is 0.5 + s / 16, of the others 0.25."""
    steps, rng = 80, np.random.default_rng(0)
    p = np.full((study.seeds, 2, steps), 0.25)
    p[:, 0] = 0.5 + np.arange(study.seeds)[:, None] / 16
    p[0, :, 0] = 0, 1
    noise = rng.normal(size=p.shape)
    return {
        "block": 1, "levels": numbers.LEVELS, "seeds": study.seeds, "steps": [step + 1.0 for step in range(steps)],
        "phases": {"baseline": [1, 20], "attached": [21, 60], "extinction": [61, 80]},
        "joints": ["attached limb", "other limbs"], "attached": [True, False],
        "cells": {
            f"{variant}/{condition}/{reward}": {
                "reward": numbers.packed(noise), "q_move": numbers.packed(noise), "move_probability": numbers.packed(p)
            }
            for variant in study.variants for condition, reward in study.pairs(variant)
        },
    }  # fmt: skip


def studies(**own: Mapping[str, Any]) -> Studies:
    """As `written`, with points in place of each variant that has some, as they are when loaded."""
    found = written(**own)
    return found.model_copy(
        update={"studies": {name: settings.spanned(PARAMS, it) for name, it in found.studies.items()}}
    )


def written(**own: Mapping[str, Any]) -> Studies:
    """Studies by name; what a study does not say is as little as can be."""
    least = {
        "title": "A title", "asks": "Does it?", "expects": "It does.", "limits": "Not here.", "seeds": 5,
        "measures": ["lead"], "cells": {"free": ["cais"]}, "variants": {"one": {"set": {}}},
    }  # fmt: skip
    titled = {name: least | {"title": f"Study {name}"} | dict(values) for name, values in own.items()}
    return Studies.model_validate({"effects": EFFECTS, "studies": titled})
