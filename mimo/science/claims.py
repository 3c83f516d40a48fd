"""The claims of the paper's §4, each as tests that were fixed before the published runs were made.

mimo.science.judgement says how tests and claims are judged. Regions and windows were settled with the results of a
pilot, under another root seed, at hand.
"""

import numpy as np
from scipy import stats

from mimo.science.analysis import MINUTE, label
from mimo.science.judgement import Array, Cell, Claim, Curves, Measure, Test, Windows

# The smallest effects that count, and the margins within which an effect counts as none.
P_MOVE = 0.05  # of P(MOVE): one movement in twenty steps
Q_MOVE = 0.06  # scaled reward: a fifth of the temperature, which is worth about P_MOVE at a P(MOVE) of 1/3
MEDIUM, SMALL = 0.5, 0.2  # Cohen's d, medium and small (Cohen 1988)
EXCESS, NO_EXCESS = 0.25, 0.1  # of the others' influence
SUSTAINED = 0.9  # share of the attached phase's minutes
REMAINS = 0.1  # of a rise
FAITHFUL = 0.7  # rank correlation


# Effects. Each returns a function from curves and windows to (seed,).


def shift(cell: Cell, curve: str, after: str, before: str) -> Measure:
    """Cohen's d of a curve's steps in one window against another: the mean's change over the pooled SD of steps."""

    def measure(curves: Curves, windows: Windows) -> Array:
        first, second = (curves[cell][curve][:, windows[name]].astype(np.float64) for name in (before, after))
        pooled = np.sqrt((first.var(axis=1) + second.var(axis=1)) / 2)
        change = second.mean(axis=1) - first.mean(axis=1)
        return np.asarray(np.divide(change, pooled, out=np.zeros_like(change), where=pooled > 0))

    return measure


def change(cell: Cell, curve: str, after: str, before: str) -> Measure:
    """Change of a curve's mean from one window to another."""

    def measure(curves: Curves, windows: Windows) -> Array:
        return np.asarray(_mean(curves[cell][curve], windows[after]) - _mean(curves[cell][curve], windows[before]))

    return measure


def remains(cell: Cell, curve: str) -> Measure:
    """What is left in late extinction of the rise from late baseline to late acquisition, as a share of it."""

    def measure(curves: Curves, windows: Windows) -> Array:
        baseline, attached, extinction = (
            _mean(curves[cell][curve], windows[name])
            for name in ("baseline_late", "acquisition_late", "extinction_late")
        )
        return np.asarray((extinction - baseline) / (attached - baseline))

    return measure


def singled_out(cell: Cell, curve: str) -> Measure:
    """What the attached limb's lead over the others gained from late baseline to late acquisition."""

    def measure(curves: Curves, windows: Windows) -> Array:
        lead = curves[cell][f"{curve}/attached"].astype(np.float64) - curves[cell][f"{curve}/others"]
        return np.asarray(_mean(lead, windows["acquisition_late"]) - _mean(lead, windows["baseline_late"]))

    return measure


def excess(cell: Cell, window: str) -> Measure:
    """Influence of the attached limb's MOVE over that of the others', minus 1."""

    def measure(curves: Curves, windows: Windows) -> Array:
        limb, others = (_mean(curves[cell][f"influence/{group}"], windows[window]) for group in ("attached", "others"))
        return np.asarray(limb / others - 1)

    return measure


def throughout(cell: Cell, skipped: int = 0) -> Measure:
    """Share of the attached phase's minutes, less the first `skipped`, with the limb's influence above the others'."""

    def measure(curves: Curves, windows: Windows) -> Array:
        phase = windows["attached"]
        starts = np.arange(min(phase.start + skipped * MINUTE, phase.stop - 1), phase.stop, MINUTE)
        lead = curves[cell]["influence/attached"].astype(np.float64) - curves[cell]["influence/others"]
        return np.asarray(np.mean(np.add.reduceat(lead[:, : phase.stop], starts, axis=1) > 0, axis=1))

    return measure


def correlation(cell: Cell, first: str, second: str) -> Measure:
    """Spearman's rank correlation of two curves over the steps of the attached phase."""

    def measure(curves: Curves, windows: Windows) -> Array:
        pairs = zip(*(curves[cell][name][:, windows["attached"]] for name in (first, second)), strict=True)
        return np.array([stats.spearmanr(a, b).statistic for a, b in pairs])

    return measure


def more(first: Measure, second: Measure) -> Measure:
    """By how much one effect exceeds another, seed by seed."""
    return lambda curves, windows: np.asarray(first(curves, windows) - second(curves, windows))


def _mean(curve: Array, window: slice) -> Array:
    return np.asarray(curve[:, window].mean(axis=1, dtype=np.float64))


# The claims.

INFINITY = float("inf")
RISES = (MEDIUM, INFINITY)
LEADS = (P_MOVE, INFINITY)
D, P = "SD over steps", "P(MOVE)"
BURST = "first minute of extinction against the minute before"


