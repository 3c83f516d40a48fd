"""The film of a published run: from beside, and through the infant's eye.

The run's recorded actions are repeated in the real world, from its first step. What it recorded of world and eye must
come out again, to the bit on a machine of the same class; else there is no film.
"""

import io
import multiprocessing
import os
import signal
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from PIL import Image

from mimo.learning.replay import replay, tied
from mimo.record import artifact
from mimo.settings import params
from mimo.vision import extractor
from mimo.world import scene
from mimo.world.eye import Eye
from stages.base import console, difference, provenance, workers
from stages.drawing import sheet, video
from stages.drawing.camera import Camera
from stages.drawing.sheet import Sheet
from stages.sweep import curves

# On another class of machine contacts amplify a last bit: single steps differ, by a fifth of the path's range, but soon
# agree again. Measured, with another libm and torch without AVX: at most .014 of a dataset's range.
TOLERANCE = 0.03  # of a dataset's range, mean over the steps
MOST = 8  # processes; encoding takes as long as more would
AHEAD = 64  # pictures that wait to be encoded, at most
NEW = 1.0  # s for which a shot's title is set off


@dataclass(frozen=True)
class Shot:
    """Successive agent steps, counted from 0, and their title."""

    title: str
    steps: range


@dataclass(frozen=True)
class Moment:
    """What a picture shows: generalised positions in the course of a step; `new` for the first second of its shot."""

    title: str
    step: int
    qpos: np.ndarray
    new: bool


