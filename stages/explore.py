"""`python -m stages.explore`: reports/explore.json, every run's curves joint by joint, for the page's explorer.

Means over blocks of steps, packed by stages.base.numbers.
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
        for pair, run in curves.runs(p, pairs, range(p.sweep.seeds), progress):
            cell = found.setdefault("/".join(pair), [])
            contents[f"{'/'.join(pair)}/{len(cell)}"] = run.content
            joints = _joints(run, p.agent.temperature)
            cell.append({name: summary.blocks(values.T, phases, width)[1] for name, values in joints.items()})
    steps, _ = summary.blocks(np.zeros(phases["extinction"].stop), phases, width)
    limb = body.attached(p.protocol.limb)
    made: dict[str, Any] = {
        "runs": identity.Digest(contents),
        "block": width,
        "levels": numbers.LEVELS,
        "seeds": p.sweep.seeds,
        "steps": steps.tolist(),
        "phases": {name: [phase.start + 1, phase.stop] for name, phase in phases.items()},
        "joints": list(body.ACTUATED),
        "attached": limb.tolist(),
        "cells": {
            name: {curve: numbers.packed(np.stack([run[curve] for run in cell])) for curve in CURVES}
            for name, cell in found.items()
        },
    }
    numbers.write(made, paths.EXPLORE)


def _joints(run: artifact.Artifact, temperature: float) -> dict[str, Array]:
    """(step, joint) by curve's name; Q in temperatures."""
    return {
        "reward": run["reward"],
        "q_move": run["q"][..., MOVE] / temperature,
        "move_probability": run["move_probability"],
    }


if __name__ == "__main__":
    sys.exit(console.main(main))
