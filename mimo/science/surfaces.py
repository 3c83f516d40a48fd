"""Where in a space of constants effects lie: response surfaces through the effects at some of its points.

A surface is the mean of a Gaussian process (Rasmussen and Williams 2006, ch. 2) with a squared-exponential kernel, a
length for each constant, and noise for what differs between seeds; scikit-learn fits it by its marginal likelihood. How
well it foretells is seen by cross-validation over points. As the kernel is a product over constants, means and
variances over the space, each constant uniform in its coordinate, are products of integrals over one constant: main
effects and pairs are Sobol's decomposition of the surface (Sobol 2001, Math. Comput. Simul. 55:271), without sampling.

Coordinates are shares of a constant's range, from 0 to 1.
"""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, Kernel, WhiteKernel
from sklearn.model_selection import KFold
from threadpoolctl import threadpool_limits

from mimo.science.judgement import Array

FOLDS = 8
FEWEST = FOLDS  # points, for a surface
NODES = 16  # of an integral over a constant
STARTS = 2  # of the fit: its likelihood may have several maxima
# Bounds of the kernel, effects in units of their SD: of lengths, from a tenth of the range to as good as flat.
LENGTHS, SIZES, NOISES = (0.1, 100.0), (0.01, 100.0), (0.0001, 10.0)


@dataclass(frozen=True)
class _Fit:
    """A Gaussian process of effects less `centre`, their mean, in units of `size`, their SD."""

    process: GaussianProcessRegressor
    centre: float
    size: float

    @property
    def noise(self) -> float:
        """SD of what no constant explains."""
        return self.size * float(np.sqrt(self.process.kernel_.k2.noise_level))

    def at(self, points: Array) -> tuple[Array, Array]:
        """(point,) effects at (point, constant) coordinates, and the SD of what is not known of them."""
        with threadpool_limits(1):
            found, away = self.process.predict(points, return_std=True)
        # What the process says of a new observation has the noise in it, and the surface has not.
        known = np.maximum(away**2 - self.process.kernel_.k2.noise_level, 0)
        return np.asarray(self.centre + self.size * found), np.asarray(self.size * np.sqrt(known))


@dataclass(frozen=True)
class Surface:
    """Of one effect.

    Attributes:
        fit: the process.
        nodes: by constant, coordinates at which integrals over it are taken, and their weights.
        noise: SD between seeds at a point, one number for all points; with one seed, what the fit takes for noise.
        q2: share of the points' variance that is foretold of points left out, below 0 if worse than by their mean; None
            where the points do not differ.
        ceiling: share of it that is not noise, and could be foretold; None with one seed, or where they do not differ.
    """

    fit: _Fit
    nodes: tuple[tuple[Array, Array], ...]
    noise: float
    q2: float | None
    ceiling: float | None

    def at(self, points: Array) -> tuple[Array, Array]:
        """(point,) effects at (point, constant) coordinates, and the SD of what is not known of them."""
        return self.fit.at(points)

    def main(self, constant: int, shares: Array) -> Array:
        """(share,) the mean effect over all other constants, at some coordinates of one."""
        others = self._means[[place for place in range(len(self._means)) if place != constant]].prod(axis=0)
        return np.asarray(self.fit.centre + self.fit.size * (self._along(constant, shares) @ (self._weights * others)))

    @cached_property
    def mean(self) -> float:
        """Over the space."""
        return self.fit.centre + self.fit.size * float(self._weights @ self._means.prod(axis=0))

    @cached_property
    def variance(self) -> float:
        """Over the space."""
        products = np.ones((len(self._weights),) * 2)
        for constant, (shares, weights) in enumerate(self.nodes):
            along = self._along(constant, shares)
            products *= along.T @ (weights[:, None] * along)
        square = float(self._weights @ products @ self._weights)
        return max(0.0, self.fit.size**2 * square - (self.mean - self.fit.centre) ** 2)

    @cached_property
    def shares(self) -> Array:
        """(constant,) of the variance, each constant's own."""
        found = [
            float(weights @ (self.main(constant, shares) - self.mean) ** 2)
            for constant, (shares, weights) in enumerate(self.nodes)
        ]
        return np.array(found) / (self.variance or 1.0)

    @cached_property
    def pairs(self) -> dict[tuple[int, int], float]:
        """Of the variance, what two constants have together, beyond what each has."""
        found = {}
        for second in range(len(self.nodes)):
            for first in range(second):
                own = self._together(first, second) / (self.variance or 1.0)
                found[first, second] = own - float(self.shares[first] + self.shares[second])
        return found

    def _together(self, first: int, second: int) -> float:
        """Variance of the mean effect over all constants but two."""
        others = [place for place in range(len(self._means)) if place not in (first, second)]
        rest = self._weights * self._means[others].prod(axis=0)
        (left, left_weights), (right, right_weights) = self.nodes[first], self.nodes[second]
        found = self.fit.size * (self._along(first, left) * rest) @ self._along(second, right).T
        return float(left_weights @ (self.fit.centre + found - self.mean) ** 2 @ right_weights)

    @cached_property
    def _weights(self) -> Array:
        """(effect,) of the kernel's bumps, one around each effect that was fitted."""
        return np.asarray(_size(self.fit.process.kernel_) * self.fit.process.alpha_)

    @cached_property
    def _means(self) -> Array:
        """(constant, effect) of each bump over each constant."""
        return np.array([weights @ self._along(own, shares) for own, (shares, weights) in enumerate(self.nodes)])

    def _along(self, constant: int, shares: Array) -> Array:
        """(share, effect) each bump's height along one constant."""
        away = shares[:, None] - self.fit.process.X_train_[:, constant]
        return np.asarray(np.exp(-0.5 * (away / _lengths(self.fit.process.kernel_)[constant]) ** 2))


