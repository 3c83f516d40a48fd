"""Stage analyse, on fabricated runs whose outcome is known."""

import csv
import json
from pathlib import Path
from typing import Any

import pytest
import yaml

from mimo.record import artifact
from mimo.settings import params
from stages import analyse
from stages.base import console, paths, store
from tests.unit.reported import SEEDS


@pytest.fixture
def metrics(project: Path) -> dict[str, Any]:
    return json.loads(paths.METRICS.read_text())


def test_metrics_know_which_limb_moved_most(metrics: dict[str, Any]):
    free, noisy = (metrics["conditions"][condition]["cais_surprise"] for condition in ("free", "noisy"))
    late = free["move_probability"]["acquisition_late"]
    assert late["attached"] == {"mean": 0.8125, "sd": 0.0883883}
    assert late["others"] == {"mean": 0.25, "sd": 0.0}
    assert free["rise"] == {"mean": 0.5625, "sd": 0.0883883}
    assert (free["most_active"], free["seeds"]) == (2, 2)
    assert noisy["most_active"] == 0
    assert noisy["move_probability"]["acquisition_late"]["others"]["mean"] == pytest.approx((2 * 0.25 + 0.875) / 3)


def test_metrics_say_what_they_are_made_of(project: Path, metrics: dict[str, Any]):
    assert metrics["runs"] == 2 * 7 * SEEDS
    assert metrics["results"] == artifact.read(project / paths.RESULTS, store.RESULTS).content
    assert metrics["encoder"]["content"] == artifact.read(project / paths.ENCODER, "encoder").content
    assert metrics["encoder"]["r2_free_x"] == 0.987654
    assert metrics["scales"] == {"mtl": 0.008}
    assert metrics["windows"]["acquisition_late"] == {"first": 41, "last": 60}


def test_results_allow_the_statistics_to_be_redone(project: Path, metrics: dict[str, Any]):
    results = artifact.read(project / paths.RESULTS, store.RESULTS)
    first, last = results["windows/acquisition_late"]
    late = results["free/mtl/move_probability/attached"][:, first - 1 : last]
    assert late.shape == (SEEDS, 20)
    assert (
        late.mean() == metrics["conditions"]["free"]["mtl"]["move_probability"]["acquisition_late"]["attached"]["mean"]
    )
    assert results.about["limb"] == "left_foot"
    assert results.about["attached_steps"] == 40
    assert results.datasets["free/mtl/part/mtl/attached"].units == "m"
    assert results.datasets["free/mtl/path_length"].units == "m"


def test_plots_are_tidy_and_small(project: Path):
    for curve in analyse.PLOTTED:
        path = project / paths.PLOTS / f"{curve}.csv"
        assert path.stat().st_size < 500_000
        with path.open() as file:
            rows = list(csv.DictReader(file))
        assert list(rows[0]) == ["step", "phase", "condition", "reward", "group", "mean", "sd"]
        assert {row["condition"] for row in rows} == {"free", "noisy"}
    with (project / paths.PLOTS / "move_probability.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert {(row["step"], row["phase"]) for row in rows} >= {
        ("20", "baseline"), ("21", "attached"), ("60", "attached"), ("61", "extinction"),
    }  # fmt: skip
    row = next(row for row in rows if row["step"] == "30")
    assert row == {"step": "30", "phase": "attached", "condition": "free", "reward": "mtl", "group": "attached",
                   "mean": "0.8125", "sd": "0.0883883"}  # fmt: skip


def test_the_analysis_is_the_same_bytes_again(copied: Path):
    files = [copied / paths.RESULTS, copied / paths.METRICS, *sorted((copied / paths.PLOTS).iterdir())]
    before = [path.read_bytes() for path in files]
    analyse.main()
    assert [path.read_bytes() for path in files] == before


def test_a_run_of_another_length_is_refused(copied: Path, monkeypatch: pytest.MonkeyPatch):
    settings = yaml.safe_load((copied / "params.yaml").read_text())
    settings["protocol"]["baseline_steps"] = 21
    longer = params.Params.model_validate(settings)
    monkeypatch.setattr(params, "load", lambda: longer)
    with pytest.raises(console.StageError, match=r"seed-000\.h5 has 80 steps where params\.yaml asks for 81"):
        analyse.main()
