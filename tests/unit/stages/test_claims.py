"""Stage claims, on made curves whose verdicts are known; and reading curves back."""

import itertools
import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from mimo.record import artifact
from mimo.record.artifact import Dataset
from mimo.settings import params
from stages import claims
from stages.base import paths, store
from stages.page import verdicts
from stages.sweep.curves import curves_of, judged, phases_of

ROOT = Path(__file__).resolve().parents[3]
ABOUT: dict[str, str | int | float] = {
    "baseline_steps": 40,
    "attached_steps": 80,
    "extinction_steps": 40,
    "seeds": 3,
    "limb": "left_foot",
}
SEEDS, STEPS = 3, 160


def cell(rise: float) -> dict[str, np.ndarray]:
    """P(MOVE) of the attached limb rises by so much, a little more in each seed; nothing else does anything."""
    still = np.random.default_rng(0).normal(size=(SEEDS, STEPS)).astype(np.float32)
    p = np.full((SEEDS, STEPS), 0.3, np.float32)
    p[:, 40:120] += rise + 0.01 * np.arange(SEEDS, dtype=np.float32)[:, None]
    return {
        "locked": np.zeros_like(p),
        "move_probability/attached": p,
        "move_probability/others": np.full_like(p, 0.3),
        "q_move/attached": p,
        "q_move/others": np.full_like(p, 0.3),
        "q_rest/attached": still,
        "reward/all": still,
        "reward/attached": still,
        "displacement": still,
        "path_length": still,
        "latent_length": still,
    }


def write(path: Path, schema: str, cells: Mapping[str, dict[str, np.ndarray]]) -> artifact.Artifact:
    datasets = {
        f"{above}/{curve}": Dataset(values, "1", "seed, step")
        for above, curves in cells.items()
        for curve, values in curves.items()
    }
    datasets["windows/baseline"] = Dataset(np.array([1, 40]), "agent step, from 1", "first and last")
    artifact.write(path, schema, "made by a test", datasets, ABOUT)
    return artifact.read(path, schema)


def test_curves_and_phases_are_read_back(tmp_path: Path) -> None:
    held = write(tmp_path / "results.h5", store.RESULTS, {"free/mtl": cell(0.2), "noisy/rtl_surprise": cell(0.0)})
    assert phases_of(held) == {"baseline": slice(0, 40), "attached": slice(40, 120), "extinction": slice(120, 160)}
    found = curves_of(held)
    assert set(found) == {("free", "mtl"), ("noisy", "rtl_surprise")}
    assert set(found["free", "mtl"]) == set(cell(0.2))
    assert np.array_equal(found["free", "mtl"]["reward/all"], cell(0.2)["reward/all"])


def test_a_variants_curves_are_its_own(tmp_path: Path) -> None:
    held = write(tmp_path / "variants.h5", store.STUDY, {"gain_1/free/mtl": cell(0.2), "gain_10/free/cais": cell(0.0)})
    assert set(curves_of(held, "gain_1/")) == {("free", "mtl")}
    assert set(curves_of(held, "gain_10/")) == {("free", "cais")}
    names = {test["name"] for test in verdicts.primary(judged(held, "gain_1/"))}
    assert names == {"mtl_sharp", "mtl_rises", "mtl_grows", "free_mtl_p", "free_mtl_q"}
    assert judged(held, "gain/") == []


def test_claims_json_says_of_what_it_is_and_rounds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    listed(tmp_path)
    monkeypatch.chdir(tmp_path)
    held = write(paths.RESULTS, store.RESULTS, {"free/mtl": cell(0.2), "free/cais_surprise": cell(0.0)})
    claims.main()
    text = paths.CLAIMS.read_text()
    found = json.loads(text)
    assert (found["results"], found["level"]) == (held.content, 0.95)
    by_name = {claim["name"]: claim for claim in found["claims"]}
    learns = by_name["3 all learn, quiet"]
    assert (learns["complete"], learns["said"]["verdict"]) == (False, "undecided")
    assert [test["name"] for test in learns["shown"]["tests"]] == ["free_mtl_q"]
    (test,) = learns["said"]["tests"]
    assert (test["name"], test["seeds"]) == ("free_mtl_p", [0.2, 0.21, 0.22])
    assert (test["effect"], test["n"], test["verdict"], test["region"]) == (0.21, 3, "holds", [0.05, None])
    assert by_name["9 CAIS + Surprise learns"]["said"]["verdict"] == "fails"
    assert found["registration"]["why"] == "reports/registered.json cannot be read"
    claims.main()
    assert paths.CLAIMS.read_text() == text
    assert headlines() == {
        "shown": {"holds": 0, "fails": 3, "undecided": 1},
        "said": {"holds": 0, "fails": 2, "undecided": 2},
        "lead-free": {"mtl": 0.21, "cais_surprise": 0.01},
    }


def listed(project: Path) -> None:
    """The files that the stage reads besides the curves, with no run in any cell."""
    (project / "params.yaml").write_text((ROOT / "params.yaml").read_text())
    settings = params.load(project / "params.yaml").sweep
    for condition, reward in itertools.product(settings.conditions, settings.rewards):
        manifest = project / paths.manifest(condition, reward)
        manifest.parent.mkdir(parents=True, exist_ok=True)
        manifest.write_text("[]")


def headlines() -> dict[str, dict[str, float]]:
    return {path.stem: json.loads(path.read_text()) for path in paths.HEADLINE.iterdir()}


@pytest.mark.filterwarnings("ignore:.*confidence interval cannot be calculated")
def test_an_effect_that_is_no_number_is_null_and_undecided(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    listed(tmp_path)
    monkeypatch.chdir(tmp_path)
    flat = {name: np.zeros_like(values) for name, values in cell(0.0).items()}
    write(paths.RESULTS, store.RESULTS, {"free/rtl": flat})
    with np.errstate(invalid="ignore"):
        claims.main()
    found = json.loads(paths.CLAIMS.read_text())["claims"][0]["shown"]["tests"]
    test = next(test for test in found if test["name"] == "rtl_returns")
    assert (test["seeds"], test["effect"], test["verdict"]) == ([None] * 3, None, "undecided")
