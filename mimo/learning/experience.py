"""The one way from actions to a transition: worlds, eye, extractor and, where needed, outcome models."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mimo.learning.outcomes import Outcomes, taus
from mimo.learning.rewards import Transition
from mimo.settings.params import Params
from mimo.vision.collect import REGIMES
from mimo.vision.extractor import LEVELS, Extractor, Trained
from mimo.world.eye import Eye
from mimo.world.physics import Outcome, Worlds


class Perception:
    """What N seeds make of what they see: h, and what their outcome models know of it.

    Attributes:
        latent: (N, latent), h of what was seen last.
        outcomes: None where nothing needs them.

    Args:
        extract: pictures to h.
        frames: (N, 128, 128, 3) uint8, what is seen first.
        outcomes: of N seeds.
    """

    def __init__(self, extract: Extractor, frames: np.ndarray, outcomes: Outcomes | None = None) -> None:
        self._extract, self.outcomes = extract, outcomes
        self.latent = extract(frames)

    def transition(
        self,
        moved: np.ndarray,
        path_length: np.ndarray,
        frames: np.ndarray,
        probability: np.ndarray | None = None,
        before_end: Sequence[np.ndarray] = (),
    ) -> Transition:
        """Take in what came of an action; the outcome models learn from it once they have said what they expected.

        Args:
            moved: (N, 12) bool, MOVE or not.
            path_length: (N,) m travelled by the mobile.
            frames: (N, 128, 128, 3) uint8, what is seen at the step's end.
            probability: (N, 12) float32, P(MOVE) by which it was decided; see Outcomes.influence.
            before_end: likewise frames, of what is seen before the end.
        """
        seen = np.stack([self.latent, *map(self._extract, (*before_end, frames))], axis=1)
        self.latent = seen[:, -1]
        return transition(moved, path_length.astype(np.float32), seen, self.outcomes, probability)


def transition(
    action: np.ndarray,
    path_length: np.ndarray,
    latents: np.ndarray,
    outcomes: Outcomes | None,
    probability: np.ndarray | None = None,
) -> Transition:
    """What came of an action; the outcome models learn from it once they have said what they expected.

    Args:
        action: (N, 12) bool, True where the joint moved.
        path_length: (N,) float32, m travelled by the mobile.
        latents: (N, frames + 1, latent) float32, h at the start and at each picture, the last at the end.
        outcomes: of N seeds, where something needs them.
        probability: (N, 12) float32, P(MOVE) by which the action was decided; see Outcomes.influence.
    """
    found = Transition(
        path_length=path_length,
        latents=latents,
        action=action,
        influence=outcomes.influence(probability) if outcomes else None,
        expectation=outcomes.expectation(action) if outcomes else None,
    )
    if outcomes:
        outcomes.update(action, latents[:, -1])
    return found


class Experience:
    """Acts in N worlds and perceives them.

    Attributes:
        worlds: as given.
        perception: its own.

    Args:
        worlds: at the start of a run.
        eye: of the same scene.
        extract: pictures to h.
        outcomes: of N seeds, where something needs them.
        frames: pictures of a step, evenly in time, the last at its end.
    """

    def __init__(
        self, worlds: Worlds, eye: Eye, extract: Extractor, outcomes: Outcomes | None = None, frames: int = 1
    ) -> None:
        self.worlds, self._eye, self._frames = worlds, eye, frames
        self.perception = Perception(extract, eye.frames(worlds.qpos), outcomes)

    def step(
        self, moved: np.ndarray, positive: np.ndarray, attached: bool, probability: np.ndarray | None = None
    ) -> tuple[Outcome, Transition]:
        """One agent step (paper §2.3, fig. 1B).

        Args:
            moved: (N, 12) bool, MOVE or not.
            positive: (N, 12) bool, the torques' directions.
            attached: whether the rope is on.
            probability: (N, 12) float32, P(MOVE) by which it was decided; see Outcomes.influence.

        Returns:
            What the worlds show, and what rewards are computed from.

        Raises:
            DivergedError: a world's physics diverged.
        """
        pieces, seen = [], []
        for outcome in self.worlds.parts(moved, positive, attached, self._frames):
            pieces.append(outcome.path_length)
            seen.append(self._eye.frames(self.worlds.qpos))
        outcome = replace(outcome, path_length=np.sum(pieces, axis=0))
        *before_end, last = seen
        return outcome, self.perception.transition(moved, outcome.path_length, last, probability, before_end)


def untaught(params: Params, trained: Trained, condition: str, generators: Sequence[np.random.Generator]) -> Outcomes:
    """Outcome models that have learned nothing of the experiment; see initial_quantiles.

    Args:
        params: all of params.yaml.
        trained: the encoder.
        condition: free or noisy.
        generators: one a seed; each draws its seed's batches.
    """
    return Outcomes(params.outcomes, initial_quantiles(params, trained, condition), generators)


def initial_quantiles(params: Params, trained: Trained, condition: str) -> np.ndarray:
    """(latent, quantiles) where every outcome model starts, by `outcomes.start`.

    `detached`: the quantiles of h over the encoder's frames of the condition with the rope off, which is what has been
    seen before an experiment. `zero`: the mean of h over all of them.
    """
    levels = taus(params.outcomes.quantiles)
    if params.outcomes.start == "zero":
        return np.zeros((params.encoder.latent, len(levels)), np.float32)
    seen = trained.quantiles[REGIMES.index((condition, False))]
    return np.stack([np.interp(levels, LEVELS, row) for row in seen]).astype(np.float32)
