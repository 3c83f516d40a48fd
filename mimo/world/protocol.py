"""The three phases of a run (paper §2.4)."""

from mimo.settings.params import Protocol

PHASES = ("baseline", "attached", "extinction")


def steps(protocol: Protocol) -> int:
    """Agent steps of a whole run."""
    return protocol.baseline_steps + protocol.attached_steps + protocol.extinction_steps


def phase(protocol: Protocol, step: int) -> str:
    """Which of PHASES agent step `step`, counted from 0, belongs to."""
    if step < protocol.baseline_steps:
        return "baseline"
    return "attached" if step < protocol.baseline_steps + protocol.attached_steps else "extinction"
