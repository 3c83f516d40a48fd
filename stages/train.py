"""`python -m stages.train`: every run of the sweep into the store, and a manifest for each cell (see `--help`)."""

import argparse
import shutil
import sys

from mimo.settings import params
from stages.base import console, paths
from stages.sweep import crew, sweep


def main() -> None:
    """Compute the runs that are missing, then write the manifests."""
    workers = crew.asked(argparse.ArgumentParser(prog="python -m stages.train")).workers
    p = params.load()
    grid = sweep.grid(p)
    runs = sweep.complete({"": grid}, p.sweep.chunk, workers)
    _drop_other_cells(set(grid.cells))
    shutil.rmtree(paths.MANIFESTS, ignore_errors=True)
    for cell in grid.cells:
        sweep.write_manifest(paths.manifest(*cell), [run for run in runs if (run.condition, run.reward) == cell])


def _drop_other_cells(cells: set[tuple[str, str]]) -> None:
    """Cells that left the sweep would else stay in data/runs, and in what hangs on it."""
    for folder in paths.RUNS.glob("*/*"):
        if (folder.parent.name, folder.name) not in cells:
            shutil.rmtree(folder)


if __name__ == "__main__":
    sys.exit(console.main(main))
