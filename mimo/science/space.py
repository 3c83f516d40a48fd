"""What the points of a space of constants say of the claims: where each holds, by which constants, and where all do.

With so few seeds a point has no verdict of its own. What is foretold, at the points and in between, is the verdict that
CONFIRMING seeds would give there: where the interval of so many around an effect's surface (mimo.science.surfaces),
widened by what the surface does not know, lies in the claim's region, outside, or astride its border; the rest is as in
mimo.science.judgement. Seeds are the same at all points, so what a seed's noise does everywhere no surface can tell.

Effects are cut off CLIPPED times a border's distance from 0 beyond it before a surface goes through them: they count by
where they lie beside their region, and a few far ones would else decide it.
"""

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import stats
from scipy.stats import qmc

from mimo.science import judgement, measures, surfaces
from mimo.science.judgement import FAILS, GROUPS, HOLDS, SATURATED, UNDECIDED, Array, Cell, Claim, Curves, Test, Windows
from mimo.science.surfaces import Surface

CONFIRMING = 5  # seeds, as a study has
CLIPPED = 4.0
DRAWN = 12  # 2^12 places of the space, at which the surfaces are asked
BINS = 8  # of a constant's range, in each of which a verdict's share is told
ALONG = tuple(place / 8 for place in range(9))  # coordinates at which main effects are told
PAIRS = 3  # of constants, told of each test


@dataclass(frozen=True)
class Space:
    """Points of a space.

    Attributes:
        points: (point, constant) coordinates, shares of the constants' ranges.
        choices: by constant, the two coordinates of one that has two values alone.
        published: (constant,) coordinates of the published values; None where one is not in its range.
    """

    points: Array
    choices: Mapping[int, Sequence[float]]
    published: Array | None

    def surface(self, effects: Array) -> Surface | None:
        """Through effects (point, seed)."""
        return surfaces.surface(self.points, effects, self.choices)

    def drawn(self) -> Array:
        """(place, constant) coordinates all over the space."""
        found = qmc.Sobol(self.points.shape[1], rng=np.random.default_rng(1)).random_base2(DRAWN)
        for constant, values in self.choices.items():
            found[:, constant] = np.array(values)[(found[:, constant] * len(values)).astype(int)]
        return np.asarray(found)


@dataclass(frozen=True)
class _Tested:
    """A test: its effects (point, seed), their surface, its verdicts at the points and at places all over the space."""

    test: Test
    effects: Array
    surface: Surface | None
    points: Array
    places: Array


def complete(claims: Sequence[Claim], cells: Container[Cell]) -> list[Claim]:
    """The claims none of whose tests lacks a cell."""
    return [
        claim
        for claim in claims
        if all(cell in cells for test in (*claim.shown, *claim.said) for cell in test.cells)
    ]  # fmt: skip


