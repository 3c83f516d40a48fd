"""The film: what is replayed is the run, to the bit; what is drawn is the replay; browsers can play the file."""

import io
import json
import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest
import torch
from PIL import Image

from mimo.learning import experiment
from mimo.learning.replay import Replay, replay
from mimo.record import artifact
from mimo.record.artifact import Artifact
from mimo.science import analysis
from mimo.settings import params
from mimo.settings.params import Params
from mimo.vision.collect import REGIMES
from mimo.vision.encoder import UNet
from mimo.vision.extractor import LEVELS, Extractor, Trained
from mimo.world import scene
from mimo.world.eye import Eye
from mimo.world.scene import Scene
from stages.base import console, paths, store
from stages.drawing import film, sheet, video
from stages.drawing.sheet import Sheet

ROOT = Path(__file__).parents[3]
RECORDED = ("centre_of_mass", "path_length", "latent_length")
LATE, LAST = 6, 9  # steps of a tiny run that are shown

Again = Callable[[Artifact], Replay]


@pytest.fixture(scope="module")
def settings(tiny: Params) -> Params:
    small = {"steps": 1, "frame_updates": 40, "width": 160}
    return tiny.model_copy(update={"film": params.checked(tiny.film, small)})


@pytest.fixture(scope="module")
def untrained(settings: Params) -> Trained:
    """An encoder as good as any here, and at no cost."""
    torch.manual_seed(0)
    weights = {name: tensor.numpy() for name, tensor in UNet(settings.encoder).state_dict().items()}
    zero = np.zeros(settings.encoder.latent, np.float32)
    quantiles = np.zeros((len(REGIMES), len(zero), len(LEVELS)), np.float32)
    return Trained(weights, zero, zero + 1, quantiles, zero, zero)


@pytest.fixture(scope="module")
def run(
    settings: Params, untrained: Trained, scales: dict[str, float], tmp_path_factory: pytest.TempPathFactory
) -> Artifact:
    path = tmp_path_factory.mktemp("run") / "seed-000.h5"
    (record,) = experiment.Experiment(settings, "noisy", "cais", [0], untrained, scales).run()
    about: artifact.About = {"condition": "noisy", "reward": "cais", "limb": settings.protocol.limb, "seed": 0}
    artifact.write(path, store.RUN, "d" * 64, record, about)
    return artifact.read(path, store.RUN)


@pytest.fixture(scope="module")
def built(settings: Params) -> Scene:
    return scene.build(settings.world, settings.protocol)


@pytest.fixture(scope="module")
def eye(built: Scene) -> Iterator[Eye]:
    with Eye(built) as opened:
        yield opened


@pytest.fixture(scope="module")
def again(settings: Params, built: Scene, eye: Eye, untrained: Trained) -> Again:
    return lambda run: replay(settings, run, built, eye, Extractor(settings.encoder, untrained), {LATE, LAST})


@pytest.fixture(scope="module")
def found(again: Again, run: Artifact) -> Replay:
    return again(run)


