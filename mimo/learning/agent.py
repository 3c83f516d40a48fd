"""The agent: Expected SARSA over 12 joints with a Boltzmann policy (paper §3.1, §3.6, appendix "Agent Architecture").

Several seeds learn in lock step, as one stack. A seed's numbers are the same bytes whatever the size of the stack, its
place in it and its companions. Products of matrices are therefore written as a product and a sum over one dimension:
a BLAS may choose another kernel, and so another rounding, for another stack. Derivatives are written out, since
autograd costs more than the arithmetic of so small a network.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from mimo.settings import params

JOINTS = 12  # paper appendix: actuated joints
ACTIONS = 2  # paper §2.3: NO_TORQUE, MOVE
NO_TORQUE, MOVE = range(ACTIONS)
RESIDUALS = 2  # paper appendix
ALIGNMENT = 64  # floats; each seed's parameters fill whole vector registers, so that all are rounded alike

Saved = tuple[Any, ...]  # what a layer's backward needs of its forward


def policy(values: Tensor, move_bias: float, temperature: float) -> Tensor:
    """Boltzmann policy, paper eq. softmax, with the bias of §3.6 added to Q(MOVE).

    Args:
        values: (..., 2), Q of NO_TORQUE and of MOVE.
        move_bias: added to Q(MOVE), in units of reward.
        temperature: in units of reward.

    Returns:
        (..., 2), probabilities that sum to 1.
    """
    bias = values.new_tensor([0.0, move_bias])
    return torch.softmax((values + bias) / temperature, dim=-1)


def sarsa_target(reward: Tensor, next_values: Tensor, next_probabilities: Tensor, gamma: float) -> Tensor:
    """Expected SARSA's target, paper eq. td-error: R + gamma sum_u p(u|s') Q(s', u).

    Args:
        reward: (...).
        next_values: (..., 2), Q of the next state, without the bias of MOVE.
        next_probabilities: (..., 2), the policy in the next state.
        gamma: discount.

    Returns:
        (...), in units of reward.
    """
    return reward + gamma * (next_probabilities * next_values).sum(-1)


def td_error(target: Tensor, values: Tensor, action: Tensor) -> Tensor:
    """Temporal-difference error, paper eq. td-error: target (...) less the entry of values (..., 2) that action chose.

    Args:
        target: (...).
        values: (..., 2), Q of NO_TORQUE and of MOVE.
        action: (...) bool, True for MOVE.
    """
    return target - torch.where(action, values[..., MOVE], values[..., NO_TORQUE])


class Linear(NamedTuple):
    """A linear layer for each seed: weight (N, out, in), bias (N, out)."""

    weight: Tensor
    bias: Tensor

    def forward(self, x: Tensor) -> tuple[Tensor, Saved]:
        """(N, in) to (N, out)."""
        return (self.weight * x.unsqueeze(-2)).sum(-1) + self.bias, (x,)

    def backward(self, saved: Saved, upstream: Tensor, gradient: "Linear") -> Tensor:
        """Write `gradient` and return the derivative by x, from that by the output."""
        (x,) = saved
        torch.mul(upstream.unsqueeze(-1), x.unsqueeze(-2), out=gradient.weight)
        gradient.bias.copy_(upstream)
        return (self.weight * upstream.unsqueeze(-1)).sum(-2)


class LayerNorm(NamedTuple):
    """A layer normalisation for each seed: weight (N, width), bias (N, width)."""

    weight: Tensor
    bias: Tensor

    def forward(self, x: Tensor) -> tuple[Tensor, Saved]:
        """(N, width) to (N, width)."""
        normal, mean, scale = torch.native_layer_norm(x, x.shape[-1:], None, None, 1e-5)
        return normal * self.weight + self.bias, (x, normal, mean, scale)

    def backward(self, saved: Saved, upstream: Tensor, gradient: "LayerNorm") -> Tensor:
        """Write `gradient` and return the derivative by x, from that by the output."""
        x, normal, mean, scale = saved
        torch.mul(upstream, normal, out=gradient.weight)
        gradient.bias.copy_(upstream)
        inner: Tensor = torch.ops.aten.native_layer_norm_backward(
            upstream * self.weight, x, x.shape[-1:], mean, scale, None, None, (True, False, False)
        )[0]
        return inner


class Residual(NamedTuple):
    """Linear layer, layer normalisation, GELU and a skip connection."""

    linear: Linear
    norm: LayerNorm

    def forward(self, x: Tensor) -> tuple[Tensor, Saved]:
        """(N, width) to (N, width)."""
        y, of_linear = self.linear.forward(x)
        y, of_norm = self.norm.forward(y)
        share = 0.5 + 0.5 * torch.erf(y * 2**-0.5)
        return x + y * share, (of_linear, of_norm, y, share)

    def backward(self, saved: Saved, upstream: Tensor, gradient: "Residual") -> Tensor:
        """Write `gradient` and return the derivative by x, from that by the output."""
        of_linear, of_norm, y, share = saved
        slope = share + y * torch.exp(-0.5 * y.square()) * (2 * np.pi) ** -0.5
        inner = self.norm.backward(of_norm, upstream * slope, gradient.norm)
        return upstream + self.linear.backward(of_linear, inner, gradient.linear)


class Network(NamedTuple):
    """Q network of the paper's appendix, "Agent Architecture", one for each seed."""

    inlet: Linear
    inlet_norm: LayerNorm
    residuals: tuple[Residual, ...]
    outlet_norm: LayerNorm
    outlet: Linear

    @classmethod
    def over(cls, flat: Tensor, inputs: int, hidden: int) -> "Network":
        """The network whose parameters are views of `flat` (N, at least `Network.size`), in the order of its fields."""
        start = 0

        def linear(outputs: int, inputs: int) -> Linear:
            return Linear(take(outputs, inputs), take(outputs))

        def norm() -> LayerNorm:
            return LayerNorm(take(hidden), take(hidden))

        def take(*shape: int) -> Tensor:
            nonlocal start
            start, first = start + int(np.prod(shape)), start
            return flat[:, first:start].view(len(flat), *shape)

        inlet, inlet_norm = linear(hidden, inputs), norm()
        residuals = tuple(Residual(linear(hidden, hidden), norm()) for _ in range(RESIDUALS))
        return cls(inlet, inlet_norm, residuals, norm(), linear(JOINTS * ACTIONS, hidden))

    @staticmethod
    def size(inputs: int, hidden: int) -> int:
        """Parameters of one seed's network."""
        norms, outputs = 2 * hidden, JOINTS * ACTIONS
        inner = hidden * (hidden + 1) + norms
        return hidden * (inputs + 1) + norms + RESIDUALS * inner + norms + outputs * (hidden + 1)

    def forward(self, state: Tensor) -> tuple[Tensor, Saved]:
        """State (N, inputs) to Q values (N, JOINTS, ACTIONS)."""
        x: Tensor = state
        saved: list[Saved] = []
        for layer in self._layers():
            x, of_layer = layer.forward(x)
            saved.append(of_layer)
        return x.view(-1, JOINTS, ACTIONS), tuple(saved)

    def backward(self, saved: Saved, upstream: Tensor, gradient: "Network") -> None:
        """Write `gradient`, from the derivative by the Q values (N, JOINTS, ACTIONS)."""
        x = upstream.flatten(-2)
        steps = zip(self._layers(), saved, gradient._layers(), strict=True)
        for layer, of_layer, into in reversed(list(steps)):
            x = layer.backward(of_layer, x, into)

    def _layers(self) -> tuple[Any, ...]:
        return (self.inlet, self.inlet_norm, *self.residuals, self.outlet_norm, self.outlet)


class Agents:
    """N agents in lock step. They share no number: each has its own weights, optimiser state and generator."""

    def __init__(self, settings: params.Agent, inputs: int, generators: Sequence[np.random.Generator]) -> None:
        """Draw the weights in the default distribution of `torch.nn.Linear`: U(-1, 1) / sqrt(inputs of the layer).

        Args:
            settings: the section `agent` of params.yaml.
            inputs: length of the state, proprioception and latent together.
            generators: one a seed; they are used here only.
        """
        self._settings = settings
        aligned = -(-Network.size(inputs, settings.hidden) // ALIGNMENT) * ALIGNMENT
        parameters = torch.zeros(len(generators), aligned)
        parameters.grad = torch.zeros_like(parameters)
        self.network = Network.over(parameters, inputs, settings.hidden)
        self._gradient = Network.over(parameters.grad, inputs, settings.hidden)
        _initialise(self.network, generators)
        # AdamW with torch's defaults, as the paper gives its learning rate alone.
        self._optimizer = torch.optim.AdamW([parameters], lr=settings.learning_rate, fused=True)

    @torch.no_grad()
    def values(self, state: Tensor) -> Tensor:
        """Q values, paper eq. q_function.

        Args:
            state: (N, inputs).

        Returns:
            (N, 12, 2): joint, then NO_TORQUE and MOVE, in units of reward.
        """
        return self.network.forward(state)[0]

    def move_probability(self, values: Tensor) -> Tensor:
        """P(MOVE) (N, 12) under the policy, from Q values (N, 12, 2)."""
        return policy(values, self._settings.move_bias, self._settings.temperature)[..., MOVE]

    @torch.no_grad()
    def update(self, state: Tensor, action: Tensor, reward: Tensor, next_state: Tensor) -> Tensor:
        """One step of AdamW on half the squared TD error of one transition, summed over joints (paper eq. td-error).

        Args:
            state: (N, inputs).
            action: (N, 12) bool, True where the joint moved.
            reward: (N, 12).
            next_state: (N, inputs).

        Returns:
            (N, 12), the TD errors before the step, in units of reward.
        """
        following = self.values(next_state)
        probabilities = policy(following, self._settings.move_bias, self._settings.temperature)
        target = sarsa_target(reward, following, probabilities, self._settings.gamma)
        values, saved = self.network.forward(state)
        error = td_error(target, values, action)
        upstream = torch.stack([~action, action], dim=-1) * -error.unsqueeze(-1)
        self.network.backward(saved, upstream, self._gradient)
        self._optimizer.step()
        return error


def _initialise(network: Network, generators: Sequence[np.random.Generator]) -> None:
    linears = [network.inlet, *(residual.linear for residual in network.residuals), network.outlet]
    norms = [network.inlet_norm, *(residual.norm for residual in network.residuals), network.outlet_norm]
    for norm in norms:
        norm.weight.fill_(1.0)
    for seed, generator in enumerate(generators):
        for linear in linears:
            bound = linear.weight.shape[-1] ** -0.5
            for part in linear:
                part[seed] = torch.from_numpy(generator.uniform(-bound, bound, part[seed].shape))
