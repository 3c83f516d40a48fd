"""A study from its encoders to the catalogue, small: what is computed, what is shared, what is published where.

Fabricated numbers, and what compare makes of them: test_compare.py.
"""

import importlib
import json
import shutil
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
import yaml

from mimo.record import artifact
from mimo.settings import params, studies
from mimo.settings.files import ParamsError
from mimo.settings.params import Params
from stages import catalogue
from stages.base import console, overlay, paths, provenance, store
from stages.commands import identify
from stages.sweep import encoders, scales

ROOT = Path(__file__).parents[3]
STUDY: dict[str, Any] = {
    "title": "Own",
    "asks": "?",
    "expects": "?",
    "limits": "?",
    "seeds": 2,
    "measures": ["lead"],
    "cells": {"free": ["mtl"]},
    "variants": {
        "same": {"set": {}},
        "greedy": {"set": {"rewards.gain": 2.0}},
        "draw": {"set": {"collect.draw": 1}},
        "draw_greedy": {"set": {"collect.draw": 1, "rewards.gain": 2.0}},
        "yoked": {"set": {}, "yoked": "cais"},
    },
}

Project = tuple[Path, Counter[str]]  # and how many artifacts of each schema were computed for the study


def stage(name: str, *given: str) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("sys.argv", [name, *given])
        importlib.import_module(f"stages.{name}").main()


def ask(study: dict[str, Any]) -> None:
    """Have studies/params.yaml ask this alone."""
    whole = yaml.safe_load((ROOT / studies.PATH).read_text())
    studies.PATH.parent.mkdir(exist_ok=True)
    studies.PATH.write_text(yaml.safe_dump(whole | {"studies": {"own": study}}))


def computed() -> Counter[str]:
    return Counter(line["schema"] for line in provenance.lines())


@pytest.fixture(scope="module")
def made(tiny: Params, tmp_path_factory: pytest.TempPathFactory) -> Project:
    """The paper's results, then the study's."""
    top = tmp_path_factory.mktemp("vary") / "project"
    top.mkdir()
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(top)
        paths.PARAMS.write_text(yaml.safe_dump(tiny.model_dump(mode="json")))
        shutil.copy(ROOT / overlay.FILES[paths.PARAMS], ".")
        ask(STUDY)
        for name in ("collect", "encoder", "calibrate"):
            stage(name)
        stage("train", "--serial")
        for manifest in sorted(paths.MANIFESTS.glob("*.json")):
            stage("runs", str(manifest))
        stage("analyse")
        before = computed()
        stage("vary", "own", "--serial")
        stage("runs", str(paths.VARIANT_MANIFESTS / "own"))
        stage("compare", "own")
        stage("catalogue", "studies")
        return top, computed() - before


