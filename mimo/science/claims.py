"""The claims of the paper's §4, each as tests that were fixed before the published runs were made.

mimo.science.judgement says how tests and claims are judged, docs/readings.md how the paper is read. Regions and windows
were settled with the results of pilots, under other root seeds, at hand; reports/registered.json has what was fixed.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy import stats

from mimo.science.analysis import MINUTE
from mimo.science.judgement import Array, Cell, Claim, Curves, Measure, Test, Windows
from mimo.science.summary import label

# The smallest effects that count, and the margins within which an effect counts as none.
P_MOVE = 0.05  # of P(MOVE): one movement in twenty steps
Q_MOVE = 0.2  # temperatures, so log odds of P(MOVE): worth about P_MOVE at a P(MOVE) of 1/3
LARGE, MEDIUM, SMALL = 0.8, 0.5, 0.2  # Cohen's d (1988): "clear"; "visible to the naked eye", so noticeable; small
EXCESS = 0.25  # of the others' influence
TOGETHER = 0.1  # likewise: as good as none
LAPSES = 0.1  # share of the attached phase's minutes: one of fifteen is "throughout", two are not
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
        lead = _lead(curves[cell], curve)
        return np.asarray(_mean(lead, windows["acquisition_late"]) - _mean(lead, windows["baseline_late"]))

    return measure


def leads_more(cell: Cell, curve: str, after: str, before: str) -> Measure:
    """Cohen's d of the steps' lead, the attached limb's curve less the others', in one window against another."""
    return lambda curves, windows: shift(cell, "lead", after, before)(
        {cell: {"lead": _lead(curves[cell], curve)}}, windows
    )


def excess(cell: Cell, window: str) -> Measure:
    """Influence of the attached limb's MOVE over that of the others', minus 1."""

    def measure(curves: Curves, windows: Windows) -> Array:
        limb, others = (_mean(curves[cell][f"influence/{group}"], windows[window]) for group in ("attached", "others"))
        return np.asarray(limb / others - 1)

    return measure


def lapses(cell: Cell, curve: str, skipped: int = 0) -> Measure:
    """Share of the attached phase's minutes, less the first `skipped`, with the limb's curve not above the others'."""

    def measure(curves: Curves, windows: Windows) -> Array:
        phase = windows["attached"]
        starts = np.arange(min(phase.start + skipped * MINUTE, phase.stop - 1), phase.stop, MINUTE)
        lead = _lead(curves[cell], curve)
        return np.asarray(np.mean(np.add.reduceat(lead[:, : phase.stop], starts, axis=1) <= 0, axis=1))

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


def _lead(cell: Mapping[str, Array], curve: str) -> Array:
    """(seed, step): the attached limb's curve less the others'."""
    return np.asarray(cell[f"{curve}/attached"].astype(np.float64) - cell[f"{curve}/others"])


def _mean(curve: Array, window: slice) -> Array:
    return np.asarray(curve[:, window].mean(axis=1, dtype=np.float64))


# The claims.

INFINITY = float("inf")
RISES, FALLS = (MEDIUM, INFINITY), (-INFINITY, -MEDIUM)
BEHAVES = (P_MOVE, INFINITY)
VALUED = (Q_MOVE, INFINITY)
NONE = (0.0, 0.0)
Region = tuple[float, float]
D, P, Q = "SD over steps", "P(MOVE)", "temperature"
LATE = "late attached phase against late baseline"
OVER = "late extinction against late attached phase"
ONSET = "first minute of extinction against the minute before"
FADES = "late extinction against its first minute"
_LATE = ("acquisition_late", "baseline_late")
_OVER = ("extinction_late", "acquisition_late")
_ONSET = ("extinction_early", "acquisition_end")
_FADES = ("extinction_late", "extinction_early")
MOVE_P, MOVE_Q = "move_probability", "q_move"


def _test(name: str, cell: Cell, says: str, unit: str, region: Region, measure: Measure, *others: Cell) -> Test:
    return Test(name, f"{cell[0]}, {label(cell[1])}: {says}", (cell, *others), unit, *region, measure)


def _absent(*tests: Test) -> tuple[Test, ...]:
    """Tests that something does not happen."""
    return tuple(replace(test, absent=True) for test in tests)


def _shifts(name: str, cell: Cell, says: str, curve: str, windows: tuple[str, str], region: Region) -> Test:
    """`windows` are after and before."""
    return _test(name, cell, says, D, region, shift(cell, curve, *windows))