@pytest.fixture(autouse=True)
def unpublished(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is published, so every machine is of the same class."""
    monkeypatch.chdir(tmp_path)


def altered(run: Artifact, name: str, step: int, change: Callable[[np.ndarray], np.ndarray]) -> Artifact:
    values = run[name].copy()
    values[step] = change(values[step])
    return replace(run, datasets=run.datasets | {name: replace(run.datasets[name], values=values)})


def least(values: np.ndarray) -> np.ndarray:
    return np.nextafter(values, np.float32(np.inf), dtype=np.float32)


def test_a_replay_comes_to_the_very_numbers_of_the_run(run: Artifact, found: Replay) -> None:
    assert found.record.keys() == set(RECORDED)
    for name in RECORDED:
        assert np.array_equal(found.record[name].values, run[name])
    film.check(run, found.record)
    assert {step: len(np.unique(updates, axis=0)) for step, updates in found.positions.items()} == {
        LATE: 120,
        LAST: 120,
    }


@pytest.mark.parametrize("name", RECORDED)
def test_the_least_change_of_a_record_is_noticed(name: str, run: Artifact, found: Replay) -> None:
    other = altered(run, name, 4, least)
    with pytest.raises(
        console.StageError, match=rf"^{re.escape(str(run.path))}, replayed, .*: {name} differs first at step 5, by "
    ):
        film.check(other, found.record)


def test_another_action_is_noticed(again: Again, run: Artifact) -> None:
    other = altered(run, "action", 4, lambda moved: 1 - moved)
    with pytest.raises(console.StageError, match="differs first at step 5"):
        film.check(other, again(other).record)


def test_on_another_class_of_machine_a_tolerance_holds(run: Artifact, found: Replay) -> None:
    paths.PUBLISHED_ON.parent.mkdir()
    paths.PUBLISHED_ON.write_text(json.dumps({"machines": [{"class": "x86_64 AnotherVendor", "versions": {}}]}))
    film.check(altered(run, "path_length", 4, least), found.record)
    far = altered(run, "path_length", 4, lambda length: length + 1)
    with pytest.raises(
        console.StageError, match=r"another class, .* path_length is 0\.\d+ .* differs first at step 5, by 1 "
    ):
        film.check(far, found.record)


def test_the_film_plays_in_browsers_and_shows_what_the_eye_saw(
    settings: Params, run: Artifact, untrained: Trained, found: Replay, eye: Eye
) -> None:
    made, drawn = film.filmed(settings, run, untrained)
    assert played(made) == {"codec": "h264", "pixels": "yuv420p", "size": (160, 90), "rate": 5, "pictures": 12}
    poster = Image.open(io.BytesIO(drawn))
    assert poster.size == (160, 90)
    left, top, width, height = Sheet(run, phases(settings), 160).pixels(sheet.EYE)
    seen = Image.fromarray(eye.frames(found.positions[LATE][79:80])[0]).resize(
        (width, height), Image.Resampling.NEAREST
    )
    assert np.array_equal(np.asarray(poster)[top : top + height, left : left + width], np.asarray(seen))


def test_shots_are_around_the_ropes_tying_and_its_loss() -> None:
    paper = [shot.steps for shot in film.shots(analysis.phases(500, 1500, 500), 12)]
    assert paper == [range(488, 500), range(500, 512), range(1988, 2000), range(2000, 2012)]
    short = [shot.steps for shot in film.shots(analysis.phases(3, 5, 1), 12)]
    assert short == [range(3), range(3, 5), range(6, 8), range(8, 9)]


def test_the_same_pictures_give_the_same_file() -> None:
    pictures = np.random.default_rng(0).integers(256, size=(9, 32, 64, 3), dtype=np.uint8)
    one, other = (video.encoded(iter(pictures), Fraction(25)) for _ in range(2))
    assert one == other
    assert b"x264" not in one and b"Lav" not in one


@pytest.mark.parametrize("condition", ["free", "noisy"])
def test_the_published_film_is_short_and_in_real_time(condition: str) -> None:
    p = params.load(ROOT / "params.yaml")
    file = ROOT / paths.FILMS / f"{condition}.mp4"
    seconds = 4 * p.film.steps * p.protocol.updates_per_step * p.protocol.timestep
    assert seconds < 60
    assert played(file.read_bytes()) == {
        "codec": "h264", "pixels": "yuv420p", "size": (1280, 720), "rate": 25, "pictures": round(25 * seconds),
    }  # fmt: skip
    assert Image.open(io.BytesIO(file.with_suffix(".png").read_bytes())).size == (1280, 720)


def phases(p: Params) -> dict[str, slice]:
    return analysis.phases(p.protocol.baseline_steps, p.protocol.attached_steps, p.protocol.extinction_steps)


def played(made: bytes) -> dict[str, object]:
    """What a player finds; it can begin before the file has come whole."""
    assert made.index(b"moov") < made.index(b"mdat")
    with av.open(io.BytesIO(made), "r") as file:
        (stream,) = file.streams.video
        codec = stream.codec_context
        assert stream.average_rate is not None
        assert file.duration == round(1e6 * stream.frames / stream.average_rate)
        return {
            "codec": codec.name,
            "pixels": codec.pix_fmt,
            "size": (codec.width, codec.height),
            "rate": stream.average_rate,
            "pictures": stream.frames,
        }