def _shifts(
    name: str, cell: Cell, says: str, curve: str, windows: tuple[str, str], region: tuple[float, float]
) -> Test:
    """`windows` are after and before."""
    return Test(name, f"{_name(cell)}: {says}", (cell,), D, *region, shift(cell, curve, *windows))


def _rises_and_returns(reward: str) -> tuple[Test, ...]:
    cell, curve = ("free", reward), "reward/all"
    says = f"{_name(cell)}: what late extinction keeps of that rise"
    return (
        _shifts(
            f"{reward}_rises", cell, "reward, late attached phase against late baseline", curve,
            ("acquisition_late", "baseline_late"), RISES,
        ),
        Test(
            f"{reward}_returns", says, (cell,), "share of the rise", -REMAINS, REMAINS, remains(cell, curve)
        ),
    )  # fmt: skip


def _correlates(name: str, which: str, first: str, second: str) -> Test:
    cell = ("free", "rtl")
    says = f"{_name(cell)}: rank correlation {which}, over the attached phase's steps"
    return Test(name, says, (cell,), "Spearman's rho", FAITHFUL, INFINITY, correlation(cell, first, second))


def _leads(cell: Cell, region: tuple[float, float] = LEADS) -> Test:
    says = f"{_name(cell)}: rise of the attached limb's lead in P(MOVE)"
    return Test(f"{'_'.join(cell)}_p", says, (cell,), P, *region, singled_out(cell, "move_probability"))


def _leads_in_q(cell: Cell) -> Test:
    says = f"{_name(cell)}: rise of the attached limb's lead in Q(MOVE)"
    return Test(f"{'_'.join(cell)}_q", says, (cell,), "scaled reward", Q_MOVE, INFINITY, singled_out(cell, "q_move"))


def _learns(cell: Cell) -> tuple[Test, ...]:
    return _leads(cell), _leads_in_q(cell)


def _alone(cell: Cell, other: Cell) -> Test:
    says = f"{_name(cell)}: rise of the lead in P(MOVE), more than with {label(other[1])}"
    lead, others = (singled_out(one, "move_probability") for one in (cell, other))
    return Test(f"more_than_{other[1]}", says, (cell, other), P, *LEADS, more(lead, others))


def _tells(condition: str) -> tuple[Test, ...]:
    cell = (condition, "cais")
    above = f"{_name(cell)}: influence of the attached limb over the others'"
    minutes = f"{_name(cell)}: minutes of the attached phase in which the attached limb's influence is above"
    return (
        Test(
            f"{condition}_above", f"{above}, late attached phase", (cell,), "share of the others'", EXCESS, INFINITY,
            excess(cell, "acquisition_late"),
        ),
        Test(
            f"{condition}_throughout", minutes, (cell,), "share of minutes", SUSTAINED, INFINITY, throughout(cell)
        ),
        Test(
            f"{condition}_together", f"{above}, late extinction", (cell,), "share of the others'", -NO_EXCESS,
            NO_EXCESS, excess(cell, "extinction_late"),
        ),
    )  # fmt: skip


def _tells_later(condition: str) -> Test:
    cell = (condition, "cais")
    says = f"{_name(cell)}: the same minutes, less the first five, in which the outcome models learn the rope"
    return Test(
        f"{condition}_later", says, (cell,), "share of minutes", SUSTAINED, INFINITY, throughout(cell, skipped=5)
    )


def _uninformed(reward: str) -> tuple[Test, ...]:
    cell, curve, margin = ("noisy", reward), "reward/all", (-SMALL, SMALL)
    return (
        _shifts(
            f"{reward}_attached", cell, "reward, late attached phase against late baseline", curve,
            ("acquisition_late", "baseline_late"), margin,
        ),
        _shifts(
            f"{reward}_extinction", cell, "reward, late extinction against late attached phase", curve,
            ("extinction_late", "acquisition_late"), margin,
        ),
        _leads(cell, (-P_MOVE, P_MOVE)),
    )  # fmt: skip


def _spike(cell: Cell, region: tuple[float, float]) -> Test:
    windows = "extinction_early", "acquisition_end"
    return _shifts(
        f"{'_'.join(cell)}_reward", cell, f"reward of the attached limb, {BURST}", "reward/attached", windows, region
    )


def _behaviour(cell: Cell, region: tuple[float, float]) -> Test:
    says = f"{_name(cell)}: P(MOVE) of the attached limb, {BURST}"
    return Test(f"{'_'.join(cell)}_p", says, (cell,), P, *region, _burst(cell))


def _burst(cell: Cell) -> Measure:
    return change(cell, "move_probability/attached", "extinction_early", "acquisition_end")


def _bursts(condition: str) -> tuple[Test, ...]:
    cell, control = (condition, "cais_surprise"), (condition, "cais")
    fades = f"{_name(cell)}: P(MOVE) of the attached limb, late extinction against its first minute"
    caused = f"{_name(cell)}: the change of P(MOVE) at the onset of extinction, more than with CAIS alone"
    return (
        _spike(cell, RISES),
        _behaviour(cell, LEADS),
        Test(
            f"{condition}_fades", fades, (cell,), P, -INFINITY, -P_MOVE,
            change(cell, "move_probability/attached", "extinction_late", "extinction_early"),
        ),
        Test(f"{condition}_by_surprise", caused, (cell, control), P, *LEADS, more(_burst(cell), _burst(control))),
    )  # fmt: skip