def _reward(name: str, cell: Cell, says: str, windows: tuple[str, str], region: Region) -> Test:
    return _shifts(name, cell, f"reward, {says}", "reward/all", windows, region)


def _rises(reward: str) -> tuple[Test, ...]:
    cell = ("free", reward)
    return (
        _reward(
            f"{reward}_sharp", cell, "first minute of the rope against the minute before",
            ("acquisition_start", "baseline_end"), RISES,
        ),
        _reward(f"{reward}_rises", cell, LATE, _LATE, RISES),
    )  # fmt: skip


def _grows(reward: str) -> Test:
    says = "late attached phase against the rope's first minute"
    return _reward(
        f"{reward}_grows", ("free", reward), says, ("acquisition_late", "acquisition_start"), (SMALL, INFINITY)
    )


def _correlates(name: str, which: str, first: str, second: str) -> Test:
    cell = ("free", "rtl")
    says = f"rank correlation {which}, over the attached phase's steps"
    return _test(name, cell, says, "Spearman's rho", (FAITHFUL, INFINITY), correlation(cell, first, second))


def _leads(cell: Cell, region: Region = BEHAVES) -> Test:
    says = "rise of the attached limb's lead in P(MOVE)"
    return _test(f"{'_'.join(cell)}_p", cell, says, P, region, singled_out(cell, MOVE_P))


def _leads_in_q(cell: Cell) -> Test:
    says = "rise of the attached limb's lead in Q(MOVE)"
    return _test(f"{'_'.join(cell)}_q", cell, says, Q, VALUED, singled_out(cell, MOVE_Q))


def _alone(curve: str, unit: str, region: Region) -> tuple[Test, ...]:
    cell = ("noisy", "cais")
    return tuple(
        _test(
            f"more_than_{other}", cell, f"rise of the lead in {'P' if curve == MOVE_P else 'Q'}(MOVE), more than with "
            f"{label(other)}", unit, region, more(singled_out(cell, curve), singled_out((cell[0], other), curve)),
            (cell[0], other),
        )
        for other in ("mtl", "rtl")
    )  # fmt: skip


def _tells(condition: str) -> tuple[Test, ...]:
    """In the reward as paid: panel C."""
    cell = (condition, "cais")
    return (
        _test(
            f"{condition}_reward", cell, f"reward of the attached limb less the others', {LATE}", D, RISES,
            leads_more(cell, "reward", *_LATE),
        ),
        _throughout(f"{condition}_reward_throughout", cell, "reward"),
    )  # fmt: skip


def _influences(condition: str) -> tuple[Test, ...]:
    """In the influence of MOVE itself, however often a limb moves."""
    cell = (condition, "cais")
    return (
        _excess(f"{condition}_above", cell, "acquisition_late", (EXCESS, INFINITY)),
        _throughout(f"{condition}_throughout", cell, "influence"),
    )


def _influences_besides(condition: str) -> tuple[Test, ...]:
    cell = (condition, "cais")
    return (
        _throughout(f"{condition}_later", cell, "influence", skipped=5),
        _excess(f"{condition}_together", cell, "extinction_late", (-TOGETHER, TOGETHER)),
    )


def _excess(name: str, cell: Cell, window: str, region: Region) -> Test:
    when = "late attached phase" if window == "acquisition_late" else "late extinction"
    says = f"influence of the attached limb over the others', {when}"
    return _test(name, cell, says, "share of the others'", region, excess(cell, window))


def _throughout(name: str, cell: Cell, curve: str, skipped: int = 0) -> Test:
    says = f"minutes of the attached phase in which the attached limb's {curve} is not above the others'"
    if skipped:
        says += f", less the first {skipped}, in which the outcome models learn the rope"
    return _test(name, cell, says, "share of minutes", (-INFINITY, LAPSES), lapses(cell, curve, skipped))


def _phases(reward: str, region: Region) -> tuple[Test, ...]:
    cell = ("noisy", reward)
    return (
        _reward(f"{reward}_attached", cell, LATE, _LATE, region),
        _reward(f"{reward}_extinction", cell, OVER, _OVER, region),
    )


def _spike(cell: Cell, region: Region) -> Test:
    says = f"reward of the attached limb, {ONSET}"
    return _shifts(f"{'_'.join(cell)}_reward", cell, says, "reward/attached", _ONSET, region)


def _onset(cell: Cell, curve: str, unit: str, region: Region) -> Test:
    says = f"{'P' if curve == MOVE_P else 'Q'}(MOVE) of the attached limb, {ONSET}"
    return _test(f"{'_'.join(cell)}_{curve}", cell, says, unit, region, change(cell, f"{curve}/attached", *_ONSET))


