"""Worlds in lock step: one C call advances every world by one agent step (paper §2.3).

A world's numbers depend on its own generator alone, never on how many worlds or threads share the call.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from mujoco import batch

from mimo.settings.errors import Fault
from mimo.settings.params import Protocol
from mimo.world import body
from mimo.world.protocol import JOINTS
from mimo.world.scene import Scene

Tied = bool | np.ndarray  # whether the rope is on, in all worlds or, bool (N,), in each


class DivergedError(Fault, RuntimeError):
    """A world's physics diverged; the message names the world."""


@dataclass(frozen=True)
class Outcome:
    """What N worlds show at the end of some updates.

    Attributes:
        proprioception: (N, 47) joint angles in rad, in the order of body.JOINTS.
        path_length: (N,) m travelled by the mobile's centre of mass (paper §3.3, MTL).
        centre_of_mass: (N, 3) of the mobile at the end, m.
    """

    proprioception: np.ndarray
    path_length: np.ndarray
    centre_of_mass: np.ndarray


class Worlds:
    """N worlds of one scene under one condition.

    Args:
        scene: the compiled scene.
        protocol: timing.
        force: N, applied to the mobile in a fresh random direction at every update (paper §2.4); 0 for none.
        noise: one generator a world, for the force's directions.
        threads: that advance the worlds.
    """

    def __init__(
        self, scene: Scene, protocol: Protocol, force: float, noise: Sequence[np.random.Generator], threads: int = 1
    ) -> None:
        self.scene = scene
        self.size = len(noise)
        self._protocol, self._force, self._noise = protocol, force, noise
        self._batch = batch.Batch(scene.model, nsim=self.size, nthread=threads)
        self._qpos = self._batch.bind("qpos")
        self._time = self._batch.bind("time")
        self._rope = self._batch.expand("tendon_stiffness")
        self._batch.reset(keyframe=0)
        self._centre = scene.centre_of_mass(self._qpos)
        self._inputs = int(mujoco.mjtState.mjSTATE_CTRL)
        if force:
            self._inputs |= int(mujoco.mjtState.mjSTATE_XFRC_APPLIED)
        self._columns = mujoco.mj_stateSize(scene.model, self._inputs)

    @property
    def qpos(self) -> np.ndarray:
        """(N, nq) generalised positions, m and rad; a copy."""
        qpos: np.ndarray = self._qpos.copy()
        return qpos

    @property
    def centre_of_mass(self) -> np.ndarray:
        """(N, 3) of the mobile, m; a copy."""
        return self._centre.copy()

    def proprioception(self) -> np.ndarray:
        """(N, 47) joint angles in rad, in the order of body.JOINTS; the fixed 15 are 0."""
        angles = np.zeros((self.size, len(body.JOINTS)))
        angles[:, body.FIXED :] = self._qpos[:, self.scene.limb_joints]
        return angles

    def step(self, moved: np.ndarray, positive: np.ndarray, attached: Tied) -> Outcome:
        """One agent step: full torque where a joint moves, for `torque_updates` updates, then rest (paper §2.2, §2.3).

        Args:
            moved: (N, 12) bool, MOVE or not, for body.ACTUATED.
            positive: (N, 12) bool, the torques' directions (fig. 1D).
            attached: whether the rope is on, in all worlds or (N,) in each.

        Raises:
            DivergedError: a world's physics diverged.
        """
        return self._advance(self._control(moved, positive), attached)

    def pieces(self, moved: np.ndarray, positive: np.ndarray, attached: Tied, cuts: Sequence[int]) -> Iterator[Outcome]:
        """One agent step as `step` makes it, cut after so many updates: between pieces the worlds can be looked at.

        Args:
            moved: (N, 12) bool, MOVE or not, for body.ACTUATED.
            positive: (N, 12) bool, the torques' directions.
            attached: whether the rope is on.
            cuts: numbers of updates, rising.

        Raises:
            DivergedError: a world's physics diverged.
        """
        for piece in np.split(self._control(moved, positive), cuts, axis=1):
            yield self._advance(piece, attached)

    def parts(self, moved: np.ndarray, positive: np.ndarray, attached: Tied, count: int) -> Iterator[Outcome]:
        """One agent step as `step` makes it, in `count` parts as even as whole updates are.

        Args:
            moved: (N, 12) bool, MOVE or not, for body.ACTUATED.
            positive: (N, 12) bool, the torques' directions.
            attached: whether the rope is on.
            count: at most as many as there are updates.

        Raises:
            DivergedError: a world's physics diverged.
        """
        ends = np.arange(1, count) * self._protocol.updates_per_step // count
        return self.pieces(moved, positive, attached, ends.tolist())

    def _control(self, moved: np.ndarray, positive: np.ndarray) -> np.ndarray:
        """(N, updates_per_step, columns) inputs of one agent step: torques, and the noise of every update."""
        for name, given in (("moved", moved), ("positive", positive)):
            if given.shape != (self.size, JOINTS):
                raise ValueError(f"{name} must be {(self.size, JOINTS)}, a joint of each world; it is {given.shape}.")
        protocol = self._protocol
        lowest, highest = self.scene.model.actuator_ctrlrange.T
        torque = np.where(moved, np.where(positive, highest, lowest), 0.0)
        control = np.zeros((self.size, protocol.updates_per_step, self._columns))
        control[:, : protocol.torque_updates, : torque.shape[1]] = torque[:, None]
        if self._force:
            first = torque.shape[1] + 6 * self.scene.mobile
            for world, generator in enumerate(self._noise):
                direction = generator.standard_normal((protocol.updates_per_step, 3))
                direction *= self._force / np.linalg.norm(direction, axis=1, keepdims=True)
                control[world, :, first : first + 3] = direction
        return control

    def _advance(self, control: np.ndarray, attached: Tied) -> Outcome:
        """As many updates as `control` (N, updates, columns) holds."""
        self._rope[:] = np.where(attached, self.scene.rope_stiffness, 0.0).reshape(-1, 1)
        due = self._time + control.shape[1] * self._protocol.timestep
        record = self._batch.rollout(nstep=control.shape[1], control=control, control_spec=self._inputs)
        # Of positions, since MuJoCo's own centres of mass belong to those before the update.
        track = self.scene.centre_of_mass(record["qpos"])
        self._check(due, track)
        moves = np.diff(np.concatenate([self._centre[:, None], track], axis=1), axis=1)
        self._centre = track[:, -1].copy()
        return Outcome(self.proprioception(), np.linalg.norm(moves, axis=2).sum(axis=1), self._centre)

    def _check(self, due: np.ndarray, track: np.ndarray) -> None:
        """MuJoCo resets a diverged world and stops stepping it: its clock then falls behind."""
        finite = np.isfinite(self._qpos).all(axis=1) & np.isfinite(track).all(axis=(1, 2))
        failed = np.flatnonzero(~finite | (np.abs(self._time - due) > self._protocol.timestep / 2))
        if failed.size:
            raise DivergedError(f"the physics of world {failed[0]} of {self.size} diverged (of all: {failed.tolist()})")
