"""From recorded runs to the curves, and stretches of steps, that claims are judged by: plain numpy, no files.

A run's joints form two groups: the three of the limb that the rope holds (`attached`) and the other nine (`others`).
Steps are agent steps; slices count them from 0.
"""

from collections.abc import Mapping

import numpy as np

from mimo.world.protocol import MOVE, NO_TORQUE, PHASES

GROUPS = ("attached", "others")
LATE = 300  # steps: what counts as early and as late in a phase
MINUTE = 100  # steps of 0.6 s
LOCKED = 0.02  # P(MOVE) of a joint that is all but certain to rest, or within so much of 1, to move

Array = np.ndarray


def phases(baseline: int, attached: int, extinction: int) -> dict[str, slice]:
    """Each of PHASES as a slice of steps, from the phases' lengths."""
    ends = np.cumsum([0, baseline, attached, extinction]).tolist()
    return {name: slice(start, stop) for name, start, stop in zip(PHASES, ends, ends[1:], strict=False)}


def windows(phases: Mapping[str, slice]) -> dict[str, slice]:
    """The stretches of steps over which claims and tables take means.

    `baseline`, `attached` and `extinction` are whole phases. Late is a phase's last LATE steps, early acquisition the
    first LATE. Start and end are a phase's first and last MINUTE steps; extinction's start is its early part, where a
    burst would be. Of a short phase, half.
    """
    baseline, attached, extinction = (phases[name] for name in PHASES)
    return {
        "baseline": baseline,
        "baseline_late": _last(baseline, LATE),
        "baseline_end": _last(baseline, MINUTE),
        "attached": attached,
        "acquisition_start": _first(attached, MINUTE),
        "acquisition_early": _first(attached, LATE),
        "acquisition_late": _last(attached, LATE),
        "acquisition_end": _last(attached, MINUTE),
        "extinction": extinction,
        "extinction_early": _first(extinction, MINUTE),
        "extinction_late": _last(extinction, LATE),
    }


def _first(phase: slice, steps: int) -> slice:
    return slice(phase.start, phase.start + _share(phase, steps))


def _last(phase: slice, steps: int) -> slice:
    return slice(phase.stop - _share(phase, steps), phase.stop)


def _share(phase: slice, steps: int) -> int:
    return max(1, min(steps, int(phase.stop - phase.start) // 2))


def curves(
    record: Mapping[str, Array], limbs: Mapping[str, Array], attached: str, temperature: float
) -> dict[str, Array]:
    """What becomes of one run, step by step.

    Args:
        record: a run's arrays by name, as mimo.learning.experiment records them.
        limbs: (12,) bool by limb's name: its joints.
        attached: name of the limb that the rope holds.
        temperature: of the policy, paper eq. policy. Values of Q are given in temperatures: one more for MOVE is one
            more of P(MOVE)'s log odds, whatever the rewards' gain.

    Returns:
        (step,) float32 by name. `reward`, `q_move` and `q_rest` (Q of MOVE and NO_TORQUE), `move_probability`, each
        `part/<reward>` in its own units and, where it was recorded, `influence` (of MOVE) end in `/attached` or
        `/others`, a mean over joints; `reward/all` is the mean over all twelve. `limb/<name>` is P(MOVE) of each limb,
        `moved/<name>` the share of its joints that moved. `locked` is the share of all joints whose P(MOVE) is within
        LOCKED of 0 or 1. `path_length` (m) and `latent_length` (h) are the mobile's and the latent's; `displacement`
        (m) is the mobile's straight way from the end of one step to that of the next (0 at the first).
    """
    joints = {"attached": limbs[attached], "others": ~limbs[attached]}
    q, p = record["q"] / temperature, record["move_probability"]
    grouped = {
        "reward": record["reward"],
        "q_move": q[..., MOVE],
        "q_rest": q[..., NO_TORQUE],
        "move_probability": p,
    }
    grouped |= {name: values for name, values in record.items() if name == "influence" or name.startswith("part/")}
    made = {
        f"{name}/{group}": values[:, mask].mean(axis=1, dtype=np.float64)
        for name, values in grouped.items()
        for group, mask in joints.items()
    }
    made["reward/all"] = record["reward"].mean(axis=1, dtype=np.float64)
    made["locked"] = (np.abs(p - 0.5) > 0.5 - LOCKED).mean(axis=1)
    for limb, mask in limbs.items():
        made[f"limb/{limb}"] = p[:, mask].mean(axis=1, dtype=np.float64)
        made[f"moved/{limb}"] = record["action"][:, mask].mean(axis=1, dtype=np.float64)
    made |= {name: record[name] for name in ("path_length", "latent_length")}
    ends = record["centre_of_mass"].astype(np.float64)
    made["displacement"] = np.linalg.norm(np.diff(ends, axis=0, prepend=ends[:1]), axis=1)
    return {name: values.astype(np.float32) for name, values in made.items()}
