"""`python -m stages.analyse`: from all runs to data/results.h5, reports/metrics.json and reports/plots/*.csv."""

import csv
import io
import json
import math
import sys
from collections.abc import Mapping
from typing import Any

import numpy as np

from mimo import analysis, artifact, body, identity, params
from stages import console, paths, store

ENCODER = "encoder"  # schema, as mimo.encoder names it; that loads torch
UNITS = {  # of the curves whose datasets in a run do not say it
    "q_move": "scaled reward",
    "q_advantage": "scaled reward",
    "limb": "1",
}
PART_UNITS = {"mtl": "m", "rtl": "h", "cais": "h", "surprise": "h"}
PLOTTED = ("move_probability", "reward", "q_move", "influence")
DIGITS = 6  # significant, in JSON and CSV

Cells = dict[tuple[str, str], dict[str, np.ndarray]]  # curves, (seed, step) by name, of each condition and reward


def main() -> None:
    """Read every run of the sweep, write what comes of them."""
    p = params.load()
    protocol = p.protocol
    phases = analysis.phases(protocol.baseline_steps, protocol.attached_steps, protocol.extinction_steps)
    windows = analysis.windows(phases)
    cells, units, runs = _read(p, phases["extinction"].stop)
    about = {
        "limb": protocol.limb,
        "seeds": p.sweep.seeds,
        "baseline_steps": protocol.baseline_steps,
        "attached_steps": protocol.attached_steps,
        "extinction_steps": protocol.extinction_steps,
    }
    digest = identity.digest({"runs": runs, "about": about})
    content = artifact.write(paths.RESULTS, store.RESULTS, digest, _datasets(cells, units, windows), about)

    held, scales = artifact.read(paths.ENCODER, ENCODER), artifact.read(paths.SCALES, store.SCALE)
    metrics: dict[str, Any] = {
        "runs": len(runs),
        "limb": protocol.limb,
        "results": content,
        "encoder": {"content": held.content} | _scalars(held, "measures/"),
        "scales": _scalars(scales),
        "windows": {name: {"first": w.start + 1, "last": w.stop} for name, w in windows.items()},
        "conditions": {condition: {} for condition in p.sweep.conditions},
    }
    for (condition, reward), stacked in cells.items():
        metrics["conditions"][condition][reward] = analysis.cell(stacked, windows, protocol.limb)
    text = json.dumps(rounded(metrics), indent=2, allow_nan=False) + "\n"
    artifact.publish(text.encode(), paths.METRICS)
    for curve in PLOTTED:
        artifact.publish(table(cells, curve, phases).encode(), paths.PLOTS / f"{curve}.csv")


def table(cells: Cells, curve: str, phases: Mapping[str, slice]) -> str:
    """A tidy CSV of one curve, a row for each block of steps, condition, reward and group of joints.

    Blocks are a hundredth of a run and never cross a phase's border; `step` is a block's middle, `sd` is over seeds and
    empty where there is one seed only.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["step", "condition", "reward", "group", "mean", "sd"])
    for (condition, reward), stacked in cells.items():
        for group in analysis.GROUPS:
            if f"{curve}/{group}" not in stacked:
                continue
            steps, means = analysis.blocks(stacked[f"{curve}/{group}"], phases, analysis.window(phases))
            for step, mean, sd in zip(steps, *analysis.mean_sd(means), strict=True):
                numbers = ["" if math.isnan(value) else rounded(float(value)) for value in (mean, sd)]
                writer.writerow([f"{step:g}", condition, reward, group, *numbers])
    return text.getvalue()


def rounded(value: Any) -> Any:
    """`value` with every float in it cut to DIGITS significant digits; -0.0 becomes 0.0."""
    if isinstance(value, float):
        return float(f"{value:.{DIGITS}g}") + 0.0
    if isinstance(value, dict):
        return {key: rounded(item) for key, item in value.items()}
    return value


def _read(p: params.Params, steps: int) -> tuple[Cells, dict[str, str], dict[str, str]]:
    """All runs' curves, stacked over seeds; the curves' units; each run's content hash by its name."""
    limbs = {limb: body.attached(limb) for limb in body.LIMB_JOINTS}
    cells: Cells = {}
    units: dict[str, str] = {}
    runs: dict[str, str] = {}
    total = len(p.sweep.conditions) * len(p.sweep.rewards) * p.sweep.seeds
    with console.Progress("Analysis", total, "runs") as progress:
        for condition in p.sweep.conditions:
            for reward in p.sweep.rewards:
                found = []
                for seed in range(p.sweep.seeds):
                    run = artifact.read(paths.run(condition, reward, seed), store.RUN)
                    record = {name: dataset.values for name, dataset in run.datasets.items()}
                    if len(record["reward"]) != steps:
                        raise console.StageError(
                            f"{run.path} has {len(record['reward'])} steps where params.yaml asks for {steps}; "
                            "run `dvc repro`."
                        )
                    found.append(analysis.curves(record, limbs, p.protocol.limb))
                    units |= {name: _unit(name, run) for name in found[-1]}
                    runs[f"{condition}/{reward}/{seed}"] = run.content
                    progress.update(len(runs))
                cells[condition, reward] = {name: np.stack([run[name] for run in found]) for name in found[0]}
    return cells, units, runs


def _datasets(cells: Cells, units: Mapping[str, str], windows: Mapping[str, slice]) -> dict[str, artifact.Dataset]:
    datasets = {
        f"{condition}/{reward}/{curve}": artifact.Dataset(values, units[curve], "seed, step")
        for (condition, reward), stacked in cells.items()
        for curve, values in stacked.items()
    }
    for name, steps in windows.items():
        ends = np.array([steps.start + 1, steps.stop])
        datasets[f"windows/{name}"] = artifact.Dataset(ends, "agent step, from 1", "first and last")
    return datasets


def _unit(curve: str, run: artifact.Artifact) -> str:
    """From the run's own dataset, unless that knows none."""
    start, _, rest = curve.partition("/")
    if start == "part":
        return PART_UNITS.get(rest.split("/")[0], "own units")
    return UNITS[start] if start in UNITS else run.datasets[start].units


def _scalars(held: artifact.Artifact, start: str = "") -> dict[str, float]:
    return {name[len(start) :]: float(held[name]) for name in held.datasets if name.startswith(start)}


if __name__ == "__main__":
    sys.exit(console.main(main))
