"""How our own kernels are compiled, and the arithmetic that they share: the same bytes on every processor.

A kernel is Python that numba compiles for the processor at hand. Without `fastmath` no operation is fused, left out or
put in another order, so vectors of any width give the same numbers. Additions, products, quotients and square roots are
exact by IEEE 754; erf is ours, since a library's differs from machine to machine.
"""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numba
import numpy as np
import platformdirs

F = TypeVar("F", bound=Callable[..., Any])
Array = np.ndarray

# Where compiled kernels are kept, once a machine; a folder that takes no file costs the compiling, each time.
CACHE = Path(os.environ.get("NUMBA_CACHE_DIR") or Path(platformdirs.user_cache_dir("mimo-agency"), "kernels"))
# Eigen's erf: x P(x^2) / Q(x^2), and constant beyond LAST, where it is 1 but for the last bit. Single names, as loops
# over tuples' items don't become vectors.
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


def kernel(function: F) -> F:
    """Compile a function of arrays and numbers when it is first called."""
    compiled: Any = numba.njit(cache=_keeps(), fastmath=False, error_model="numpy")(function)
    return compiled  # type: ignore[no-any-return]


def _keeps() -> bool:
    try:
        CACHE.mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    numba.config.CACHE_DIR = str(CACHE)  # type: ignore[attr-defined]
    return os.access(CACHE, os.W_OK)


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
