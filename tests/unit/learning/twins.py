"""The paper's agent and outcome models in PyTorch, to be read as it has them: what the kernels are held against."""

from collections.abc import Sequence

import torch
from torch import Tensor, nn


class Residual(nn.Module):
    """Paper appendix "Agent Architecture"."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.inner = nn.Sequential(nn.Linear(width, width), nn.LayerNorm(width), nn.GELU())

    def forward(self, x: Tensor) -> Tensor:
        return x + self.inner(x)


def q_network(inputs: int, width: int, joints: int = 12) -> nn.Sequential:
    """Paper eq. q_function: (N, inputs) to (N, joints, 2), in float64."""
    return nn.Sequential(
        nn.Linear(inputs, width), nn.LayerNorm(width), Residual(width), Residual(width), nn.LayerNorm(width),
        nn.Linear(width, 2 * joints), nn.Unflatten(-1, (joints, 2)),
    ).double()  # fmt: skip


def policy(values: Tensor, move_bias: float, temperature: float) -> Tensor:
    """Paper eq. softmax, with the bias of §3.6 added to Q(MOVE): (..., 2) to (..., 2)."""
    return torch.softmax((values + torch.tensor([0.0, move_bias])) / temperature, dim=-1)


def td_loss(
    net: nn.Module,
    state: Tensor,
    action: Tensor,
    reward: Tensor,
    following: Tensor,
    gamma: float,
    policy_: Sequence[float],
    bias_in_target: float = 0.0,
) -> Tensor:
    """Half the squared TD error of Expected SARSA, summed over joints (paper eq. td-error).

    With a `bias_in_target` the target's Q(MOVE) has it too: another reading of §3.6.
    """
    with torch.no_grad():
        then = net(following)
        expected = policy(then, *policy_) * (then + torch.tensor([0.0, bias_in_target]))
        target = reward + gamma * expected.sum(-1)
    taken = net(state).gather(-1, action.long().unsqueeze(-1)).squeeze(-1)
    return 0.5 * (target - taken).square().sum()


def huber(u: Tensor, kappa: float) -> Tensor:
    """Paper eq. huber_loss."""
    size = u.abs()
    return torch.where(size <= kappa, 0.5 * u.square(), kappa * (size - 0.5 * kappa))


def quantile_loss(y: Tensor, q: Tensor, tau: Tensor, kappa: float) -> Tensor:
    """Paper eq. quantile_loss, of each element."""
    u = y - q
    return (tau - (u < 0).to(u.dtype)).abs() * huber(u, kappa)
