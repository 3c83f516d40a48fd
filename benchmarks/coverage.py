"""`python -m benchmarks.coverage`: how often 95 % intervals of the interquartile mean hold it, for so few seeds.

Five populations that effects over seeds may come from, samples of 5, 10 and 20, and three intervals: the bootstrap's
percentile interval, BCa, and the percentile interval expanded for small samples, which mimo.science.judgement uses.
"""

import argparse
from collections.abc import Callable
from typing import Literal

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy import stats

from mimo.science import judgement

Array = np.ndarray
RESAMPLES = 1999
MANY = 2_000_000  # draws that a population's own interquartile mean is taken of
POPULATIONS: dict[str, Callable[[np.random.Generator, tuple[int, ...]], Array]] = {
    "normal": lambda rng, shape: rng.normal(size=shape),
    "skewed": lambda rng, shape: rng.lognormal(sigma=0.8, size=shape),
    "heavy tails": lambda rng, shape: rng.standard_t(3, size=shape),
    "two kinds": lambda rng, shape: rng.normal(size=shape) * 0.3 + 2.0 * (rng.random(shape) < 0.3),
    "bounded": lambda rng, shape: rng.beta(5, 1, size=shape),
}


def main() -> None:
    """Simulate and print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.coverage", description=__doc__)
    parser.add_argument("--draws", type=int, default=1000, help="samples of each size from each population")
    options = parser.parse_args()
    table = Table(title=f"Coverage of {judgement.LEVEL:.0%} intervals, {options.draws} draws")
    for column in ("n", "population", *INTERVALS):
        table.add_column(column)
    rng = np.random.default_rng(0)
    judgement.RESAMPLES = RESAMPLES  # fewer than for verdicts, which need small p
    for n in (5, 10, 20):
        for name, draw in POPULATIONS.items():
            true = float(judgement.interquartile_mean(draw(rng, (MANY,))))
            samples = draw(rng, (options.draws, n))
            table.add_row(str(n), name, *(f"{covered(samples, true, own):.3f}" for own in INTERVALS.values()))
    Console().print(table)


def covered(samples: Array, true: float, interval: Callable[[Array], tuple[float, float]]) -> float:
    """Share of samples whose interval holds the true value."""
    ends = np.array([interval(sample) for sample in samples])
    return float(((ends[:, 0] <= true) & (true <= ends[:, 1])).mean())


def expanded(sample: Array) -> tuple[float, float]:
    """Of mimo.science.judgement."""
    return judgement.interval(judgement.resampled(sample), len(sample))


def scipys(method: Literal["percentile", "BCa"]) -> Callable[[Array], tuple[float, float]]:
    """An interval by its name in SciPy."""

    def interval(sample: Array) -> tuple[float, float]:
        found = stats.bootstrap(
            (sample,), judgement.interquartile_mean, n_resamples=RESAMPLES, method=method,
            confidence_level=judgement.LEVEL, vectorized=True, rng=np.random.default_rng(0),
        )  # fmt: skip
        return float(found.confidence_interval.low), float(found.confidence_interval.high)

    return interval


INTERVALS = {"percentile": scipys("percentile"), "BCa": scipys("BCa"), "expanded percentile": expanded}


if __name__ == "__main__":
    main()
