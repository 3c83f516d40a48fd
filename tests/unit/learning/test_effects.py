"""Joints' effects under the resting policy: the statistics by hand, a small measurement, the stage."""

import dataclasses
import json
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from scipy import stats

from mimo.learning import effects
from mimo.learning.effects import Sample
from mimo.record import streams
from mimo.settings import params, studies
from mimo.settings.params import Params
from mimo.settings.studies import Effects
from mimo.vision.extractor import Extractor, Trained
from mimo.world import body, scene
from mimo.world.eye import Eye
from mimo.world.physics import Worlds
from stages import effects as stage
from stages.base import paths, store

LEVELS = np.arange(1, 50) / 50
ATTACHED = body.attached("left_foot")


# The statistics.


def test_a_difference_is_of_means_in_sd() -> None:
    """By hand: (1 + 3 + 8) / 3 - 0 = 4 and 1 - 4 = -3, the SD of 1, 3, 8, 0 is sqrt(9.5)."""
    reward = np.array([1.0, 3.0, 8.0, 0.0])
    moved = np.array([[True, True], [True, False], [True, False], [False, True]])
    expected = [4 / math.sqrt(9.5), (0.5 - 5.5) / math.sqrt(9.5)]
    assert effects.differences(reward, moved) == pytest.approx(expected, rel=1e-12)


def test_differences_keep_when_the_reward_is_shifted_or_scaled() -> None:
    rng = np.random.default_rng(1)
    reward, moved = rng.standard_normal(200), rng.random((200, 12)) < 0.3
    assert effects.differences(5 + 7 * reward, moved) == pytest.approx(effects.differences(reward, moved), rel=1e-9)


def test_a_distance_is_the_mean_over_levels_and_dimensions() -> None:
    """By hand: x is 1 where the joint moved, in half of the steps, else 0; in the other dimension 3 or 0."""
    own = np.arange(1000) % 2 == 0
    moved = np.stack([own, np.arange(1000) % 4 < 2], axis=1)
    x = np.stack([own, 3.0 * own], axis=1)
    found = effects.distances(x, moved, np.array([0.1, 0.3, 0.7, 0.9]))
    assert found == pytest.approx([0.5 * (1 + 3) / 2, 0.0], abs=1e-12)


def test_a_shift_that_moving_alone_brings_is_found() -> None:
    """Against scipy's W1 of the samples, which takes every level."""
    rng = np.random.default_rng(2)
    moved = rng.random((20_000, 2)) < 0.34
    x = rng.standard_normal((20_000, 3))
    x[moved[:, 0]] += 0.8
    shifted, still = effects.distances(x, moved, LEVELS)
    whole = np.mean([stats.wasserstein_distance(x[moved[:, 0], i], x[:, i]) for i in range(3)])
    assert shifted == pytest.approx(whole, rel=0.03)
    assert shifted == pytest.approx(0.8 * 0.66, rel=0.05)
    assert still < 0.03


def test_cohens_d() -> None:
    """By hand: means 3 and 1, variances 1 and 4."""
    assert effects.cohens_d(np.array([2.0, 4.0]), np.array([-1.0, 3.0])) == pytest.approx(2 / math.sqrt(2.5), rel=1e-12)


@pytest.fixture(scope="module")
def fair() -> Sample:
    """The attached limb's first joint moves the mobile by 2 mm on average, in x by 10 mm, in all of h by 1."""
    rng = np.random.default_rng(3)
    moved = rng.random((4000, 12)) < 0.34
    cause = moved[:, np.flatnonzero(ATTACHED)[0]]
    return Sample(
        moved=moved,
        mtl=0.03 + 0.002 * cause + 0.001 * rng.standard_normal(4000),
        rtl=rng.standard_normal(4000),
        position=0.01 * (np.array([1.0, 0.0, 0.0]) * cause[:, None] + rng.standard_normal((4000, 3))),
        latent=1.0 * cause[:, None] + rng.standard_normal((4000, 5)),
    )


