"""The encoder's kernel is UNet.encode, and the same bytes for whatever processor it is compiled."""

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from mimo.settings import params
from mimo.vision import encoder, inference

ROOT = Path(__file__).parents[3]
SETTINGS = params.load(ROOT / "params.yaml").encoder
SCRIPT = """
import hashlib
import mimo
from tests.unit.vision.test_inference import drawn, hashed
print(hashed(*drawn([4, 5, 16, 3], 2)))
"""


def drawn(widths: list[int], seed: int) -> tuple[encoder.UNet, np.ndarray]:
    """A U-Net of random weights, gains and shifts of its norms among them, and two random frames."""
    torch.manual_seed(seed)
    net = encoder.UNet(params.checked(SETTINGS, {"widths": widths})).eval().requires_grad_(False)
    for parameter in net.parameters():
        parameter.add_(0.2 * torch.randn_like(parameter))
    return net, np.random.default_rng(seed).integers(0, 256, (2, 128, 128, 3), np.uint8)


def hashed(net: encoder.UNet, frames: np.ndarray) -> str:
    weights = {name: value.numpy() for name, value in net.state_dict().items()}
    return hashlib.sha256(inference.raw(inference.layers(weights), frames).tobytes()).hexdigest()


@given(widths=st.lists(st.integers(1, 9), min_size=4, max_size=4), seed=st.integers(0, 99))
@settings(max_examples=15)
def test_the_kernel_is_the_unets_encoder(widths: list[int], seed: int) -> None:
    net, frames = drawn(widths, seed)
    weights = {name: value.numpy() for name, value in net.state_dict().items()}
    expected = net.encode(encoder.images(frames))[0].numpy()
    found = inference.raw(inference.layers(weights), frames)
    assert found.dtype == np.float32
    assert np.abs(found - expected).max() < 2e-5 * np.abs(expected).max()


def test_a_dark_frame_is_no_exception() -> None:
    """Nothing varies in its middle: the norms divide by little more than what is added to a variance of zero."""
    net, _ = drawn([4, 8, 16, 16], 0)
    weights = {name: value.numpy() for name, value in net.state_dict().items()}
    dark = np.zeros((1, 128, 128, 3), np.uint8)
    found = inference.raw(inference.layers(weights), dark)
    assert np.allclose(found, net.encode(encoder.images(dark))[0].numpy(), rtol=1e-4, atol=1e-4)


def elsewhere(**variables: str) -> str:
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT], cwd=ROOT, env=os.environ | variables, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


@pytest.mark.parametrize("processor", ["generic", "haswell"])
def test_the_bytes_are_the_same_for_whatever_processor_it_is_compiled(processor: str, tmp_path: Path) -> None:
    """`generic` has neither AVX nor FMA."""
    found = elsewhere(NUMBA_CPU_NAME=processor, NUMBA_CPU_FEATURES="", NUMBA_CACHE_DIR=str(tmp_path))
    assert found == hashed(*drawn([4, 5, 16, 3], 2))
    assert list(tmp_path.glob("*.kernel"))  # kept for the next process


def test_a_cache_that_takes_no_file_costs_nothing_but_time() -> None:
    assert elsewhere(NUMBA_CACHE_DIR="/proc/nowhere") == hashed(*drawn([4, 5, 16, 3], 2))
