"""`python -m stages.commands.identify FILE`: all that an artifact depends on, and whether the tree would make it so.

The exit code is 0 if it matches the tree, 1 if it does not; then the inputs that changed are named.
"""

import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from mimo.learning import experiment
from mimo.record import artifact, identity
from mimo.settings import params, studies
from mimo.settings.errors import Fault
from mimo.settings.params import Params
from stages import effects, trial
from stages.base import command, console, paths, store
from stages.sweep import encoders, scales

Inputs = Mapping[str, Any]


def main(arguments: list[str] | None = None) -> int:
    """Print what the artifact was made from, then how the working tree differs."""
    parser = command.parser("identify", __doc__, "python -m stages.commands.identify data/runs/free/mtl/seed-000.h5")
    parser.add_argument("artifact", type=Path, help="an HDF5 file of this project, under data/ or .work/")
    try:
        return identify(parser.parse_args(arguments).artifact)
    except Fault as fault:
        print(fault, file=sys.stderr)
        return 1


def identify(path: Path) -> int:
    """Print the file's inputs and whether they still hold; 0 if they do.

    Raises:
        Fault: the file or params.yaml cannot be trusted, or the file does not say what it was made from.
    """
    held = artifact.read(path, artifact.schema(path))
    if held.inputs is None:
        raise console.StageError(f"{path} does not say what it was made from; run {paths.made_by(path)}.")
    own = dict(flat(held.inputs))
    print(f"{path}: {held.schema}, digest {held.digest}, content {held.content}")
    for key, value in own.items():
        print(f"  {key}: {value}")
    known = TREE.get(held.schema)
    if known is None:
        raise console.StageError(f"{path} is of a kind ({held.schema}) that is not compared with the working tree.")
    trees = [dict(flat(inputs)) for inputs in known(held, path, params.load())]
    changes = min(([*changed(own, tree)] for tree in trees), key=len)
    if not changes:
        print("It matches the working tree.")
        return 0
    print(f"It does not match the working tree; what differs ({len(changes)}):")
    print(*(f"  {change}" for change in changes), sep="\n")
    return 1


def flat(inputs: Inputs, above: str = "") -> Iterator[tuple[str, Any]]:
    """Every leaf with its dotted key, but for a module's name, which has dots of its own."""
    for key, value in inputs.items():
        if isinstance(value, Mapping):
            yield from flat(value, f"{above}{key}.")
        else:
            yield f"{above}{key}", list(value) if isinstance(value, tuple) else value


def changed(own: Inputs, tree: Inputs) -> Iterator[str]:
    """A line for each input that differs between the file and the working tree."""
    for key in sorted(own.keys() | tree.keys()):
        if key not in tree:
            yield f"{key}: {own[key]} in the file, no input any more"
        elif key not in own:
            yield f"{key}: {tree[key]} in the working tree, no input of the file"
        elif identity.canonical(own[key]) != identity.canonical(tree[key]):
            yield f"{key}: {own[key]} in the file, {tree[key]} in the working tree"


def _runs(held: artifact.Artifact, path: Path, p: Params) -> Iterator[Inputs]:
    """As the paper's own run or as a variant's: the one that its place names, or, in the store, any."""
    assert held.inputs is not None
    sight = store.sight(artifact.read(paths.ENCODER, store.ENCODER))
    parts = path.resolve().parts
    variants = {"": p} | _variants(p)
    if paths.VARIANTS.name in parts:
        place = len(parts) - parts[::-1].index(paths.VARIANTS.name)
        name = "/".join(parts[place : place + 2])
        if name not in variants:
            raise console.StageError(f"{path} is of the variant {name!r}, which studies/params.yaml has no more.")
        variants = {name: variants[name]}
    elif not path.resolve().is_relative_to(paths.store().resolve()):
        variants = {"": p}
    for name, own in variants.items():
        other = paths.variant_encoder(name)
        eye = store.sight(artifact.read(other, store.ENCODER)) if name and other.exists() else sight
        digest = scales.digest(own, eye)
        scale = store.place(store.SCALE, digest) if name else paths.SCALES
        # A variant's scales may not have been measured here: then the file's are taken for right.
        found = scales.read(scale) if scale.exists() else held.inputs["scales"]
        cell = str(held.about["condition"]), str(held.about["reward"])
        # Whose mobile it was is the file's to say: a donor is a published run, and has inputs of its own.
        donor = {"donor": held.inputs["donor"]} if "donor" in held.inputs else {}
        yield experiment.inputs(own, *cell, eye, found) | {"seed": int(held.about["seed"])} | donor


