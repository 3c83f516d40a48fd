"""`python -m stages.train [--serial]`: every run of the sweep into the store, and a manifest for each cell."""

import argparse
import json
import shutil
import sys

from mimo import artifact, encoder, params
from stages import console, paths, store, sweep


def main() -> None:
    """Compute the runs that are missing, then write the manifests."""
    parser = argparse.ArgumentParser(prog="python -m stages.train")
    parser.add_argument("--serial", action="store_true", help="in this process, without Ray; the same bytes")
    serial = parser.parse_args().serial
    p = params.load()
    file = paths.ENCODER.read_bytes()
    held = artifact.from_bytes(file, encoder.SCHEMA, source=paths.ENCODER)
    scales = {name: float(data.values) for name, data in artifact.read(paths.SCALES, store.SCALE).datasets.items()}
    job = sweep.Job(p, file, scales)
    wanted = sweep.runs(job, held.content)
    todo = sweep.missing(wanted)
    print(f"{len(wanted)} runs, {len(wanted) - len(todo)} of them in the store.", flush=True)
    failed = sweep.compute(job, sweep.chunks(todo, p.sweep.chunk), serial) if todo else []
    if failed:
        raise console.StageError(
            "\n".join([*failed, f"{len(failed)} of {len(wanted)} runs failed; the others are kept."])
        )
    _drop_other_cells({(run.condition, run.reward) for run in wanted})
    shutil.rmtree(paths.MANIFESTS, ignore_errors=True)
    paths.MANIFESTS.mkdir(parents=True)
    for condition in p.sweep.conditions:
        for reward in p.sweep.rewards:
            cell = [run for run in wanted if (run.condition, run.reward) == (condition, reward)]
            listed = [
                {
                    "seed": run.seed,
                    "digest": run.digest,
                    "content": artifact.content(store.place(store.RUN, run.digest)),
                }
                for run in cell
            ]
            manifest = {"condition": condition, "reward": reward, "runs": listed}
            paths.manifest(condition, reward).write_text(json.dumps(manifest, indent=1) + "\n")


def _drop_other_cells(cells: set[tuple[str, str]]) -> None:
    """Cells that left the sweep would else stay in data/runs, and in what hangs on it."""
    for folder in paths.RUNS.glob("*/*"):
        if (folder.parent.name, folder.name) not in cells:
            shutil.rmtree(folder)


if __name__ == "__main__":
    sys.exit(console.main(main))
