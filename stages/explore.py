"""`python -m stages.explore`: reports/explore.json, every run's curves joint by joint, for the page's explorer.

Means over blocks of steps, each value in two base64 digits (DIGITS): 0 stands for a curve's least value, LEVELS for
its greatest.
"""

import itertools
import sys
from typing import Any

import numpy as np

from mimo.record import artifact, identity
from mimo.science import summary
from mimo.settings import params
from mimo.world import body
from mimo.world.protocol import MOVE
from stages.base import console, numbers, paths
from stages.sweep import curves

DIGITS = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/"
LEVELS = 64**2 - 1
CURVES = ("reward", "q_move", "move_probability")

Array = np.ndarray


def main() -> None:
    """Read every run of the sweep and keep what the explorer draws."""
    p = params.load()
    phases = curves.phases(p)
    width = summary.window(phases)
    pairs = list(itertools.product(p.sweep.conditions, p.sweep.rewards))
    found: dict[str, list[dict[str, Array]]] = {}
    contents = {}
    with console.Progress("Explorer", len(pairs) * p.sweep.seeds, "runs") as progress:
        for pair, run in curves.runs(p, pairs, p.sweep.seeds, progress):
            cell = found.setdefault("/".join(pair), [])
            contents[f"{'/'.join(pair)}/{len(cell)}"] = run.content
            joints = _joints(run, p.agent.temperature)
            cell.append({name: summary.blocks(values.T, phases, width)[1] for name, values in joints.items()})
    steps, _ = summary.blocks(np.zeros(phases["extinction"].stop), phases, width)
    limb = body.attached(p.protocol.limb)
    made: dict[str, Any] = {
        "runs": identity.Digest(contents),
        "block": width,
        "levels": LEVELS,
        "seeds": p.sweep.seeds,
        "steps": steps.tolist(),
        "phases": {name: [phase.start + 1, phase.stop] for name, phase in phases.items()},
        "joints": list(body.ACTUATED),
        "attached": limb.tolist(),
        "cells": {
            name: {curve: packed(np.stack([run[curve] for run in cell])) for curve in CURVES}
            for name, cell in found.items()
        },
    }
    numbers.write(made, paths.EXPLORE)


def packed(values: Array) -> dict[str, Any]:
    """An array as `low`, `high` and `text`: its values in C order, rounded to LEVELS equal steps from low to high."""
    low, high = numbers.rounded([float(values.min()), float(values.max())])
    levels = np.rint((values - low) / ((high - low) or 1) * LEVELS).clip(0, LEVELS).astype(int)
    digits = np.frombuffer(DIGITS.encode(), np.uint8)[np.stack([levels // 64, levels % 64], axis=-1)]
    return {"low": low, "high": high, "text": digits.tobytes().decode()}


def _joints(run: artifact.Artifact, temperature: float) -> dict[str, Array]:
    """(step, joint) by curve's name; Q in temperatures."""
    return {
        "reward": run["reward"],
        "q_move": run["q"][..., MOVE] / temperature,
        "move_probability": run["move_probability"],
    }


if __name__ == "__main__":
    sys.exit(console.main(main))