@pytest.fixture
def project(made: Project, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy to work in."""
    shutil.copytree(made[0], tmp_path / "project")
    monkeypatch.chdir(tmp_path / "project")
    return tmp_path / "project"


def listed(variant: str) -> list[dict[str, Any]]:
    return json.loads(paths.variant_manifest(f"own/{variant}").read_text())


def test_what_variants_have_in_common_is_computed_once(made: Project) -> None:
    """One draw's frames, encoder, record and scales serve two variants; the others have the paper's."""
    assert made[1] == {store.FRAME: 1, store.ENCODER: 1, store.REST: 1, store.SCALE: 1, store.RUN: 8, store.STUDY: 1}


def test_a_variant_that_changes_nothing_has_the_papers_runs(project: Path) -> None:
    paper = [run["digest"] for run in json.loads(paths.manifest("free", "mtl").read_text())]
    assert [run["digest"] for run in listed("same")] == paper
    assert all(run["digest"] not in paper for name in STUDY["variants"] if name != "same" for run in listed(name))
    for seed in range(2):
        one, other = (paths.run("free", "mtl", seed, variant) for variant in ("", "own/same"))
        assert one.read_bytes() == other.read_bytes()


def test_an_encoder_that_is_a_variants_own_is_published_beside_its_runs(project: Path) -> None:
    own = {path.as_posix() for path in paths.VARIANTS.rglob("encoder.h5")}
    assert own == {f"data/variants/own/{name}/encoder.h5" for name in ("draw", "draw_greedy")}
    (seen,) = {Path(path).read_bytes() for path in own}
    assert seen != paths.ENCODER.read_bytes()
    sight = store.sight(artifact.read(paths.variant_encoder("own/draw"), store.ENCODER))
    for name in ("draw", "draw_greedy"):
        inputs = artifact.read(paths.run("free", "mtl", 0, f"own/{name}"), store.RUN).inputs
        assert inputs and inputs["encoder"] == sight


def test_a_yoked_infant_is_under_the_mobile_of_the_next_seed(project: Path) -> None:
    for seed in range(2):
        inputs = artifact.read(paths.run("free", "mtl", seed, "own/yoked"), store.RUN).inputs
        assert inputs and inputs["donor"] == artifact.content(paths.run("free", "cais", 1 - seed))


def test_a_variant_that_left_the_study_leaves_data(project: Path) -> None:
    ask(STUDY | {"variants": {name: own for name, own in STUDY["variants"].items() if name != "greedy"}})
    before = computed()
    stage("vary", "own", "--serial")
    assert computed() == before
    left = {*STUDY["variants"]} - {"greedy"}
    assert {path.name for path in (paths.VARIANTS / "own").iterdir()} == left
    assert {path.stem for path in (paths.VARIANT_MANIFESTS / "own").iterdir()} == {*left, "encoders"}


def test_a_study_that_is_not_there_is_refused(project: Path) -> None:
    for name in ("vary", "compare"):
        with pytest.raises(ParamsError, match=r"^There is no study 'onw' in studies/params\.yaml; known are own\.$"):
            stage(name, "onw")


def test_a_measure_that_is_not_there_is_refused(project: Path) -> None:
    ask(STUDY | {"measures": ["lead", "laed"]})
    with pytest.raises(
        console.StageError, match=r"^studies/params\.yaml: studies\.own\.measures has 'laed'; known are lead, lead_q, "
    ):
        stage("compare", "own")


# Publishing from the store.

REMEDY = (
    r"get them by `make fetch` or `dvc repro --pull studies/dvc\.yaml`, or compute them, and nothing else that is "
    r"missing, by `dvc repro --single-item --force studies/dvc\.yaml:vary@own studies/dvc\.yaml:variants@own`\.$"
)


@pytest.mark.parametrize("kind", ["run", "encoder"])
def test_what_the_store_lacks_is_said_with_what_costs_least(kind: str, project: Path) -> None:
    if kind == "run":
        store.place(store.RUN, listed("yoked")[1]["digest"]).unlink()
    else:
        own = json.loads(paths.variant_encoders("own").read_text())
        store.place(store.ENCODER, own["own/draw"]["digest"]).unlink()
    shutil.rmtree(paths.VARIANTS)
    lacking = {"run": 1, "encoder": 2}[kind]  # the encoder is two variants'
    with pytest.raises(
        console.StageError, match=rf"lacks {lacking} of 12 artifacts of data/variant-manifests/own; {REMEDY}"
    ):
        stage("runs", str(paths.VARIANT_MANIFESTS / "own"))
    assert not paths.VARIANTS.exists()


def test_what_is_published_already_need_not_be_in_the_store(project: Path) -> None:
    before = {path: path.read_bytes() for path in paths.VARIANTS.rglob("*.h5")}
    for folder in ("runs", "encoders"):
        shutil.rmtree(paths.store() / folder)
    stage("runs", str(paths.VARIANT_MANIFESTS / "own"))
    assert {path: path.read_bytes() for path in paths.VARIANTS.rglob("*.h5")} == before


def test_another_content_than_is_listed_is_not_published(project: Path) -> None:
    file = paths.variant_encoders("own")
    file.write_text(file.read_text().replace(artifact.content(paths.variant_encoder("own/draw")), "0" * 64))
    with pytest.raises(console.StageError, match=rf"\.h5 is not what data/variant-manifests/own lists; {REMEDY}"):
        stage("runs", str(paths.VARIANT_MANIFESTS / "own"))


# The catalogue, and what each artifact says of itself.


def test_the_catalogue_has_the_studys_curves_encoders_and_runs(project: Path) -> None:
    found = catalogue.published(paths.STUDIES_ARTIFACTS.read_text())
    kinds = Counter(entry["schema"] for entry in found.values())
    assert kinds == {store.STUDY: 1, store.ENCODER: 2, store.RUN: 10}
    assert {path for path, entry in found.items() if entry["schema"] == store.ENCODER} == {
        paths.variant_encoder(f"own/{name}") for name in ("draw", "draw_greedy")
    }
    for path, entry in found.items():
        assert artifact.content(path) == entry["content"]


def test_every_artifact_of_a_study_matches_the_tree_that_made_it(
    project: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    p = params.load()
    own = params.changed(p, STUDY["variants"]["draw"]["set"])
    sight = store.sight(artifact.read(paths.variant_encoder("own/draw"), store.ENCODER))
    files = [
        paths.run("free", "mtl", 1, "own/yoked"),
        paths.run("free", "mtl", 0, "own/draw_greedy"),
        store.place(store.RUN, listed("draw")[0]["digest"]),
        paths.variant_encoder("own/draw"),
        store.place(store.FRAME, encoders.frames_digest(own)),
        store.place(store.SCALE, scales.digest(own, sight)),
        paths.study("own"),
    ]
    for file in files:
        assert identify.main([str(file)]) == 0, file
        assert capsys.readouterr().out.endswith("It matches the working tree.\n")


def test_what_changed_is_named_for_a_variants_encoder(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    ask(STUDY | {"variants": {"draw": {"set": {"collect.draw": 1}}}})
    whole = yaml.safe_load(paths.PARAMS.read_text())
    whole["encoder"]["tau"] = 9.0
    paths.PARAMS.write_text(yaml.safe_dump(whole))
    assert identify.main([str(paths.variant_encoder("own/draw"))]) == 1
    assert capsys.readouterr().out.endswith(
        "what differs (1):\n  params.encoder.tau: 0.5 in the file, 9.0 in the working tree\n"
    )
