"""The frozen extractor: h centred and scaled, the same bytes in any company and from an artifact; reconstructions."""

from pathlib import Path

import numpy as np
import pytest
import torch

from mimo.record import artifact
from mimo.settings import params
from mimo.vision import encoder, extractor
from mimo.vision.encoder import images
from mimo.vision.extractor import Extractor, Trained
from tests.unit.vision.reference import fingerprint, untrained

SETTINGS = params.load().encoder


def test_h_over_the_training_frames_is_centred_and_scaled(
    learned: Trained, brief: params.Encoder, few: np.ndarray
) -> None:
    h = Extractor(brief, learned)(few.reshape(-1, 128, 128, 3)).astype(float)
    assert h.shape == (12, 64)
    assert h.mean(axis=0) == pytest.approx(np.zeros(64), abs=1e-4)
    assert h.std(axis=0) == pytest.approx(np.full(64, brief.latent_sd), rel=1e-4)
    assert learned.quantiles.shape == (2, 64, 99)
    for group, seen in enumerate((h[:6], h[6:])):  # three pairs each
        expected = np.quantile(seen, np.arange(1, 100) / 100, axis=0).T
        assert learned.quantiles[group] == pytest.approx(expected, abs=1e-4)
    assert (np.diff(learned.quantiles, axis=-1) >= 0).all()
    assert np.abs(learned.quantiles[0] - learned.quantiles[1]).max() > 0.1


def test_h_is_the_networks_output_less_the_mean_over_the_sd(few: np.ndarray) -> None:
    made = untrained(SETTINGS)
    extract = Extractor(SETTINGS, made)
    with torch.no_grad():
        raw = encoder.frozen(SETTINGS, made.weights).encode(images(few[:, 0]))[0].numpy()
    h = extract(few[:, 0])
    assert h.dtype == np.float32
    np.testing.assert_allclose(h, (raw - 0.25) / 2 * SETTINGS.latent_sd, rtol=1.3e-6, atol=1e-6)
    assert h.std() > 0


def test_h_is_the_same_bytes_in_any_company(few: np.ndarray) -> None:
    extract = Extractor(SETTINGS, untrained(SETTINGS))
    frames = few.reshape(-1, 128, 128, 3)
    together = extract(frames)
    assert len({row.tobytes() for row in together}) > 6
    alone = np.concatenate([extract(frame[None]) for frame in frames])
    assert together.tobytes() == alone.tobytes()
    order = np.random.default_rng(0).permutation(len(frames))
    assert extract(frames[order]).tobytes() == together[order].tobytes()


@pytest.mark.parametrize(
    "frames", [np.zeros((1, 64, 64, 3), np.uint8), np.zeros((1, 128, 128, 3))], ids=["side", "type"]
)
def test_other_frames_are_refused(frames: np.ndarray) -> None:
    """They would be read beyond their end."""
    with pytest.raises(ValueError, match=r"^frames must be \(1, 128, 128, 3\) of uint8; it is"):
        Extractor(SETTINGS, untrained(SETTINGS))(frames)


def test_the_extractor_is_frozen(few: np.ndarray) -> None:
    made = untrained(SETTINGS)
    extract = Extractor(SETTINGS, made)
    net = encoder.frozen(SETTINGS, made.weights)
    assert not any(weight.requires_grad for weight in net.parameters())
    assert not net.training
    before, drawn = extract(few[:, 0]).tobytes(), encoder.reconstruct(net, few[:1, 0])
    for weight in made.weights.values():  # both have their own copies
        weight[...] = 0
    assert extract(few[:, 0]).tobytes() == before
    assert (encoder.reconstruct(net, few[:1, 0]) == drawn).all()


def test_reconstructions_are_pictures(learned: Trained, brief: params.Encoder, few: np.ndarray) -> None:
    net = encoder.frozen(brief, learned.weights)
    pictures = encoder.reconstruct(net, few[:, 0])
    assert pictures.shape == few[:, 0].shape
    assert pictures.dtype == np.uint8
    with torch.no_grad():
        decoded = net.decode(*net.encode(images(few[:, 0]))).permute(0, 2, 3, 1).numpy()
    assert np.abs(pictures - 255.0 * decoded).max() < 0.51
    error = np.square((pictures - few[:, 0].astype(float)) / 255).mean()
    assert error < learned.reconstruction[0]


def test_without_skips_a_reconstruction_is_of_h_alone(learned: Trained, brief: params.Encoder, few: np.ndarray) -> None:
    net = encoder.frozen(brief, learned.weights)
    pictures = encoder.reconstruct(net, few[:, 0], skips=False)
    assert pictures.shape == few[:, 0].shape
    assert (pictures != encoder.reconstruct(net, few[:, 0])).any()
    with torch.no_grad():
        latent, passed = net.encode(images(few[:, 0]))
        decoded = net.decode(latent, [0 * skip for skip in passed]).permute(0, 2, 3, 1).numpy()
    assert np.abs(pictures - 255.0 * decoded).max() < 0.51


def test_an_artifact_gives_the_same_h(learned: Trained, brief: params.Encoder, few: np.ndarray, tmp_path: Path) -> None:
    content = extractor.save(learned, tmp_path / "encoder.h5", "d" * 64, {"r2_free_x": 0.5})
    held = artifact.read(tmp_path / "encoder.h5", extractor.SCHEMA, "d" * 64)
    assert held.content == content
    assert held["measures/r2_free_x"] == 0.5
    again = extractor.load(held)
    assert fingerprint(again) == fingerprint(learned)
    frames = few.reshape(-1, 128, 128, 3)
    assert Extractor(brief, again)(frames).tobytes() == Extractor(brief, learned)(frames).tobytes()
