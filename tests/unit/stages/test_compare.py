"""Stage compare, on fabricated runs: each variant's curves and verdicts are those of its own runs."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mimo.record import artifact
from stages import compare
from stages.base import console, paths, store
from stages.page import verdicts
from tests.unit.reported import SEEDS, VARIANTS


@pytest.fixture
def found(project: Path) -> dict[str, Any]:
    return json.loads(paths.VARIANT_CLAIMS.read_text())


def test_it_says_of_each_variant_what_it_asks_and_changes(found: dict[str, Any]) -> None:
    assert {name: (own["asks"], own["set"], own["seeds"]) for name, own in found["variants"].items()} == {
        name: (own["asks"], own["set"], SEEDS) for name, own in VARIANTS.items()
    }
    assert found["variants"]["gain_1"]["published"] == {"rewards.gain": 0.3}
    assert found["variants"]["heavy"]["published"] == {"world.mobile_mass": 0.03}


def test_a_variants_claims_are_those_that_its_cells_answer(found: dict[str, Any]) -> None:
    names = {name: [claim["name"][:2] for claim in own["claims"]] for name, own in found["variants"].items()}
    assert names == {"gain_1": ["1 ", "3 "], "heavy": ["4 "]}
    assert found["variants"]["heavy"]["claims"][0]["name"] == "4 perceptual rewards fail, noisy"


def test_the_variants_runs_are_judged_as_the_papers_are(found: dict[str, Any]) -> None:
    """Here they are the same runs."""
    published = json.loads(paths.CLAIMS.read_text())
    assert found["level"] == published["level"]
    own = {"claims": [claim for variant in found["variants"].values() for claim in variant["claims"]]}
    pairs = [pair for rows in verdicts.compared(published, {"all": own}).values() for pair in rows]
    assert len(pairs) >= 10
    for there, here in pairs:
        assert there and here
        assert {**here, "holm": ""} == {**there, "holm": ""}  # Holm's correction is over fewer tests


def test_the_curves_are_kept_by_variant(found: dict[str, Any]) -> None:
    held, results = (
        artifact.read(path, schema)
        for path, schema in ((paths.VARIANT_RESULTS, store.VARIANTS), (paths.RESULTS, store.RESULTS))
    )
    assert found["results"] == held.content
    assert {name.split("/")[0] for name in held.datasets} == {*VARIANTS, "windows"}
    for cell in ("gain_1/free/mtl", "heavy/noisy/mtl"):
        name = f"{cell}/move_probability/attached"
        assert held[name].shape == (SEEDS, 80)
        assert np.array_equal(held[name], results[name.partition("/")[2]])
    assert (held.about["limb"], held.about["seeds"]) == ("left_foot", SEEDS)


def test_it_is_the_same_bytes_again(copied: Path) -> None:
    files = [copied / paths.VARIANT_RESULTS, copied / paths.VARIANT_CLAIMS]
    before = [path.read_bytes() for path in files]
    compare.main()
    assert [path.read_bytes() for path in files] == before


def test_without_a_variants_manifest_it_says_what_to_do(copied: Path) -> None:
    paths.variant_manifest("heavy").unlink()
    with pytest.raises(
        console.StageError,
        match=r"heavy\.json is missing or damaged; run `dvc checkout` or `dvc repro studies/dvc\.yaml`",
    ):
        compare.main()