def _bursts(condition: str, curve: str, unit: str, least: float) -> tuple[Test, ...]:
    """It rises, for a while, and by Surprise."""
    cell, control, own = (condition, "cais_surprise"), (condition, "cais"), f"{curve}/attached"
    letter = "P" if curve == MOVE_P else "Q"
    fades = f"{letter}(MOVE) of the attached limb, {FADES}"
    caused = f"the change of {letter}(MOVE) at the onset of extinction, more than with CAIS alone"
    more_than_alone = more(change(cell, own, *_ONSET), change(control, own, *_ONSET))
    return (
        _onset(cell, curve, unit, (least, INFINITY)),
        _test(f"{condition}_{curve}_fades", cell, fades, unit, (-INFINITY, -least), change(cell, own, *_FADES)),
        _test(f"{condition}_{curve}_by_surprise", cell, caused, unit, (least, INFINITY), more_than_alone, control),
    )


def _limb_bursts(condition: str) -> Test:
    cell = (condition, "cais_surprise")
    own, others = (change(cell, f"{MOVE_P}/{group}", *_ONSET) for group in ("attached", "others"))
    says = "the change of P(MOVE) at the onset of extinction, more than that of the others"
    return _test(f"{condition}_of_the_limb", cell, says, P, BEHAVES, more(own, others))


def _why_no_burst(condition: str) -> tuple[Test, ...]:
    cell = (condition, "cais_surprise")
    own, rest = (change(cell, f"{curve}/attached", *_ONSET) for curve in (MOVE_Q, "q_rest"))
    return (
        _test(f"{condition}_rest", cell, f"Q(NO_TORQUE) of the attached limb, {ONSET}", Q, VALUED, rest),
        _test(
            f"{condition}_both", cell, "the change of Q(MOVE) at the onset of extinction, more than that of "
            "Q(NO_TORQUE)", Q, VALUED, more(own, rest),
        ),
    )  # fmt: skip


_SURPRISE = ("free", "surprise")
_WITH_SURPRISE = tuple((condition, f"{one}_surprise") for condition in ("free", "noisy") for one in ("mtl", "rtl"))

