"""What the fixtures of runs give, and of what."""

from collections.abc import Callable

import numpy as np

from mimo.learning.experiment import Record
from mimo.record import artifact

STEPS, ATTACHED = 10, range(3, 7)  # of `tiny`
ALL = ("mtl", "rtl", "cais", "surprise", "mtl_surprise", "rtl_surprise", "cais_surprise")

Records = Callable[..., list[Record]]
Runs = Callable[..., list[dict[str, np.ndarray]]]


def arrays(record: Record) -> dict[str, np.ndarray]:
    return {name: dataset.values for name, dataset in record.items()}


def file(record: Record) -> bytes:
    return artifact.to_bytes("run", "d" * 64, record)
