"""Stage compare, on fabricated runs: each variant's curves, effects and verdicts are those of its own runs."""

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from mimo.record import artifact
from mimo.science import measures
from mimo.settings import params, studies
from mimo.world import body
from stages.base import console, numbers, paths, store
from stages.page import verdicts
from tests.unit.reported import MEASURES, SEEDS, STEPS, STUDIES, compared, list_runs


def read(study: str) -> dict[str, Any]:
    return json.loads((paths.STUDIES_NUMBERS / f"{study}.json").read_text())


@pytest.fixture
def found(project: Path) -> dict[str, Any]:
    return read("constants")


def test_it_says_of_each_variant_what_it_changes(found: dict[str, Any]) -> None:
    variants = STUDIES["constants"]["variants"]
    assert {name: (own["set"], own["seeds"]) for name, own in found["variants"].items()} == {
        name: (own["set"], SEEDS) for name, own in variants.items()
    }
    assert found["variants"]["gain_1"]["published"] == {"rewards.gain": 0.3}
    assert found["variants"]["heavy"]["published"] == {"world.mobile_mass": 0.03}
    assert {name: [*own["cells"]] for name, own in found["variants"].items()} == {
        "gain_1": ["free/mtl"], "heavy": ["noisy/mtl"],
    }  # fmt: skip


def test_an_effect_is_what_the_fabricated_runs_say(found: dict[str, Any]) -> None:
    """P(MOVE) is .25; with the rope on the limb's is .75 and more if free, .5 and more, and a hand's .875, if noisy."""
    free, noisy = found["variants"]["gain_1"]["cells"]["free/mtl"], found["variants"]["heavy"]["cells"]["noisy/mtl"]
    rise = np.array([0.125 * seed for seed in range(SEEDS)])
    hand = body.attached("right_hand").sum() / (~body.attached("left_foot")).sum() * 0.625
    expected = {
        "limb": (0.5 + rise, 0.25 + rise),
        "others": (0 * rise, hand + 0 * rise),
        "lead": (0.5 + rise, 0.25 + rise - hand),
        "burst": (-0.5 - rise, -0.25 - rise),
        "burst_others": (0 * rise, -hand + 0 * rise),
    }
    for name, (first, second) in expected.items():
        assert free[name] == pytest.approx(first, abs=1e-6), name
        assert noisy[name] == pytest.approx(second, abs=1e-6), name


def test_there_are_the_measures_that_a_reward_allows(project: Path) -> None:
    of_influence = {"influence", "excess"}
    plain = {name for name, own in measures.MEASURES.items() if own.needs == "locked"}
    assert plain == measures.MEASURES.keys() - of_influence
    assert read("constants")["variants"]["gain_1"]["cells"]["free/mtl"].keys() == plain
    assert read("noise")["variants"]["n10"]["cells"]["noisy/cais"].keys() == measures.MEASURES.keys()


def test_the_papers_own_effects_stand_beside(found: dict[str, Any]) -> None:
    """Here the variants' runs are copies of them."""
    assert found["paper"]["free/mtl"] == found["variants"]["gain_1"]["cells"]["free/mtl"]
    assert found["paper"]["noisy/mtl"] == found["variants"]["heavy"]["cells"]["noisy/mtl"]
    assert found["published"] == artifact.read(paths.RESULTS, store.RESULTS).content


def test_a_variants_claims_are_those_that_its_cells_answer(found: dict[str, Any]) -> None:
    names = {name: [claim["name"][:2] for claim in own["claims"]] for name, own in found["variants"].items()}
    assert names == {"gain_1": ["1 ", "3 "], "heavy": ["4 "]}
    assert found["variants"]["heavy"]["claims"][0]["name"] == "4 perceptual rewards fail, noisy"


