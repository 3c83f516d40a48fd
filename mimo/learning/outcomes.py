"""What follows an action: quantile models of p(h|a) and p(h), and their distance (paper §3.4), as kernels.

A model is a free table: a number, the quantile, for each tau and each dimension of the latent h. A table of p(h|a), one
for each joint and action, learns from the transitions in which the joint took that action, the table of p(h) from all.
Each draws a batch of its own, so that all move at one pace. With `outcomes.action` "limb", a joint's action is its
limb's: MOVE if any of the limb's joints moved. Several seeds learn in lock step, each computed by itself:
its numbers are the same bytes in any company.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from mimo.record.kernels import ONE, Array, adamw, checked, kernel
from mimo.settings import params
from mimo.world import body
from mimo.world.protocol import ACTIONS, JOINTS, MOVE, NO_TORQUE

CONDITIONAL = JOINTS * ACTIONS  # tables of p(h|a); row 2 * joint + action
MARGINAL = CONDITIONAL  # the row of p(h), which comes last
NONE = -1  # in a batch: no transition
LIMBS = tuple(  # of each joint: the joints of its limb, itself among them
    np.flatnonzero(next(body.attached(limb) for limb, own in body.LIMB_JOINTS.items() if joint in own))
    for joint in body.ACTUATED
)


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
        self._actions = np.zeros((seeds, settings.memory, JOINTS), bool)
        self._latents = np.zeros((seeds, settings.memory, latent), np.float32)

    @property
    def conditional(self) -> Array:
        """Quantiles of p(h|a), a view (N, joint, action, latent, quantiles)."""
        tables = self.tables[:, :CONDITIONAL]
        return tables.reshape(-1, JOINTS, ACTIONS, *tables.shape[2:]).swapaxes(-1, -2)

    @property
    def marginal(self) -> Array:
        """Quantiles of p(h), a view (N, latent, quantiles)."""
        return self.tables[:, MARGINAL].swapaxes(-1, -2)

    @property
    def tables(self) -> Array:
        """All of them, a view (N, 25, quantiles, latent): row 2 * joint + action is p(h|a), the last p(h)."""
        return self._tables

    def update(self, action: Array, latent: Array) -> None:
        """Remember a transition, then take one step of AdamW on batches of the last `memory` transitions.

        A table's batch (`batches: own`) is drawn from the transitions that it learns from, uniformly and with
        replacement, so it need not hold the newest; where there is none, the table has no gradient. With `batches:
        shared` one batch is drawn of all transitions, of which each table takes what it learns from. The loss of a
        quantile q at level tau is |tau - 1(u < 0)| Huber(u) with u = h - q (paper eqs. huber_loss, quantile_loss), mean
        over the batch, summed over tables, which are independent.

        Args:
            action: (N, 12) bool, True where the joint moved.
            latent: (N, latent) float32, the h that followed.

        Raises:
            ValueError: an argument has another shape or type.
        """
        latent = checked("latent", latent, (len(self._tables), self._latents.shape[-1]), np.float32)
        place = self._steps % self._settings.memory
        self._actions[:, place] = self._acted(action)
        self._latents[:, place] = latent
        self._steps += 1
        held = min(self._steps, self._settings.memory)
        for seed, generator in enumerate(self._generators):
            actions, latents = self._actions[seed, :held], self._latents[seed, :held]
            if self._settings.batches == "own":
                drawn = _own(actions, generator.random((MARGINAL + 1, self._settings.batch)))
            else:
                drawn = _shared(actions, generator.integers(0, held, self._settings.batch))
            table, gradient = self._tables[seed], self._gradient[seed]
            _differentiate(table, drawn, latents, self._levels, self._kappa, gradient)
            adamw(table.reshape(-1), gradient.reshape(-1), self._first[seed].reshape(-1),
                  self._second[seed].reshape(-1), self._rate, self._steps)  # fmt: skip

    def influence(self, probability: Array | None = None) -> Array:
        """Causal influence of each action, paper eq. causality_continuous: W1 of p(h|a) and p(h), mean over the latent.

        W1 is the mean distance of quantiles at the same level. With `marginal: policy`, p(h) is a joint's two p(h|a)
        mixed by its policy, and W1 between p(h|a) and that is the probability of the other action times W1 of the two.

        Args:
            probability: (N, 12) float32, P(MOVE); read with `marginal: policy` alone.

        Returns:
            (N, 12, 2): joint, then NO_TORQUE and MOVE, in units of h.

        Raises:
            ValueError: `probability` is read, and is missing or has another shape or type.
        """
        if self._settings.marginal == "policy":
            if probability is None:
                raise ValueError("With outcomes.marginal `policy`, influence needs P(MOVE); there is none.")
            probability = checked("probability", probability, (len(self._tables), JOINTS), np.float32)
            if self._settings.action == "limb":
                probability = ONE - np.stack([(ONE - probability)[:, own].prod(axis=1) for own in LIMBS], axis=1)
            apart = np.stack([_apart(tables) for tables in self._tables])
            return np.stack([probability * apart, (ONE - probability) * apart], axis=-1)
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
        rows = self._acted(action) + ACTIONS * np.arange(JOINTS)
        return np.stack([_means(tables, own) for tables, own in zip(self._tables, rows, strict=True)])

    def _acted(self, action: Array) -> Array:
        """(N, 12) bool, what the tables take for each joint's action."""
        action = checked("action", action, (len(self._tables), JOINTS), bool)
        if self._settings.action == "joint":
            return action
        return np.stack([action[:, own].any(axis=1) for own in LIMBS], axis=1)


