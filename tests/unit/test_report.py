"""Stages analyse, claims, figures and report, on fabricated runs whose outcome is known."""

import base64
import csv
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from mimo import artifact, body, encoder, params
from mimo.artifact import Dataset
from mimo.encoder import Trained
from stages import analyse, claims, compare, console, figures, numbers, paths, report, store, verdicts

ROOT = Path(__file__).resolve().parents[2]
SEEDS = 2
LENGTHS = {"baseline_steps": 20, "attached_steps": 40, "extinction_steps": 20}
STEPS = sum(LENGTHS.values())
VOID = {"meta", "br", "img"}
MEASURES = {f"r2_{condition}_{axis}": 0.987654321 for condition in ("free", "noisy") for axis in "xyz"} | {"cltt": 0.2}


def fabricate(condition: str, reward: str, seed: int) -> None:
    """A test's run file: with the rope on, the attached foot moves most if free, the right hand if noisy."""
    p = np.full((STEPS, 12), 0.25, np.float32)
    on = slice(20, 60)
    p[on, body.attached("left_foot")] = (0.75 if condition == "free" else 0.5) + 0.125 * seed
    p[on, body.attached("right_hand")] = 0.25 if condition == "free" else 0.875
    joints = np.random.default_rng(seed).normal(size=(STEPS, 12)).astype(np.float32)
    datasets = {
        "move_probability": Dataset(p, "1", "step, joint"),
        "q": Dataset(np.stack([joints, joints + 1], axis=-1), "scaled reward", "step, joint, action"),
        "reward": Dataset(joints, "scaled reward", "step, joint"),
        "path_length": Dataset(joints[:, 0], "m", "step"),
        "latent_length": Dataset(joints[:, 1], "h", "step"),
        "centre_of_mass": Dataset(joints[:, :3], "m", "step, xyz"),
    }
    datasets |= {f"part/{part}": Dataset(joints, "own units", "step, joint") for part in reward.split("_")}
    if "cais" in reward or "surprise" in reward:
        datasets["influence"] = Dataset(joints, "h", "step, joint")
    digest = f"{condition}, {reward}, {seed}: fabricated by a test"
    artifact.write(paths.run(condition, reward, seed), store.RUN, digest, datasets)


def list_runs(condition: str, reward: str, manifest: Path, variant: str = "") -> None:
    """A cell's manifest, as stages.train and stages.vary write it."""
    runs = [
        {"variant": variant, "condition": condition, "reward": reward, "seed": seed,
         "digest": f"{condition}, {reward}, {seed}: fabricated by a test"}
        for seed in range(SEEDS)
    ]  # fmt: skip
    manifest.parent.mkdir(parents=True, exist_ok=True)
    manifest.write_text(json.dumps(runs))


@pytest.fixture(scope="module")
def project(
    tmp_path_factory: pytest.TempPathFactory,
    tiny: params.Params,
    collected: tuple[np.ndarray, np.ndarray],
    trained: Trained,
) -> Iterator[Path]:
    """A folder with params.yaml, fabricated runs, a tiny encoder, and what the four stages made of them."""
    folder = tmp_path_factory.mktemp("project")
    settings = yaml.safe_load((ROOT / "params.yaml").read_text())
    settings["protocol"] |= LENGTHS
    settings["sweep"]["seeds"] = settings["sweeps"]["seeds"] = SEEDS
    settings["sweeps"]["variants"] = {
        "gain_1": {"asks": "does it?", "set": {"rewards.gain": 1.0}, "cells": {"free": ["mtl"]}}
    }
    settings |= {"collect": tiny.collect.model_dump(), "encoder": tiny.encoder.model_dump(mode="json")}
    (folder / "params.yaml").write_text(yaml.safe_dump(settings))
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for condition in settings["sweep"]["conditions"]:
            for reward in settings["sweep"]["rewards"]:
                for seed in range(SEEDS):
                    fabricate(condition, reward, seed)
                list_runs(condition, reward, paths.manifest(condition, reward))
        list_runs("free", "mtl", paths.variant_manifest("gain_1"), "gain_1")
        encoder.save(trained, paths.ENCODER, "trained by a test", MEASURES)
        frames = {"frames": Dataset(collected[0], "1", "regime, world, step, frame, row, column, colour")}
        artifact.write(paths.FRAMES, store.FRAME, "collected by a test", frames)
        scale = {"mtl": Dataset(np.array(0.008), "m", "")}
        artifact.write(paths.SCALES, store.SCALE, "fabricated by a test", scale)
        shutil.copytree(paths.RUNS / "free/mtl", paths.VARIANTS / "gain_1/free/mtl")
        numbers.write(EFFECTS, paths.EFFECTS)
        for stage in (analyse, compare, claims, figures, report):
            stage.main()
        yield folder


