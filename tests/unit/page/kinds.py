"""One study of each kind: what they ask, numbers whose effects are known, and their page."""

from collections.abc import Mapping
from typing import Any

from mimo.settings.studies import Studies
from stages.page import page
from tests.unit.page import fabricated

ASKED: dict[str, dict[str, Any]] = {  # one study of each kind
    "dose": {
        "axis": "conditions.noisy.force",
        "measures": ["lead", "burst"],
        "cells": {"noisy": ["mtl", "cais"]},
        "variants": {f"n{force}": {"set": {"conditions.noisy.force": float(force)}} for force in (0, 80)},
    },
    "asking": {
        "cells": {"free": ["cais"], "noisy": ["cais"]},
        "variants": {
            "lost": {"asks": "does it lose?", "set": {"rewards.gain": 1.0}},
            "kept": {"asks": "does it keep?", "set": {"outcomes.memory": 500}},
        },
    },
    "drawn": {"variants": {f"draw{draw}": {"set": {"collect.draw": draw}} for draw in (1, 2, 3)}},
    "mapped": {
        "seeds": 2,
        "cells": {"free": ["mtl"], "noisy": ["cais"]},
        "variants": {
            "p": {
                "set": {},
                "points": 8,
                "over": {
                    "rewards.gain": {"low": 0.1, "high": 1.0, "log": True},
                    "rewards.scale": {"of": ["resting", "running"]},
                },
            }
        },
    },
    "other": {"cells": {"noisy": ["mtl", "cais"]}, "variants": {"tied": {"set": {"protocol.limb": "right_foot"}}}},
}  # fmt: skip
WORLD = {"attached": [0.8, -0.004, 0.25], "others": 0.05}
LATENT = {"attached": [0.03, 0.02, 0.04], "others": 0.01, "ratio": 3.0}
JOINTS = {"mtl": WORLD, "rtl": WORLD, "latent": LATENT}
EFFECTS = {
    "steps": 100,
    "worlds": {
        "published": {"set": {}, "free": JOINTS, "noisy": JOINTS, "phases": {"mtl": 0.14, "rtl": -0.05}},
        "heavy": {
            "set": {"world.mobile_mass": 0.3}, "free": JOINTS, "noisy": JOINTS, "phases": {"mtl": 0.2, "rtl": 0.0},
        },
    },
}  # fmt: skip


def effect(variant: str, cell: str, measure: str) -> float:
    """The lead is .2; without noise .4, at 80 N 0; `lost` loses it; a draw more is .1 more."""
    changed = {"n0": 0.4, "n80": 0.0, "lost": -0.2, "draw1": 0.3, "draw2": 0.4, "draw3": 0.5}
    return changed.get(variant, 0.2)


def computed(asked: Studies) -> dict[str, dict[str, Any]]:
    published = {"conditions.noisy.force": 40.0, "rewards.gain": 0.3}
    return {name: fabricated.made(study, effect, published) for name, study in asked.studies.items()}


def written(asked: Studies, made: Mapping[str, dict[str, Any]]) -> str:
    explored = {name: fabricated.explored(asked.studies[name]) for name in made if name != "mapped"}
    return page.studies(asked, page.Beyond(dict(made), explored), fabricated.judged(effect), EFFECTS, [])