@kernel
def wasserstein(first: Array, second: Array) -> Any:
    """W1 between two tables (quantiles, latent): the mean distance of quantiles at the same level, over the latent."""
    quantiles, latent = first.shape
    sums = np.zeros(latent, np.float32)
    for k in range(quantiles):
        a, b = first[k], second[k]
        for d in range(latent):
            sums[d] += abs(a[d] - b[d])
    found = sums[0]
    for d in range(1, latent):
        found += sums[d]
    return found / np.float32(quantiles * latent)


@kernel
def _own(actions: Array, chance: Array) -> Array:
    """(tables, batch) indices of transitions: of each table's own, as `chance` (tables, batch) in [0, 1) has it.

    Args:
        actions: (transitions, 12) bool.
        chance: float64.
    """
    drawn = np.full(chance.shape, NONE)
    own = np.empty(len(actions), np.int64)
    for row in range(len(drawn)):
        joint, move = divmod(row, ACTIONS)
        count = 0
        for n in range(len(actions)):
            if row == MARGINAL or actions[n, joint] == (move == MOVE):
                own[count] = n
                count += 1
        if count:
            for place in range(chance.shape[1]):
                drawn[row, place] = own[int(chance[row, place] * count)]
    return drawn


@kernel
def _shared(actions: Array, batch: Array) -> Array:
    """(tables, batch) indices of transitions: those of one `batch` (batch,) that a table learns from, else NONE."""
    drawn = np.full((MARGINAL + 1, len(batch)), NONE)
    for place in range(len(batch)):
        n = batch[place]
        drawn[MARGINAL, place] = n
        for joint in range(actions.shape[1]):
            drawn[ACTIONS * joint + actions[n, joint], place] = n
    return drawn


@kernel
def _differentiate(tables: Array, drawn: Array, latents: Array, levels: Array, kappa: Any, gradient: Array) -> None:
    """Write the gradient of paper eq. quantile_loss: by q it is -|tau - 1(u < 0)| clip(u, -kappa, kappa).

    Args:
        tables: (tables, quantiles, latent).
        drawn: (tables, batch), which transitions each table learns from, or NONE.
        latents: (transitions, latent), the h of each.
        levels: (quantiles,), taus.
        kappa: in units of h.
        gradient: like tables.
    """
    gradient[:] = 0
    batch, none = np.float32(drawn.shape[1]), np.float32(0)
    for row in range(len(drawn)):
        for place in range(drawn.shape[1]):
            if drawn[row, place] == NONE:
                continue
            h = latents[drawn[row, place]]
            for k in range(len(levels)):
                above, below = levels[k] / batch, (ONE - levels[k]) / batch
                q, into = tables[row, k], gradient[row, k]
                for d in range(len(h)):
                    u = h[d] - q[d]
                    into[d] -= above * min(max(u, none), kappa) + below * max(min(u, none), -kappa)


@kernel
def _apart(tables: Array) -> Array:
    """(joints,): W1 of each joint's two tables of p(h|a)."""
    found = np.empty(MARGINAL // ACTIONS, np.float32)
    for joint in range(len(found)):
        found[joint] = wasserstein(tables[ACTIONS * joint + MOVE], tables[ACTIONS * joint + NO_TORQUE])
    return found


@kernel
def _distances(tables: Array) -> Array:
    """(tables - 1,): W1 of each table and the last."""
    found = np.empty(len(tables) - 1, np.float32)
    for row in range(len(found)):
        found[row] = wasserstein(tables[row], tables[-1])
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