SIZES = {"attached": [0.8, -0.004, 0.25], "others": 0.05}
JOINTS = {"mtl": SIZES, "rtl": SIZES, "latent": {"attached": [0.03, 0.02, 0.04], "others": 0.01, "ratio": 3.0}}
EFFECTS = {
    "steps": 100,
    "worlds": {
        "published": {"set": {}, "free": JOINTS, "noisy": JOINTS, "phases": {"mtl": 0.14, "rtl": -0.05}},
        "heavy": {
            "set": {"world.mobile_mass": 0.3}, "free": JOINTS, "noisy": JOINTS, "phases": {"mtl": 0.2, "rtl": 0.0},
        },
    },
}  # fmt: skip


@pytest.fixture
def judged(project: Path) -> dict[str, Any]:
    return json.loads((project / paths.CLAIMS).read_text())


@pytest.fixture
def metrics(project: Path) -> dict[str, Any]:
    return json.loads((project / paths.METRICS).read_text())


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
        assert list(rows[0]) == ["step", "condition", "reward", "group", "mean", "sd"]
        assert {row["condition"] for row in rows} == {"free", "noisy"}
    with (project / paths.PLOTS / "move_probability.csv").open() as file:
        row = next(row for row in csv.DictReader(file) if row["step"] == "30")
    assert row == {"step": "30", "condition": "free", "reward": "mtl", "group": "attached",
                   "mean": "0.8125", "sd": "0.0883883"}  # fmt: skip


def test_the_analysis_is_the_same_bytes_again(project: Path):
    files = [project / paths.RESULTS, project / paths.METRICS, *sorted((project / paths.PLOTS).iterdir())]
    before = [path.read_bytes() for path in files]
    analyse.main()
    assert [path.read_bytes() for path in files] == before


def test_a_run_of_another_length_is_refused(project: Path, monkeypatch: pytest.MonkeyPatch):
    settings = yaml.safe_load((project / "params.yaml").read_text())
    settings["protocol"]["baseline_steps"] = 21
    longer = params.Params.model_validate(settings)
    monkeypatch.setattr(params, "load", lambda: longer)
    with pytest.raises(console.StageError, match=r"seed-000\.h5 has 80 steps where params\.yaml asks for 81"):
        analyse.main()


def test_figures_are_the_same_bytes_in_another_process_whatever_the_users_matplotlibrc(project: Path):
    drawn = {path.name: path.read_bytes() for path in (project / paths.FIGURES).iterdir()}
    assert set(drawn) == {f"{name}.{kind}" for name in report.CAPTIONS for kind in figures.METADATA}
    rc = project / "matplotlibrc"
    rc.write_text("lines.linewidth: 7\nsvg.fonttype: none\naxes.facecolor: red\n")
    environment = os.environ | {"PYTHONPATH": str(ROOT), "PYTHONHASHSEED": "7", "TZ": "Asia/Tokyo", "LC_ALL": "C"}
    subprocess.run([sys.executable, "-m", "stages.figures"], cwd=project, env=environment, check=True)
    rc.unlink()
    assert {path.name: path.read_bytes() for path in (project / paths.FIGURES).iterdir()} == drawn
    assert not any(b"dc:date" in data or b"/CreationDate" in data for data in drawn.values())
    pdfs = [data for name, data in drawn.items() if name.endswith(".pdf")]
    assert all(b"/FontFile2" in data and b"/Type3" not in data for data in pdfs)  # fonts embedded, as TrueType