def test_the_variants_runs_are_judged_as_the_papers_are(found: dict[str, Any]) -> None:
    """Here they are the same runs."""
    published = json.loads(paths.CLAIMS.read_text())
    assert found["level"] == published["level"]
    judged = [claim for variant in found["variants"].values() for claim in variant["claims"]]
    there, own = (
        [((claim["name"], group, test["name"]), test) for claim in claims for group, test in verdicts.tests(claim)]
        for claims in (published["claims"], judged)
    )
    assert len(own) >= 10
    for name, here in own:
        assert {**here, "holm": ""} == {**dict(there)[name], "holm": ""}  # Holm's correction is over fewer tests


def test_the_curves_are_kept_by_variant(found: dict[str, Any]) -> None:
    held, results = (
        artifact.read(path, schema)
        for path, schema in ((paths.study("constants"), store.STUDY), (paths.RESULTS, store.RESULTS))
    )
    assert found["results"] == held.content
    assert {name.split("/")[0] for name in held.datasets} == {*STUDIES["constants"]["variants"], "windows"}
    for cell in ("gain_1/free/mtl", "heavy/noisy/mtl"):
        name = f"{cell}/move_probability/attached"
        assert held[name].shape == (SEEDS, STEPS)
        assert np.array_equal(held[name], results[name.partition("/")[2]])
    assert (held.about["limb"], held.about["seeds"]) == ("left_foot", SEEDS)


def test_the_explorer_has_the_limb_and_the_others(project: Path) -> None:
    found = json.loads((paths.STUDIES_EXPLORE / "constants.json").read_text())
    assert (found["seeds"], found["joints"], found["attached"]) == (
        SEEDS,
        ["attached limb", "other limbs"],
        [True, False],
    )
    assert [*found["cells"]] == ["gain_1/free/mtl", "heavy/noisy/mtl"]
    packed = found["cells"]["gain_1/free/mtl"]["move_probability"]
    assert (packed["low"], packed["high"]) == (0.25, 0.875)
    assert len(packed["text"]) == 2 * SEEDS * 2 * len(found["steps"])
    digits = np.array([numbers.PACKED.index(digit) for digit in packed["text"]]).reshape(-1, 2) @ [64, 1]
    values = (0.25 + 0.625 * digits / found["levels"]).reshape(SEEDS, 2, -1)
    limb = [[0.75 + 0.125 * seed if 20 < step <= 60 else 0.25 for step in found["steps"]] for seed in range(SEEDS)]
    assert values[:, 0] == pytest.approx(np.array(limb), abs=1e-3)
    assert values[:, 1] == pytest.approx(np.full_like(values[:, 1], 0.25), abs=1e-3)


def test_an_encoder_of_its_own_is_measured(copied: Path) -> None:
    assert all(own["probe"] == {} for own in read("constants")["variants"].values())
    shutil.copy(paths.ENCODER, paths.variant_encoder("constants/heavy"))
    compared("constants")
    probes = {name: own["probe"] for name, own in read("constants")["variants"].items()}
    assert probes == {"gain_1": {}, "heavy": numbers.rounded(MEASURES)}


def test_another_limb_is_the_one_that_counts(copied: Path) -> None:
    """In noise it is the right hand that moves most."""
    whole = yaml.safe_load(studies.PATH.read_text())
    whole["studies"]["noise"]["variants"]["n10"]["set"]["protocol.limb"] = "right_hand"
    studies.PATH.write_text(yaml.safe_dump(whole))
    compared("noise")
    limb = {name: own["cells"]["noisy/cais"]["limb"] for name, own in read("noise")["variants"].items()}
    assert limb == {"n10": pytest.approx([0.625, 0.625]), "n20": pytest.approx([0.25, 0.375])}


