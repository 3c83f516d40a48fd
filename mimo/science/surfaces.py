"""Where in a space of constants effects lie: response surfaces through the effects at some of its points.

A surface is the mean of a Gaussian process (Rasmussen and Williams 2006, ch. 2) with a squared-exponential kernel, a
length for each constant, and noise for what differs between seeds; scikit-learn fits it by its marginal likelihood. How
well it foretells is seen by cross-validation over points. As the kernel is a product over constants, means and
variances over the space, each constant uniform on its range, are products of integrals over one constant: main effects
and pairs are Sobol's decomposition of the surface (Sobol 2001, Math. Comput. Simul. 55:271), without sampling.

Coordinates are shares of a constant's range, from 0 to 1.
"""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import stats
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, Kernel, WhiteKernel
from sklearn.model_selection import GroupKFold
from threadpoolctl import threadpool_limits

from mimo.science.judgement import Array

FOLDS = 8
NODES = 16  # of an integral over a constant
# Bounds of the kernel, effects in units of their SD: of lengths, from a tenth of the range to as good as flat.
LENGTHS, SIZES, NOISES = (0.1, 100.0), (0.01, 100.0), (0.0001, 10.0)
LEVEL = 0.05  # of all pairs of claims together, by Holm's correction
FEWEST = FOLDS  # points, for a surface


@dataclass(frozen=True)
class Surface:
    """Of one effect.

    Attributes:
        fitted: the Gaussian process, of effects less `centre`, over `size`.
        centre: the effects' mean.
        size: their SD, 1 where they do not differ.
        places: by constant, coordinates at which integrals over it are taken, and their weights.
        q2: share of the points' variance that the surface foretells of points left out; below 0 it is worse than their
            mean.
        ceiling: share of that variance which is not seeds' noise, and could be foretold.
    """

    fitted: GaussianProcessRegressor
    centre: float
    size: float
    places: tuple[tuple[Array, Array], ...]
    q2: float
    ceiling: float

    def at(self, points: Array) -> Array:
        """(point,) effects at (point, constant) coordinates."""
        return np.asarray(self.centre + self.size * _predicted(self.fitted, points))

    def main(self, constant: int, shares: Array) -> Array:
        """(share,) the mean effect over all other constants, at some coordinates of one."""
        others = self._means[[place for place in range(len(self._means)) if place != constant]].prod(axis=0)
        return np.asarray(self.centre + self.size * (self._along(constant, shares) @ (self._weights * others)))

    @property
    def noise(self) -> float:
        """SD between seeds at a point."""
        return self.size * float(np.sqrt(self.fitted.kernel_.k2.noise_level))

    @cached_property
    def mean(self) -> float:
        """Over the space."""
        return self.centre + self.size * float(self._weights @ self._means.prod(axis=0))

    @cached_property
    def variance(self) -> float:
        """Over the space."""
        products = np.ones((len(self._weights),) * 2)
        for constant, (shares, weights) in enumerate(self.places):
            along = self._along(constant, shares)
            products *= along.T @ (weights[:, None] * along)
        square = float(self._weights @ products @ self._weights)
        return max(0.0, self.size**2 * square - (self.mean - self.centre) ** 2)

    @cached_property
    def shares(self) -> Array:
        """(constant,) of the variance, each constant's own."""
        found = [
            float(weights @ (self.main(constant, shares) - self.mean) ** 2)
            for constant, (shares, weights) in enumerate(self.places)
        ]
        return np.array(found) / (self.variance or 1.0)

    @cached_property
    def pairs(self) -> dict[tuple[int, int], float]:
        """Of the variance, what two constants have together, beyond what each has."""
        found = {}
        for first in range(len(self.places)):
            for second in range(first):
                own = self._together(second, first)
                found[second, first] = own / (self.variance or 1.0) - float(self.shares[first] + self.shares[second])
        return found

    def _together(self, first: int, second: int) -> float:
        """Variance of the mean effect over all constants but two."""
        others = [place for place in range(len(self._means)) if place not in (first, second)]
        rest = self._weights * self._means[others].prod(axis=0)
        (left, left_weights), (right, right_weights) = self.places[first], self.places[second]
        surface = self.size * (self._along(first, left) * rest) @ self._along(second, right).T
        away = self.centre + surface - self.mean
        return float(left_weights @ away**2 @ right_weights)

    @cached_property
    def _weights(self) -> Array:
        """(effect,) of the kernel's bumps, one around each effect that was fitted."""
        return np.asarray(_parts(self.fitted.kernel_)[0] * self.fitted.alpha_)

    @cached_property
    def _means(self) -> Array:
        """(constant, effect) of each bump over each constant."""
        return np.array([weights @ self._along(own, shares) for own, (shares, weights) in enumerate(self.places)])

    def _along(self, constant: int, shares: Array) -> Array:
        """(share, effect) each bump's height along one constant."""
        away = shares[:, None] - self.fitted.X_train_[:, constant]
        return np.asarray(np.exp(-0.5 * (away / _parts(self.fitted.kernel_)[1][constant]) ** 2))


