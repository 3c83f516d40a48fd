"""What an agent may do (paper §2.3), and the three phases of a run (§2.4)."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mimo.settings.params import Protocol

JOINTS = 12  # actuated, paper appendix; named in body.ACTUATED
ACTIONS = 2  # of each joint, paper §2.3
NO_TORQUE, MOVE = range(ACTIONS)
# Fields of params.Protocol that decide what a step does; the others are the phases' lengths.
STEP = ("limb", "updates_per_step", "torque_updates", "timestep")
PHASES = ("baseline", "attached", "extinction")


def steps(protocol: Protocol) -> int:
    """Agent steps of a whole run."""
    return protocol.baseline_steps + protocol.attached_steps + protocol.extinction_steps


def phase(protocol: Protocol, step: int) -> str:
    """Which of PHASES agent step `step`, counted from 0, belongs to."""
    if step < protocol.baseline_steps:
        return "baseline"
    return "attached" if step < protocol.baseline_steps + protocol.attached_steps else "extinction"
