"""What follows an action: quantile models of p(h|a) and p(h), and their distance (paper §3.4).

A model is a free table: for each dimension of the latent h and each tau one number, the quantile. Tables of p(h|a), one
for each joint and action, and the table of p(h) learn from the same transitions.

Several seeds learn in lock step. Each seed is computed by calls of the same shapes, so its numbers are the same bytes
whatever its companions; and what a seed's call touches stays in the cache.
"""

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from mimo.learning.agent import ACTIONS, JOINTS
from mimo.settings import params

CONDITIONAL = JOINTS * ACTIONS  # tables of p(h|a); row 2 * joint + action
MARGINAL = CONDITIONAL  # the row of p(h), which comes last


def taus(quantiles: int) -> Tensor:
    """The quantiles' levels k / (quantiles + 1), paper §3.4.2: 49 of them are 0.02, 0.04, ..., 0.98."""
    return torch.arange(1, quantiles + 1) / (quantiles + 1)


class Outcomes:
    """Outcome models of N seeds in lock step, which share no number."""

    def __init__(self, settings: params.Outcomes, initial: Tensor, generators: Sequence[np.random.Generator]) -> None:
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
        seeds, batch = len(generators), settings.batch
        # The latent runs fastest: then a batch's h is added to a table in whole rows.
        self._tables = initial.T.contiguous().float().repeat(seeds, MARGINAL + 1, 1, 1)
        self._gradient = torch.zeros_like(self._tables)
        tables = list(self._tables)
        for table, gradient in zip(tables, self._gradient, strict=True):
            table.grad = gradient
        # AdamW with torch's defaults, as the paper gives its learning rate alone. The default decay draws all tables
        # alike towards 0 by 1e-5 of their value a step, against steps of up to 1e-3: too little to matter for W1.
        self._optimizer = torch.optim.AdamW(tables, lr=settings.learning_rate, fused=True)
        levels = taus(quantiles).unsqueeze(-1).expand(quantiles, latent)
        self._positive_factor, self._negative_factor = -levels / batch, (levels - 1) / batch
        self._rows = torch.full((seeds, settings.memory, JOINTS + 1), MARGINAL)
        self._latents = torch.zeros(seeds, settings.memory, latent)
        self._work = torch.empty(2, batch, JOINTS + 1, quantiles, latent)
        self._distance = torch.empty(CONDITIONAL, quantiles, latent)

    @property
    def conditional(self) -> Tensor:
        """Quantiles of p(h|a), a view (N, joint, action, latent, quantiles)."""
        return self._tables[:, :CONDITIONAL].view(-1, JOINTS, ACTIONS, *self._tables.shape[2:]).mT

    @property
    def marginal(self) -> Tensor:
        """Quantiles of p(h), a view (N, latent, quantiles)."""
        return self._tables[:, MARGINAL].mT

    @torch.no_grad()
    def update(self, action: Tensor, latent: Tensor) -> None:
        """Remember a transition, then take one step of AdamW on a batch of the last `memory` transitions.

        The batch is drawn uniformly and with replacement, so it need not hold the newest transition. The loss of a
        quantile q at level tau is |tau - 1(u < 0)| Huber(u) with u = h - q (paper eqs. huber_loss, quantile_loss), mean
        over the batch, summed over tables: the tables are independent, and each action's table learns from the
        transitions in which its joint took that action.

        Args:
            action: (N, 12) bool, True where the joint moved.
            latent: (N, latent), the h that followed.
        """
        place = self._steps % self._settings.memory
        self._rows[:, place, :JOINTS] = _rows(action)
        self._latents[:, place] = latent
        self._steps += 1
        held = min(self._steps, self._settings.memory)
        for seed, generator in enumerate(self._generators):
            drawn = torch.from_numpy(generator.integers(0, held, self._settings.batch))
            self._differentiate(seed, self._rows[seed, drawn].flatten(), self._latents[seed, drawn])
        self._optimizer.step()

    def _differentiate(self, seed: int, rows: Tensor, latent: Tensor) -> None:
        """Write the loss's gradient in few passes over memory.

        The derivative of paper eq. quantile_loss by q is -|tau - 1(u < 0)| clip(u, -kappa, kappa), here split at u = 0.

        Args:
            seed: place in the stack.
            rows: (batch * 13,), the tables that learn from each transition.
            latent: (batch, latent), the h of each transition.
        """
        kappa = self._settings.kappa
        u, positive = self._work
        torch.index_select(self._tables[seed], 0, rows, out=u.flatten(0, 1))
        y = latent[:, None, None].repeat(1, 1, u.shape[2], 1)  # whole tables: a broadcast would run row by row
        torch.sub(y, u, out=u)
        torch.clamp(u, 0, kappa, out=positive)
        negative = u.clamp_(-kappa, 0)
        terms = positive.mul_(self._positive_factor).addcmul_(negative, self._negative_factor)
        self._gradient[seed].zero_().index_add_(0, rows, terms.flatten(0, 1))

    @torch.no_grad()
    def influence(self) -> Tensor:
        """Causal influence of each action, paper eq. causality_continuous: W1 of p(h|a) and p(h), mean over the latent.

        W1 is the mean distance of quantiles at the same level (paper eq. quantile_w2).

        Returns:
            (N, 12, 2): joint, then NO_TORQUE and MOVE, in units of h.
        """
        distances = []
        for table in self._tables:
            torch.sub(table[:CONDITIONAL], table[MARGINAL], out=self._distance)
            distances.append(self._distance.abs_().flatten(1).mean(1))
        return torch.stack(distances).view(-1, JOINTS, ACTIONS)

    @torch.no_grad()
    def expectation(self, action: Tensor) -> Tensor:
        """E[h|a] for the action of each joint (paper §3.5): the mean of its quantiles.

        Args:
            action: (N, 12) bool, True where the joint moved.

        Returns:
            (N, 12, latent), in units of h.
        """
        pairs = zip(self._tables, _rows(action), strict=True)
        return torch.stack([table.mean(1)[rows] for table, rows in pairs])


def _rows(action: Tensor) -> Tensor:
    """The rows of p(h|a) for actions (..., 12)."""
    return action.long() + ACTIONS * torch.arange(JOINTS)
