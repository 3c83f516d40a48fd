"""The one way from actions to a transition: worlds, eye, extractor and, where needed, outcome models."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from mimo.learning import rewards
from mimo.learning.outcomes import Outcomes, taus
from mimo.learning.rewards import Reward, Transition
from mimo.settings.params import Params
from mimo.vision.collect import REGIMES
from mimo.vision.extractor import LEVELS, Extractor, Trained
from mimo.world.eye import Eye
from mimo.world.physics import Outcome, Tied, Worlds
from mimo.world.yoked import Yoked


class Perception:
    """What N seeds make of what they see: h, and what their outcome models know of it.

    Attributes:
        latent: (N, latent), h of what was seen last.
        outcomes: None where nothing needs them.

    Args:
        extract: pictures to h.
        frames: (N, 128, 128, 3) uint8, what is seen first.
        outcomes: of N seeds.
        terms: the rewards that are to be paid.
    """

    def __init__(
        self, extract: Extractor, frames: np.ndarray, outcomes: Outcomes | None = None, terms: Sequence[Reward] = ()
    ) -> None:
        self._extract, self.outcomes, self._terms = extract, outcomes, terms
        self.latent = extract(frames)

    def transition(
        self,
        moved: np.ndarray,
        path_length: np.ndarray,
        frames: np.ndarray,
        probability: np.ndarray | None = None,
        before_end: Sequence[np.ndarray] = (),
        proprioception: np.ndarray | None = None,
    ) -> Transition:
        """Take in what came of an action; the outcome models learn from it once they have said what they expected.

        Args:
            moved: (N, 12) bool, MOVE or not.
            path_length: (N,) m travelled by the mobile.
            frames: (N, 128, 128, 3) uint8, what is seen at the step's end.
            probability: (N, 12) float32, P(MOVE) by which it was decided; see Outcomes.influence.
            before_end: likewise frames, of what is seen before the end.
            proprioception: (N, 47) joint angles at the step's start, rad; some rewards read them.
        """
        seen = np.stack([self.latent, *map(self._extract, (*before_end, frames))], axis=1)
        self.latent = seen[:, -1]
        joints = None if proprioception is None else proprioception.astype(np.float32)
        whole = Transition(path_length.astype(np.float32), seen, moved, probability=probability, proprioception=joints)
        return learned(whole, self.outcomes, self._terms)


def learned(seen: Transition, outcomes: Outcomes | None, terms: Iterable[Reward]) -> Transition:
    """What came of an action; the outcome models learn from it once they have said what they expected.

    Args:
        seen: without what the outcome models say of it.
        outcomes: of N seeds, where something needs them.
        terms: the rewards that are to be paid.
    """
    if outcomes is None:
        return seen
    found = replace(
        seen,
        influence=outcomes.influence(seen.probability),
        expectation=outcomes.expectation(seen.action),
        tables=outcomes.tables.copy() if any(term.needs_tables for term in terms) else None,
    )
    outcomes.update(seen.action, seen.latent)
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
        terms: the rewards that are to be paid; they say how many pictures of a step there are.
    """

    def __init__(
        self,
        worlds: Worlds | Yoked,
        eye: Eye,
        extract: Extractor,
        outcomes: Outcomes | None = None,
        terms: Sequence[Reward] = (),
    ) -> None:
        self.worlds, self._eye, self._frames = worlds, eye, rewards.frames(terms)
        self.perception = Perception(extract, eye.frames(worlds.qpos), outcomes, terms)

    def step(
        self, moved: np.ndarray, positive: np.ndarray, attached: Tied, probability: np.ndarray | None = None
    ) -> tuple[Outcome, Transition]:
        """One agent step (paper §2.3, fig. 1B).

        Args:
            moved: (N, 12) bool, MOVE or not.
            positive: (N, 12) bool, the torques' directions.
            attached: whether the rope is on, in all worlds or (N,) in each.
            probability: (N, 12) float32, P(MOVE) by which it was decided; see Outcomes.influence.

        Returns:
            What the worlds show, and what rewards are computed from.

        Raises:
            DivergedError: a world's physics diverged.
        """
        pieces, seen, joints = [], [], self.worlds.proprioception()
        for outcome in self.worlds.parts(moved, positive, attached, self._frames):
            pieces.append(outcome.path_length)
            seen.append(self._eye.frames(self.worlds.qpos))
        outcome = replace(outcome, path_length=np.sum(pieces, axis=0))
        *before_end, last = seen
        return outcome, self.perception.transition(moved, outcome.path_length, last, probability, before_end, joints)


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
