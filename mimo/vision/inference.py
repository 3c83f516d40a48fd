"""The frozen encoder's kernel: pictures to raw h, as UNet.encode has it (paper appendix), the same bytes everywhere.

Four times a 3 x 3 convolution, instance normalisation, GELU and the mean over 2 x 2; then a linear layer.
"""

import math
from collections.abc import Mapping

import numpy as np

from mimo.record.kernels import Array, checked, kernel, normal, total

LAYERS = 4
EPSILON = 1e-5  # torch's, of the variance in an instance normalisation
QUARTER = np.float32(0.25)
WHITE = np.float32(255)

Layers = tuple[tuple[Array, ...], ...]


def layers(weights: Mapping[str, Array]) -> Layers:
    """What `raw` reads of a U-Net's weights: copies of the layers' filters, biases, gains, shifts; `squeeze`'s two.

    Raises:
        ValueError: weights that do not fit each other.
    """
    found: list[tuple[Array, ...]] = []
    inputs = 3
    for k in range(LAYERS):
        outputs = len(weights[f"down.{k}.0.weight"])
        shapes = {"0.weight": (outputs, inputs, 3, 3)} | dict.fromkeys(("0.bias", "1.weight", "1.bias"), (outputs,))
        found.append(tuple(_copied(weights, f"down.{k}.{name}", shape) for name, shape in shapes.items()))
        inputs = outputs
    latent, places = np.shape(weights["squeeze.weight"])
    side = math.isqrt(places // inputs)
    squeeze = _copied(weights, "squeeze.weight", (latent, inputs * side**2))
    return (*zip(*found, strict=True), (np.ascontiguousarray(squeeze.T), _copied(weights, "squeeze.bias", (latent,))))


def _copied(weights: Mapping[str, Array], name: str, shape: tuple[int, ...]) -> Array:
    return checked(name, weights[name], shape, np.float32).copy()


def raw(given: Layers, frames: Array) -> Array:
    """(N, side, side, 3) uint8 frames to raw h (N, latent) float32.

    Raises:
        ValueError: frames of another shape or type.
    """
    filters, biases, gains, shifts, (squeeze, offset) = given
    side = 2**LAYERS * math.isqrt(len(squeeze) // len(biases[-1]))
    frames = checked("frames", frames, (len(frames), side, side, 3), np.uint8)
    return np.stack([_encoded(frame, filters, biases, gains, shifts, squeeze, offset) for frame in frames])


@kernel
def _encoded(
    frame: Array,
    filters: tuple[Array, ...],
    biases: tuple[Array, ...],
    gains: tuple[Array, ...],
    shifts: tuple[Array, ...],
    squeeze: Array,
    offset: Array,
) -> Array:
    """A frame (side, side, 3) uint8 to raw h (latent,)."""
    side = frame.shape[0]
    x = np.zeros((3, side + 2, side + 2), np.float32)  # with a border of zeros
    for i in range(side):
        for j in range(side):
            for c in range(3):
                x[c, i + 1, j + 1] = np.float32(frame[i, j, c]) / WHITE
    for k in range(LAYERS):
        y = np.empty((len(biases[k]), side, side), np.float32)
        _convolve(x, filters[k], biases[k], y)
        _normalise(y, gains[k], shifts[k])
        side //= 2
        x = np.zeros((len(y), side + 2, side + 2), np.float32)
        _pool(y, x)
    h = offset.copy()
    place = 0
    for c in range(len(x)):
        for i in range(side):
            for j in range(side):
                value = x[c, i + 1, j + 1]
                for d in range(len(h)):
                    h[d] += value * squeeze[place, d]
                place += 1
    return h


@kernel
def _convolve(x: Array, weights: Array, bias: Array, y: Array) -> None:
    """3 x 3 convolution of x (inputs, S + 2, S + 2) to y (outputs, S, S), two outputs at a time."""
    spare = np.empty(y.shape[2], np.float32)
    for i in range(y.shape[1]):
        for o in range(0, len(y), 2):
            other = min(o + 1, len(y) - 1)
            row, next_row = y[o, i], y[other, i] if other > o else spare
            row[:], next_row[:] = bias[o], bias[other]
            for c in range(len(x)):
                for k in range(3):
                    above, v, w = x[c, i + k], weights[o, c, k], weights[other, c, k]
                    v0, v1, v2, w0, w1, w2 = v[0], v[1], v[2], w[0], w[1], w[2]
                    for j in range(len(row)):
                        left, here, right = above[j], above[j + 1], above[j + 2]
                        row[j] += v0 * left + v1 * here + v2 * right
                        next_row[j] += w0 * left + w1 * here + w2 * right


@kernel
def _normalise(x: Array, gain: Array, shift: Array) -> None:
    """Instance normalisation of x (C, S, S), and GELU, in place."""
    sums = np.empty(x.shape[2])  # in double precision; column by column, so that a vector adds many at once
    pixels = x.shape[1] * x.shape[2]
    for c in range(len(x)):
        sums[:] = 0
        for i in range(x.shape[1]):
            row = x[c, i]
            for j in range(len(row)):
                sums[j] += row[j]
        mean = np.float32(total(sums) / pixels)
        sums[:] = 0
        for i in range(x.shape[1]):
            row = x[c, i]
            for j in range(len(row)):
                sums[j] += (row[j] - mean) * (row[j] - mean)
        scale = np.float32(gain[c] / np.sqrt(total(sums) / pixels + EPSILON))
        for i in range(x.shape[1]):
            row = x[c, i]
            for j in range(len(row)):
                z = (row[j] - mean) * scale + shift[c]
                row[j] = z * normal(z)


@kernel
def _pool(x: Array, y: Array) -> None:
    """Mean over 2 x 2 of x (C, 2 S, 2 S), to the inside of y (C, S + 2, S + 2)."""
    for c in range(len(x)):
        for i in range(x.shape[1] // 2):
            upper, lower, row = x[c, 2 * i], x[c, 2 * i + 1], y[c, i + 1]
            for j in range(x.shape[2] // 2):
                row[j + 1] = QUARTER * (upper[2 * j] + upper[2 * j + 1] + lower[2 * j] + lower[2 * j + 1])
