"""Stage figures, on fabricated runs and a tiny encoder."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.text import Text

from mimo.record import artifact
from mimo.settings import params
from mimo.vision import encoder, extractor
from stages.base import origin, paths, store
from stages.drawing import figures
from stages.page import captions

ROOT = Path(__file__).resolve().parents[3]
REDRAWN = ("fig1", "fig3", "reconstructions")  # with text, curves and images; the others take long and have the same
REDRAW = """
import sys
from mimo.record import artifact; from mimo.vision import encoder, extractor; from mimo.settings import params
from stages.drawing import figures; from stages.base import paths, store
results, held = artifact.read(paths.RESULTS, store.RESULTS), artifact.read(paths.ENCODER, extractor.SCHEMA)
plan = figures.plan(params.load(), results, held, artifact.read(paths.FRAMES, store.FRAME)["frames"])
for name in sys.argv[1:]:
    for kind, data in figures.files(plan[name]).items():
        path = paths.FIGURES / f"{name}.{kind}"
        path.unlink()
        path.write_bytes(data)
"""


def test_figures_are_the_same_bytes_in_another_process_whatever_the_users_matplotlibrc(copied: Path):
    drawn = {path.name: path.read_bytes() for path in (copied / paths.FIGURES).iterdir()}
    kinds = figures.METADATA
    assert set(drawn) == {origin.NAME, *(f"{name}.{kind}" for name in captions.CAPTIONS for kind in kinds)}
    rc = copied / "matplotlibrc"
    rc.write_text("lines.linewidth: 7\nsvg.fonttype: none\naxes.facecolor: red\n")
    environment = os.environ | {"PYTHONPATH": str(ROOT), "PYTHONHASHSEED": "7", "TZ": "Asia/Tokyo", "LC_ALL": "C"}
    subprocess.run([sys.executable, "-c", REDRAW, *REDRAWN], cwd=copied, env=environment, check=True)
    assert {path.name: path.read_bytes() for path in (copied / paths.FIGURES).iterdir()} == drawn
    assert not any(b"dc:date" in data or b"/CreationDate" in data for data in drawn.values())
    pdfs = [data for name, data in drawn.items() if name.endswith(".pdf")]
    assert all(b"/FontFile2" in data and b"/Type3" not in data for data in pdfs)  # fonts embedded, as TrueType


def test_reconstructions_are_small_and_of_frames_kept_from_the_training(project: Path, tiny: params.Params):
    svg = (project / paths.FIGURES / "reconstructions.svg").read_bytes()
    assert len(svg) < 400_000  # a trained encoder leaves less noise, and 200 kB
    held = artifact.read(project / paths.ENCODER, extractor.SCHEMA)
    frames = artifact.read(project / paths.FRAMES, store.FRAME)["frames"]
    figure = figures._reconstructions(tiny, held, frames)
    images = [np.asarray(ax.images[0].get_array()) for ax in figure.axes if ax.images]
    assert [image.shape for image in images] == [(128, 128, 3)] * 12
    assert svg.count(b"<image ") == 12
    first = round(tiny.collect.steps * (1 - tiny.collect.held_out))
    assert all((image == frames[regime, 0, first, 0]).all() for regime, image in enumerate(images[:4]))
    assert not any((with_skips == alone).all() for with_skips, alone in zip(images[4:8], images[8:], strict=True))
    texts = [text.get_text() for text in figure.findobj(Text)]
    assert [text for text in texts if "rope" in text] == [
        "free, rope off", "free, rope on", "noisy, rope off", "noisy, rope on",
    ]  # fmt: skip


def test_from_the_latent_alone_nothing_else_of_the_frame_counts(project: Path, tiny: params.Params):
    frame = artifact.read(paths.FRAMES, store.FRAME)["frames"][0, 0, :1, 0]
    net = encoder.frozen(tiny.encoder, extractor.load(artifact.read(paths.ENCODER, extractor.SCHEMA)).weights)
    h, skips = net.encode(encoder.images(frame))
    expected = net.decode(h, [0 * skip for skip in skips]).mul(255).round().byte().permute(0, 2, 3, 1).numpy()
    assert np.array_equal(encoder.reconstruct(net, frame, skips=False), expected)


def test_a_reward_that_was_not_run_leaves_a_note_in_its_place(project: Path):
    whole = artifact.read(project / paths.RESULTS, store.RESULTS)
    kept = {name: dataset for name, dataset in whole.datasets.items() if not name.startswith("free/rtl/")}
    part = replace(whole, datasets=kept)
    figure = figures._paper_figure(part, "free", "Free mobile")
    texts = [text.get_text() for ax in figure.axes for text in ax.texts]
    assert texts.count("not in this sweep") == 1
