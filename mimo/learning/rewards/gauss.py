"""CAIS by the KL divergence of Gaussians: how far an action shifts and spreads h, against how far h spreads anyway."""

import numpy as np

from mimo.learning.rewards.divergence import of_moves
from mimo.learning.rewards.reward import Reward, Transition
from mimo.settings.section import Factor, Section


class GaussianKL(Reward):
    """KL(p(h|MOVE) || p(h)) of Gaussians with the mean and variance of the tables' quantiles, in nats, paid as CAIS.

    As the outermost quantiles are at 0.02 and 0.98, and tables hold expectiles while |u| < kappa, variances are
    smaller than those of h; that of both distributions alike.
    """

    name = "kl"
    unit = "nats"
    needs_outcomes = True
    needs_tables = True

    class Constants(Section):
        """`floor`: the least SD of a Gaussian, in units of h."""

        floor: Factor

    def __call__(self, t: Transition) -> np.ndarray:
        """See Reward."""
        return of_moves(t, self._divergence)

    def _divergence(self, moves: np.ndarray, marginal: np.ndarray) -> np.ndarray:
        """See of_moves."""
        (mean, variance), (wide_mean, wide) = self._moments(moves), self._moments(marginal)
        ratio = variance / wide
        found: np.ndarray = 0.5 * (ratio - 1 - np.log(ratio) + (mean - wide_mean) ** 2 / wide).mean(axis=-1)
        return found

    def _moments(self, tables: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean and variance (..., latent) of tables (..., quantiles, latent), float64."""
        values = tables.astype(np.float64)
        return values.mean(axis=-2), np.maximum(values.var(axis=-2), self.constants.floor**2)
