"""The agent's Q network (paper eq. q_function, appendix "Agent Architecture") as a kernel: of one seed and state.

Linear, layer normalisation, two residual layers (linear, normalisation, GELU, skip), normalisation, linear; and the
derivatives of each, written out. The weights are views of one row of numbers, laid out as torch's modules have them.
"""

from typing import Any, NamedTuple

import numpy as np

from mimo.record.kernels import HALF, LANES, ONE, Array, dot, exp, kernel, normal
from mimo.world.protocol import ACTIONS, JOINTS

RESIDUALS = 2  # paper appendix
NORMS = RESIDUALS + 2
EPSILON = np.float32(1e-5)  # torch's, of the variance in a layer normalisation
DENSITY = np.float32((2 * np.pi) ** -0.5)  # of the normal distribution at 0


class Linear(NamedTuple):
    """Weight (outputs, inputs), bias (outputs,)."""

    weight: Array
    bias: Array


class LayerNorm(NamedTuple):
    """Weight (width,), bias (width,)."""

    weight: Array
    bias: Array


class Residual(NamedTuple):
    """x + GELU(norm(linear(x)))."""

    linear: Linear
    norm: LayerNorm


class Network(NamedTuple):
    """The layers, in the order of the computation."""

    inlet: Linear
    inlet_norm: LayerNorm
    residuals: tuple[Residual, ...]
    outlet_norm: LayerNorm
    outlet: Linear


class Trace(NamedTuple):
    """What `backward` needs of `forward`.

    Attributes:
        state: (inputs,).
        z: (NORMS, width), what each normalisation made before its weight and bias.
        inverse: (NORMS,), one over the SD that each divided by.
        x: (RESIDUALS + 1, width), what went into each residual layer, and what came out of the last.
        y: (RESIDUALS, width), what went into each GELU.
        share: (RESIDUALS, width), the share of it that came out.
        last: (width,), what went into the outlet.
    """

    state: Array
    z: Array
    inverse: Array
    x: Array
    y: Array
    share: Array
    last: Array


def size(inputs: int, width: int) -> int:
    """How many numbers a network has."""
    linears = width * inputs + RESIDUALS * width**2 + (RESIDUALS + 1) * width
    return linears + 2 * NORMS * width + JOINTS * ACTIONS * (width + 1)


def over(numbers: Array, inputs: int, width: int) -> Network:
    """The network whose weights are views of `numbers` (size,)."""
    shapes = _shapes(inputs, width)
    ends = np.cumsum([np.prod(shape) for shape in shapes])
    views = [part.reshape(shape) for part, shape in zip(np.split(numbers, ends[:-1]), shapes, strict=True)]
    pairs = list(zip(views[::2], views[1::2], strict=True))
    residuals = tuple(Residual(Linear(*pairs[k]), LayerNorm(*pairs[k + 1])) for k in range(2, 2 + 2 * RESIDUALS, 2))
    return Network(Linear(*pairs[0]), LayerNorm(*pairs[1]), residuals, LayerNorm(*pairs[-2]), Linear(*pairs[-1]))


def _shapes(inputs: int, width: int) -> list[tuple[int, ...]]:
    norm = [(width,), (width,)]
    inner = [(width, width), (width,), *norm] * RESIDUALS
    return [(width, inputs), (width,), *norm, *inner, *norm, (JOINTS * ACTIONS, width), (JOINTS * ACTIONS,)]


def trace(inputs: int, width: int) -> Trace:
    """Room for one."""
    shapes = ((inputs,), (NORMS, width), (NORMS,), (RESIDUALS + 1, width), *[(RESIDUALS, width)] * 2, (width,))
    return Trace(*(np.zeros(shape, np.float32) for shape in shapes))


