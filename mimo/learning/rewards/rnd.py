"""Random network distillation (Burda, Edwards, Storkey & Klimov 2019, ICLR): how new h is."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import Field

from mimo.learning.rewards.reward import Reward, Transition
from mimo.settings.section import Rate, Section

if TYPE_CHECKING:
    from mimo.learning.network import Network


class RND(Reward):
    """Mean squared error of a network that learns what a fixed random one makes of h, the same for all joints.

    Both have the agent's architecture (paper appendix) with h as their input; the predictor takes a step of AdamW on
    that error once it has been paid, on the newest h alone.
    """

    name = "rnd"
    unit = "1"

    class Constants(Section):
        """`hidden`: width of both networks; `learning_rate`: the predictor's."""

        hidden: Annotated[int, Field(gt=0, le=1024)]
        learning_rate: Rate

    def __init__(self, constants: Any, draws: Sequence[np.random.Generator] = ()) -> None:
        """See Reward; weights are drawn in the first step."""
        super().__init__(constants, draws)
        self._seeds: list[_Distillation] = []

    def __call__(self, t: Transition) -> np.ndarray:
        """See Reward."""
        assert len(self.draws) == len(t.action), "RND draws its weights: it needs a generator for each seed"
        if not self._seeds:
            latent, own = t.latent.shape[1], self.constants
            self._seeds = [_Distillation(latent, own.hidden, own.learning_rate, draw) for draw in self.draws]
        errors = [seed(h) for seed, h in zip(self._seeds, np.ascontiguousarray(t.latent), strict=True)]
        return np.broadcast_to(np.array(errors, np.float32)[:, None], t.action.shape)


class _Distillation:
    """Of one seed."""

    def __init__(self, inputs: int, width: int, rate: float, draw: np.random.Generator) -> None:
        """Draw the weights of the fixed network, then the predictor's, as torch does by default."""
        from mimo.learning import network

        self._rate, self._steps = np.float32(rate), 0
        target, self._numbers, self._gradients, self._first, self._second = np.zeros(
            (5, network.size(inputs, width)), np.float32
        )
        views = (network.over(row, inputs, width) for row in (target, self._numbers, self._gradients))
        self.target, self.predictor, self._gradient = views
        self._trace, self._spare = network.trace(inputs, width), network.trace(inputs, width)
        for net in (self.target, self.predictor):
            _initialise(net, draw)

    def __call__(self, h: np.ndarray) -> np.float32:
        """The error on h (latent,), before the predictor learns from it."""
        from mimo.learning import network
        from mimo.record.kernels import adamw

        apart = network.forward(self.predictor, h, self._trace) - network.forward(self.target, h, self._spare)
        network.backward(self.predictor, self._trace, apart * np.float32(2 / len(apart)), self._gradient)
        self._steps += 1
        adamw(self._numbers, self._gradients, self._first, self._second, self._rate, self._steps)
        error: np.float32 = np.square(apart).mean()
        return error


def _initialise(net: Network, draw: np.random.Generator) -> None:
    """U(-1, 1) / sqrt(inputs of the layer), the default of `torch.nn.Linear`, and layer normalisation as it starts."""
    for norm in (net.inlet_norm, *(residual.norm for residual in net.residuals), net.outlet_norm):
        norm.weight[:] = 1
    for linear in (net.inlet, *(residual.linear for residual in net.residuals), net.outlet):
        bound = linear.weight.shape[1] ** -0.5
        for part in linear:
            part[:] = draw.uniform(-bound, bound, part.shape)
