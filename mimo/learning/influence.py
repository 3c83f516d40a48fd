"""Models of the next h that know the state, for CAI: linear in it, one for each joint and action, as kernels.

Several seeds learn in lock step, each computed by itself: its numbers are the same bytes in any company.
"""

from collections.abc import Sequence

import numpy as np

from mimo.record.kernels import ONE, Array, adamw, checked, kernel
from mimo.world.protocol import ACTIONS, JOINTS, MOVE

TAKEN = np.arange(JOINTS)


class Models:
    """Gaussians of N seeds, which share no number: E[h'|s, a] = W s, and a variance for each joint and dimension."""

    def __init__(
        self, inputs: int, latent: int, memory: int, batch: int, rate: float, generators: Sequence[np.random.Generator]
    ) -> None:
        """Start at W = 0, which is the mean of h over the encoder's frames.

        Args:
            inputs: length of the state s.
            latent: length of h.
            memory: transitions that batches are drawn from, and steps that the variance is a running mean over.
            batch: transitions that a model learns from in a step.
            rate: of AdamW.
            generators: one a seed; each draws its seed's batches.
        """
        seeds = len(generators)
        self._generators, self._memory, self._batch, self._rate = generators, memory, batch, np.float32(rate)
        self._weights, self._gradient, self._first, self._second = np.zeros(
            (4, seeds, JOINTS * ACTIONS, inputs, latent), np.float32
        )
        self._actions = np.zeros((seeds, memory, JOINTS), bool)
        self._states, self._latents = (np.zeros((seeds, memory, size), np.float32) for size in (inputs, latent))
        self.variance = np.zeros((seeds, JOINTS, latent), np.float32)
        self._steps = 0

    def means(self, state: Array) -> Array:
        """E[h'|s, a], (N, 12, 2, latent), of states (N, inputs) float32.

        Raises:
            ValueError: the state has another shape or type.
        """
        state = checked("state", state, (len(self._weights), self._states.shape[-1]), np.float32)
        found = [_means(weights, own) for weights, own in zip(self._weights, state, strict=True)]
        return np.stack(found).reshape(len(state), JOINTS, ACTIONS, -1)

    def update(self, state: Array, action: Array, latent: Array) -> None:
        """Remember a transition; take its errors into the variances, then a step of AdamW on batches of the last.

        Each model's batch is drawn from the transitions in which its joint took its action, uniformly and with
        replacement, as the outcome models' are (`outcomes.batches: own`). Its loss is half the squared error, summed
        over the latent, mean over the batch. A variance is the running mean of squared errors of a joint's two models,
        each that of the action taken, before they learn.

        Args:
            state: (N, inputs) float32.
            action: (N, 12) bool, True where the joint moved.
            latent: (N, latent) float32, the h that followed.

        Raises:
            ValueError: an argument has another shape or type.
        """
        latent = checked("latent", latent, (len(self._weights), self._latents.shape[-1]), np.float32)
        action = checked("action", action, (len(latent), JOINTS), bool)
        means, place = self.means(state), self._steps % self._memory
        self._steps += 1
        held = min(self._steps, self._memory)
        for seed, generator in enumerate(self._generators):
            errors = latent[seed] - means[seed, TAKEN, action[seed].astype(int)]
            self.variance[seed] += (errors * errors - self.variance[seed]) / np.float32(held)
            for kept, new in ((self._states, state), (self._actions, action), (self._latents, latent)):
                kept[seed, place] = new[seed]
            states, actions, latents = (own[seed, :held] for own in (self._states, self._actions, self._latents))
            weights, gradient = self._weights[seed], self._gradient[seed]
            chance = generator.random((JOINTS * ACTIONS, self._batch))
            _differentiate(weights, states, actions, latents, chance, gradient)
            adamw(weights.reshape(-1), gradient.reshape(-1), self._first[seed].reshape(-1),
                  self._second[seed].reshape(-1), self._rate, self._steps)  # fmt: skip


@kernel
def _means(weights: Array, state: Array) -> Array:
    """(models, latent): what each of `weights` (models, inputs, latent) makes of a state (inputs,)."""
    found = np.zeros((weights.shape[0], weights.shape[2]), np.float32)
    for row in range(len(weights)):
        _predict(weights[row], state, found[row])
    return found


@kernel
def _predict(weights: Array, state: Array, mean: Array) -> None:
    """Add to `mean` (latent,) what `weights` (inputs, latent) make of a state."""
    for i in range(len(state)):
        s, own = state[i], weights[i]
        for d in range(len(mean)):
            mean[d] += s * own[d]


@kernel
def _differentiate(
    weights: Array, states: Array, actions: Array, latents: Array, chance: Array, gradient: Array
) -> None:
    """Write the gradient of half the squared error, mean over a batch of each model's own transitions.

    Args:
        weights: (models, inputs, latent).
        states: (transitions, inputs).
        actions: (transitions, 12) bool.
        latents: (transitions, latent).
        chance: (models, batch) float64 in [0, 1), which of its own transitions each model learns from.
        gradient: like weights; 0 where a model has none.
    """
    batch, share = chance.shape[1], ONE / np.float32(chance.shape[1])
    own = np.empty(len(actions), np.int64)
    error = np.empty(latents.shape[1], np.float32)
    gradient[:] = 0
    for row in range(len(weights)):
        joint, move = divmod(row, ACTIONS)
        count = 0
        for n in range(len(actions)):
            if actions[n, joint] == (move == MOVE):
                own[count] = n
                count += 1
        if count == 0:
            continue
        for place in range(batch):
            n = own[int(chance[row, place] * count)]
            state, h = states[n], latents[n]
            error[:] = 0
            _predict(weights[row], state, error)
            for d in range(len(error)):
                error[d] = (error[d] - h[d]) * share
            for i in range(len(state)):
                s, into = state[i], gradient[row, i]
                for d in range(len(error)):
                    into[d] += s * error[d]
