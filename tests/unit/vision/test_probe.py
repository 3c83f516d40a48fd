"""What the probe reads off h: over all frames, and with the rope tied to each limb."""

import numpy as np
import pytest

from mimo.record import streams
from mimo.settings.params import Params
from mimo.vision import collect, probe
from mimo.vision.extractor import Extractor, Trained
from mimo.world import body

LIMBS = list(body.LIMB_JOINTS)
STEPS, CUT = 5, 3
BARE = {f"r2_{condition}_{axis}" for condition in streams.CONDITIONS for axis in "xyz"}
Seen = tuple[np.ndarray, np.ndarray]


@pytest.fixture(scope="module")
def seen(pairs: np.ndarray) -> Seen:
    """Frames and centres of six worlds, which tell each from the others."""
    draw = np.random.default_rng(5)
    shape = (len(collect.REGIMES), 6, STEPS, 2)
    pictures = pairs.reshape(-1, *pairs.shape[3:])
    frames = pictures[draw.integers(0, len(pictures), shape)]
    return frames, draw.normal(size=(*shape, 3))


def test_one_limb_has_the_measures_of_all_frames_alone(tiny: Params, trained: Trained, seen: Seen) -> None:
    found = probe.measure(tiny, ["left_foot"], trained, *seen, CUT)
    sds = {f"latent_sd_{condition}_{rope}" for condition in streams.CONDITIONS for rope in ("attached", "detached")}
    assert found.keys() == BARE | sds | {"reconstruction", "cltt"}
    assert np.isfinite(list(found.values())).all()


def test_several_limbs_have_each_their_own_besides(tiny: Params, trained: Trained, seen: Seen) -> None:
    """R² by hand: one least-squares fit over the training frames, then held-out frames of some worlds, rope on."""
    one, all_ = (probe.measure(tiny, tied, trained, *seen, CUT) for tied in (LIMBS[:1], LIMBS))
    assert {name: all_[name] for name in one} == one
    assert all_.keys() - one.keys() == {f"{name}_{limb}" for name in BARE for limb in LIMBS}
    frames, centres = seen
    h = Extractor(tiny.encoder, trained)(frames.reshape(-1, 128, 128, 3)).reshape(*frames.shape[:4], -1)
    h = np.concatenate([h, np.ones((*h.shape[:4], 1))], axis=-1)
    fit = np.linalg.lstsq(h[:, :, :CUT].reshape(-1, h.shape[-1]), centres[:, :, :CUT].reshape(-1, 3))[0]
    left = centres - h @ fit
    assert LIMBS == ["left_foot", "left_hand", "right_foot", "right_hand"]
    worlds = {"left_foot": [0, 4], "left_hand": [1, 5], "right_foot": [2], "right_hand": [3]}
    for condition, regime in (("free", 1), ("noisy", 3)):
        for limb, own in worlds.items():
            true, error = (values[regime, own, CUT:].reshape(-1, 3) for values in (centres, left))
            r2 = 1 - np.square(error).sum(axis=0) / np.square(true - true.mean(axis=0)).sum(axis=0)
            found = [all_[f"r2_{condition}_{axis}_{limb}"] for axis in "xyz"]
            assert found == pytest.approx(r2.tolist(), rel=1e-6)
        true, error = (values[[regime - 1, regime], :, CUT:].reshape(-1, 3) for values in (centres, left))
        r2 = 1 - np.square(error).sum(axis=0) / np.square(true - true.mean(axis=0)).sum(axis=0)
        assert [all_[f"r2_{condition}_{axis}"] for axis in "xyz"] == pytest.approx(r2.tolist(), rel=1e-6)
    assert len({all_[name] for name in all_}) == len(all_)