def filmed(p: params.Params, run: artifact.Artifact, trained: extractor.Trained) -> tuple[bytes, bytes]:
    """The film as MP4 and its poster, a picture of late acquisition, as PNG.

    Args:
        p: what the run was made with.
        run: as published.
        trained: its encoder.

    Raises:
        console.StageError: the run's actions do not lead to what it recorded.
    """
    plan = shots(curves.phases(p), p.film.steps)
    shown = {step for shot in plan for step in shot.steps}
    built = scene.build(p.world, p.protocol)
    with Eye(built) as eye, console.Progress("Replay", max(shown) + 1, "agent steps") as progress:
        found = replay(p, run, built, eye, extractor.Extractor(p.encoder, trained), shown, progress.update)
    check(run, found.record)
    listed = list(moments(p, plan, found.positions))
    late = [moment for moment in listed if moment.title == plan[2].title]
    with _painters(p, run) as painted:
        with console.Progress("Film", len(listed), "pictures") as progress:
            film = video.encoded(_counted(painted(listed), progress), _rate(p))
        poster = io.BytesIO()
        (picture,) = painted([late[len(late) // 2]])
        Image.fromarray(picture).save(poster, "png", optimize=True)
    return film, poster.getvalue()


class Painter:
    """Draws a run's moments.

    Args:
        p: what the run was made with.
        run: its record.
    """

    def __init__(self, p: params.Params, run: artifact.Artifact) -> None:
        built = scene.build(p.world, p.protocol)
        self._p, self._run, self._sheet = p, run, Sheet(run, curves.phases(p), p.film.width)
        *_, width, height = self._sheet.pixels(sheet.VIEW)
        self._eye = Eye(built)
        self._camera = Camera(built, p.protocol.limb, self._sheet.colour, (height, width))

    def __call__(self, moment: Moment) -> np.ndarray:
        """(height, width, 3) uint8, the sheet of a moment."""
        attached = tied(self._p, self._run, moment.step)
        beside, within = self._camera.picture(moment.qpos, attached), self._eye.frames(moment.qpos[None])[0]
        return self._sheet.at(moment.step, moment.title, moment.new, beside, within)

    def close(self) -> None:
        """Free the GL contexts."""
        self._eye.close()
        self._camera.close()


@contextmanager
def _painters(p: params.Params, run: artifact.Artifact) -> Iterator[Callable[[Sequence[Moment]], Iterator[np.ndarray]]]:
    """Processes that draw a run's moments, in their order: a picture costs ten times what it takes to encode it."""
    fresh = multiprocessing.get_context("spawn")  # a GL context is of no use after a fork
    size = min(workers.count(), MOST)
    with ProcessPoolExecutor(size, fresh, _begin, (os.getpid(), p, run)) as pool:

        def painted(listed: Sequence[Moment]) -> Iterator[np.ndarray]:
            coming: deque[Future[np.ndarray]] = deque()
            for moment in listed:
                coming.append(pool.submit(_paint, moment))
                if len(coming) > AHEAD:
                    yield coming.popleft().result()
            yield from (picture.result() for picture in coming)

        try:
            yield painted
        except BrokenProcessPool as fault:
            raise console.StageError(
                f"A process that drew pictures was lost, as where memory runs out; each of {size} takes some 400 MB. "
                f"Run it again, with a lower {workers.VARIABLE}."
            ) from fault
        finally:
            pool.shutdown(wait=False, cancel_futures=True)


_painter: Painter  # of a process that draws


def _begin(parent: int, p: params.Params, run: artifact.Artifact) -> None:
    global _painter  # noqa: PLW0603  # one a process
    console.die_with_parent(parent)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the one that asks for pictures
    _painter = Painter(p, run)


def _paint(moment: Moment) -> np.ndarray:
    return _painter(moment)


def shots(phases: Mapping[str, slice], steps: int) -> list[Shot]:
    """What is around the rope's tying and its loss, `steps` each or as many as a short phase has."""
    baseline, attached, extinction = (range(phase.start, phase.stop) for phase in phases.values())
    few = max(1, min(steps, len(attached) // 2))
    return [
        Shot("End of baseline: no rope", baseline[-steps:]),
        Shot("Early acquisition: rope tied", attached[:few]),
        Shot("Late acquisition: rope tied", attached[-few:]),
        Shot("Start of extinction: rope gone", extinction[:steps]),
    ]


def moments(p: params.Params, plan: list[Shot], positions: Mapping[int, np.ndarray]) -> Iterator[Moment]:
    """What the film's pictures show, in real time.

    Args:
        p: for the film's pace.
        plan: the shots.
        positions: (updates, nq) by step, after each update.
    """
    each = p.protocol.updates_per_step
    for shot in plan:
        for update in range(p.film.frame_updates - 1, each * len(shot.steps), p.film.frame_updates):
            step = shot.steps[update // each]
            new = (update + 1) * p.protocol.timestep <= NEW
            yield Moment(shot.title, step, positions[step][update % each], new)


def check(run: artifact.Artifact, found: Mapping[str, artifact.Dataset]) -> None:
    """Compare what came out with what the run recorded, as far as the replay went.

    Raises:
        console.StageError: they differ; on a machine of another class than the published, by more than TOLERANCE.
    """
    held = {
        name: artifact.Dataset(run[name][: len(again.values)], again.units, again.axes) for name, again in found.items()
    }
    differences = list(difference.compare(held, found))
    if not differences:
        return
    if not provenance.foreign():
        raise console.StageError(
            f"{run.path}, replayed, is not what was recorded: {difference.first(differences)}; "
            f"`python -m stages.commands.identify {run.path}` says whether code or params.yaml changed."
        )
    for name, again in found.items():
        apart = np.abs(held[name].values.astype(float) - again.values).mean() / np.ptp(held[name].values)
        if apart > TOLERANCE:
            raise console.StageError(
                f"{run.path}, replayed on a machine of another class, is not what was recorded: {name} is {apart:.3f} "
                f"of its range apart, mean over {len(again.values)} steps, where {TOLERANCE:g} is allowed; "
                f"{difference.first(differences)}."
            )


def _rate(p: params.Params) -> Fraction:
    """Pictures a second."""
    return 1 / Fraction(p.film.frame_updates * p.protocol.timestep).limit_denominator(10_000)


def _counted(pictures: Iterator[np.ndarray], progress: console.Progress) -> Iterator[np.ndarray]:
    for done, picture in enumerate(pictures):
        yield picture
        progress.update(done + 1)
