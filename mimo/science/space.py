"""What the points of a space of constants say of the claims: where each holds, by which constants, and where all do.

With so few seeds a point has no verdict of its own. A test is met where its effect's surface (mimo.science.surfaces)
lies in the claim's region, and a verdict holds where all its tests are met; so it is foretold, at the points and in
between. A region that is the point 0 is met where SEEDS seeds could not tell the effect from 0. A test that something
does not happen is not met where half the joints are locked, as in mimo.science.judgement.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import stats
from scipy.stats import qmc

from mimo.science import judgement, measures, surfaces
from mimo.science.judgement import GROUPS, SATURATED, Array, Cell, Claim, Curves, Test, Windows
from mimo.science.surfaces import Surface

SEEDS = 5  # as a study has
DRAWN = 12  # 2^12 places of the space, at which the surfaces are asked
BINS = 8  # of a constant's range, in each of which a claim's share is told
ALONG = tuple(place / 8 for place in range(9))  # coordinates at which main effects are told
PAIRS = 3  # of constants, told of each test


@dataclass(frozen=True)
class Space:
    """Points of a space.

    Attributes:
        points: (point, constant) coordinates, shares of the constants' ranges.
        choices: by constant, the coordinates of one that has a few values alone.
    """

    points: Array
    choices: Mapping[int, Sequence[float]]

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
    """A test at each point: its effects (point, seed), their surface, and whether it is met, there and at places."""

    test: Test
    effects: Array
    surface: Surface | None
    met: Array
    places: Array


def mapped(
    curves: Sequence[Curves], windows: Windows, space: Space, claims: Sequence[Claim], shown: Sequence[str]
) -> dict[str, Any]:
    """All of it, ready for JSON.

    Args:
        curves: of each point, in the space's order, as judgement.evaluate has them.
        windows: likewise.
        space: the points.
        claims: usually CLAIMS; those that lack a cell are left out.
        shown: measures (mimo.science.measures) whose main effects are told of each cell.

    Returns:
        `tests`: for each `claim`, `group`, `name`, `says`, `unit`, `region`, `seeds` (of each point), `q2`, `ceiling`,
        `shares` (of the variance, by constant), `pairs` (two constants and their share, the largest first), `foretold`
        (at each point) and `share` (of the space where it is met); without a surface, None and empty lists.
        `measures`: by measure and cell `q2`, `ceiling`, `shares`, `pairs`, and `main`, by constant the effect at ALONG
        or at each of its few values.
        `verdicts`: for each `claim` and `group`, `share` (of the space where it holds), `met` (at each point) and `by`,
        by constant its share in each bin. `together`: `counts`, the share of the space by how many verdicts hold, and
        `all`. `excluding`: pairs of claim and group. `order`: points, by how many verdicts, then tests, are foretold.
    """
    cells = [cell for cell in curves[0] if all(cell in own for own in curves)]
    drawn = space.drawn()
    locked = {cell: space.surface(np.array([_locked(own[cell], windows) for own in curves])) for cell in cells}
    held = [
        (claim, group, [_tested(test, curves, windows, space, drawn, locked) for test in getattr(claim, group)])
        for claim in claims
        for group in GROUPS
        if all(cell in cells for test in (*claim.shown, *claim.said) for cell in test.cells)
    ]
    names = [f"{claim.name}, as {group}" for claim, group, _ in held]
    met = {name: np.all([own.met for own in tests], axis=0) for name, (_, _, tests) in zip(names, held, strict=True)}
    places = {
        name: np.all([own.places for own in tests], axis=0) for name, (_, _, tests) in zip(names, held, strict=True)
    }
    counts = np.sum(list(places.values()), axis=0)
    tests = np.sum([own.met for _, _, own_tests in held for own in own_tests], axis=0)
    order = np.lexsort((np.arange(len(curves)), -tests, -np.sum(list(met.values()), axis=0)))
    return {
        "tests": [_told(claim.name, group, own) for claim, group, tests in held for own in tests],
        "measures": {name: _measured(name, curves, windows, space, cells) for name in shown},
        "verdicts": [
            {
                "claim": claim.name, "group": group, "tests": len(tests), "share": float(places[name].mean()),
                "met": met[name].tolist(), "by": _by(places[name], drawn, space),
            }
            for name, (claim, group, tests) in zip(names, held, strict=True)
        ],
        "together": {
            "counts": (np.bincount(counts, minlength=len(names) + 1) / len(counts)).tolist(),
            "all": float((counts == len(names)).mean()),
        },
        "excluding": surfaces.excluding(met),
        "order": order.tolist(),
    }  # fmt: skip


def _tested(
    test: Test, curves: Sequence[Curves], windows: Windows, space: Space, drawn: Array,
    locked: Mapping[Cell, Surface | None],
) -> _Tested:  # fmt: skip
    effects = np.array([np.asarray(test.measure(own, windows), np.float64) for own in curves])
    surface = space.surface(effects)
    met, places = (
        np.zeros(len(at), bool) if surface is None else _inside(test, surface, at) & ~_saturated(test, locked, at)
        for at in (space.points, drawn)
    )
    return _Tested(test, effects, surface, met, places)


def _inside(test: Test, surface: Surface, at: Array) -> Array:
    reach = 0.0
    if test.low == test.high:
        reach = surface.noise * float(stats.t.ppf((1 + judgement.LEVEL) / 2, SEEDS - 1)) / SEEDS**0.5
    found = surface.at(at)
    return np.asarray((test.low - reach <= found) & (found <= test.high + reach))


def _saturated(test: Test, locked: Mapping[Cell, Surface | None], at: Array) -> Array:
    held = [surface for cell in test.cells if (surface := locked[cell]) is not None] if test.absent else []
    found = np.zeros(len(at), bool)
    for surface in held:
        found |= surface.at(at) >= SATURATED
    return found


def _locked(cell: Mapping[str, Array], windows: Windows) -> Array:
    """(seed,) share of locked joints in late baseline or late acquisition: the larger."""
    shares = [cell["locked"][:, windows[name]].mean(axis=1) for name in ("baseline_late", "acquisition_late")]
    return np.asarray(np.max(shares, axis=0))


def _told(claim: str, group: str, own: _Tested) -> dict[str, Any]:
    return {
        "claim": claim, "group": group, "name": own.test.name, "says": own.test.says, "unit": own.test.unit,
        "region": [None if np.isinf(end) else end for end in (own.test.low, own.test.high)],
        "seeds": own.effects.tolist(), "share": float(own.places.mean()),
        "foretold": own.met.tolist(),
    } | _fit(own.surface)  # fmt: skip


def _measured(
    name: str, curves: Sequence[Curves], windows: Windows, space: Space, cells: Sequence[Cell]
) -> dict[str, Any]:
    """By cell, of those whose curves allow the measure."""
    found = {}
    for cell in cells:
        effects = [measures.effects(own[cell], windows, [name]).get(name) for own in curves]
        if all(effects):
            surface = space.surface(np.array(effects))
            at = [np.array(space.choices.get(constant, ALONG)) for constant in _constants(space)]
            main = [] if surface is None else [surface.main(*own).tolist() for own in enumerate(at)]
            found["/".join(cell)] = _fit(surface) | {"main": main}
    return found


def _fit(surface: Surface | None) -> dict[str, Any]:
    if surface is None:
        return {"q2": None, "ceiling": None, "shares": [], "pairs": []}
    pairs = sorted(surface.pairs.items(), key=lambda pair: (-pair[1], pair[0]))[:PAIRS]
    return {
        "q2": surface.q2, "ceiling": surface.ceiling, "shares": surface.shares.tolist(),
        "pairs": [[*pair, share] for pair, share in pairs],
    }  # fmt: skip


def _by(met: Array, drawn: Array, space: Space) -> list[list[float]]:
    """By constant, the share of places where something is met, in each bin or at each of its few values."""
    found = []
    for constant in _constants(space):
        bins = len(space.choices.get(constant, ())) or BINS
        where = (drawn[:, constant] * bins).astype(int)
        found.append([float(met[where == one].mean()) for one in range(bins)])
    return found


def _constants(space: Space) -> range:
    return range(space.points.shape[1])
