"""How our own kernels are compiled, and the arithmetic that they share: the same bytes on every processor.

A kernel is Python that numba compiles for the processor at hand. Without `fastmath` no operation is fused, left out or
put in another order, so vectors of any width give the same numbers. Additions, products, quotients and square roots are
exact by IEEE 754; exp and erf are ours, since a library's differ from machine to machine.
"""

import functools
import hashlib
import platform
from collections.abc import Callable
from typing import Any, TypeVar

import numba
import numpy as np

from mimo.record import cache
from mimo.record.runtime import KernelError

F = TypeVar("F", bound=Callable[..., Any])
Array = np.ndarray

ONE, HALF = np.float32(1), np.float32(0.5)
# Single names and index loops throughout, as loops over tuples' items don't become vectors.
# Cephes' expf: exp(x) = 2^n exp(r), |r| <= log(2) / 2; between LEAST and MOST both are normal numbers.
LEAST, MOST = np.float32(-87), np.float32(88)
PER_LOG_2, LOG_2_HIGH, LOG_2_LOW = map(np.float32, (1.44269504088896341, 0.693359375, -2.12194440e-4))
E0, E1, E2, E3, E4, E5 = map(
    np.float32, (5.0000001201e-1, 1.6666665459e-1, 4.1665795894e-2, 8.3334519073e-3, 1.3981999507e-3, 1.9875691500e-4)
)
# Eigen's erf: x P(x^2) / Q(x^2), and constant beyond LAST, where it is 1 but for the last bit.
LAST = np.float32(3.832506856900711)
FIRST = np.float32(-LAST)
P0, P1, P2, P3, P4 = map(
    np.float32,
    (1.128379143519084, 0.18520832239976145, 0.050955695062380861, 0.0034082910107109506, 0.00022905065861350646),
)
Q0, Q1, Q2, Q3, Q4, Q5, Q6 = map(
    np.float32,
    (1.0, 0.49746925110067538, 0.11098505178285362, 0.014070470171167667, 0.0010179625278914885,
     0.000023547966471313185, -1.1791602954361697e-7),
)  # fmt: skip
ROOT_HALF = np.float32(0.5**0.5)
# AdamW's defaults in torch, as the paper gives its learning rates alone.
BETA_1, BETA_2, DECAY = 0.9, 0.999, np.float32(0.01)
KEPT_2, NEW_1, NEW_2, TINY = map(np.float32, (BETA_2, 1 - BETA_1, 1 - BETA_2, 1e-8))
LANES = 8  # sums in `dot`
# What `_computed` gives with this release of numba.
FINGERPRINTS = {"0.68.1": "30498eb44cf05581"}


def kernel(function: F) -> F:
    """Compile a function of arrays and numbers when it is first called."""
    compiled: Any = numba.njit(fastmath=False, error_model="numpy")(function)
    cache.keep(compiled)
    return compiled  # type: ignore[no-any-return]


@functools.cache
def check() -> None:
    """Make sure that kernels compute here as everywhere. Takes milliseconds, once.

    Raises:
        KernelError: they do not.
    """
    expected = FINGERPRINTS.get(numba.__version__)
    if platform.machine() == "x86_64" and expected is not None and _computed() != expected:
        raise KernelError(
            "Results would be other bytes here: compiled kernels round otherwise than they should. Look for a library "
            "that changed how this process computes (flush-to-zero), or for NUMBA_ variables."
        )


def _computed() -> str:
    """A hash of what kernels make of numbers of all sizes, some of them below the normal ones."""
    x = np.linspace(-9, 9, 512).astype(np.float32)
    y = np.float32(1e-19) * x
    numbers, moments = x.copy(), np.zeros((2, len(x)), np.float32)
    adamw(numbers, y, moments[0], moments[1], np.float32(0.001), 1)
    single = np.array([[exp(value), normal(value)] for value in x], np.float32)
    products = np.array([dot(x, x[::-1].copy(), np.zeros(LANES, np.float32)), total(x.astype(float))])
    found = hashlib.sha256()
    for values in (single, products, numbers, moments):
        found.update(values.tobytes())
    return found.hexdigest()[:16]


def checked(name: str, given: Array, shape: tuple[int, ...], dtype: Any) -> Array:
    """An array for a kernel, contiguous: kernels read and write beyond an array's end without a word.

    Raises:
        ValueError: it has another shape or type.
    """
    given = np.asarray(given)
    if given.shape != shape or given.dtype != dtype:
        raise ValueError(f"{name} must be {shape} of {np.dtype(dtype)}; it is {given.shape} of {given.dtype}.")
    return np.ascontiguousarray(given)


@kernel
def exp(x: Any) -> Any:
    """e^x of a float32, to 2e-7 of its size; x below LEAST counts as LEAST, above MOST as MOST."""
    x = min(max(x, LEAST), MOST)
    n = np.floor(x * PER_LOG_2 + HALF)
    r = x - n * LOG_2_HIGH - n * LOG_2_LOW
    p = ((((E5 * r + E4) * r + E3) * r + E2) * r + E1) * r + E0
    power = np.int32((np.int32(n) + np.int32(127)) << np.int32(23)).view(np.float32)  # 2^n, by its bits
    return (p * r * r + r + ONE) * power


@kernel
def erf(x: Any) -> Any:
    """The error function of a float32, to 4e-7."""
    x = min(max(x, FIRST), LAST)
    t = x * x
    p = (((P4 * t + P3) * t + P2) * t + P1) * t + P0
    q = (((((Q6 * t + Q5) * t + Q4) * t + Q3) * t + Q2) * t + Q1) * t + Q0
    return x * p / q


@kernel
def total(x: Array) -> Any:
    """The sum of x (n,) float64, from first to last."""
    found = 0.0
    for value in x:
        found += value
    return found


@kernel
def normal(x: Any) -> Any:
    """The normal distribution function of a float32; GELU is x times it."""
    return HALF + HALF * erf(x * ROOT_HALF)


@kernel
def dot(x: Array, y: Array, lanes: Array) -> Any:
    """The sum of x y, both (n,) float32: LANES sums, then theirs; `lanes` (LANES,) is room for them."""
    whole = len(x) // LANES * LANES
    lanes[:] = 0
    for i in range(0, whole, LANES):
        for lane in range(LANES):
            lanes[lane] += x[i + lane] * y[i + lane]
    for i in range(whole, len(x)):
        lanes[0] += x[i] * y[i]
    found = lanes[0]
    for lane in range(1, LANES):
        found += lanes[lane]
    return found


@kernel
def adamw(x: Array, gradient: Array, first: Array, second: Array, rate: Any, count: int) -> None:
    """Step `count`, from 1, of AdamW (Loshchilov & Hutter 2019) on x (n,) float32 with its moments, all in place."""
    kept = ONE - rate * DECAY
    step = np.float32(rate / (1 - BETA_1**count))
    root = np.float32(np.sqrt(1 - BETA_2**count))
    for i in range(len(x)):
        first[i] += NEW_1 * (gradient[i] - first[i])
        second[i] = KEPT_2 * second[i] + NEW_2 * gradient[i] * gradient[i]
        x[i] = x[i] * kept - step * first[i] / (np.sqrt(second[i]) / root + TINY)
