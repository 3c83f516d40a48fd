"""What follows an action: quantile models of p(h|a) and p(h), and their distance (paper §3.4), as kernels.

A model is a free table: for each tau and each dimension of the latent h one number, the quantile. Tables of p(h|a), one
for each joint and action, and the table of p(h) learn from the same transitions. Several seeds learn in lock step, each
computed by itself: its numbers are the same bytes in any company.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from mimo.record.kernels import ONE, Array, adamw, checked, kernel
from mimo.settings import params
from mimo.world.protocol import ACTIONS, JOINTS

CONDITIONAL = JOINTS * ACTIONS  # tables of p(h|a); row 2 * joint + action
MARGINAL = CONDITIONAL  # the row of p(h), which comes last


def taus(quantiles: int) -> Array:
    """The quantiles' levels k / (quantiles + 1), paper §3.4.2, float32: 49 of them are 0.02, 0.04, ..., 0.98."""
    return (np.arange(1, quantiles + 1) / (quantiles + 1)).astype(np.float32)


class Outcomes:
    """Outcome models of N seeds in lock step, which share no number."""

    def __init__(self, settings: params.Outcomes, initial: Array, generators: Sequence[np.random.Generator]) -> None:
        """Start every table at `initial`.

        Args:
            settings: the section `outcomes` of params.yaml.
            initial: (latent, quantiles), in units of h.
            generators: one a seed; each draws its seed's batches.

        Raises:
            ValueError: `initial` has another number of quantiles than `settings`.
        """
        latent, quantiles = initial.shape
        if quantiles != settings.quantiles:
            raise ValueError(f"initial has {quantiles} quantiles, but outcomes.quantiles is {settings.quantiles}.")
        self._settings, self._generators, self._steps = settings, generators, 0
        self._kappa, self._rate = np.float32(settings.kappa), np.float32(settings.learning_rate)
        self._levels = taus(quantiles)
        seeds = len(generators)
        # The latent runs fastest: then a batch's h is compared with whole rows of a table. AdamW's default decay draws
        # all tables alike towards 0 by 1e-5 of their value a step, against steps of up to 1e-3: too little for W1.
        self._tables = np.empty((seeds, MARGINAL + 1, quantiles, latent), np.float32)
        self._tables[:] = initial.T
        self._gradient, self._first, self._second = (np.zeros_like(self._tables) for _ in range(3))
        self._rows = np.full((seeds, settings.memory, JOINTS + 1), MARGINAL)
        self._latents = np.zeros((seeds, settings.memory, latent), np.float32)

    @property
    def conditional(self) -> Array:
        """Quantiles of p(h|a), a view (N, joint, action, latent, quantiles)."""
        tables = self._tables[:, :CONDITIONAL]
        return tables.reshape(-1, JOINTS, ACTIONS, *tables.shape[2:]).swapaxes(-1, -2)

    @property
    def marginal(self) -> Array:
        """Quantiles of p(h), a view (N, latent, quantiles)."""
        return self._tables[:, MARGINAL].swapaxes(-1, -2)

    def update(self, action: Array, latent: Array) -> None:
        """Remember a transition, then take one step of AdamW on a batch of the last `memory` transitions.

        The batch is drawn uniformly and with replacement, so it need not hold the newest transition. The loss of a
        quantile q at level tau is |tau - 1(u < 0)| Huber(u) with u = h - q (paper eqs. huber_loss, quantile_loss), mean
        over the batch, summed over tables: the tables are independent, and each action's table learns from the
        transitions in which its joint took that action.

        Args:
            action: (N, 12) bool, True where the joint moved.
            latent: (N, latent) float32, the h that followed.

        Raises:
            ValueError: an argument has another shape or type.
        """
        latent = checked("latent", latent, (len(self._tables), self._latents.shape[-1]), np.float32)
        place = self._steps % self._settings.memory
        self._rows[:, place, :JOINTS] = self._of(action)
        self._latents[:, place] = latent
        self._steps += 1
        held = min(self._steps, self._settings.memory)
        for seed, generator in enumerate(self._generators):
            drawn = generator.integers(0, held, self._settings.batch)
            table, gradient = self._tables[seed], self._gradient[seed]
            _differentiate(table, self._rows[seed, drawn], self._latents[seed, drawn], self._levels, self._kappa,
                           gradient)  # fmt: skip
            adamw(table.reshape(-1), gradient.reshape(-1), self._first[seed].reshape(-1),
                  self._second[seed].reshape(-1), self._rate, self._steps)  # fmt: skip

    def influence(self) -> Array:
        """Causal influence of each action, paper eq. causality_continuous: W1 of p(h|a) and p(h), mean over the latent.

        W1 is the mean distance of quantiles at the same level.

        Returns:
            (N, 12, 2): joint, then NO_TORQUE and MOVE, in units of h.
        """
        return np.stack([_distances(tables) for tables in self._tables]).reshape(-1, JOINTS, ACTIONS)

    def expectation(self, action: Array) -> Array:
        """E[h|a] for the action of each joint (paper §3.5): the mean of its quantiles.

        Args:
            action: (N, 12) bool, True where the joint moved.

        Returns:
            (N, 12, latent), in units of h.

        Raises:
            ValueError: the action has another shape or type.
        """
        return np.stack([_means(tables, rows) for tables, rows in zip(self._tables, self._of(action), strict=True)])

    def _of(self, action: Array) -> Array:
        """The rows (N, 12) of p(h|a)."""
        return checked("action", action, (len(self._tables), JOINTS), bool) + ACTIONS * np.arange(JOINTS)