def surface(points: Array, effects: Array, choices: Mapping[int, Sequence[float]]) -> Surface | None:
    """Fit one; None with fewer than FEWEST points at which all effects are numbers.

    Args:
        points: (point, constant) coordinates.
        effects: (point, seed).
        choices: by constant, the coordinates of one that has a few values alone.
    """
    held = np.isfinite(effects).all(axis=1)
    points, effects = points[held], effects[held]
    if len(points) < FEWEST:
        return None
    centre, size = float(effects.mean()), float(effects.std()) or 1.0
    places = tuple(_places(choices.get(constant)) for constant in range(points.shape[1]))
    with threadpool_limits(1):  # with more, last bits hang on how many there are
        fitted = _fitted(points, (effects - centre) / size)
        means = effects.mean(axis=1)
        foretold = np.empty(len(points))
        for kept, left in GroupKFold(FOLDS).split(points, groups=np.arange(len(points))):
            foretold[left] = centre + size * _predicted(
                _fitted(points[kept], (effects[kept] - centre) / size), points[left]
            )
    spread = float(means.var()) or 1.0
    noise = float(effects.var(axis=1, ddof=1).mean()) / effects.shape[1] if effects.shape[1] > 1 else 0.0
    q2 = 1 - float(((means - foretold) ** 2).mean()) / spread
    return Surface(fitted, centre, size, places, q2, max(0.0, 1 - noise / float(means.var(ddof=1) or 1.0)))


def excluding(met: Mapping[str, Array]) -> list[tuple[str, str]]:
    """Which two of some conditions exclude each other: they are met together at fewer points than by chance.

    By the hypergeometric distribution, with Holm's correction over all pairs.

    Args:
        met: by name, (point,) whether it is met.
    """
    names, chances = list(met), {}
    for place, first in enumerate(names):
        for second in names[:place]:
            both, points = int((met[first] & met[second]).sum()), len(met[first])
            chances[second, first] = float(
                stats.hypergeom.cdf(both, points, int(met[first].sum()), int(met[second].sum()))
            )
    found = []
    for rank, pair in enumerate(sorted(chances, key=lambda pair: (chances[pair], pair))):
        if chances[pair] > LEVEL / (len(chances) - rank):
            break
        found.append(pair)
    return found


def _fitted(points: Array, effects: Array) -> GaussianProcessRegressor:
    """Of effects (point, seed) in units of their SD, each seed's an observation of its own."""
    kernel = ConstantKernel(1.0, SIZES) * RBF(np.ones(points.shape[1]), LENGTHS) + WhiteKernel(0.5, NOISES)
    with warnings.catch_warnings():
        # A length at its bound is a constant that does nothing, and noise at its own an effect that has none.
        warnings.simplefilter("ignore", ConvergenceWarning)
        return GaussianProcessRegressor(kernel).fit(np.repeat(points, effects.shape[1], axis=0), effects.ravel())


def _predicted(fitted: GaussianProcessRegressor, points: Array) -> Array:
    with threadpool_limits(1):
        return np.asarray(fitted.predict(points))


def _parts(kernel: Kernel) -> tuple[float, Array]:
    """The size and the lengths of what `_fitted` fits."""
    product = kernel.k1
    return float(product.k1.constant_value), np.asarray(product.k2.length_scale)


def _places(choices: Sequence[float] | None) -> tuple[Array, Array]:
    """Coordinates and weights of an integral over one constant."""
    if choices:
        return np.array(choices), np.full(len(choices), 1 / len(choices))
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    return (nodes + 1) / 2, weights / 2
