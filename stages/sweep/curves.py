"""From published runs to curves stacked over seeds, to datasets, and back: of the paper's cells, or a variant's."""

import itertools
import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mimo.learning.rewards import REWARDS
from mimo.record import artifact
from mimo.science import analysis, claims, judgement
from mimo.settings.params import Params
from mimo.world import body
from mimo.world.protocol import PHASES
from stages.base import console, paths, store

UNITS = {  # of the curves whose datasets in a run do not say it
    "q_move": "temperature",
    "q_rest": "temperature",
    "limb": "1",
    "moved": "1",
    "locked": "1",
    "displacement": "m",
}

Cells = dict[tuple[str, str], dict[str, np.ndarray]]  # curves, (seed, step) by name, of each condition and reward


@dataclass(frozen=True)
class Stacked:
    """Curves of some cells, the curves' units, and each run's content hash by its name."""

    cells: Cells
    units: dict[str, str]
    runs: dict[str, str]


def phases(p: Params) -> dict[str, slice]:
    """The phases' steps."""
    return analysis.phases(p.protocol.baseline_steps, p.protocol.attached_steps, p.protocol.extinction_steps)


def about(p: Params, seeds: int) -> dict[str, str | int | float]:
    """What an artifact of curves says of itself."""
    lengths = {f"{name}_steps": getattr(p.protocol, f"{name}_steps") for name in PHASES}
    return {"limb": p.protocol.limb, "seeds": seeds} | lengths


def read(
    p: Params, pairs: Iterable[tuple[str, str]], seeds: range, progress: console.Progress, variant: str = ""
) -> Stacked:
    """The curves of some cells, of the paper or of a variant, whose params `p` then is; else as in `runs`."""
    limbs = {limb: body.attached(limb) for limb in body.LIMB_JOINTS}
    found: dict[tuple[str, str], list[dict[str, np.ndarray]]] = {}
    stacked = Stacked({}, {}, {})
    for pair, run in runs(p, pairs, seeds, progress, variant):
        record = {name: dataset.values for name, dataset in run.datasets.items()}
        curves = analysis.curves(record, limbs, p.protocol.limb, p.agent.temperature)
        cell = found.setdefault(pair, [])
        stacked.runs[f"{'/'.join(pair)}/{len(cell)}"] = run.content
        cell.append(curves)
        stacked.units.update({name: _unit(name, run) for name in curves})
    for pair, cell in found.items():
        stacked.cells[pair] = {name: np.stack([run[name] for run in cell]) for name in cell[0]}
    return stacked


def runs(
    p: Params, pairs: Iterable[tuple[str, str]], seeds: range, progress: console.Progress, variant: str = ""
) -> Iterator[tuple[tuple[str, str], artifact.Artifact]]:
    """The runs of some cells, a cell's in the order of seeds, each with its condition and reward.

    Args:
        p: for the protocol, which all variants share.
        pairs: condition and reward of each cell.
        seeds: of each.
        progress: counts runs.
        variant: empty for the paper's own.

    Raises:
        console.StageError: a run has another length than `p` asks for, or a manifest cannot be read.
        artifact.ArtifactError: a file is damaged, or not the run that the manifest lists for its place.
    """
    pairs = list(pairs)
    listed = digests({paths.variant_manifest(variant)} if variant else {paths.manifest(*pair) for pair in pairs})
    steps = phases(p)["extinction"].stop
    for pair, seed in itertools.product(pairs, seeds):
        path = paths.run(*pair, seed, variant)
        run = artifact.read(path, store.RUN, listed.get(path))
        if len(run["reward"]) != steps:
            raise console.StageError(
                f"{run.path} has {len(run['reward'])} steps where params.yaml asks for {steps}; "
                f"run {paths.made_by(path)}."
            )
        yield pair, run
        progress.update(progress.done + 1)


def datasets(stacked: Stacked, above: str = "") -> dict[str, artifact.Dataset]:
    """Every curve as `<above><condition>/<reward>/<curve>`."""
    return {
        f"{above}{condition}/{reward}/{curve}": artifact.Dataset(values, stacked.units[curve], "seed, step")
        for (condition, reward), cell in stacked.cells.items()
        for curve, values in cell.items()
    }


def ends(windows: Mapping[str, slice]) -> dict[str, artifact.Dataset]:
    """Every window as `windows/<name>`."""
    return {
        f"windows/{name}": artifact.Dataset(
            np.array([steps.start + 1, steps.stop]), "agent step, from 1", "first and last"
        )
        for name, steps in windows.items()
    }


def phases_of(held: artifact.Artifact) -> dict[str, slice]:
    """The phases' steps."""
    baseline, attached, extinction = (int(held.about[f"{name}_steps"]) for name in PHASES)
    return analysis.phases(baseline, attached, extinction)


def curves_of(held: artifact.Artifact, above: str = "") -> dict[tuple[str, str], dict[str, np.ndarray]]:
    """Curves, (seed, step) by name, of each condition and reward.

    Args:
        held: its datasets are `<above><condition>/<reward>/<curve>`, beside others.
        above: `<variant>/` for those of a variant.
    """
    found: dict[tuple[str, str], dict[str, np.ndarray]] = {}
    for name, dataset in held.datasets.items():
        parts = name.removeprefix(above).split("/", 2)
        if name.startswith(above) and len(parts) == 3:
            condition, reward, curve = parts
            found.setdefault((condition, reward), {})[curve] = dataset.values
    return found


def judged(held: artifact.Artifact, above: str = "") -> list[dict[str, Any]]:
    """The claims of mimo.science.claims with their verdicts, from an artifact of curves; `above` as in `curves_of`."""
    return judgement.evaluate(curves_of(held, above), analysis.windows(phases_of(held)), claims.CLAIMS)


def digests(manifests: Iterable[Path]) -> dict[Path, str]:
    """The digest of the run that belongs to each place."""
    found = {}
    for manifest in manifests:
        try:
            for run in json.loads(manifest.read_text(encoding="utf-8")):
                found[paths.run(run["condition"], run["reward"], run["seed"], run["variant"])] = run["digest"]
        except (OSError, ValueError, KeyError, TypeError) as fault:
            raise console.StageError(
                f"{manifest} is missing or damaged; run `dvc checkout` or {paths.made_by(manifest)}."
            ) from fault
    return found


def _unit(curve: str, run: artifact.Artifact) -> str:
    """From the run's own dataset, unless that knows none."""
    start, _, rest = curve.partition("/")
    if start == "part":
        return REWARDS[rest.split("/")[0]].unit
    return UNITS[start] if start in UNITS else run.datasets[start].units
