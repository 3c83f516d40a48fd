"""What studies measure of a cell's runs: effects in every seed, as the claims' are, and regions where they count."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from mimo.science import claims, judgement
from mimo.science.judgement import Array, Windows

Curves = Mapping[str, Array]  # (seed, step) by name, of one cell
LATE = "late attached phase against late baseline"
ONSET = "first minute without the rope against the minute before"


@dataclass(frozen=True)
class Measure:
    """An effect.

    Attributes:
        title: for people, short.
        says: what is compared with what.
        unit: of the effect.
        low: an effect counts if low <= effect <= high.
        high: see low.
        measure: from curves and windows to (seed,).
        needs: a curve without which there is none.
    """

    title: str
    says: str
    unit: str
    low: float
    high: float
    measure: judgement.Measure
    needs: str = "locked"


CELL = ("", "")  # a cell by itself
_LATE, _ONSET = ("acquisition_late", "baseline_late"), ("extinction_early", "acquisition_end")
_P = claims.MOVE_P


def _level(curve: str, window: str) -> judgement.Measure:
    """A curve's mean in a window."""
    return lambda curves, windows: np.asarray(curves[CELL][curve][:, windows[window]].mean(axis=1, dtype=np.float64))


MEASURES = {
    "lead": Measure(
        "Lead in P(MOVE)", f"the limb's P(MOVE) over the others', {LATE}", claims.P, claims.P_MOVE, np.inf,
        claims.singled_out(CELL, _P),
    ),
    "lead_q": Measure(
        "Lead in Q(MOVE)", f"the limb's Q(MOVE) over the others', {LATE}", claims.Q, claims.Q_MOVE, np.inf,
        claims.singled_out(CELL, claims.MOVE_Q),
    ),
    "limb": Measure(
        "P(MOVE) of the limb", LATE, claims.P, claims.P_MOVE, np.inf, claims.change(CELL, f"{_P}/attached", *_LATE)
    ),
    "others": Measure(
        "P(MOVE) of the others", LATE, claims.P, claims.P_MOVE, np.inf, claims.change(CELL, f"{_P}/others", *_LATE)
    ),
    "reward": Measure(
        "Reward", f"mean over joints, {LATE}", claims.D, claims.MEDIUM, np.inf, claims.shift(CELL, "reward/all", *_LATE)
    ),
    "influence": Measure(
        "Influence of MOVE", f"of the limb, {LATE}", "h / 1000", 1.0, np.inf,
        lambda curves, windows: 1000 * claims.change(CELL, "influence/attached", *_LATE)(curves, windows),
        needs="influence/attached",
    ),
    "excess": Measure(
        "Excess influence", "of the limb over the others', late attached phase", "share of the others'",
        claims.EXCESS, np.inf, claims.excess(CELL, "acquisition_late"), needs="influence/attached",
    ),
    "burst": Measure(
        "Burst of the limb", f"P(MOVE), {ONSET}", claims.P, claims.P_MOVE, np.inf,
        claims.change(CELL, f"{_P}/attached", *_ONSET),
    ),
    "burst_others": Measure(
        "Burst of the others", f"P(MOVE), {ONSET}", claims.P, claims.P_MOVE, np.inf,
        claims.change(CELL, f"{_P}/others", *_ONSET),
    ),
    "burst_reward": Measure(
        "Reward at the onset", f"mean over joints, {ONSET}", claims.D, claims.MEDIUM, np.inf,
        claims.shift(CELL, "reward/all", *_ONSET),
    ),
    "locked": Measure(
        "Locked joints", "late attached phase", "share", judgement.SATURATED, np.inf, _level("locked", _LATE[0])
    ),
    "path": Measure(
        "Mobile's path", f"m a step, {LATE}", claims.D, claims.MEDIUM, np.inf, claims.shift(CELL, "path_length", *_LATE)
    ),
}  # fmt: skip


def effects(curves: Curves, windows: Windows, names: Iterable[str] = MEASURES) -> dict[str, list[float]]:
    """Of one cell, by measure's name: the effect in each seed, for every one of the measures that its curves allow."""
    return {
        name: np.asarray(MEASURES[name].measure({CELL: curves}, windows), np.float64).tolist()
        for name in names
        if MEASURES[name].needs in curves
    }


@dataclass(frozen=True)
class Found:
    """An interquartile mean over seeds with its 95 % interval; None where one seed, or no number, gives none."""

    effect: float
    interval: tuple[float, float] | None
    n: int
    seeds: list[float]

    @property
    def certain(self) -> bool:
        """Whether the interval leaves 0 out."""
        return self.interval is not None and not self.interval[0] <= 0 <= self.interval[1]

    def within(self, low: float, high: float) -> bool:
        """Whether the whole interval lies between two values."""
        return self.interval is not None and low <= self.interval[0] and self.interval[1] <= high


def summed(seeds: list[float]) -> Found:
    """What effects in some seeds come to, as judgement has it of a claim's."""
    effects = np.asarray(seeds, np.float64)
    bounds = None
    if len(effects) > 1 and np.isfinite(effects).all():
        bounds = judgement.interval(judgement.resampled(effects), len(effects))
    return Found(float(judgement.interquartile_mean(effects)), bounds, len(effects), effects.tolist())