def surface(points: Array, effects: Array, choices: Mapping[int, Sequence[float]]) -> Surface | None:
    """Fit one; None with fewer than FEWEST points at which all effects are numbers.

    Args:
        points: (point, constant) coordinates.
        effects: (point, seed).
        choices: by constant, the two coordinates of one that has two values alone.
    """
    held = np.isfinite(effects).all(axis=1)
    points, effects = points[held], effects[held]
    if len(points) < FEWEST:
        return None
    fit, means = _fitted(points, effects), effects.mean(axis=1)
    nodes = tuple(_nodes(choices.get(constant)) for constant in range(points.shape[1]))
    foretold = np.empty(len(points))
    for kept, left in KFold(FOLDS, shuffle=True, random_state=0).split(points):
        foretold[left] = _fitted(points[kept], effects[kept]).at(points[left])[0]
    spread, several = float(means.var(ddof=1)), effects.shape[1] > 1
    noise = float(np.sqrt(effects.var(axis=1, ddof=1).mean())) if several else fit.noise
    q2, ceiling = None, None
    if spread > 0:
        q2 = 1 - float(((means - foretold) ** 2).sum() / ((means - means.mean()) ** 2).sum())
        ceiling = max(0.0, 1 - _rest(effects) / effects.shape[1] / spread) if several else None
    return Surface(fit, nodes, noise, q2, ceiling)


def _rest(effects: Array) -> float:
    """Variance of effects (point, seed) less points' and seeds' means: a seed saw the same noise at all points."""
    rest = effects - effects.mean(axis=1, keepdims=True) - effects.mean(axis=0) + effects.mean()
    return float((rest**2).sum() / ((effects.shape[0] - 1) * (effects.shape[1] - 1)))


def _fitted(points: Array, effects: Array) -> _Fit:
    """Of effects (point, seed), each seed's an observation of its own."""
    centre, size = float(effects.mean()), float(effects.std()) or 1.0
    kernel = ConstantKernel(1.0, SIZES) * RBF(np.ones(points.shape[1]), LENGTHS) + WhiteKernel(0.5, NOISES)
    process = GaussianProcessRegressor(kernel, n_restarts_optimizer=STARTS - 1, random_state=0)
    with warnings.catch_warnings(), threadpool_limits(1):  # with more threads, last bits hang on how many there are
        # A length at its bound is a constant that does nothing, and noise at its own an effect that has none.
        warnings.filterwarnings("ignore", "The optimal value found for dimension")
        process.fit(np.repeat(points, effects.shape[1], axis=0), (effects.ravel() - centre) / size)
    return _Fit(process, centre, size)


def _size(kernel: Kernel) -> float:
    """Of what `_fitted` fits."""
    return float(kernel.k1.k1.constant_value)


def _lengths(kernel: Kernel) -> Array:
    """(constant,) of what `_fitted` fits."""
    return np.atleast_1d(kernel.k1.k2.length_scale)


def _nodes(choice: Sequence[float] | None) -> tuple[Array, Array]:
    """Coordinates and weights of an integral over one constant."""
    if choice:
        return np.array(choice), np.full(len(choice), 1 / len(choice))
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    return (nodes + 1) / 2, weights / 2