def mapped(
    curves: Sequence[Curves],
    published: Curves,
    windows: Windows,
    space: Space,
    claims: Sequence[Claim],
    shown: Sequence[str],
) -> dict[str, Any]:
    """All of it, ready for JSON.

    Args:
        curves: of each point, in the space's order, as judgement.evaluate has them.
        published: those of the published constants.
        windows: stretches of steps.
        space: the points.
        claims: usually CLAIMS, of which at least one must be complete.
        shown: measures (mimo.science.measures) whose main effects are told of each cell.

    Returns:
        `tests`: for each `claim`, `group`, `name`, `says`, `unit`, `region`, `seeds` (effects at each point), `q2`,
        `ceiling`, `noise`, `shares` (of the surface's variance, by constant), `pairs` (two constants and their share,
        the largest first), `points` (verdicts), `holds` and `fails` (shares of the space) and `published`, where all
        is known: the surface there, the SD of what it does not know, the published effect cut off alike. `measures`: by
        measure and cell `main`, by constant the effect at ALONG or at both of its values. `verdicts`: for each `claim`
        and `group`, `holds`, `fails`, `points` and `by`, by constant the share that holds in each bin. `together`: by
        how many verdicts hold (`holds`), and fail (`fails`), the shares of the space. `apart`: pairs of verdicts that
        hold somewhere, but hardly ever at one place. `order`: points, by how many verdicts, then tests, hold.
    """
    cells = [cell for cell in curves[0] if all(cell in own for own in curves)]
    drawn = space.drawn()
    locked = {cell: space.surface(np.array([_locked(own[cell], windows) for own in curves])) for cell in cells}
    held = [
        (claim, group, [_tested(test, curves, windows, space, drawn, locked) for test in getattr(claim, group)])
        for claim in complete(claims, cells)
        for group in GROUPS
    ]
    points = [_together([own.points for own in tests]) for _, _, tests in held]
    places = [_together([own.places for own in tests]) for _, _, tests in held]
    tests = np.sum([own.points == HOLDS for _, _, all_tests in held for own in all_tests], axis=0)
    order = np.lexsort((np.arange(len(curves)), -tests, -np.sum(np.array(points) == HOLDS, axis=0)))
    return {
        "tests": [
            _told(claim.name, group, own, published, windows, space) for claim, group, tests in held for own in tests
        ],
        "measures": {name: _measured(name, curves, windows, space, cells) for name in shown},
        "verdicts": [
            {
                "claim": claim.name, "group": group, "points": at.tolist(), "by": _by(all_over == HOLDS, drawn, space),
            } | _shares(all_over)
            for (claim, group, _), at, all_over in zip(held, points, places, strict=True)
        ],
        "together": {word: _counted(np.array(places) == word) for word in (HOLDS, FAILS)},
        "apart": _apart([f"{claim.name}, as {group}" for claim, group, _ in held], np.array(places) == HOLDS),
        "order": order.tolist(),
    }  # fmt: skip


def _tested(
    test: Test,
    curves: Sequence[Curves],
    windows: Windows,
    space: Space,
    drawn: Array,
    locked: Mapping[Cell, Surface | None],
) -> _Tested:
    effects = np.array([np.asarray(test.measure(own, windows), np.float64) for own in curves])
    surface = space.surface(_clipped(test, effects))
    points, places = (_verdicts(test, surface, at, locked) for at in (space.points, drawn))
    points[~np.isfinite(effects).all(axis=1)] = UNDECIDED
    return _Tested(test, effects, surface, points, places)


def _clipped(test: Test, effects: Array) -> Array:
    borders = [end for end in (test.low, test.high) if np.isfinite(end)]
    reach = CLIPPED * max(map(abs, borders)) or np.inf
    return np.asarray(np.clip(effects, min(borders) - reach, max(borders) + reach))


def _verdicts(test: Test, surface: Surface | None, at: Array, locked: Mapping[Cell, Surface | None]) -> Array:
    """(place,) words."""
    if surface is None:
        return np.full(len(at), UNDECIDED, object)
    found, unknown = surface.at(at)
    times = float(stats.t.ppf((1 + judgement.LEVEL) / 2, CONFIRMING - 1))
    reach = times * np.sqrt(surface.noise**2 / CONFIRMING + unknown**2)
    words = [
        judgement.verdict(bounds, test.low, test.high) for bounds in zip(found - reach, found + reach, strict=True)
    ]
    return np.where(_saturated(test, at, locked), UNDECIDED, np.array(words, object))


def _saturated(test: Test, at: Array, locked: Mapping[Cell, Surface | None]) -> Array:
    held = [surface for cell in test.cells if (surface := locked[cell]) is not None] if test.absent else []
    found = np.zeros(len(at), bool)
    for surface in held:
        found |= surface.at(at)[0] >= SATURATED
    return found


