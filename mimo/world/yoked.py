"""The yoked control of the mobile paradigm: infants under mobiles that others have moved."""

from collections.abc import Iterator

import numpy as np

from mimo.world.physics import Outcome, Tied, Worlds


class Yoked:
    """N infants, each under the mobile of another, its donor, whose recorded actions are repeated in the donor's world.

    An infant moves its own body, sees it, and feels it; the mobile that it sees, and the path that counts, are the
    donor's, to the bit. No rope is tied to it, so nothing that it does moves the mobile. It stands for Worlds.

    Args:
        own: the infants' worlds, whose mobiles are not looked at.
        donors: the donors' worlds, of the same scene, at the start of their runs.
        moved: (steps, N, 12) bool, the donors' actions.
        positive: (steps, N, 12) bool, the directions of their torques.

    Raises:
        ValueError: there are not as many donors as infants.
    """

    def __init__(self, own: Worlds, donors: Worlds, moved: np.ndarray, positive: np.ndarray) -> None:
        if donors.size != own.size:
            raise ValueError(f"There must be a donor for each of {own.size} infants; there are {donors.size}.")
        self.scene, self.size = own.scene, own.size
        self._own, self._donors, self._moved, self._positive = own, donors, moved, positive
        model = own.scene.model
        first = int(model.jnt_qposadr[model.body_jntadr[own.scene.mobile]])
        self._mobile = slice(first, first + 4)  # a quaternion
        self._step = 0

    @property
    def qpos(self) -> np.ndarray:
        """(N, nq) generalised positions: the infants' joints, the donors' mobiles."""
        qpos = self._own.qpos
        qpos[:, self._mobile] = self._donors.qpos[:, self._mobile]
        return qpos

    def proprioception(self) -> np.ndarray:
        """(N, 47) the infants' joint angles, as Worlds has them."""
        return self._own.proprioception()

    def parts(self, moved: np.ndarray, positive: np.ndarray, attached: Tied, count: int) -> Iterator[Outcome]:
        """One agent step of all, as Worlds.parts; `attached` is of the donors' ropes.

        Raises:
            DivergedError: a world's physics diverged.
            IndexError: the donors' runs have ended.
        """
        own = self._own.parts(moved, positive, False, count)
        donors = self._donors.parts(self._moved[self._step], self._positive[self._step], attached, count)
        self._step += 1
        for mine, theirs in zip(own, donors, strict=True):
            yield Outcome(mine.proprioception, theirs.path_length, theirs.centre_of_mass)
