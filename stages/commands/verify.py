"""`python -m stages.commands.verify` (`make verify`): compute some artifacts again, compare with the published ones.

The encoder at preview scale from the published frames (stages.trial), and a sample of the published runs, each at full
length. Says OK, or which artifact and which dataset differs first, and by how much. Nothing is written.
"""

import argparse
import random
import sys
from collections.abc import Mapping
from functools import partial
from pathlib import Path

import numpy as np

from mimo.record import artifact, identity
from mimo.settings import params
from mimo.world import body
from stages import catalogue, claims, trial
from stages.base import command, console, difference, paths, provenance, store
from stages.sweep import crew, curves, encoders, sweep
from stages.sweep.schedule import Chunk, Run

# Machines of another class need not give the same bytes: contacts amplify a last bit within some steps, and then
# actions differ. Measured: with another libm's sin and exp, actions part at step 20, and the means differ by .011.
MEANS = 0.05  # a run's P(MOVE), its mean over each phase, of the attached limb and of the others
TOLERANCE = 1e-3  # any other artifact's numbers, in units of their dataset's range
WITHIN = "within the tolerance"


def main() -> None:
    """Compute again, compare, say what was found."""
    options = _options()
    p = params.load()
    listed = _published()
    for path in (paths.FRAMES, paths.ENCODER, paths.SCALES):
        _as_published(path, listed[path])
    same_class = _same_class()
    found = {paths.TRIAL: _trial()} | _again(p, sample(listed, options.runs, options.draw), listed, options.workers)
    faults = []
    for path, data in found.items():
        told = compared(path, artifact.from_bytes(data, listed[path]["schema"]), listed[path]["content"], same_class)
        print(f"{path}: {told or 'the published bytes'}.")
        faults += [path] if told and not told.startswith(WITHIN) else []
    if told := claims.stale(p):
        print(told)
    if faults:
        raise console.StageError(f"{len(faults)} of {len(found)} artifacts are not the published ones.")
    print(f"OK: {len(found)} artifacts computed again.")


def sample(listed: catalogue.Published, size: int, draw: int) -> list[Path]:
    """Some of the paper's own runs, drawn by the seed `draw`."""
    runs = sorted(path for path in listed if path.is_relative_to(paths.RUNS))
    return sorted(random.Random(draw).sample(runs, min(size, len(runs))))


def compared(path: Path, found: artifact.Artifact, content: str, same_class: bool) -> str:
    """How an artifact that was computed again differs from the published one at `path`; empty if it does not.

    Begins with WITHIN if that is within what is allowed to a machine of another class.
    """
    if found.content == content:
        return ""
    if not path.exists() or (held := artifact.read(path, found.schema)).content != content:
        return "not the published one, which is not here to compare with (`dvc pull` and `dvc checkout` get it)"
    differences = list(difference.compare(held.datasets, found.datasets))
    if not differences:
        return "not the published one in what it says of itself, though in every number"
    first = difference.first(differences)
    if same_class:
        return f"not the published one: {first}"
    if held.schema == store.RUN:
        apart = float(np.abs(_means(held) - _means(found)).max())
        inside, measure = apart <= MEANS, f"{MEANS:g} of mean P(MOVE): {apart:.3f} apart"
    else:
        worst = max(each.relative for each in differences)
        inside, measure = worst <= TOLERANCE, f"{TOLERANCE:g} of a dataset's range: at most {worst:.1e} apart"
    return f"{WITHIN} {measure}; {first}" if inside else f"not the published one, nor {WITHIN} {measure}; {first}"


def _means(run: artifact.Artifact) -> np.ndarray:
    """(phase, 2): mean P(MOVE) of the attached limb, and of the others."""
    p = params.load()
    attached = body.attached(str(run.about["limb"]))
    moving = run["move_probability"]
    return np.array([[moving[s][:, own].mean() for own in (attached, ~attached)] for s in curves.phases(p).values()])


def _options() -> argparse.Namespace:
    parser = command.parser("verify", __doc__, "make verify", "python -m stages.commands.verify --runs 10 --draw 7")
    parser.add_argument("--runs", type=int, default=3, metavar="N", help="how many runs (default: %(default)s)")
    parser.add_argument("--draw", type=int, default=0, metavar="SEED", help="draws the sample (default: %(default)s)")
    return crew.asked(parser)


def _published() -> catalogue.Published:
    if not paths.ARTIFACTS.exists():
        raise console.StageError(f"{paths.ARTIFACTS} is missing, so nothing is published here; run `dvc repro`.")
    return catalogue.published(paths.ARTIFACTS.read_text(encoding="utf-8"))


def _as_published(path: Path, entry: Mapping[str, str]) -> None:
    """What the sample is computed from must be what is published."""
    if artifact.read(path, entry["schema"]).content != entry["content"]:
        raise console.StageError(f"{path} is not what {paths.ARTIFACTS} lists; run `dvc checkout` or `dvc repro`.")


def _same_class() -> bool:
    """Whether the same bytes are to be expected here; says why not."""
    if not paths.PUBLISHED_ON.exists():
        print(f"{paths.PUBLISHED_ON} is missing: taken for a machine of the same class.")
    foreign = provenance.foreign()
    if foreign:
        print(
            f"{foreign}: runs need agree to {MEANS:g} of mean P(MOVE) only, other artifacts to {TOLERANCE:g} of a "
            "dataset's range."
        )
    return not foreign


def _trial() -> bytes:
    p = trial.settings(params.load())
    frames = artifact.read(paths.FRAMES, store.FRAME)
    return encoders.encoder(p, frames, measured=False)


def _again(p: params.Params, chosen: list[Path], listed: catalogue.Published, workers: int | None) -> dict[Path, bytes]:
    """Each chosen run's file, computed again.

    Raises:
        console.StageError: the working tree's run is another one than the published, or computing it failed.
    """
    job = {"": sweep.grid(p)}
    wanted = {paths.run(run.condition, run.reward, run.seed): run for run in sweep.wanted(job)}
    todo = {}
    for path in chosen:
        if path not in wanted:
            raise console.StageError(f"{path} is published, but params.yaml asks for no such run; run `dvc repro`.")
        run = wanted[path]
        if run.digest != listed[path]["digest"] and _other_inputs(run.digest, path):
            raise console.StageError(
                f"{path}: params.yaml or the code asks for another run than the published one; "
                f"`python -m stages.commands.identify {path}` says which input changed."
            )
        todo[str(path)] = partial(_one, job, run)
    with console.Progress("Runs", len(todo), "runs") as progress:
        found = {}
        for name, made in sweep.each(todo, workers):
            found[Path(name)] = made.result
            progress.update(len(found))
    return dict(sorted(found.items()))


def _one(job: sweep.Job, run: Run) -> bytes:
    return sweep.work(job, Chunk((run,)), lambda steps: None)[0]


def _other_inputs(digest: str, path: Path) -> bool:
    """Whether more than the libraries' versions differs from what the published file was made from."""
    if not path.exists() or not isinstance(digest, identity.Digest):
        return True
    held = artifact.read(path, store.RUN).inputs
    if held is None:
        return True
    return identity.Digest(held | {"versions": {}}) != identity.Digest({**digest.inputs, "versions": {}})


if __name__ == "__main__":
    sys.exit(console.main(main))