@kernel
def _differentiate(tables: Array, rows: Array, latents: Array, levels: Array, kappa: Any, gradient: Array) -> None:
    """Write the gradient of paper eq. quantile_loss: by q it is -|tau - 1(u < 0)| clip(u, -kappa, kappa).

    Args:
        tables: (tables, quantiles, latent).
        rows: (batch, 13), the tables that learn from each transition.
        latents: (batch, latent), the h of each.
        levels: (quantiles,), taus.
        kappa: in units of h.
        gradient: like tables.
    """
    gradient[:] = 0
    batch, none = np.float32(len(rows)), np.float32(0)
    for n in range(len(rows)):
        h = latents[n]
        for place in range(rows.shape[1]):
            row = rows[n, place]
            for k in range(len(levels)):
                above, below = levels[k] / batch, (ONE - levels[k]) / batch
                q, into = tables[row, k], gradient[row, k]
                for d in range(len(h)):
                    u = h[d] - q[d]
                    into[d] -= above * min(max(u, none), kappa) + below * max(min(u, none), -kappa)


@kernel
def _distances(tables: Array) -> Array:
    """(tables - 1,): W1 of each table and the last."""
    quantiles, latent = tables.shape[1:]
    found, sums = np.empty(len(tables) - 1, np.float32), np.empty(latent, np.float32)
    for row in range(len(found)):
        sums[:] = 0
        for k in range(quantiles):
            q, marginal = tables[row, k], tables[-1, k]
            for d in range(latent):
                sums[d] += abs(q[d] - marginal[d])
        found[row] = sums[0]
        for d in range(1, latent):
            found[row] += sums[d]
        found[row] /= np.float32(quantiles * latent)
    return found


@kernel
def _means(tables: Array, rows: Array) -> Array:
    """(rows, latent): the means of tables' quantiles."""
    quantiles, latent = tables.shape[1:]
    found = np.zeros((len(rows), latent), np.float32)
    for n in range(len(rows)):
        mean = found[n]
        for k in range(quantiles):
            q = tables[rows[n], k]
            for d in range(latent):
                mean[d] += q[d]
        for d in range(latent):
            mean[d] /= np.float32(quantiles)
    return found
