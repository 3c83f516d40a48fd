"""The one way from actions to a transition: worlds, eye, extractor and, where needed, outcome models."""

from collections.abc import Sequence

import numpy as np

from mimo.learning.outcomes import Outcomes, taus
from mimo.learning.rewards import Transition
from mimo.settings.params import Params
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

    def transition(self, moved: np.ndarray, path_length: np.ndarray, frames: np.ndarray) -> Transition:
        """Take in what came of an action; the outcome models learn from it once they have said what they expected.

        Args:
            moved: (N, 12) bool, MOVE or not.
            path_length: (N,) m travelled by the mobile.
            frames: (N, 128, 128, 3) uint8, what is seen at the step's end.
        """
        before, self.latent = self.latent, self._extract(frames)
        return transition(moved, path_length.astype(np.float32), before, self.latent, self.outcomes)


def transition(
    action: np.ndarray, path_length: np.ndarray, before: np.ndarray, after: np.ndarray, outcomes: Outcomes | None
) -> Transition:
    """What came of an action; the outcome models learn from it once they have said what they expected.

    Args:
        action: (N, 12) bool, True where the joint moved.
        path_length: (N,) float32, m travelled by the mobile.
        before: (N, latent) float32, h.
        after: (N, latent) float32, h.
        outcomes: of N seeds, where something needs them.
    """
    found = Transition(
        path_length=path_length,
        latent_before=before,
        latent=after,
        action=action,
        influence=outcomes.influence() if outcomes else None,
        expectation=outcomes.expectation(action) if outcomes else None,
    )
    if outcomes:
        outcomes.update(action, after)
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
    """

    def __init__(self, worlds: Worlds, eye: Eye, extract: Extractor, outcomes: Outcomes | None = None) -> None:
        self.worlds, self._eye = worlds, eye
        self.perception = Perception(extract, eye.frames(worlds.qpos), outcomes)

    def step(self, moved: np.ndarray, positive: np.ndarray, attached: bool) -> tuple[Outcome, Transition]:
        """One agent step (paper §2.3, fig. 1B).

        Args:
            moved: (N, 12) bool, MOVE or not.
            positive: (N, 12) bool, the torques' directions.
            attached: whether the rope is on.

        Returns:
            What the worlds show, and what rewards are computed from.

        Raises:
            DivergedError: a world's physics diverged.
        """
        outcome = self.worlds.step(moved, positive, attached)
        return outcome, self.perception.transition(moved, outcome.path_length, self._eye.frames(self.worlds.qpos))


def untaught(params: Params, trained: Trained, generators: Sequence[np.random.Generator]) -> Outcomes:
    """Outcome models that have learned nothing: they start at h's marginal quantiles over the encoder's frames.

    Args:
        params: all of params.yaml.
        trained: the encoder.
        generators: one a seed; each draws its seed's batches.
    """
    return Outcomes(params.outcomes, initial_quantiles(params, trained), generators)


def initial_quantiles(params: Params, trained: Trained) -> np.ndarray:
    """(latent, quantiles) where every outcome model starts."""
    levels = taus(params.outcomes.quantiles)
    return np.stack([np.interp(levels, LEVELS, row) for row in trained.quantiles]).astype(np.float32)