CLAIMS = (
    Claim(
        "1 perceptual rewards, quiet",
        "§4.1",
        "With a free mobile the MTL and RTL rewards rise sharply and for good while the rope is on, as the agent "
        "learns to move the limb, and are back at baseline in extinction.",
        "fig. 3 A",
        shown=(
            *_rises("mtl"),
            *_rises("rtl"),
            _test(
                "rtl_returns",
                ("free", "rtl"),
                "what late extinction keeps of the reward's rise",
                "share of the rise",
                (-REMAINS, REMAINS),
                remains(("free", "rtl"), "reward/all"),
            ),
        ),
        said=(_grows("mtl"), _grows("rtl")),
    ),
    Claim(
        "1b RTL follows the mobile",
        "§4.1, §3.3",
        "With a free mobile the latent's way is a faithful proxy of the mobile's: as shown, by the equation of "
        "§4.1, from the end of a step to that of the next; as said in §3.3, of the distance traversed over the step.",
        "fig. 3 A",
        shown=(
            _correlates(
                "displacement", "of the latent's way with the mobile's displacement", "displacement", "latent_length"
            ),
        ),
        said=(_correlates("path", "of the latent's way with the mobile's path", "path_length", "latent_length"),),
        besides=(_correlates("mobile", "of the mobile's displacement with its path", "displacement", "path_length"),),
    ),
    Claim(
        "2 CAIS tells the limb",
        "§4.1, §4.2",
        "With and without noise the attached limb's CAIS is above the others' throughout the attached phase.",
        "figs. 3 C, 4 C",
        shown=(*_tells("free"), *_tells("noisy")),
        said=(*_influences("free"), *_influences("noisy")),
        besides=(*_influences_besides("free"), *_influences_besides("noisy")),
    ),
    Claim(
        "3 all learn, quiet",
        "§4.1",
        "With a free mobile agents rewarded by MTL, RTL or CAIS raise Q(MOVE), and with it P(MOVE), of the attached "
        "limb above the others'.",
        "fig. 3 D",
        shown=tuple(_leads_in_q(("free", reward)) for reward in ("mtl", "rtl", "cais")),
        said=tuple(_leads(("free", reward)) for reward in ("mtl", "rtl", "cais")),
    ),
    Claim(
        "4 perceptual rewards fail, noisy",
        "§4.2",
        "In noise the MTL and RTL rewards do not differ between the phases (as shown: by less than a small effect; as "
        "said: not discernibly), and their agents do not single out the limb.",
        "fig. 4 A",
        shown=_absent(*_phases("mtl", (-SMALL, SMALL)), *_phases("rtl", (-SMALL, SMALL))),
        said=_absent(
            *_phases("mtl", NONE),
            *_phases("rtl", NONE),
            _leads(("noisy", "mtl"), (-P_MOVE, P_MOVE)),
            _leads(("noisy", "rtl"), (-P_MOVE, P_MOVE)),
        ),
    ),
    Claim(
        "5 CAIS alone learns, noisy",
        "§4.2",
        "In noise the agent rewarded by CAIS raises Q(MOVE), and with it P(MOVE), of the attached limb, and it alone "
        "of the three.",
        "fig. 4 C, D",
        shown=(_leads_in_q(("noisy", "cais")), *_alone(MOVE_Q, Q, VALUED)),
        said=(_leads(("noisy", "cais")), *_alone(MOVE_P, P, BEHAVES)),
    ),
    Claim(
        "6 Surprise detects violations",
        "§4.3",
        "Surprise spikes at the onset of the attached phase, decays in it, and spikes again, dramatically, at the "
        "onset of extinction, when the movement that was expected fails to occur.",
        "fig. 3 A",
        shown=(
            _reward(
                "onset",
                _SURPRISE,
                "first minute of the rope against the minute before",
                ("acquisition_start", "baseline_end"),
                RISES,
            ),
            _reward(
                "decay",
                _SURPRISE,
                "last minute of the rope against its first",
                ("acquisition_end", "acquisition_start"),
                FALLS,
            ),
            _reward("violation", _SURPRISE, ONSET, _ONSET, RISES),
        ),
        said=(
            _reward("dramatic", _SURPRISE, ONSET, _ONSET, (LARGE, INFINITY)),
            _reward("passes", _SURPRISE, FADES, _FADES, FALLS),
            _test(
                "of_the_limb",
                _SURPRISE,
                f"reward of the attached limb less the others', {ONSET}",
                D,
                (SMALL, INFINITY),
                leads_more(_SURPRISE, "reward", *_ONSET),
            ),
        ),
    ),
    *(
        Claim(
            f"{number} burst, {where}",
            "§4.3",
            f"CAIS + Surprise {where_said}: when the rope is gone the attached limb's reward spikes noticeably and its "
            "Q(MOVE) (as shown) and P(MOVE) (as said: more than the others') burst, for a while, and by Surprise.",
            panels,
            shown=(_spike((condition, "cais_surprise"), RISES), *_bursts(condition, MOVE_Q, Q, Q_MOVE)),
            said=(*_bursts(condition, MOVE_P, P, P_MOVE), _limb_bursts(condition)),
            besides=_why_no_burst(condition),
        )
        for number, where, where_said, condition, panels in (
            ("7a", "quiet", "with a free mobile", "free", "fig. 3 C, D"),
            ("7b", "noisy", "in noise", "noisy", "fig. 4 C, D"),
        )
    ),
    Claim(
        "8 no burst without CAIS",
        "§4.3",
        "MTL + Surprise and RTL + Surprise show no clear burst; with a free mobile the base reward's drop prevents any "
        "net rise of the reward.",
        "figs. 3 B, D, 4 B, D",
        shown=_absent(
            *(_spike(cell, (-INFINITY, SMALL if cell[0] == "free" else LARGE)) for cell in _WITH_SURPRISE),
            *(_onset(cell, MOVE_Q, Q, (-INFINITY, Q_MOVE)) for cell in _WITH_SURPRISE),
        ),
        said=_absent(*(_onset(cell, MOVE_P, P, (-INFINITY, P_MOVE)) for cell in _WITH_SURPRISE)),
    ),
    Claim(
        "9 CAIS + Surprise learns",
        "§4.4",
        "The agent rewarded by CAIS + Surprise raises Q(MOVE), and with it P(MOVE), of the attached limb in both "
        "conditions.",
        "figs. 3 D, 4 D",
        shown=(_leads_in_q(("free", "cais_surprise")), _leads_in_q(("noisy", "cais_surprise"))),
        said=(_leads(("free", "cais_surprise")), _leads(("noisy", "cais_surprise"))),
    ),
)
