"""Every path of the pipeline, relative to the project's top folder."""

from pathlib import Path

PARAMS = Path("params.yaml")

FRAMES = Path("data/frames.h5")
ENCODER = Path("data/encoder.h5")
SCALES = Path("data/scales.h5")
MANIFESTS = Path("data/manifests")
RUNS = Path("data/runs")
RESULTS = Path("data/results.h5")
VARIANT_MANIFESTS = Path("data/variant-manifests")
VARIANTS = Path("data/variants")
VARIANT_RESULTS = Path("data/variants.h5")
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
VARIANT_CLAIMS = Path("reports/studies/variants.json")

STORE = Path(".work")  # content-addressed, one folder a kind
LOG = STORE / "error.log"
LOCK = STORE / "lock"
PROVENANCE = STORE / "provenance.jsonl"
RENDERER = STORE / "renderer.txt"  # what draws, by stages.commands.gl


def made_by(path: Path) -> str:
    """The command that makes a file of data/ or reports/, as a sentence has it."""
    own = path.as_posix().startswith(("data/variant", "reports/studies"))
    return "`dvc repro studies/dvc.yaml`" if own else "`dvc repro`"


def manifest(condition: str, reward: str) -> Path:
    """The list of a cell's runs."""
    return MANIFESTS / f"{condition}-{reward}.json"


def variant_manifest(variant: str) -> Path:
    """The list of a variant's runs."""
    return VARIANT_MANIFESTS / f"{variant}.json"


def run(condition: str, reward: str, seed: int, variant: str = "") -> Path:
    """A published run, the paper's own or a variant's."""
    top = VARIANTS / variant if variant else RUNS
    return top / condition / reward / f"seed-{seed:03d}.h5"
