"""Which runs are computed next, and how many together: chunks of one cell that shrink towards the end."""

import heapq
import math
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass

from mimo.learning import rewards


@dataclass(frozen=True)
class Run:
    """One run and its digest; `variant` is empty for the paper's own."""

    condition: str
    reward: str
    seed: int
    digest: str
    variant: str = ""


@dataclass(frozen=True)
class Chunk:
    """Runs of one cell that train in lock step."""

    runs: tuple[Run, ...]

    @property
    def name(self) -> str:
        """For people: variant, condition, reward and seeds."""
        first = self.runs[0]
        seeds = ", ".join(str(run.seed) for run in self.runs)
        return f"{of(first)}{first.condition}, {first.reward}, seed {seeds}"


def of(run: Run) -> str:
    """How a run's name begins."""
    return f"{run.variant}: " if run.variant else ""


class Schedule:
    """Hands out chunks of runs, each run once.

    Low seeds of every cell come first, so that an early look sees all cells; then those with outcome models, which take
    longest. Lock step saves time, so chunks are as large as may be while there is much to do; then they shrink, so that
    no worker is left with a long one when the others have none.

    Args:
        todo: the runs.
        size: how many runs a chunk has at most.
    """

    def __init__(self, todo: Iterable[Run], size: int) -> None:
        self._size = size
        self._alone: deque[Run] = deque()
        cells: dict[tuple[str, str, str], deque[Run]] = {}
        for run in todo:
            cells.setdefault((run.variant, run.condition, run.reward), deque()).append(run)
        self._heap = [(*_rank(cell[0]), order, cell) for order, cell in enumerate(cells.values())]
        heapq.heapify(self._heap)
        self._left = sum(map(len, cells.values()))
        self._chunks = 0  # handed out

    def next(self, workers: int) -> Chunk | None:
        """The next chunk, for a crew of so many; None if there is none now."""
        if self._alone:
            return Chunk((self._alone.popleft(),))
        if not self._heap:
            return None
        *_, order, cell = heapq.heappop(self._heap)
        runs = tuple(cell.popleft() for _ in range(min(self._size, self._share(workers), len(cell))))
        self._left -= len(runs)
        self._chunks += 1
        if cell:
            heapq.heappush(self._heap, (*_rank(cell[0]), order, cell))
        return Chunk(runs)

    def _share(self, workers: int) -> int:
        """Half of what there is for each worker; two in lock step as long as some worker must do two anyway."""
        if workers == 1:
            return self._left
        idle = workers - self._chunks if self._chunks < workers else workers
        return max(2, math.ceil(self._left / (2 * workers))) if self._left > idle else 1

    def apart(self, chunk: Chunk) -> bool:
        """Hand the runs of a chunk that failed out again, each alone; False if it was one alone."""
        if len(chunk.runs) == 1:
            return False
        self._alone.extend(chunk.runs)
        return True


def _rank(run: Run) -> tuple[int, bool]:
    return run.seed, not rewards.needs_outcomes(run.reward)
