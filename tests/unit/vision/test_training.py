"""Training: its losses, its bytes, its faults."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from mimo.settings import params
from mimo.vision.encoder import UNet, images, train
from mimo.vision.extractor import Trained
from tests.unit.vision.reference import fingerprint, nt_xent

SCRIPT = """
import sys
import numpy as np
import torch
from mimo.settings import params
from mimo.vision import encoder
from tests.unit.vision.reference import fingerprint
torch.manual_seed(99)  # torch's own stream must not matter
settings = params.Encoder.model_validate_json(sys.argv[1])
trained = encoder.train(settings, np.load(sys.argv[2]), np.random.default_rng(3))
print(fingerprint(trained))
"""


def test_training_lowers_both_losses(learned: Trained, brief: params.Encoder, few: np.ndarray) -> None:
    assert len(few) == 6
    total = learned.reconstruction + brief.cltt_weight * learned.cltt
    assert total.shape == (6,)
    for loss in (total, learned.reconstruction, learned.cltt):
        assert loss[-1] < loss[0]


def test_the_first_losses_are_those_of_the_drawn_network(
    learned: Trained, brief: params.Encoder, few: np.ndarray
) -> None:
    """The first frame is reconstructed; first and second are contrasted; losses are means."""
    torch.manual_seed(int(np.random.default_rng(3).integers(2**31)))
    net = UNet(brief)
    first, second = images(few[:, 0]), images(few[:, 1])
    with torch.no_grad():
        latent, skips = net.encode(first)
        error = (net.decode(latent, skips) - first).square().mean().item()
        z = [net.project(h).numpy() for h in (latent, net.encode(second)[0])]
    assert learned.reconstruction[0] == pytest.approx(error, rel=1e-5)
    assert learned.cltt[0] == pytest.approx(nt_xent(z[0], z[1], brief.tau), rel=1e-4)


def test_every_weight_learns(learned: Trained, brief: params.Encoder) -> None:
    torch.manual_seed(int(np.random.default_rng(3).integers(2**31)))
    start = UNet(brief).state_dict()
    assert set(learned.weights) == set(start)
    assert [name for name, value in learned.weights.items() if (value == start[name].numpy()).all()] == []


def test_training_is_the_same_bytes_in_another_process(
    learned: Trained, brief: params.Encoder, grouped: np.ndarray, tmp_path: Path
) -> None:
    np.save(tmp_path / "pairs.npy", grouped)
    command = [sys.executable, "-c", SCRIPT, brief.model_dump_json(), str(tmp_path / "pairs.npy")]
    there = subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    assert there == fingerprint(learned)


def test_groups_are_trained_on_together(learned: Trained, brief: params.Encoder, few: np.ndarray) -> None:
    """Only what is measured of each group depends on what the groups are."""
    together = train(brief, few[None], np.random.default_rng(3))
    assert together.quantiles.shape == (1, 64, 99)
    assert fingerprint(replace(together, quantiles=learned.quantiles)) == fingerprint(learned)


def test_the_generator_decides(tiny: params.Params, grouped: np.ndarray) -> None:
    once = tiny.encoder.model_copy(update={"iterations": 1, "pairs": 2})
    one, other = (train(once, grouped, np.random.default_rng(seed)) for seed in (0, 1))
    assert fingerprint(one) != fingerprint(other)


def test_progress_counts_iterations(tiny: params.Params, grouped: np.ndarray) -> None:
    told: list[int] = []
    train(tiny.encoder.model_copy(update={"iterations": 2, "pairs": 2}), grouped, np.random.default_rng(0), told.append)
    assert told == [1, 2]


@pytest.mark.parametrize(("change", "iteration"), [({"tau": 1e-320}, 0), ({"learning_rate": 1e30}, 1)])
def test_a_loss_that_is_not_finite_raises_with_its_iteration(
    change: dict[str, float], iteration: int, tiny: params.Params, grouped: np.ndarray
) -> None:
    told: list[int] = []
    with pytest.raises(FloatingPointError, match=f"not finite at iteration {iteration}$"):
        train(tiny.encoder.model_copy(update=change), grouped, np.random.default_rng(0), told.append)
    assert told == list(range(1, iteration + 1))
