"""`python -m stages.analyse`: from all runs to data/results.h5, reports/metrics.json and reports/plots/*.csv."""

import csv
import io
import itertools
import sys
from collections.abc import Mapping
from typing import Any

from mimo.record import artifact, identity
from mimo.science import analysis, summary
from mimo.settings import params
from stages.base import console, numbers, paths, provenance, store
from stages.sweep import curves

PLOTTED = ("move_probability", "reward", "q_move", "influence")


def main() -> None:
    """Read every run of the sweep, write what comes of them."""
    p = params.load()
    held, scales = artifact.read(paths.ENCODER, store.ENCODER), artifact.read(paths.SCALES, store.SCALE)
    phases = curves.phases(p)
    windows = analysis.windows(phases)
    pairs = list(itertools.product(p.sweep.conditions, p.sweep.rewards))
    with console.Progress("Analysis", len(pairs) * p.sweep.seeds, "runs") as progress:
        stacked = curves.read(p, pairs, range(p.sweep.seeds), progress)
    cells, about = stacked.cells, curves.about(p, p.sweep.seeds)
    digest = identity.Digest({"runs": stacked.runs, "about": about})
    content = artifact.write(
        paths.RESULTS, store.RESULTS, digest, curves.datasets(stacked) | curves.ends(windows), about
    )
    provenance.note(store.RESULTS, digest)
    metrics: dict[str, Any] = {
        "runs": len(stacked.runs),
        "limb": p.protocol.limb,
        "results": content,
        "encoder": {"content": held.content} | _scalars(held, "measures/"),
        "scales": _scalars(scales),
        "windows": {name: {"first": w.start + 1, "last": w.stop} for name, w in windows.items()},
        "conditions": {condition: {} for condition in p.sweep.conditions},
    }
    for (condition, reward), cell in cells.items():
        metrics["conditions"][condition][reward] = summary.cell(cell, windows, p.protocol.limb)
    numbers.write(metrics, paths.METRICS)
    for curve in PLOTTED:
        artifact.publish(table(cells, curve, phases).encode(), paths.PLOTS / f"{curve}.csv")


def table(cells: curves.Cells, curve: str, phases: Mapping[str, slice]) -> str:
    """A tidy CSV of one curve, a row for each block of steps, condition, reward and group of joints.

    Blocks are a hundredth of a run and never cross a phase's border; `step` is a block's middle, `sd` is over seeds and
    empty where there is one seed only.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["step", "phase", "condition", "reward", "group", "mean", "sd"])
    for (condition, reward), stacked in cells.items():
        for group in analysis.GROUPS:
            if f"{curve}/{group}" not in stacked:
                continue
            steps, means = summary.blocks(stacked[f"{curve}/{group}"], phases, summary.window(phases))
            for step, mean, sd in zip(steps, *summary.mean_sd(means), strict=True):
                values = [numbers.rounded(float(value)) for value in (mean, sd)]
                phase = next(name for name, steps in phases.items() if step <= steps.stop)
                writer.writerow([f"{step:g}", phase, condition, reward, group, *values])
    return text.getvalue()


def _scalars(held: artifact.Artifact, start: str = "") -> dict[str, float]:
    return {name[len(start) :]: float(held[name]) for name in held.datasets if name.startswith(start)}


if __name__ == "__main__":
    sys.exit(console.main(main))