def test_reconstructions_are_small_and_of_frames_kept_from_the_training(
    project: Path, tiny: params.Params, collected: tuple[np.ndarray, np.ndarray]
):
    svg = (project / paths.FIGURES / "reconstructions.svg").read_bytes()
    assert len(svg) < 400_000  # a trained encoder leaves less noise, and 200 kB
    held = artifact.read(project / paths.ENCODER, encoder.SCHEMA)
    figure = figures._reconstructions(tiny, held, collected[0])
    texts, *pictures = figure.axes
    images = [np.asarray(ax.images[0].get_array()) for ax in pictures]
    assert [image.shape for image in images] == [(128, 128, 3)] * 12
    assert svg.count(b"<image ") == 12
    first = round(tiny.collect.steps * (1 - tiny.collect.held_out))
    assert all((image == collected[0][regime, 0, first, 0]).all() for regime, image in enumerate(images[:4]))
    assert not any((with_skips == alone).all() for with_skips, alone in zip(images[4:8], images[8:], strict=True))
    assert [text.get_text() for text in texts.texts] == [
        "input", "reconstruction", "from h alone",
        "free, rope off", "free, rope on", "noisy, rope off", "noisy, rope on",
    ]  # fmt: skip


def test_from_the_latent_alone_nothing_else_of_the_frame_counts(
    tiny: params.Params, trained: Trained, pairs: np.ndarray
):
    net = encoder.Extractor(tiny.encoder, trained).net
    frame = pairs[:1, 0]
    h, skips = net.encode(encoder.images(frame))
    expected = net.decode(h, [0 * skip for skip in skips]).mul(255).round().byte().permute(0, 2, 3, 1).numpy()
    assert np.array_equal(figures._from_latent(net, frame), expected)


def test_a_reward_that_was_not_run_leaves_a_note_in_its_place(project: Path):
    whole = artifact.read(project / paths.RESULTS, store.RESULTS)
    kept = {name: dataset for name, dataset in whole.datasets.items() if not name.startswith("free/rtl/")}
    part = replace(whole, datasets=kept)
    figure = figures._paper_figure(part, "free", "Free mobile")
    texts = [text.get_text() for ax in figure.axes for text in ax.texts]
    assert texts.count("not in this sweep") == 1


