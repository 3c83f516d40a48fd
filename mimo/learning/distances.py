"""Distances of tables of quantiles beside W1, as kernels: for rewards that are CAIS with another distance.

Each takes the quantiles of a dimension as a sample, and is the mean over the latent.
"""

from typing import Any

import numpy as np

from mimo.record.kernels import Array, kernel

# exp(x) = 2^n exp(r), |r| <= log(2) / 2, in float64, as the differences of means in `mmd` leave float32 no digits. By
# adding ROUNDING a number loses its fraction, and its low bits are the integer n.
LEAST, PER_LOG_2, LOG_2_HIGH, LOG_2_LOW = -700.0, 1.4426950408889634, 0.693145751953125, 1.42860682030941723212e-6
ROUNDING, BIAS, MANTISSA = 1.5 * 2.0**52, np.int64(1023), np.int64(52)
E2, E3, E4, E5, E6, E7, E8, E9, E10, E11 = (1 / float(np.prod(np.arange(1.0, k + 1))) for k in range(2, 12))  # 1 / k!


@kernel
def energy(moves: Array, marginal: Array) -> Array:
    """Root of the energy distance, 2 E|x - y| - E|x - x'| - E|y - y'|, which is twice the integral of (F - G)².

    Args:
        moves: (moved, quantiles, latent) float32, in units of h; quantiles may be in any order.
        marginal: (quantiles, latent), likewise.

    Returns:
        (moved,), in roots of h's unit.
    """
    count, quantiles, latent = moves.shape
    found = np.empty(count, np.float32)
    second = _sorted(marginal)
    whole = np.float32(2) / np.float32(quantiles * quantiles)
    for n in range(count):
        first = _sorted(moves[n])
        total = np.float32(0)
        for d in range(latent):
            x, y = first[d], second[d]
            area, at, i, j = np.float32(0), min(x[0], y[0]), 0, 0
            while i < quantiles and j < quantiles:  # beyond the last of either, see below
                following = min(x[i], y[j])
                area += np.float32((i - j) * (i - j)) * (following - at)
                at = following
                if x[i] <= y[j]:
                    i += 1
                else:
                    j += 1
            for k in range(i, quantiles):
                area += np.float32((quantiles - k) * (quantiles - k)) * (x[k] - at)
                at = x[k]
            for k in range(j, quantiles):
                area += np.float32((quantiles - k) * (quantiles - k)) * (y[k] - at)
                at = y[k]
            total += np.sqrt(whole * area)
        found[n] = total / np.float32(latent)
    return found


@kernel
def _sorted(table: Array) -> Array:
    """(latent, quantiles), a table's quantiles from least to greatest; they are nearly so, hence by insertion."""
    quantiles, latent = table.shape
    found = np.empty((latent, quantiles), np.float32)
    for d in range(latent):
        row = found[d]
        for k in range(quantiles):
            value, place = table[k, d], k
            while place > 0 and row[place - 1] > value:
                row[place] = row[place - 1]
                place -= 1
            row[place] = value
    return found


@kernel
def mmd(moves: Array, marginal: Array, narrow: float) -> Array:
    """Root of E k(x, x') + E k(y, y') - 2 E k(x, y), where k(x, y) = exp(-narrow (x - y)²), a V-statistic.

    Args:
        moves: (moved, quantiles, latent) float64, in units of h.
        marginal: (quantiles, latent), likewise.
        narrow: one over twice the squared bandwidth.

    Returns:
        (moved,), pure numbers.
    """
    count, _, latent = moves.shape
    found = np.empty(count)
    own = _alike(marginal, marginal, narrow, True)
    for n in range(count):
        between, within = _alike(moves[n], marginal, narrow, False), _alike(moves[n], moves[n], narrow, True)
        total = 0.0
        for d in range(latent):
            total += np.sqrt(max(within[d] + own[d] - 2 * between[d], 0.0))
        found[n] = total / latent
    return found


@kernel
def _alike(first: Array, second: Array, narrow: float, same: bool) -> Array:
    """(latent,): E k(x, y) of each dimension; `same` if the two are one."""
    quantiles, latent = first.shape
    sums = np.zeros(latent)
    for k in range(quantiles):
        a = first[k]
        for j in range(k if same else quantiles):
            b = second[j]
            for d in range(latent):
                sums[d] += _exp(-narrow * (a[d] - b[d]) * (a[d] - b[d]))
    for d in range(latent):
        sums[d] = (2 * sums[d] + quantiles if same else sums[d]) / (quantiles * quantiles)
    return sums


@kernel
def _exp(x: Any) -> Any:
    """e^x of a float64 that is not above 0, to 1e-14 of its size; x below LEAST counts as LEAST."""
    x = max(x, LEAST)
    shifted = x * PER_LOG_2 + ROUNDING
    n = shifted - ROUNDING
    r = x - n * LOG_2_HIGH - n * LOG_2_LOW
    p = (((((((((E11 * r + E10) * r + E9) * r + E8) * r + E7) * r + E6) * r + E5) * r + E4) * r + E3) * r + E2) * r
    power = np.int64((np.float64(shifted).view(np.int64) + BIAS) << MANTISSA).view(np.float64)  # 2^n, by its bits
    return (p * r + r + 1.0) * power
