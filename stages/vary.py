"""`python -m stages.vary STUDY`: scales and runs of a study's variants into the store, and a manifest for each."""

import argparse
import json
import shutil
import sys
from collections.abc import Iterable, Mapping
from functools import partial

from mimo.learning import experiment
from mimo.record import artifact
from mimo.settings import params, studies
from mimo.vision import collect, extractor
from stages.base import console, paths, store
from stages.sweep import crew, encoders, scales, sweep


def main() -> None:
    """Compute what is missing of the study, then write its manifests."""
    parser = argparse.ArgumentParser(prog="python -m stages.vary")
    parser.add_argument("study", help="a name in studies/params.yaml")
    asked = crew.asked(parser)
    p = params.load()
    study = studies.study(p, asked.study)
    settings = {f"{asked.study}/{name}": params.changed(p, own.set) for name, own in study.variants.items()}
    files = {name: _encoder(p, own) for name, own in settings.items()}
    measured = _scales(p, files, settings, asked.workers)
    grids = {}
    for name, (variant, own) in zip(settings, study.variants.items(), strict=True):
        pairs = study.pairs(variant)
        donors = _donors(p, own.yoked, pairs, study.numbers()) if own.yoked else {}
        grids[name] = sweep.Grid(
            settings[name], measured[name], files[name], p.encoder.latent_sd, pairs, study.numbers(), donors
        )
    runs = sweep.complete(grids, p.sweep.chunk, asked.workers)
    _drop_other_variants(asked.study, set(study.variants))
    shutil.rmtree(paths.VARIANT_MANIFESTS / asked.study, ignore_errors=True)
    for name in grids:
        sweep.write_manifest(paths.variant_manifest(name), [run for run in runs if run.variant == name])
    _list_encoders(asked.study, files)


def _encoder(p: params.Params, variant: params.Params) -> bytes:
    """The file of what a variant's agents see by: the published encoder, unless `collect` is another."""
    own = p.model_copy(update={"collect": variant.collect})
    if own.collect == p.collect:
        return paths.ENCODER.read_bytes()
    made = encoders.frames_digest(own)
    if not store.has(store.FRAME, made):
        total = len(collect.REGIMES) * own.collect.worlds * own.collect.steps
        with console.Progress("Frames", total, "agent steps") as progress:
            store.keep(store.FRAME, made, encoders.frames(own, progress.update))
    frames = artifact.read(store.place(store.FRAME, made), store.FRAME, made)
    digest = encoders.digest(own, frames)
    if not store.has(store.ENCODER, digest):
        with console.Progress("Encoder", own.encoder.iterations, "iterations") as progress:
            store.keep(store.ENCODER, digest, encoders.encoder(own, frames, progress=progress.update))
    return store.place(store.ENCODER, digest).read_bytes()


def _scales(
    p: params.Params, files: Mapping[str, bytes], settings: Mapping[str, params.Params], workers: int | None
) -> dict[str, dict[str, float]]:
    """By variant; those that differ in rewards and outcome models alone are measured on one record."""
    held = {file: artifact.from_bytes(file, store.ENCODER, source=paths.ENCODER) for file in set(files.values())}
    sights = {name: store.sight(held[file]) for name, file in files.items()}
    digests = {name: scales.digest(own, sights[name]) for name, own in settings.items()}
    todo = {
        name: sweep.trained(held[files[name]], p.encoder.latent_sd, settings[name])
        for digest, name in {digest: name for name, digest in digests.items()}.items()
        if not store.has(store.SCALE, digest, elsewhere=[paths.SCALES])
    }
    _record({name: settings[name] for name in todo}, todo, sights, workers)
    tasks = {}
    for name, trained in todo.items():
        rest = scales.rest_digest(settings[name], sights[name])
        record = artifact.read(store.place(store.REST, rest), store.REST, rest)
        tasks[name] = partial(scales.measure, settings[name], trained, sights[name], record)
    if tasks:
        with console.Progress("Scales", len(tasks), "variants") as progress:
            for _ in sweep.fill(store.SCALE, digests, tasks, workers):
                progress.update(progress.done + 1)
    return {name: scales.read(store.place(store.SCALE, digest), digest) for name, digest in digests.items()}


def _record(
    settings: Mapping[str, params.Params],
    trained: Mapping[str, extractor.Trained],
    sights: Mapping[str, str],
    workers: int | None,
) -> None:
    """The resting policy's records that the store lacks."""
    rests = {name: scales.rest_digest(own, sights[name]) for name, own in settings.items()}
    todo = {
        name: partial(scales.record, settings[name], trained[name], sights[name])
        for digest, name in {digest: name for name, digest in rests.items()}.items()
        if not store.has(store.REST, digest)
    }
    steps = {name: settings[name].calibrate.steps * settings[name].calibrate.worlds for name in todo}
    if todo:
        with console.Progress("Resting policy", sum(steps.values()), "agent steps") as progress:
            for name in sweep.fill(store.REST, rests, todo, workers):
                progress.update(progress.done + steps[name])


def _donors(
    p: params.Params, reward: str, pairs: tuple[tuple[str, str], ...], seeds: Iterable[int]
) -> dict[tuple[str, int], experiment.Donor]:
    """Whose mobile each yoked infant is under: the published run of the next seed, which has another's noise.

    Raises:
        console.StageError: donors' rope may not have held.
    """
    if p.world.rope_holds < 1:
        raise console.StageError("Donors' rope always holds; yoked infants need world.rope_holds: 1.0 in params.yaml.")
    found = {}
    for condition in dict.fromkeys(condition for condition, _ in pairs):
        for seed in seeds:
            other = (seed + 1) % p.sweep.seeds
            run = artifact.read(paths.run(condition, reward, other), store.RUN)
            acted = (run[name].astype(bool) for name in ("action", "positive"))
            found[condition, seed] = experiment.Donor(run.content, other, *acted)
    return found


def _drop_other_variants(study: str, names: set[str]) -> None:
    """Variants that left the study would else stay in data/variants, and in what hangs on it."""
    for folder in (paths.VARIANTS / study).glob("*"):
        if folder.name not in names:
            shutil.rmtree(folder)


def _list_encoders(study: str, files: Mapping[str, bytes]) -> None:
    """The variants' encoders that are not the paper's, for stages.runs to publish."""
    published, listed = paths.ENCODER.read_bytes(), {}
    for name, file in files.items():
        if file != published:
            held = artifact.from_bytes(file, store.ENCODER)
            listed[name] = {"digest": held.digest, "content": held.content}
    artifact.publish(f"{json.dumps(listed, indent=1)}\n".encode(), paths.variant_encoders(study))


if __name__ == "__main__":
    sys.exit(console.main(main))