def _no_burst(cell: Cell) -> tuple[Test, ...]:
    return _spike(cell, (-INFINITY, MEDIUM)), _behaviour(cell, (-INFINITY, P_MOVE))


def _name(cell: Cell) -> str:
    return f"{cell[0]}, {label(cell[1])}"


CLAIMS = (
    Claim(
        "1 perceptual rewards, quiet",
        "§4.1",
        "With a free mobile the MTL and RTL rewards rise while the rope is on, and are back at baseline in extinction.",
        "fig. 3 A",
        (*_rises_and_returns("mtl"), *_rises_and_returns("rtl")),
    ),
    Claim(
        "1b RTL follows the mobile",
        "§4.1",
        "With a free mobile the path of the latent is a faithful proxy of the path of the mobile.",
        "fig. 3 A",
        (_correlates("rank_correlation", "of the latent's path with the mobile's", "path_length", "latent_length"),),
        (
            _correlates(
                "displacement", "of the latent's path with the mobile's displacement", "displacement", "latent_length"
            ),
            _correlates("path", "of the mobile's displacement with its path", "displacement", "path_length"),
        ),
    ),
    Claim(
        "2 CAIS tells the limb",
        "§4.1, §4.2",
        "With and without noise the attached limb's CAIS is above the others' throughout the attached phase, and back "
        "with them in extinction.",
        "figs. 3 C, 4 C",
        (*_tells("free"), *_tells("noisy")),
        (_tells_later("free"), _tells_later("noisy")),
    ),
    Claim(
        "3 all learn, quiet",
        "§4.1",
        "With a free mobile agents rewarded by MTL, RTL or CAIS raise P(MOVE) and Q(MOVE) of the attached limb above "
        "the others'.",
        "fig. 3 D",
        (*_learns(("free", "mtl")), *_learns(("free", "rtl")), *_learns(("free", "cais"))),
    ),
    Claim(
        "4 perceptual rewards fail, noisy",
        "§4.2",
        "In noise the MTL and RTL rewards do not differ between the phases, and their agents do not single out the "
        "limb.",
        "fig. 4 A, D",
        (*_uninformed("mtl"), *_uninformed("rtl")),
    ),
    Claim(
        "5 CAIS alone learns, noisy",
        "§4.2",
        "In noise the agent rewarded by CAIS raises P(MOVE) and Q(MOVE) of the attached limb, and it alone of the "
        "three.",
        "fig. 4 C, D",
        (
            *_learns(("noisy", "cais")),
            _alone(("noisy", "cais"), ("noisy", "mtl")),
            _alone(("noisy", "cais"), ("noisy", "rtl")),
        ),
    ),
    Claim(
        "6 Surprise detects violations",
        "§4.3",
        "Surprise spikes at the onset of the attached phase, decays in it, and spikes again at the onset of "
        "extinction.",
        "fig. 3 A",
        (
            _shifts(
                "onset",
                ("free", "surprise"),
                "reward, first minute of the rope against the minute before",
                "reward/all",
                ("acquisition_start", "baseline_end"),
                RISES,
            ),
            _shifts(
                "decay",
                ("free", "surprise"),
                "reward, last minute of the rope against its first",
                "reward/all",
                ("acquisition_end", "acquisition_start"),
                (-INFINITY, -MEDIUM),
            ),
            _shifts(
                "violation",
                ("free", "surprise"),
                f"reward, {BURST}",
                "reward/all",
                ("extinction_early", "acquisition_end"),
                RISES,
            ),
        ),
    ),
    Claim(
        "7a burst, quiet",
        "§4.3",
        "CAIS + Surprise with a free mobile: reward and P(MOVE) of the attached limb burst when the rope is gone, for "
        "a while, and by Surprise.",
        "fig. 3 C",
        _bursts("free"),
    ),
    Claim(
        "7b burst, noisy",
        "§4.3",
        "The same in noise.",
        "fig. 4 C",
        _bursts("noisy"),
    ),
    Claim(
        "8 no burst without CAIS",
        "§4.3",
        "MTL + Surprise and RTL + Surprise show no clear burst, with or without noise.",
        "figs. 3 B, 4 B",
        tuple(
            test
            for condition in ("free", "noisy")
            for reward in ("mtl_surprise", "rtl_surprise")
            for test in _no_burst((condition, reward))
        ),
    ),
    Claim(
        "9 CAIS + Surprise learns",
        "§4.4",
        "The agent rewarded by CAIS + Surprise raises P(MOVE) of the attached limb in both conditions.",
        "figs. 3 D, 4 D",
        (_leads(("free", "cais_surprise")), _leads(("noisy", "cais_surprise"))),
    ),
)
