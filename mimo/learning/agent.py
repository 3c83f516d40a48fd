"""The agent: Expected SARSA over 12 joints with a Boltzmann policy (paper §3.1, §3.6, appendix "Agent Architecture").

Several seeds learn in lock step, each computed by itself: its numbers are the same bytes in any company.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from mimo.learning import network
from mimo.learning.network import Network
from mimo.record.kernels import ONE, Array, adamw, checked, exp, kernel
from mimo.settings import params
from mimo.world.protocol import ACTIONS, JOINTS, MOVE, NO_TORQUE


@kernel
def move_probability(rest: Any, move: Any, move_bias: Any, temperature: Any) -> Any:
    """P(MOVE) of the Boltzmann policy, paper eq. softmax, with the bias of §3.6 added to Q(MOVE).

    Args:
        rest: Q of NO_TORQUE; all are float32.
        move: Q of MOVE.
        move_bias: in units of reward.
        temperature: in units of reward.
    """
    return ONE / (ONE + exp((rest - move - move_bias) / temperature))


@kernel
def sarsa_target(reward: Any, rest: Any, move: Any, probability: Any, gamma: Any) -> Any:
    """Expected SARSA's target, paper eq. td-error: R + gamma sum_u p(u|s') Q(s', u), in units of reward.

    Args:
        reward: R; all are float32.
        rest: Q of NO_TORQUE in the next state.
        move: Q of MOVE in the next state; with the bias, if `agent.bias_in_target`.
        probability: P(MOVE) in the next state.
        gamma: discount.
    """
    return reward + gamma * ((ONE - probability) * rest + probability * move)


class Agents:
    """N agents in lock step. They share no number: each has its own weights, optimiser state and generator."""

    def __init__(self, settings: params.Agent, inputs: int, generators: Sequence[np.random.Generator]) -> None:
        """Draw the weights in the default distribution of `torch.nn.Linear`: U(-1, 1) / sqrt(inputs of the layer).

        Args:
            settings: the section `agent` of params.yaml.
            inputs: length of the state, proprioception and latent together.
            generators: one a seed; they are used here only.
        """
        width = settings.hidden
        chosen = (settings.gamma, settings.move_bias, settings.temperature, settings.learning_rate)
        self._gamma, self._move_bias, self._temperature, self._rate = map(np.float32, chosen)
        self._in_target = np.float32(settings.move_bias if settings.bias_in_target else 0)
        self._numbers, self._gradients, self._first, self._second = np.zeros(
            (4, len(generators), network.size(inputs, width)), np.float32
        )
        self.networks = [network.over(numbers, inputs, width) for numbers in self._numbers]
        self.gradients = [network.over(numbers, inputs, width) for numbers in self._gradients]
        self._traces = [network.trace(inputs, width) for _ in generators]
        self._spare = network.trace(inputs, width)
        self._values = np.zeros((len(generators), JOINTS * ACTIONS), np.float32)
        self._inputs, self._asked, self._updates = inputs, False, 0
        for net, generator in zip(self.networks, generators, strict=True):
            _initialise(net, generator)

    def values(self, state: Array) -> Array:
        """Q values, paper eq. q_function; the update that follows learns from them.

        Args:
            state: (N, inputs) float32.

        Returns:
            (N, 12, 2): joint, then NO_TORQUE and MOVE, in units of reward.

        Raises:
            ValueError: the state has another shape or type.
        """
        state = checked("state", state, (len(self.networks), self._inputs), np.float32)
        for q, net, own, trace in zip(self._values, self.networks, state, self._traces, strict=True):
            q[:] = network.forward(net, own, trace)
        self._asked = True
        return self._values.reshape(-1, JOINTS, ACTIONS).copy()

    def move_probability(self, values: Array) -> Array:
        """P(MOVE) (N, 12) under the policy, from Q values (N, 12, 2)."""
        values = checked("values", values, (len(values), JOINTS, ACTIONS), np.float32)
        return _move_probabilities(values, self._move_bias, self._temperature)

    def update(self, action: Array, reward: Array, next_state: Array) -> Array:
        """One step of AdamW on half the squared TD error of one transition, summed over joints (paper eq. td-error).

        Args:
            action: (N, 12) bool, True where the joint moved in the state of which `values` was asked last.
            reward: (N, 12) float32.
            next_state: (N, inputs) float32.

        Returns:
            (N, 12), the TD errors before the step, in units of reward.

        Raises:
            RuntimeError: `values` was not asked since the last update.
            ValueError: an argument has another shape or type.
        """
        if not self._asked:
            raise RuntimeError("Ask for the values of the state that the action was taken in before each update.")
        joints = (len(self.networks), JOINTS)
        action, reward = checked("action", action, joints, bool), checked("reward", reward, joints, np.float32)
        next_state = checked("next_state", next_state, (len(self.networks), self._inputs), np.float32)
        self._asked = False
        self._updates += 1
        errors = np.empty(action.shape, np.float32)
        for seed, (net, gradient) in enumerate(zip(self.networks, self.gradients, strict=True)):
            following = network.forward(net, next_state[seed], self._spare)
            constants = self._gamma, self._move_bias, self._temperature, self._in_target
            errors[seed], upstream = _errors(self._values[seed], following, action[seed], reward[seed], *constants)
            network.backward(net, self._traces[seed], upstream, gradient)
            numbers, moments = self._numbers[seed], (self._first[seed], self._second[seed])
            adamw(numbers, self._gradients[seed], *moments, self._rate, self._updates)
        return errors


@kernel
def _move_probabilities(values: Array, move_bias: Any, temperature: Any) -> Array:
    found = np.empty(values.shape[:2], np.float32)
    for seed in range(len(values)):
        for joint in range(values.shape[1]):
            rest, move = values[seed, joint, NO_TORQUE], values[seed, joint, MOVE]
            found[seed, joint] = move_probability(rest, move, move_bias, temperature)
    return found


@kernel
def _errors(
    values: Array,
    following: Array,
    action: Array,
    reward: Array,
    gamma: Any,
    move_bias: Any,
    temperature: Any,
    in_target: Any,
) -> tuple[Array, Array]:
    """TD errors (12,), and half their squares' derivatives by the Q values (24,), of which the actions chose 12."""
    error, upstream = np.empty(len(action), np.float32), np.zeros(len(values), np.float32)
    for joint in range(len(action)):
        rest, move = following[ACTIONS * joint + NO_TORQUE], following[ACTIONS * joint + MOVE]
        probability = move_probability(rest, move, move_bias, temperature)
        chosen = ACTIONS * joint + action[joint]
        error[joint] = sarsa_target(reward[joint], rest, move + in_target, probability, gamma) - values[chosen]
        upstream[chosen] = -error[joint]
    return error, upstream


def _initialise(net: Network, generator: np.random.Generator) -> None:
    for norm in (net.inlet_norm, *(residual.norm for residual in net.residuals), net.outlet_norm):
        norm.weight[:] = 1
    for linear in (net.inlet, *(residual.linear for residual in net.residuals), net.outlet):
        bound = linear.weight.shape[1] ** -0.5
        for part in linear:
            part[:] = generator.uniform(-bound, bound, part.shape)