@kernel
def forward(net: Network, state: Array, into: Trace) -> Array:
    """Q values (JOINTS * ACTIONS,) of a state (inputs,)."""
    into.state[:] = state
    a = np.empty_like(into.last)
    _linear(net.inlet, state, a)
    into.inverse[0] = _norm(net.inlet_norm, a, into.z[0], into.x[0])
    for k in range(RESIDUALS):
        x, y, share, following = into.x[k], into.y[k], into.share[k], into.x[k + 1]
        _linear(net.residuals[k].linear, x, a)
        into.inverse[k + 1] = _norm(net.residuals[k].norm, a, into.z[k + 1], y)
        for i in range(len(x)):
            share[i] = normal(y[i])
            following[i] = x[i] + y[i] * share[i]
    into.inverse[-1] = _norm(net.outlet_norm, into.x[-1], into.z[-1], into.last)
    q = np.empty_like(net.outlet.bias)
    _linear(net.outlet, into.last, q)
    return q


@kernel
def backward(net: Network, made: Trace, upstream: Array, gradient: Network) -> None:
    """Write `gradient`, from the derivative `upstream` (JOINTS * ACTIONS,) by the Q values that `made` led to."""
    a, b, x = np.empty_like(made.last), np.empty_like(made.last), np.empty_like(made.last)
    _linear_gradient(made.last, upstream, gradient.outlet)
    _linear_backward(net.outlet, upstream, a)
    _norm_backward(net.outlet_norm, made.z[-1], made.inverse[-1], a, gradient.outlet_norm, x)
    for k in range(RESIDUALS - 1, -1, -1):
        y, share, own, into = made.y[k], made.share[k], net.residuals[k], gradient.residuals[k]
        for i in range(len(x)):
            a[i] = x[i] * (share[i] + y[i] * exp(-HALF * y[i] * y[i]) * DENSITY)
        _norm_backward(own.norm, made.z[k + 1], made.inverse[k + 1], a, into.norm, b)
        _linear_gradient(made.x[k], b, into.linear)
        _linear_backward(own.linear, b, a)
        for i in range(len(x)):
            x[i] += a[i]
    _norm_backward(net.inlet_norm, made.z[0], made.inverse[0], x, gradient.inlet_norm, a)
    _linear_gradient(made.state, a, gradient.inlet)


@kernel
def _linear(layer: Linear, x: Array, y: Array) -> None:
    """Y = weight x + bias."""
    lanes = np.empty(LANES, np.float32)
    for o in range(len(y)):
        y[o] = dot(layer.weight[o], x, lanes) + layer.bias[o]


@kernel
def _linear_gradient(x: Array, upstream: Array, gradient: Linear) -> None:
    """Derivatives by weight and bias, from that by y."""
    for o in range(len(upstream)):
        u, into = upstream[o], gradient.weight[o]
        gradient.bias[o] = u
        for i in range(len(x)):
            into[i] = u * x[i]


@kernel
def _linear_backward(layer: Linear, upstream: Array, downstream: Array) -> None:
    """The derivative by x, from that by y."""
    downstream[:] = 0
    for o in range(len(upstream)):
        u, weight = upstream[o], layer.weight[o]
        for i in range(len(downstream)):
            downstream[i] += u * weight[i]


@kernel
def _norm(layer: LayerNorm, x: Array, z: Array, y: Array) -> Any:
    """Y = weight z + bias, z = (x - mean) / SD; returns 1 / SD."""
    width = np.float32(len(x))
    mean, variance = np.float32(0), np.float32(0)
    for i in range(len(x)):
        mean += x[i]
    mean /= width
    for i in range(len(x)):
        variance += (x[i] - mean) * (x[i] - mean)
    inverse = ONE / np.sqrt(variance / width + EPSILON)
    for i in range(len(x)):
        z[i] = (x[i] - mean) * inverse
        y[i] = z[i] * layer.weight[i] + layer.bias[i]
    return inverse


@kernel
def _norm_backward(
    layer: LayerNorm, z: Array, inverse: Any, upstream: Array, gradient: LayerNorm, downstream: Array
) -> None:
    """Derivatives by weight, bias and x, from that by y."""
    width = np.float32(len(z))
    plain, along = np.float32(0), np.float32(0)
    for i in range(len(z)):
        gradient.weight[i], gradient.bias[i] = upstream[i] * z[i], upstream[i]
        downstream[i] = upstream[i] * layer.weight[i]
        plain += downstream[i]
        along += downstream[i] * z[i]
    for i in range(len(z)):
        downstream[i] = inverse * (downstream[i] - plain / width - z[i] * along / width)
