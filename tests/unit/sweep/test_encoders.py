"""What an agent sees by: what names frames and encoder, and that the files are what they say."""

from pathlib import Path

import numpy as np
import pytest

from mimo.record import artifact, streams
from mimo.record.artifact import Artifact, Dataset
from mimo.settings import params
from mimo.settings.params import Params
from mimo.vision import collect, encoder, extractor
from mimo.world import body
from stages.base import store
from stages.sweep import encoders

P = params.load()
ALL = {"collect.limbs": "all"}


def held(limbs: str = "left_foot", number: float = 1.0) -> Artifact:
    """Frames, as far as an encoder's digest reads them."""
    data = {"centre_of_mass": Dataset(np.full(3, number), "m", "xyz")}
    return artifact.from_bytes(artifact.to_bytes(store.FRAME, "d" * 64, data, {"limbs": limbs}), store.FRAME)


# Names.


@pytest.mark.parametrize(
    ("key", "value", "matters"),
    [
        ("seed", 1, True),
        ("collect.draw", 1, True),
        ("collect.limbs", "all", True),
        ("collect.worlds", 5, True),
        ("collect.steps", 149, True),
        ("collect.pair_updates", 9, True),
        ("protocol.limb", "right_hand", True),
        ("protocol.updates_per_step", 121, True),
        ("protocol.torque_updates", 41, True),
        ("protocol.timestep", 0.004, True),
        ("conditions.noisy.force", 1.0, True),
        ("world.mobile_mass", 0.5, True),
        ("agent.move_bias", 0.1, True),
        ("agent.temperature", 0.2, True),
        ("world.rope_holds", 0.5, False),
        ("collect.held_out", 0.3, False),
        ("protocol.attached_steps", 9, False),
        ("encoder.latent", 32, False),
        ("agent.gamma", 0.2, False),
        ("outcomes.action", "limb", False),
        ("rewards.surprise.weight", 0.5, False),
    ],
)
def test_frames_are_named_by_what_they_are_made_from(key: str, value: object, matters: bool) -> None:
    other = encoders.frames_digest(params.changed(P, {key: value}))
    assert (other != encoders.frames_digest(P)) == matters


def test_the_protocols_limb_matters_to_frames_of_that_limb_alone() -> None:
    own = {encoders.frames_digest(params.changed(P, {"protocol.limb": limb})) for limb in body.LIMB_JOINTS}
    assert len(own) == 4
    of_all = {encoders.frames_digest(params.changed(P, ALL | {"protocol.limb": limb})) for limb in body.LIMB_JOINTS}
    assert len(of_all) == 1
    assert not own & of_all


@pytest.mark.parametrize(
    ("key", "value", "matters"),
    [
        ("seed", 1, True),
        ("collect.draw", 1, True),
        ("collect.held_out", 0.3, True),
        ("encoder.latent", 32, True),
        ("encoder.iterations", 299, True),
        ("encoder.latent_sd", 1.0, True),
        ("world.rope_holds", 0.5, False),
        ("protocol.limb", "right_hand", False),  # by the frames alone
        ("world.mobile_mass", 0.5, False),  # likewise
        ("agent.gamma", 0.2, False),
        ("outcomes.action", "limb", False),
    ],
)
@pytest.mark.parametrize("measured", [True, False])
def test_an_encoder_is_named_by_what_it_is_trained_with(key: str, value: object, matters: bool, measured: bool) -> None:
    other = encoders.digest(params.changed(P, {key: value}), held(), measured)
    assert (other != encoders.digest(P, held(), measured)) == matters


def test_an_encoder_is_named_by_its_frames_their_limbs_and_whether_it_is_measured() -> None:
    of = [held(), held("left_foot, left_hand"), held(number=2.0)]
    names = {encoders.digest(P, frames, measured) for frames in of for measured in (True, False)}
    assert len(names) == 6
    code, bare = (dict(encoders.digest(P, held(), measured).inputs)["code"] for measured in (True, False))
    assert "mimo.vision.probe" in code and "mimo.vision.probe" not in bare  # type: ignore[operator]


# Files.


@pytest.fixture(scope="module")
def small(tiny: Params) -> Params:
    """Of all limbs."""
    return params.changed(tiny, ALL | {"collect.worlds": 4, "encoder.iterations": 1})


@pytest.fixture(scope="module")
def frames(small: Params) -> Artifact:
    told: list[int] = []
    data = encoders.frames(small, told.append)
    assert told[-1] == 4 * 4 * 5
    return artifact.from_bytes(data, store.FRAME, encoders.frames_digest(small))


def test_frames_say_what_they_are_of(small: Params, frames: Artifact) -> None:
    assert frames.about["limbs"] == "left_foot, left_hand, right_foot, right_hand"
    assert frames.about["regimes"] == "free, detached; free, attached; noisy, detached; noisy, attached"
    seen, centres = collect.collect(small)
    assert frames["frames"].tobytes() == seen.tobytes()
    assert frames["centre_of_mass"].tobytes() == centres.tobytes()


def test_an_encoder_is_trained_on_what_is_not_held_out(small: Params, frames: Artifact, tmp_path: Path) -> None:
    """By its draw's stream, and measured limb by limb."""
    for draw in (0, 1):
        p = params.changed(small, {"collect.draw": draw})
        data = encoders.encoder(p, frames)
        made = artifact.from_bytes(data, store.ENCODER, encoders.digest(p, frames))
        pairs = np.ascontiguousarray(frames["frames"][:, :, :4])
        stream = streams.generator(p.seed, "free", draw, "encoder")
        twin = encoder.train(p.encoder, pairs.reshape(4, 16, *pairs.shape[3:]), stream)
        for name, weights in twin.weights.items():
            assert made[f"weights/{name}"].tobytes() == weights.tobytes()
        assert made["latent/quantiles"].tobytes() == twin.quantiles.tobytes()
        found = encoders.measures(made)
        assert {f"r2_noisy_x_{limb}" for limb in body.LIMB_JOINTS} < found.keys()
        assert found["cltt"] == made["measures/cltt"]
        extractor.save(extractor.load(made), tmp_path / "again.h5", encoders.digest(p, frames), found)
        assert (tmp_path / "again.h5").read_bytes() == data
        if draw == 0:
            first = made
    assert made["latent/mean"].tobytes() != first["latent/mean"].tobytes()
    bare = artifact.from_bytes(encoders.encoder(small, frames, measured=False), store.ENCODER)
    assert encoders.measures(bare) == {}
    assert bare["latent/mean"].tobytes() == first["latent/mean"].tobytes()
