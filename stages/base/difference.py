"""Where recorded datasets differ from others of the same names, and by how much."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from mimo.record.artifact import Dataset


@dataclass(frozen=True)
class Difference:
    """Where two datasets of one name differ first: in `dataset`, at `step` counted from 0 (None where it has no steps).

    `size` is the largest difference there, `relative` the same over the dataset's range.
    """

    dataset: str
    step: int | None
    size: float
    relative: float

    def __str__(self) -> str:
        where = "" if self.step is None else f" at step {self.step + 1}"
        return f"{self.dataset} differs first{where}, by {self.size:.3g} ({self.relative:.1e} of its range)"


def compare(held: Mapping[str, Dataset], found: Mapping[str, Dataset]) -> Iterator[Difference]:
    """Where each dataset that differs does so first; where it has no steps, over all of it."""
    for name in sorted(held.keys() | found.keys()):
        if name not in held or name not in found:
            yield Difference(f"{name}, which only one of them has,", None, np.inf, np.inf)
            continue
        old, new = held[name], found[name]
        if old.values.shape != new.values.shape or old.values.dtype.kind == "S":
            if not np.array_equal(old.values, new.values):
                yield Difference(f"{name}, in shape or text,", None, np.inf, np.inf)
            continue
        stepped = old.axes.startswith("step")
        away = np.abs(old.values.astype(float) - new.values.astype(float))
        if away.any():
            span = float(np.ptp(old.values.astype(float))) or float(np.abs(old.values).max()) or 1.0
            step = int(np.nonzero(away.reshape(len(away), -1).any(axis=1))[0][0]) if stepped else None
            size = float(away.max() if step is None else away[step].max())
            yield Difference(name, step, size, size / span)


def first(differences: Iterable[Difference]) -> Difference:
    """The one of the earliest step; of several, the largest."""
    return min(differences, key=lambda each: (each.step or 0, -each.relative))