def _together(tests: Sequence[Array]) -> Array:
    """(place,) the verdict of all tests, as judgement has it."""
    found = np.full(len(tests[0]), UNDECIDED, object)
    found[np.all([own == HOLDS for own in tests], axis=0)] = HOLDS
    found[np.any([own == FAILS for own in tests], axis=0)] = FAILS
    return found


def _locked(cell: Mapping[str, Array], windows: Windows) -> Array:
    """(seed,) share of locked joints in late baseline or late acquisition: the larger."""
    shares = [cell["locked"][:, windows[name]].mean(axis=1) for name in ("baseline_late", "acquisition_late")]
    return np.asarray(np.max(shares, axis=0))


def _told(
    claim: str, group: str, own: _Tested, published: Curves, windows: Windows, space: Space
) -> dict[str, Any]:  # fmt: skip
    beside = None
    if own.surface is not None and space.published is not None and all(cell in published for cell in own.test.cells):
        effects = np.asarray(own.test.measure(published, windows), np.float64)
        effect = float(judgement.interquartile_mean(_clipped(own.test, effects)))
        found, unknown = own.surface.at(space.published[None])
        beside = [float(found[0]), float(unknown[0]), effect]
    return {
        "claim": claim, "group": group, "name": own.test.name, "says": own.test.says, "unit": own.test.unit,
        "region": [None if np.isinf(end) else end for end in (own.test.low, own.test.high)],
        "seeds": own.effects.tolist(), "points": own.points.tolist(), "published": beside,
    } | _fit(own.surface) | _shares(own.places)  # fmt: skip


def _fit(surface: Surface | None) -> dict[str, Any]:
    if surface is None:
        return {"q2": None, "ceiling": None, "noise": None, "shares": [], "pairs": []}
    pairs = sorted(surface.pairs.items(), key=lambda pair: (-pair[1], pair[0]))[:PAIRS]
    return {
        "q2": surface.q2, "ceiling": surface.ceiling, "noise": surface.noise, "shares": surface.shares.tolist(),
        "pairs": [[*pair, share] for pair, share in pairs],
    }  # fmt: skip


def _measured(
    name: str, curves: Sequence[Curves], windows: Windows, space: Space, cells: Sequence[Cell]
) -> dict[str, Any]:
    """By cell, of those whose curves allow the measure and have a surface."""
    at = [np.array(space.choices.get(constant, ALONG)) for constant in _constants(space)]
    found = {}
    for cell in cells:
        effects = [measures.effects(own[cell], windows, [name]).get(name) for own in curves]
        surface = space.surface(np.array(effects)) if all(effects) else None
        if surface is not None:
            found["/".join(cell)] = {"main": [surface.main(*own).tolist() for own in enumerate(at)]}
    return found


def _shares(places: Array) -> dict[str, float]:
    return {word: float((places == word).mean()) for word in (HOLDS, FAILS)}


def _counted(held: Array) -> list[float]:
    """By how many of (verdict, place) are true, from none to all, the share of places."""
    counts = np.bincount(held.sum(axis=0), minlength=len(held) + 1)
    return (counts / counts.sum()).tolist()  # type: ignore[no-any-return]


def _apart(names: Sequence[str], held: Array) -> list[list[str]]:
    """Each holds in a twentieth of the space at least, both in less than a tenth of what chance would have."""
    shares = held.mean(axis=1)
    return [
        [names[first], names[second]]
        for second in range(len(names))
        for first in range(second)
        if min(shares[first], shares[second]) >= 0.05
        and (held[first] & held[second]).mean() < 0.1 * shares[first] * shares[second]
    ]


def _by(held: Array, drawn: Array, space: Space) -> list[list[float]]:
    """By constant, the share of places where something holds, in each bin or at either of its two values."""
    found = []
    for constant in _constants(space):
        bins = len(space.choices.get(constant, ())) or BINS
        where = (drawn[:, constant] * bins).astype(int)
        found.append([float(held[where == one].mean()) for one in range(bins)])
    return found


def _constants(space: Space) -> range:
    return range(space.points.shape[1])
