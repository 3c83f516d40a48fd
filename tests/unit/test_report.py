"""Stages analyse, figures and report, on fabricated runs whose outcome is known."""

import base64
import csv
import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from mimo import artifact, body, params
from mimo.artifact import Dataset
from stages import analyse, console, figures, paths, report, store

ROOT = Path(__file__).resolve().parents[2]
SEEDS = 2
LENGTHS = {"baseline_steps": 20, "attached_steps": 40, "extinction_steps": 20}
STEPS = sum(LENGTHS.values())
VOID = {"meta", "br", "img"}


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
    }
    datasets |= {f"part/{part}": Dataset(joints, "own units", "step, joint") for part in reward.split("_")}
    if "cais" in reward or "surprise" in reward:
        datasets["influence"] = Dataset(joints, "h", "step, joint")
    artifact.write(paths.run(condition, reward, seed), store.RUN, "fabricated by a test", datasets)


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder with params.yaml, fabricated runs, and what the three stages made of them."""
    folder = tmp_path_factory.mktemp("project")
    settings = yaml.safe_load((ROOT / "params.yaml").read_text())
    settings["protocol"] |= LENGTHS
    settings["sweep"]["seeds"] = SEEDS
    (folder / "params.yaml").write_text(yaml.safe_dump(settings))
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for condition in settings["sweep"]["conditions"]:
            for reward in settings["sweep"]["rewards"]:
                for seed in range(SEEDS):
                    fabricate(condition, reward, seed)
        curve = np.linspace(1, 0.1, 10, dtype=np.float32)
        measured = {f"curves/{name}": Dataset(curve, "1", "iteration") for name in ("reconstruction", "cltt")}
        measured |= {"measures/r2_free_x": Dataset(np.array(0.987654321), "1", "")}
        measured |= {"measures/cltt": Dataset(np.array(0.2), "1", "")}
        artifact.write(paths.ENCODER, "encoder", "fabricated by a test", measured)
        scale = {"mtl": Dataset(np.array(0.008), "m", "")}
        artifact.write(paths.SCALES, store.SCALE, "fabricated by a test", scale)
        for stage in (analyse, figures, report):
            stage.main()
        yield folder


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
    assert set(drawn) == {f"{name}.{kind}" for name in report.CAPTIONS for kind in ("svg", "png")}
    rc = project / "matplotlibrc"
    rc.write_text("lines.linewidth: 7\nsvg.fonttype: none\naxes.facecolor: red\n")
    environment = os.environ | {"PYTHONPATH": str(ROOT), "PYTHONHASHSEED": "7", "TZ": "Asia/Tokyo", "LC_ALL": "C"}
    subprocess.run([sys.executable, "-m", "stages.figures"], cwd=project, env=environment, check=True)
    rc.unlink()
    assert {path.name: path.read_bytes() for path in (project / paths.FIGURES).iterdir()} == drawn
    assert not any(b"dc:date" in data for data in drawn.values())


def test_a_reward_that_was_not_run_leaves_a_note_in_its_place(project: Path):
    whole = artifact.read(project / paths.RESULTS, store.RESULTS)
    kept = {name: dataset for name, dataset in whole.datasets.items() if not name.startswith("free/rtl/")}
    part = artifact.Artifact(whole.path, whole.schema, whole.digest, whole.content, whole.about, kept)
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
    assert "Formal tests of the paper's claims are not in this version." in text
    assert text.count(metrics["results"]) == 5  # tables and four figures
    assert "dvc repro figures" in text
    assert text.count("Line: mean over n = 2 seeds. Shaded: 1 SD over seeds.") == 4
    assert "sweep.rewards" in text


def test_the_page_is_the_same_bytes_again(project: Path, html: str):
    report.main()
    assert (project / paths.REPORT).read_text() == html


def test_without_figures_the_report_says_what_to_do(metrics: dict[str, Any], tmp_path: Path):
    with pytest.raises(console.StageError, match="run `dvc repro figures`"):
        report.figures(metrics, tmp_path, 0.3)


def test_what_a_name_holds_is_escaped(metrics: dict[str, Any]):
    bad = report.Constant("a", "<script>", "", "& more")
    assert "&lt;script&gt;" in report.page(metrics, [], [bad])


def test_constants_with_their_comments():
    lines = (
        "seed: 3 # ours: any",
        "a:",
        "  b: [1, 2] # m. paper §2.1; ours: more",
        "  c: '#no'",
        "  d:",
        "  - x",
        "  - y",
        "e: 1.0 # paper appendix",
    )
    assert report.constants("\n".join(lines)) == [
        report.Constant("seed", "3", "ours", "ours: any"),
        report.Constant("a.b", "1, 2", "paper and ours", "m. paper §2.1; ours: more"),
        report.Constant("a.c", "#no", "", ""),
        report.Constant("a.d", "x, y", "", ""),
        report.Constant("e", "1.0", "paper", "paper appendix"),
    ]


def test_every_constant_of_params_yaml_says_its_source():
    assert [
        constant.key for constant in report.constants((ROOT / "params.yaml").read_text()) if not constant.source
    ] == []


def test_numbers_as_people_write_them():
    assert report.number(-0.001) == "0.00"
    assert report.number(-0.26) == "−0.26"
    assert report.number(None) == "–"
    assert report.spread({"mean": 0.5, "sd": None}) == "0.50"
    assert analyse.rounded({"a": [1], "b": -0.0, "c": 0.12345678}) == {"a": [1], "b": 0.0, "c": 0.123457}
