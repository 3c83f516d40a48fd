"""Every path of the pipeline, relative to the project's top folder."""

from pathlib import Path

FRAMES = Path("data/frames.h5")
ENCODER = Path("data/encoder.h5")
SCALES = Path("data/scales.h5")
MANIFESTS = Path("data/manifests")
RUNS = Path("data/runs")
RESULTS = Path("data/results.h5")

METRICS = Path("reports/metrics.json")
ENCODER_METRICS = Path("reports/encoder.json")
PLOTS = Path("reports/plots")
FIGURES = Path("reports/figures")
REPORT = Path("reports/index.html")

STORE = Path(".work")  # content-addressed, one folder a kind
LOG = Path(".work/error.log")


def manifest(condition: str, reward: str) -> Path:
    """The list of a cell's runs."""
    return MANIFESTS / f"{condition}-{reward}.json"


def run(condition: str, reward: str, seed: int) -> Path:
    """A published run."""
    return RUNS / condition / reward / f"seed-{seed:03d}.h5"
