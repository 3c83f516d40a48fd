"""The kernels' arithmetic against scipy's and torch's."""

import subprocess
import sys

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from scipy import special

from mimo.record import kernels


def test_erf_is_scipys_to_single_precision() -> None:
    x = np.concatenate([np.linspace(-6, 6, 4001), [-np.inf, np.inf, 0.0, 1e-30]]).astype(np.float32)
    found = np.array([kernels.erf(value) for value in x])
    assert np.abs(found - special.erf(x.astype(float))).max() < 4e-7
    assert found[-2] == 0


def test_exp_is_numpys_to_single_precision() -> None:
    x = np.linspace(-87, 88, 20001).astype(np.float32)
    found = np.array([kernels.exp(value) for value in x]).astype(float)
    expected = np.exp(x.astype(float))
    assert np.abs(found / expected - 1).max() < 2e-7
    assert kernels.exp(np.float32(0)) == 1
    assert kernels.exp(np.float32(-1e9)) == kernels.exp(kernels.LEAST) > 0
    assert np.isfinite(kernels.exp(np.float32(1e9)))
    assert np.isnan(kernels.exp(np.float32(np.nan)))


def test_normal_is_the_normal_distribution_function() -> None:
    x = np.linspace(-9, 9, 2001).astype(np.float32)
    found = np.array([kernels.normal(value) for value in x])
    assert np.abs(found - special.ndtr(x.astype(float))).max() < 4e-7


@given(st.integers(0, 70), st.integers(0, 99))
def test_dot_is_a_product_of_vectors(size: int, seed: int) -> None:
    x, y = np.random.default_rng(seed).normal(size=(2, size)).astype(np.float32)
    found = kernels.dot(x, y, np.full(kernels.LANES, np.nan, np.float32))
    assert found == pytest.approx(x.astype(float) @ y, abs=1e-4)


def test_adamw_is_torchs() -> None:
    generator = np.random.default_rng(0)
    x = generator.normal(size=50).astype(np.float32)
    first, second = np.zeros((2, 50), np.float32)
    twin = torch.from_numpy(x.astype(float))
    optimizer = torch.optim.AdamW([twin], lr=0.01)
    for count in range(1, 200):
        gradient = (generator.normal(size=50) * 10.0 ** generator.integers(-6, 3, 50)).astype(np.float32)
        twin.grad = torch.from_numpy(gradient.astype(float))
        optimizer.step()
        kernels.adamw(x, gradient, first, second, np.float32(0.01), count)
        np.testing.assert_allclose(x, twin.numpy(), atol=2e-5)


FLUSHED = """
from mimo.record import kernels, runtime
import torch
assert torch.set_flush_denormal({})
for check in (lambda: runtime.check("numpy"), kernels.check):
    try:
        check()
        print("the same")
    except runtime.KernelError as fault:
        print(fault)
"""


@pytest.mark.parametrize(("flush", "said"), [(False, "the same\n"), (True, "Results would be other bytes here: ")])
def test_a_process_in_which_the_smallest_numbers_count_as_0_is_refused(flush: bool, said: str) -> None:
    """Some libraries set that when they are loaded, for all that their thread computes."""
    done = subprocess.run([sys.executable, "-c", FLUSHED.format(flush)], capture_output=True, text=True)
    assert done.stdout.count(said) == 2, done.stderr