def _variants(p: Params) -> dict[str, Params]:
    return {
        f"{study}/{name}": params.changed(p, variant.set)
        for study, own in studies.load(p).studies.items()
        for name, variant in own.variants.items()
    }


def _scales(held: artifact.Artifact, path: Path, p: Params) -> Iterator[Inputs]:
    sight = store.sight(artifact.read(paths.ENCODER, store.ENCODER))
    for name, own in ({"": p} | _variants(p)).items():
        other = paths.variant_encoder(name)
        eye = store.sight(artifact.read(other, store.ENCODER)) if name and other.exists() else sight
        yield scales.digest(own, eye).inputs


def _effects(held: artifact.Artifact, path: Path, p: Params) -> Iterator[Inputs]:
    sight = store.sight(artifact.read(paths.ENCODER, store.ENCODER))
    asked = studies.load(p).effects
    for own in (p, *(params.changed(p, values) for values in asked.alternatives.values())):
        yield effects.digest(own, asked, sight).inputs


def _frames(held: artifact.Artifact, path: Path, p: Params) -> Iterator[Inputs]:
    for own in _seeing(p):
        yield encoders.frames_digest(own).inputs


def _encoders(held: artifact.Artifact, path: Path, p: Params) -> Iterator[Inputs]:
    frames = artifact.read(paths.FRAMES, store.FRAME)
    yield encoders.digest(p, frames).inputs
    yield encoders.digest(trial.settings(p), frames, measured=False).inputs
    for own in _seeing(p):
        digest = encoders.frames_digest(own)
        if (place := store.place(store.FRAME, digest)).exists():
            yield encoders.digest(own, artifact.read(place, store.FRAME, digest)).inputs


def _seeing(p: Params) -> Iterator[Params]:
    """The published params, and those with which a variant's own encoder is made."""
    for own in (p, *_variants(p).values()):
        yield p.model_copy(update={"collect": own.collect})


def _curves(held: artifact.Artifact, path: Path, p: Params) -> Iterator[Inputs]:
    """Of results: the runs as they lie in data/."""
    assert held.inputs is not None
    listed = held.inputs["runs"]
    nested = {"": listed} if held.schema == store.RESULTS else listed
    above = "" if held.schema == store.RESULTS else f"{path.stem}/"
    found: dict[str, dict[str, str]] = {
        variant: {
            name: artifact.content(place) if (place := paths.run(*cell(name), above + variant)).exists() else "missing"
            for name in runs
        }
        for variant, runs in nested.items()
    }
    yield {**held.inputs, "runs": found[""] if held.schema == store.RESULTS else found}


def cell(name: str) -> tuple[str, str, int]:
    """Condition, reward and seed of a run named `condition/reward/seed`."""
    condition, reward, seed = name.split("/")
    return condition, reward, int(seed)


TREE: dict[str, Callable[[artifact.Artifact, Path, Params], Iterator[Inputs]]] = {
    store.RUN: _runs,
    store.SCALE: _scales,
    store.EFFECT: _effects,
    store.FRAME: _frames,
    store.ENCODER: _encoders,
    store.RESULTS: _curves,
    store.STUDY: _curves,
}


if __name__ == "__main__":
    sys.exit(main())