class Page(HTMLParser):
    """Every tag closed in order; collects attributes and text."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.attributes: list[tuple[str, str, str | None]] = []
        self.text = ""
        self.feed(html)
        self.close()
        assert not self.open

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.attributes += [(tag, name, value) for name, value in attrs]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data


@pytest.fixture(scope="module")
def html(project: Path) -> str:
    return (project / paths.REPORT).read_text()


def test_the_page_holds_every_figure(project: Path, html: str):
    pictures = [value or "" for tag, name, value in Page(html).attributes if (tag, name) == ("img", "src")]
    held = [base64.b64decode(picture.removeprefix("data:image/svg+xml;base64,")) for picture in pictures]
    assert held == [(project / paths.FIGURES / f"{name}.svg").read_bytes() for name in report.CAPTIONS]


def test_the_page_loads_nothing(html: str):
    links = [value or "" for _, name, value in Page(html).attributes if name in {"src", "href", "srcset", "data"}]
    assert all(link.startswith(("data:", "#")) for link in links)
    assert {link[1:] for link in links if link.startswith("#")} <= set(re.findall(r'id="([^"]+)"', html))
    without = re.sub(r"data:image[^\"]+", "", html)
    assert not re.search(r"https?:|url\(|@import|<script", without)


def test_the_page_says_numbers_and_where_they_are_from(html: str, metrics: dict[str, Any]):
    text = " ".join(Page(html).text.split())
    assert "0.81 ± 0.09" in text
    assert "2 of 2" in text
    assert text.count(metrics["results"]) == 6  # claims, tables and four figures
    assert "dvc repro figures" in text
    assert text.count("Line: mean over n = 2 seeds. Shaded: 1 SD over seeds.") == 4
    assert "learn from the last 200 transitions" in text
    assert "an R² of 0.99 (free, x), 0.99 (free, y), 0.99 (free, z), 0.99 (noisy, x)" in text
    assert "sweep.rewards" in text


def test_the_page_is_the_same_bytes_again(project: Path, html: str):
    report.main()
    assert (project / paths.REPORT).read_text() == html


def test_without_figures_the_report_says_what_to_do(metrics: dict[str, Any], tiny: params.Params, tmp_path: Path):
    with pytest.raises(console.StageError, match="run `dvc repro figures`"):
        report.figures(metrics, tmp_path, tiny)


def test_without_claims_the_report_says_what_to_do(project: Path):
    held = project / paths.CLAIMS
    held.rename(held.with_suffix(".away"))
    with pytest.raises(console.StageError, match=r"reports/claims\.json cannot be read .*; run `dvc repro`"):
        report.main()
    held.with_suffix(".away").rename(held)


def test_what_a_name_holds_is_escaped(metrics: dict[str, Any], judged: dict[str, Any]):
    bad = report.Constant("a", "<script>", "", "& more")
    assert "&lt;script&gt;" in report.page(metrics, judged, {}, EFFECTS, [], [bad])


def rows(html: str, section: str) -> list[list[str]]:
    """The cells' texts of a section's table rows, heads left out."""
    part = re.search(f'<section id="{section}">.*?</section>', html, re.DOTALL)
    assert part
    found = re.findall(r"<tr>(<td.*?)</tr>", re.sub(r"<svg.*?</svg>|<br>", " ", part[0], flags=re.DOTALL), re.DOTALL)
    return [[" ".join(Page(cell).text.split()) for cell in re.findall(r"<td.*?</td>", row, re.DOTALL)] for row in found]


def test_every_claim_stands_on_the_page_with_its_tests(html: str, judged: dict[str, Any]):
    found = rows(html, "claims")
    tests = [test for claim in judged["claims"] for test in claim["tests"]]
    assert len(tests) > 40
    assert [row[:2] for row in found] == [
        *([claim["name"], claim["verdict"]] for claim in judged["claims"]),
        *(
            [test["says"], test["verdict"] if test in claim["tests"] else ""]
            for claim in judged["claims"]
            for test in claim["tests"] + claim["afterwards"]
        ),
    ]
    text = " ".join(Page(html).text.split())
    for claim in judged["claims"]:
        assert f"{claim['says']} Paper {claim['section']}, {claim['panel']}" in text
    assert html.index('id="claims"') < html.index('id="results"')
    assert '<a href="#fig3">3 C</a>, <a href="#fig4">4 C</a>' in html


def test_a_tests_row_says_effect_interval_region_unit_and_seeds(html: str, judged: dict[str, Any]):
    claim = next(claim for claim in judged["claims"] if claim["name"].startswith("9"))
    test = next(test for test in claim["tests"] if test["name"] == "free_cais_surprise_p")
    row = next(row for row in reversed(rows(html, "claims")) if row[0] == test["says"])
    assert row == [test["says"], "holds", "0.562", "[0.500, 0.625]", "≥ 0.05 P(MOVE)", "2", ""]
    assert "<title>0.500, 0.625</title>" in html


def test_the_effects_of_every_world_are_on_the_page(html: str):
    sizes = "0.80 0.00 0.25 | 0.05"
    assert rows(html, "fair") == [
        ["published", *[sizes] * 4, "3.0", "3.0", "0.14, −0.05"],
        ["heavy world.mobile_mass 0.3", *[sizes] * 4, "3.0", "3.0", "0.20, 0.00"],
    ]


def test_a_variants_verdicts_reach_the_page(html: str):
    assert "What decides" in html
    assert "gain_1" in html


def test_variants_stand_beside_the_published_runs(metrics: dict[str, Any], judged: dict[str, Any]):
    claim = judged["claims"][0]
    test = claim["tests"][0]
    other = test | {"effect": -0.25, "interval": [-0.5, 0.25], "verdict": "fails"}
    own = {"asks": "does it?", "set": {"rewards.gain": 1.0}, "published": {"rewards.gain": 0.3}, "seeds": 5}
    variants = {
        "gain_1": own | {"claims": [claim | {"tests": [other], "complete": False}]},
        "other": own | {"claims": []},
    }
    html = report.page(metrics, judged, variants, EFFECTS, [], [])
    assert "gain_1: does it? rewards.gain 1.0 in place of 0.3" in " ".join(Page(html).text.split())
    region = "≥ 0.5, SD over steps"
    published = f"{numbers.number(test['effect'], 3)} {verdicts.interval(test['interval'])} {test['verdict']}"
    assert rows(html, "decides") == [[f"{test['says']} {region}", published, "−0.250 [−0.500, 0.250] fails", ""]]
    links = [value for _, name, value in Page(html).attributes if name == "href"]
    assert "#decides" in links
    assert "#fig3" not in links  # there is no such figure on this page
