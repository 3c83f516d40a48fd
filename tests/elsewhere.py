"""`python -m tests.elsewhere [PAIRS ITERATIONS STEPS]`: hashes of all that a processor could compute otherwise.

The encoder's training, its inference, and agent steps of a run with every kind of model: on frames drawn at random, at
the published sizes but for the number of pairs, since libraries choose kernels by size.
"""

import hashlib
import sys
from collections.abc import Iterable, Iterator
from typing import Any

import mimo  # noqa: F401  # first: it decides which kernels compute

# isort: split
import numpy as np

from mimo.learning.experiment import Experiment
from mimo.record import runtime
from mimo.settings import params
from mimo.vision import encoder
from mimo.vision.collect import REGIMES
from mimo.vision.extractor import Extractor

LEAST, MOST = (2, 1, 2), (8, 3, 20)  # pairs, iterations, agent steps: for every test run, and for `make same-bytes`


def main(pairs: int, iterations: int, steps: int) -> None:
    p = params.load()
    for library in ("numpy", "torch"):
        print(library, runtime._computed(library), flush=True)
    frames = np.random.default_rng(0).integers(0, 256, (len(REGIMES), pairs, 2, 128, 128, 3), np.uint8)
    few = params.checked(p.encoder, {"pairs": pairs, "iterations": iterations})
    trained = encoder.train(few, frames, np.random.default_rng(1))
    print("training", digest(trained.weights.values()), flush=True)
    print("inference", digest([Extractor(few, trained)(frames[0, :, 0]), trained.quantiles]), flush=True)
    scales = {"mtl": 0.1, "rtl": 0.1, "cais": 0.1, "surprise": 1.0}
    run = Experiment(p, "noisy", "_".join(scales), [0, 1], trained, scales)
    with run.eye:
        first = p.protocol.baseline_steps  # the rope is tied
        for step in range(steps):
            run.step(first + step)
    for name, values in recorded(run):
        print(name, digest([values]), flush=True)


def recorded(run: Experiment) -> Iterator[tuple[str, np.ndarray]]:
    """What the run has recorded, by name, of all seeds."""
    first, *others = run.log.records()
    for name in first:
        yield name, np.stack([first[name].values, *(other[name].values for other in others)])


def digest(values: Iterable[Any]) -> str:
    found = hashlib.sha256()
    for each in values:
        found.update(np.ascontiguousarray(each).tobytes())
    return found.hexdigest()[:16]


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]) if len(sys.argv) == 4 else LEAST)
