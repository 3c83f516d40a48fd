"""`python -m stages.vary`: scales and runs of every variant into the store, and a manifest for each (see `--help`)."""

import argparse
import shutil
import sys
from collections.abc import Mapping
from functools import partial

from mimo.record import artifact
from mimo.settings import params, studies
from mimo.vision import encoder
from stages.base import console, paths, store
from stages.sweep import crew, scales, sweep


def main() -> None:
    """Compute what is missing of the variants, then write their manifests."""
    workers = crew.asked(argparse.ArgumentParser(prog="python -m stages.vary")).workers
    p = params.load()
    sweeps = studies.load(p).sweeps
    file = paths.ENCODER.read_bytes()
    held = artifact.from_bytes(file, encoder.SCHEMA, source=paths.ENCODER)
    settings = {name: params.changed(p, variant.set) for name, variant in sweeps.variants.items()}
    sight = store.sight(held)
    digests = {name: scales.digest(own, sight) for name, own in settings.items()}
    _measure(p, held, settings, digests, workers)
    grids = {}
    for name, variant in sweeps.variants.items():
        own = sweep.scales(store.place(store.SCALE, digests[name]), digests[name])
        grids[name] = sweep.Grid(settings[name], own, variant.pairs, sweeps.seeds)
    runs = sweep.complete(sweep.Job(file, p.encoder.latent_sd, grids), p.sweep.chunk, workers)
    _drop_other_variants(set(grids))
    shutil.rmtree(paths.VARIANT_MANIFESTS, ignore_errors=True)
    for name in grids:
        sweep.write_manifest(paths.variant_manifest(name), [run for run in runs if run.variant == name])


def _measure(
    p: params.Params,
    held: artifact.Artifact,
    settings: dict[str, params.Params],
    digests: Mapping[str, str],
    workers: int | None,
) -> None:
    """All scales that the store lacks; a variant that changes nothing they depend on finds the published ones."""
    names = {digest: name for name, digest in digests.items()}  # of variants with the same scales, one
    todo = {
        name: partial(
            scales.measure, settings[name], sweep.trained(held, p.encoder.latent_sd, settings[name]), store.sight(held)
        )
        for digest, name in names.items()
        if not store.has(store.SCALE, digest, elsewhere=[paths.SCALES])
    }
    if not todo:
        return
    steps = p.calibrate.steps * p.calibrate.worlds
    with console.Progress("Reward scales", len(todo) * steps, "agent steps") as progress:
        for _ in sweep.fill(store.SCALE, digests, todo, workers):
            progress.update(progress.done + steps)


def _drop_other_variants(names: set[str]) -> None:
    """Variants that left studies/params.yaml would else stay in data/variants, and in what hangs on it."""
    for folder in paths.VARIANTS.glob("*"):
        if folder.name not in names:
            shutil.rmtree(folder)


if __name__ == "__main__":
    sys.exit(console.main(main))