def test_the_attached_joints_stand_against_the_others(fair: Sample) -> None:
    found = effects.joints(fair, ATTACHED, LEVELS)
    assert list(found) == ["mtl", "rtl", "position", "latent", "position_sd_mm", "mtl_mm"]
    assert found["mtl"]["attached"][0] == pytest.approx(0.002 / fair.mtl.std(), rel=0.03)
    sizes = np.abs(effects.differences(fair.mtl, fair.moved))
    assert found["mtl"]["others"] == sizes[~ATTACHED].max() < 0.15
    assert max(np.abs(found["mtl"]["attached"][1:])) < 0.15
    for name, x in (("position", fair.position / fair.position.std(axis=0)), ("latent", fair.latent)):
        sizes = effects.distances(x, fair.moved, LEVELS)
        assert found[name]["attached"] == sizes[ATTACHED].tolist()
        assert found[name]["others"] == pytest.approx(sizes[~ATTACHED].mean(), rel=1e-12)
        assert found[name]["ratio"] == pytest.approx(sizes[ATTACHED].mean() / sizes[~ATTACHED].mean(), rel=1e-12)
    assert found["position"]["ratio"] > 2
    assert found["position_sd_mm"] == pytest.approx(1000 * fair.position.std(axis=0), rel=1e-12)
    assert found["mtl_mm"] == pytest.approx({"mean": 1000 * fair.mtl.mean(), "sd": 1000 * fair.mtl.std()}, rel=1e-12)


def test_the_limb_decides_which_joints_are_attached(fair: Sample) -> None:
    found = effects.joints(fair, body.attached("right_hand"), LEVELS)
    assert max(np.abs(found["mtl"]["attached"])) < 0.15
    assert found["mtl"]["others"] > 0.5


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"moved": np.ones((4000, 12), bool)}, "a joint's action"),
        ({"mtl": np.full(4000, 0.1)}, "mtl"),
        ({"rtl": np.zeros(4000)}, "rtl"),
        ({"position": np.ones((4000, 3))}, "the mobile's position"),
    ],
)
def test_what_does_not_vary_has_no_effect(change: dict[str, np.ndarray], words: str, fair: Sample) -> None:
    with pytest.raises(FloatingPointError, match=f"^{words} does not vary"):
        effects.joints(dataclasses.replace(fair, **change), ATTACHED, LEVELS)


# A small measurement.


@pytest.fixture(scope="module")
def asked() -> Effects:
    """50 agent steps, of which 30 count, in each of two worlds."""
    shipped = studies.load(params.load()).effects
    return params.checked(shipped, {"steps": 50, "worlds": 2, "alternatives": {"heavy": {"world.mobile_mass": 0.3}}})


def taken(p: Params, asked: Effects, trained: Trained, regime: tuple[str, bool]) -> Sample:
    built = scene.build(p.world, p.protocol)
    with Eye(built) as eye:
        return effects.sample(p, asked, built, eye, Extractor(p.encoder, trained), regime, lambda done: None)


@pytest.fixture(scope="module")
def measured(tiny: Params, asked: Effects, trained: Trained) -> tuple[dict[str, Any], list[int]]:
    """The effects, and the progress told."""
    told: list[int] = []
    return effects.measure(tiny, asked, trained, told.append), told


def test_all_is_measured(measured: tuple[dict[str, Any], list[int]]) -> None:
    found, told = measured
    assert told == list(range(2, 301, 2))
    assert list(found) == ["free", "noisy", "phases"]
    for condition in ("free", "noisy"):
        for name in ("mtl", "rtl", "position", "latent"):
            assert len(found[condition][name]["attached"]) == 3
            assert found[condition][name]["others"] > 0
        assert min(found[condition]["position_sd_mm"]) > 0
    assert found["noisy"]["mtl_mm"]["mean"] > 2 * found["free"]["mtl_mm"]["mean"]
    assert all(math.isfinite(value) for value in found["phases"].values())
    json.dumps(found, allow_nan=False)


def test_steps_are_those_of_the_world(tiny: Params, asked: Effects, trained: Trained) -> None:
    """Again by a loop over worlds, one at a time, with the streams as other code would draw them."""
    found = taken(tiny, asked, trained, ("noisy", True))
    assert found.moved.shape == (60, 12)
    built, extract = scene.build(tiny.world, tiny.protocol), Extractor(tiny.encoder, trained)
    with Eye(built) as eye:
        for world in range(2):
            policy, direction, noise = (
                streams.generator(tiny.seed, "noisy", 10**6 + world, purpose)
                for purpose in ("policy", "direction", "noise")
            )
            worlds = Worlds(built, tiny.protocol, 40.0, [noise])
            latent = extract(eye.frames(worlds.qpos))
            for step in range(50):
                moved = policy.random(12) < 1 / (1 + math.exp(0.2 / 0.3))
                positive = direction.random(12) < 0.5
                outcome = worlds.step(moved[None], positive[None], attached=True)
                before, latent = latent, extract(eye.frames(worlds.qpos))
                if step >= 20:
                    row = 2 * (step - 20) + world
                    assert (found.moved[row] == moved).all()
                    assert found.mtl[row] == outcome.path_length[0]
                    assert (found.position[row] == outcome.centre_of_mass[0]).all()
                    assert (found.latent[row] == latent[0]).all()
                    assert found.rtl[row] == pytest.approx(float(np.linalg.norm(latent - before)), rel=1e-5)


