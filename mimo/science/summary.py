"""From curves to figures' lines and tables' numbers: plain numpy, no files. No claim is judged by what is here."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from mimo.science import analysis

ACRONYMS = ("mtl", "rtl", "cais", "rnd", "cai")
TITLES = {
    "means": "CAIS by means",
    "kl": "CAIS by Gaussian KL",
    "energy": "CAIS by energy distance",
    "mmd": "CAIS by MMD",
    "progress": "Learning progress",
}
# The windows of tables.
TABLED = ("baseline", "acquisition_early", "acquisition_late", "extinction_early", "extinction_late")
LEARNED, MINUTES, OF = 1.5, 2, 3  # times the baseline's rate, in two of any three consecutive minutes: see `learned`
ROUNDING = 1e-9  # of rates, which are shares of a few hundred movements

Array = np.ndarray


def label(reward: str) -> str:
    """A reward as the paper writes it, or would: `rtl_surprise` is RTL + Surprise."""
    return " + ".join(
        part.upper() if part in ACRONYMS else TITLES.get(part, part.capitalize()) for part in reward.split("_")
    )


def window(phases: Mapping[str, slice]) -> int:
    """Steps that figures smooth over: a hundredth of a run, 25 in the paper's protocol."""
    return max(1, int(phases["extinction"].stop) // 100)


def smooth(values: Array, phases: Mapping[str, slice], width: int) -> Array:
    """Centred moving average over `width` steps, the last axis; near a phase's border only its own steps count."""
    out = np.empty(values.shape, np.float64)
    before, after = (width - 1) // 2, width // 2
    for phase in phases.values():
        total = np.cumsum(values[..., phase], axis=-1, dtype=np.float64)
        total = np.concatenate([np.zeros((*total.shape[:-1], 1)), total], axis=-1)
        here = np.arange(phase.stop - phase.start)
        first, last = np.maximum(here - before, 0), np.minimum(here + after + 1, len(here))
        out[..., phase] = (total[..., last] - total[..., first]) / (last - first)
    return out


def blocks(values: Array, phases: Mapping[str, slice], width: int) -> tuple[Array, Array]:
    """Means over blocks of `width` steps, the last axis; a phase's last block may be shorter.

    Returns:
        (block,) the mean of each block's steps, counted from 1, and (..., block) its means.
    """
    starts = np.concatenate([np.arange(phase.start, phase.stop, width) for phase in phases.values()])
    lengths = np.diff(starts, append=phases["extinction"].stop)
    means = np.add.reduceat(values.astype(np.float64), starts, axis=-1) / lengths
    return starts + (lengths + 1) / 2, means


def mean_sd(values: Array) -> tuple[Array, Array]:
    """Mean and SD (n - 1) over the first axis, the seeds; one seed has no SD: NaN."""
    values = np.asarray(values, np.float64)
    sd = values.std(axis=0, ddof=1) if len(values) > 1 else np.full(values.shape[1:], np.nan)
    return values.mean(axis=0), sd


def onset_change(values: Array, phases: Mapping[str, slice], width: int) -> Array:
    """(seed,) by how much a curve's mean over extinction's first `width` steps exceeds that over as many before it."""
    onset = phases["extinction"].start
    after, before = values[:, onset : onset + width], values[:, onset - width : onset]
    return np.asarray(after.mean(axis=1, dtype=np.float64) - before.mean(axis=1, dtype=np.float64))


def most_active(move_probability: Mapping[str, Array], attached: str) -> Array:
    """(seed,) bool: whether the attached limb's P(MOVE) exceeds every other limb's.

    Args:
        move_probability: (seed,) by limb's name.
        attached: name of the limb that the rope holds.
    """
    return np.asarray(
        np.all([move_probability[attached] > p for limb, p in move_probability.items() if limb != attached], axis=0)
    )


def learned(moved: Array, windows: Mapping[str, slice]) -> Array:
    """(seed,) bool: whether a limb meets the criterion by which infants are judged in the mobile paradigm.

    That is a rate of at least LEARNED times that of the baseline, in MINUTES of any OF consecutive minutes of the
    attached phase (Rovee-Collier, Sullivan, Enright, Lucas & Fagen 1980, Science 208:1159).

    Args:
        moved: (seed, step), the share of the limb's joints that moved.
        windows: of the phases; `baseline` and `attached` are read.
    """
    rate, phase = moved[:, windows["baseline"]].mean(axis=1), moved[:, windows["attached"]]
    minutes = (
        phase[:, : phase.shape[1] // analysis.MINUTE * analysis.MINUTE]
        .reshape(len(phase), -1, analysis.MINUTE)
        .mean(axis=2)
    )
    met = (minutes >= LEARNED * rate[:, None] - ROUNDING) & (minutes > 0)
    if met.shape[1] < OF:
        return np.zeros(len(met), bool)
    return np.asarray((np.lib.stride_tricks.sliding_window_view(met, OF, axis=1).sum(axis=2) >= MINUTES).any(axis=1))


def cell(stacked: Mapping[str, Array], windows: Mapping[str, slice], attached: str) -> dict[str, Any]:
    """The numbers of one condition and reward.

    Args:
        stacked: (seed, step) by name, as mimo.science.analysis.curves names them.
        windows: stretches of steps by name.
        attached: name of the limb that the rope holds.

    Returns:
        `reward`, `move_probability` and, where recorded, `influence`: for each window the mean and SD over seeds of the
        attached limb, of the others and of their difference. `rise`: what P(MOVE)'s difference gained from baseline to
        late acquisition. `most_active`: in how many of the `seeds` the attached limb moved most in late acquisition.
        `locked`: for each window the mean share of locked joints. `learned`: the share of seeds in which the attached
        limb met the criterion of `learned`, and the mean share for the other limbs.
    """
    over = {name: values.astype(np.float64) for name, values in stacked.items()}
    found: dict[str, Any] = {}
    for curve in ("move_probability", "reward", "influence"):
        if f"{curve}/attached" not in over:
            continue
        found[curve] = {}
        for name in TABLED:
            steps = windows[name]
            limb, others = (over[f"{curve}/{group}"][:, steps].mean(axis=1) for group in analysis.GROUPS)
            groups = {"attached": limb, "others": others, "difference": limb - others}
            found[curve][name] = {group: _spread(values) for group, values in groups.items()}
    difference = over["move_probability/attached"] - over["move_probability/others"]
    before, late = windows["baseline"], windows["acquisition_late"]
    found["rise"] = _spread(difference[:, late].mean(axis=1) - difference[:, before].mean(axis=1))
    limbs = {
        name.removeprefix("limb/"): p[:, late].mean(axis=1) for name, p in over.items() if name.startswith("limb/")
    }
    found["most_active"] = int(most_active(limbs, attached).sum())
    found["locked"] = {name: float(over["locked"][:, windows[name]].mean()) for name in TABLED}
    met = {
        name.removeprefix("moved/"): float(learned(moved, windows).mean())
        for name, moved in over.items()
        if name.startswith("moved/")
    }
    own = met.pop(attached)
    found["learned"] = {"attached": own, "others": float(np.mean(list(met.values())))}
    found["seeds"] = len(difference)
    return found


def _spread(values: Array) -> dict[str, float | None]:
    mean, sd = mean_sd(values)
    return {"mean": float(mean), "sd": None if np.isnan(sd) else float(sd)}
