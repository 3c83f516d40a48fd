"""`python -m stages.vary`: scales and runs of every variant into the store, and a manifest for each (see `--help`)."""

import argparse
import shutil
import sys
from collections.abc import Mapping
from functools import partial

from mimo.record import artifact
from mimo.settings import params, studies
from stages.base import console, paths, store
from stages.sweep import crew, scales, sweep


def main() -> None:
    """Compute what is missing of the variants, then write their manifests."""
    workers = crew.asked(argparse.ArgumentParser(prog="python -m stages.vary")).workers
    p = params.load()
    sweeps = studies.load(p).sweeps
    file = paths.ENCODER.read_bytes()
    held = artifact.from_bytes(file, store.ENCODER, source=paths.ENCODER)
    settings = {name: params.changed(p, variant.set) for name, variant in sweeps.variants.items()}
    sight = store.sight(held)
    digests = {name: scales.digest(own, sight) for name, own in settings.items()}
    _measure(p, held, settings, digests, workers)
    grids = {}
    for name, variant in sweeps.variants.items():
        own = scales.read(store.place(store.SCALE, digests[name]), digests[name])
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
    sight = store.sight(held)
    todo = {
        name: sweep.trained(held, p.encoder.latent_sd, settings[name])
        for digest, name in names.items()
        if not store.has(store.SCALE, digest, elsewhere=[paths.SCALES])
    }
    rests = {name: scales.rest_digest(settings[name], sight) for name in todo}
    acting = {
        name: partial(scales.record, settings[name], todo[name], sight)
        for digest, name in {digest: name for name, digest in rests.items()}.items()
        if not store.has(store.REST, digest)
    }
    if acting:
        steps = p.calibrate.steps * p.calibrate.worlds
        with console.Progress("Resting policy", len(acting) * steps, "agent steps") as progress:
            for _ in sweep.fill(store.REST, rests, acting, workers):
                progress.update(progress.done + steps)
    for name, trained in todo.items():
        record = artifact.read(store.place(store.REST, rests[name]), store.REST, rests[name])
        store.keep(store.SCALE, digests[name], scales.measure(settings[name], trained, sight, record))


def _drop_other_variants(names: set[str]) -> None:
    """Variants that left studies/params.yaml would else stay in data/variants, and in what hangs on it."""
    for folder in paths.VARIANTS.glob("*"):
        if folder.name not in names:
            shutil.rmtree(folder)


if __name__ == "__main__":
    sys.exit(console.main(main))
