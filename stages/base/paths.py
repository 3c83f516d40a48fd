"""Every path of the pipeline, relative to the project's top folder."""

import os
import platform
from pathlib import Path

from mimo.settings.errors import Fault

PARAMS = Path("params.yaml")
READINGS = Path("docs/readings.md")
REGISTERED = Path("reports/registered.json")

FRAMES = Path("data/frames.h5")
ENCODER = Path("data/encoder.h5")
SCALES = Path("data/scales.h5")
MANIFESTS = Path("data/manifests")
RUNS = Path("data/runs")
RESULTS = Path("data/results.h5")
VARIANT_MANIFESTS = Path("data/variant-manifests")
VARIANTS = Path("data/variants")
TRIAL = Path("data/trial.h5")

ARTIFACTS = Path("reports/artifacts.json")
PUBLISHED_ON = Path("reports/published-on.json")
HEADLINE = Path("reports/headline")
METRICS = Path("reports/metrics.json")
ENCODER_METRICS = Path("reports/encoder.json")
CLAIMS = Path("reports/claims.json")
EXPLORE = Path("reports/explore.json")
PLOTS = Path("reports/plots")
FIGURES = Path("reports/figures")
FILMS = Path("reports/film")
REPORT = Path("reports/index.html")

STUDIES = Path("reports/studies.html")
STUDIES_ARTIFACTS = Path("reports/studies/artifacts.json")
EFFECTS = Path("reports/studies/effects.json")
STUDIES_NUMBERS = Path("reports/studies")
STUDIES_EXPLORE = Path("reports/studies/explore")

WORK = Path(".work")  # the store of a clone, and the preview
LOCK = WORK / "lock"  # of a folder, whatever store it uses
EXPERIMENTS = (".dvc", "tmp", "exps")  # where DVC makes copies of the project for temporary and queued experiments


class StoreError(Fault):
    """There can be no store where the user wants it."""


def store() -> Path:
    """Where finished artifacts lie by their digests, a folder a kind, with what else outlives an experiment's copy.

    It is MIMO_STORE where that is set, seen from the clone, else the clone's `.work`, which its worktrees and
    experiments share.

    Raises:
        StoreError: MIMO_STORE begins with another user's home, and there is no such user.
    """
    here = Path.cwd()
    clone = _clone(here)
    if own := os.environ.get("MIMO_STORE"):
        try:
            return clone / Path(own).expanduser()
        except RuntimeError as fault:
            raise StoreError(f"MIMO_STORE is {own!r}, and that home is not known; name another folder.") from fault
    return WORK if clone == here else clone / WORK


def log() -> Path:
    """Tracebacks."""
    return store() / "error.log"


def provenance() -> Path:
    """Where and when each artifact was computed."""
    return store() / "provenance.jsonl"


def renderer() -> Path:
    """What draws on this machine, by stages.commands.gl."""
    return store() / f"renderer-{platform.node()}.txt"


def progress() -> Path:
    """What stages at work are doing, a file each."""
    return store() / "progress"


def _clone(folder: Path) -> Path:
    """The clone that a project's folder was made from; itself, unless it is an experiment's copy or a git worktree."""
    for copy in (folder, *folder.parents):
        if copy.parts[-4:-1] == EXPERIMENTS:
            return _clone(copy.parents[3])
    link = folder / ".git"
    if link.is_file():  # of a worktree: it names the clone's .git/worktrees/NAME
        git = folder / os.fsdecode(link.read_bytes()).removeprefix("gitdir:").strip()
        common = git / "commondir"
        if common.is_file():
            top = (git / os.fsdecode(common.read_bytes()).strip()).resolve()
            return top.parent if top.name == ".git" else folder
    return folder


def made_by(path: Path) -> str:
    """The command that makes a file of data/ or reports/, as a sentence has it."""
    own = path.as_posix().startswith(("data/variant", "data/studies", "reports/studies"))
    return "`dvc repro studies/dvc.yaml`" if own else "`dvc repro`"


def manifest(condition: str, reward: str) -> Path:
    """The list of a cell's runs."""
    return MANIFESTS / f"{condition}-{reward}.json"


def variant_manifest(variant: str) -> Path:
    """The list of the runs of a variant, which is named `study/variant`."""
    return VARIANT_MANIFESTS / f"{variant}.json"


def variant_encoders(study: str) -> Path:
    """The list of the encoders of a study's variants that are not the paper's."""
    return VARIANT_MANIFESTS / study / "encoders.json"


def variant_encoder(variant: str) -> Path:
    """The encoder of a variant, if it is not the paper's."""
    return VARIANTS / variant / "encoder.h5"


def study(name: str) -> Path:
    """The curves of a study's variants."""
    return Path("data/studies") / f"{name}.h5"


def run(condition: str, reward: str, seed: int, variant: str = "") -> Path:
    """A published run, the paper's own or, of `study/variant`, a variant's."""
    top = VARIANTS / variant if variant else RUNS
    return top / condition / reward / f"seed-{seed:03d}.h5"