def add(name: str, **changes: Any) -> None:
    """A study like `constants`, whose variants' runs are the paper's of the same cells."""
    whole = yaml.safe_load(studies.PATH.read_text())
    whole["studies"][name] = STUDIES["constants"] | changes
    studies.PATH.write_text(yaml.safe_dump(whole))
    study = studies.study(params.load(), name)
    for variant in study.variants:
        own = f"{name}/{variant}"
        for condition, reward in study.pairs(variant):
            shutil.copytree(paths.RUNS / condition / reward, paths.VARIANTS / own / condition / reward)
        list_runs(study.pairs(variant), paths.variant_manifest(own), own)
    compared(name)


def test_seeds_begin_where_the_study_says(copied: Path, found: dict[str, Any]) -> None:
    add("later", variants={"gain_1": {"set": {"rewards.gain": 1.0}, "first": 1}}, seeds=1)
    own, whole = (made["variants"]["gain_1"] for made in (read("later"), found))
    assert own["seeds"] == 1
    assert json.loads((paths.STUDIES_EXPLORE / "later.json").read_text())["first"] == 1
    assert artifact.read(paths.study("later"), store.STUDY).about["first"] == 1
    assert own["cells"]["free/mtl"]["limb"] == whole["cells"]["free/mtl"]["limb"][1:] == pytest.approx([0.625])


def test_points_of_a_space_are_mapped(copied: Path) -> None:
    """With the same runs at all points claim 3 is met everywhere, or nowhere, as its effect lies."""
    over = {"rewards.gain": {"low": 0.1, "high": 1.0}, "rewards.scale": {"of": ["resting", "running"]}}
    cells = {"free": ["mtl", "rtl", "cais"]}
    add("map", cells=cells, variants={"p": {"set": {}, "points": 8, "over": over}})
    made, explored = read("map"), json.loads((paths.STUDIES_EXPLORE / "map.json").read_text())
    assert [*made["variants"]] == [f"p0{place}" for place in range(8)]
    assert all(own["claims"] == [] and own["published"]["rewards.gain"] == 0.3 for own in made["variants"].values())
    assert explored["cells"] == {}
    found = made["space"]
    assert {(own["claim"], own["group"]): own["holds"] for own in found["verdicts"]} == {
        ("1 perceptual rewards, quiet", "shown"): 0, ("1 perceptual rewards, quiet", "said"): 0,
        ("1b RTL follows the mobile", "shown"): 0, ("1b RTL follows the mobile", "said"): 0,
        ("3 all learn, quiet", "shown"): 0, ("3 all learn, quiet", "said"): 1,
    }  # fmt: skip
    own = next(test for test in found["tests"] if test["name"] == "free_mtl_p")
    assert own["seeds"] == [[0.5, 0.625]] * 8
    assert own["shares"] == pytest.approx([0, 0], abs=1e-6)
    assert found["measures"]["lead"]["free/cais"]["main"] == [
        pytest.approx([0.5625] * 9, abs=1e-3), pytest.approx([0.5625] * 2, abs=1e-3),
    ]  # fmt: skip
    assert found["order"] == list(range(8))


def test_cells_that_complete_no_claim_have_no_map(copied: Path) -> None:
    over = {"rewards.gain": {"low": 0.1, "high": 1.0}}
    with pytest.raises(console.StageError, match=r"studies\.map\.cells complete no claim"):
        add("map", cells={"noisy": ["cais"]}, variants={"p": {"points": 8, "over": over}})


def test_it_is_the_same_bytes_again(copied: Path) -> None:
    files = [
        paths.study("constants"),
        paths.STUDIES_NUMBERS / "constants.json",
        paths.STUDIES_EXPLORE / "constants.json",
    ]
    before = [path.read_bytes() for path in files]
    compared("constants")
    assert [path.read_bytes() for path in files] == before


def test_without_a_variants_manifest_it_says_what_to_do(copied: Path) -> None:
    paths.variant_manifest("constants/heavy").unlink()
    with pytest.raises(
        console.StageError,
        match=r"heavy\.json is missing or damaged; run `dvc checkout` or `dvc repro studies/dvc\.yaml`",
    ):
        compared("constants")
