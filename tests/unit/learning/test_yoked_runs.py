"""Yoked runs: what the mobile does is what it did in the donors' runs, to the bit, whatever the infants do."""

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest

from mimo.learning.experiment import Donor, Experiment, Record
from mimo.learning.rewards.reward import length
from mimo.record import streams
from mimo.settings import params
from mimo.settings.params import Params
from mimo.vision.extractor import Extractor, Trained
from mimo.world import body, scene
from mimo.world.eye import Eye
from mimo.world.physics import Worlds
from tests.unit.learning.recorded import ATTACHED, STEPS, Runs, arrays, file

DONORS = {0: 1, 1: 2, 2: 0}  # of each seed; runs paid MTL
ARMS = ("shoulder", "elbow", "hand", "fingers")
Yoked = Callable[..., list[Record]]  # of condition, reward, seeds


def donor(runs: Runs, condition: str, seed: int) -> Donor:
    run = runs(condition, "mtl", 0, 1, 2)[seed]
    return Donor(f"{seed}" * 64, seed, run["action"].astype(bool), run["positive"].astype(bool))


@pytest.fixture(scope="module")
def yoked(tiny: Params, trained: Trained, scales: dict[str, float], runs: Runs) -> Yoked:
    @cache
    def run(condition: str, reward: str, *seeds: int) -> list[Record]:
        donors = [donor(runs, condition, DONORS[seed]) for seed in seeds]
        return Experiment(tiny, condition, reward, seeds, trained, scales, donors).run()

    return run


@pytest.mark.parametrize("reward", ["mtl", "rtl", "cais_surprise"])
@pytest.mark.parametrize("condition", streams.CONDITIONS)
def test_the_mobile_repeats_the_donors_run(condition: str, reward: str, yoked: Yoked, runs: Runs) -> None:
    own, theirs = runs(condition, reward, 0, 1, 2), runs(condition, "mtl", 0, 1, 2)
    for seed, found in enumerate(map(arrays, yoked(condition, reward, 0, 1, 2))):
        assert found.keys() == own[seed].keys()
        for name in ("path_length", "centre_of_mass"):
            assert found[name].tobytes() == theirs[DONORS[seed]][name].tobytes()
            assert found[name].tobytes() != own[seed][name].tobytes()
        for name in ("positive", "action"):  # its own draws
            assert (found[name][0] == own[seed][name][0]).all()
        if reward == "mtl":
            assert (found["part/mtl"] == theirs[DONORS[seed]]["path_length"][:, None]).all()


@pytest.mark.parametrize(("condition", "reward"), [("free", "rtl"), ("noisy", "cais_surprise")])
def test_the_same_bytes_in_any_company(condition: str, reward: str, yoked: Yoked) -> None:
    three = [file(record) for record in yoked(condition, reward, 0, 1, 2)]
    assert len(set(three)) == 3
    assert [file(record) for record in yoked(condition, reward, 2, 0)] == [three[2], three[0]]
    for seed in range(3):
        assert [file(record) for record in yoked(condition, reward, seed)] == [three[seed]]


@pytest.mark.parametrize("condition", streams.CONDITIONS)
def test_h_differs_from_the_donors_by_the_arms_alone(
    condition: str, yoked: Yoked, runs: Runs, tiny: Params, trained: Trained
) -> None:
    """A run lived again in two worlds; with the donor's arms in the picture its way of h is the donor's, to the bit."""
    seed = 1
    found, theirs = arrays(yoked(condition, "rtl", 0, 1, 2)[seed]), runs(condition, "mtl", 0, 1, 2)[DONORS[seed]]
    assert (found["part/rtl"] == found["latent_length"][:, None]).all()
    built, extract = scene.build(tiny.world, tiny.protocol), Extractor(tiny.encoder, trained)
    model, force = built.model, {"free": 0.0, "noisy": 40.0}[condition]
    mobile = model.joint("suspension").qposadr[0] + np.arange(4)
    chosen = [name for name in body.JOINTS[body.FIXED :] if any(part in name for part in ARMS)]
    arms = np.array([model.joint(name).qposadr[0] for name in chosen])
    assert len(arms) == 16
    own = Worlds(built, tiny.protocol, 0.0, [np.random.default_rng()])
    other = Worlds(built, tiny.protocol, force, [streams.generator(tiny.seed, condition, DONORS[seed], "noise")])
    with Eye(built) as eye:
        h = lent = extract(eye.frames(own.qpos))
        for step in range(STEPS):
            for worlds, run, tied in ((own, found, False), (other, theirs, step in ATTACHED)):
                moved, positive = (run[name][step : step + 1] > 0 for name in ("action", "positive"))
                worlds.step(moved, positive, tied)
            seen = own.qpos
            seen[:, mobile] = other.qpos[:, mobile]
            last, h = h, extract(eye.frames(seen))
            assert found["latent_length"][step] == length(h - last)[0]
            seen[:, arms] = other.qpos[:, arms]
            last, lent = lent, extract(eye.frames(seen))
            assert theirs["latent_length"][step] == length(lent - last)[0]


def test_under_its_own_mobile_only_the_rope_at_its_limb_is_lacking(
    tiny: Params, trained: Trained, scales: dict[str, float], runs: Runs
) -> None:
    """An infant yoked to itself lives through its baseline to the bit; then its foot is not held back."""
    own = runs("free", "mtl", 0, 1, 2)[2]
    (record,) = Experiment(tiny, "free", "mtl", [2], trained, scales, [donor(runs, "free", 2)]).run()
    found, first = arrays(record), ATTACHED[0]
    for name, values in own.items():
        assert found[name][: first + 1].tobytes() == values[: first + 1].tobytes()
    assert (found["q"][first + 1 :] != own["q"][first + 1 :]).any()


def test_donors_are_one_for_each_seed(tiny: Params, trained: Trained, scales: dict[str, float], runs: Runs) -> None:
    with pytest.raises(ValueError, match=r"^There must be a donor for each of 2 infants; there are 1\.$"):
        Experiment(tiny, "free", "mtl", [0, 1], trained, scales, [donor(runs, "free", 2)])


def test_a_donor_whose_run_is_too_short_stops_the_run(
    tiny: Params, trained: Trained, scales: dict[str, float], runs: Runs
) -> None:
    longer = params.changed(tiny, {"protocol.extinction_steps": 4})
    with pytest.raises(IndexError):
        Experiment(longer, "free", "mtl", [0], trained, scales, [donor(runs, "free", 1)]).run()