def test_the_rope_alone_tells_its_phases_apart(tiny: Params, asked: Effects, trained: Trained) -> None:
    on, off = (taken(tiny, asked, trained, ("noisy", rope)) for rope in (True, False))
    assert (on.moved == off.moved).all()
    assert not np.array_equal(on.position, off.position)


def test_a_mobile_that_the_rope_never_moves_is_refused(tiny: Params, asked: Effects, trained: Trained) -> None:
    # The settings would refuse both.
    loose = tiny.model_copy(update={"world": tiny.world.model_copy(update={"rope_slack": 5.0})})
    few = asked.model_copy(update={"steps": 30, "worlds": 1})
    with pytest.raises(FloatingPointError, match="does not vary under the resting policy"):
        effects.measure(loose, few, trained)


# The stage.


@pytest.fixture
def project(tiny: Params, asked: Effects, encoder_file: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the files of settings and an encoder."""
    whole = studies.load(params.load())
    small = whole.model_copy(update={"effects": asked, "studies": {"noise": whole.studies["noise"]}})
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["effects", "--serial"])
    paths.PARAMS.write_text(yaml.safe_dump(tiny.model_dump()))
    studies.PATH.parent.mkdir()
    studies.PATH.write_text(yaml.safe_dump(small.model_dump()))
    paths.ENCODER.parent.mkdir()
    paths.ENCODER.write_bytes(encoder_file)
    return tmp_path


def test_worlds_are_measured_once_and_published_rounded(
    project: Path, monkeypatch: pytest.MonkeyPatch, measured: tuple[dict[str, Any], list[int]]
) -> None:
    stage.main()
    first = paths.EFFECTS.read_bytes()
    found = json.loads(first)
    assert found["steps"] == 60
    assert {name: world["set"] for name, world in found["worlds"].items()} == {
        "published": {}, "heavy": {"world.mobile_mass": 0.3},
    }  # fmt: skip
    published, own = found["worlds"]["published"], measured[0]
    assert list(published) == ["set", "free", "noisy", "phases"]
    assert published["free"]["mtl_mm"] == {name: float(f"{x:.4g}") for name, x in own["free"]["mtl_mm"].items()}
    assert published["free"] != found["worlds"]["heavy"]["free"]
    assert len(list((paths.store() / f"{store.EFFECT}s").glob("*.h5"))) == 2
    monkeypatch.setattr(effects, "measure", lambda *_: pytest.fail("measured again"))
    paths.EFFECTS.unlink()
    stage.main()
    assert paths.EFFECTS.read_bytes() == first


@pytest.mark.parametrize(
    ("key", "value", "matters"),
    [
        ("world.mobile_mass", 0.5, True),
        ("conditions.noisy.force", 1.0, True),
        ("protocol.limb", "right_hand", True),
        ("agent.move_bias", 0.1, True),
        ("outcomes.quantiles", 9, True),
        ("encoder.latent_sd", 1.0, True),
        ("effects.steps", 51, True),
        ("effects.worlds", 3, True),
        ("effects.dropped", 19, True),
        ("seed", 1, True),
        ("effects.alternatives", {}, False),
        ("protocol.attached_steps", 9, False),
        ("outcomes.memory", 9, False),
        ("rewards.gain", 9.0, False),
        ("sweep.seeds", 9, False),
    ],
)
def test_the_digest_is_of_what_a_world_reads(
    key: str, value: object, matters: bool, tiny: Params, asked: Effects
) -> None:
    p, changed = tiny, asked
    if key.startswith("effects."):
        changed = params.checked(asked, {key.removeprefix("effects."): value})
    else:
        p = params.changed(tiny, {key: value})
    assert (stage.digest(p, changed, "e") != stage.digest(tiny, asked, "e")) == matters
