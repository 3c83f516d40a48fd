"""How much of what differs between runs is whose: effects of every encoder with every seed, in two-way components.

The model is the random-effects one without replication: an effect is a mean, plus the encoder's part, plus the seed's,
plus the rest, which is their interaction and all else. Components of variance are those of the analysis of variance,
none below 0. A share's interval is by generalised pivotal quantities (Weerahandi 1993, J. Am. Stat. Assoc. 88:899):
sums of squares over draws of chi squared. The mean's interval over both is by the pigeonhole bootstrap (Owen 2007, Ann.
Appl. Stat. 1:386), which draws encoders and seeds anew, each with all its runs; it errs on the wide side.
"""

from dataclasses import dataclass

import numpy as np

from mimo.science import judgement
from mimo.science.judgement import Array

DRAWS = 99_999


@dataclass(frozen=True)
class Components:
    """SD between encoders, between seeds and of the rest; the share of all variance that is the encoder's.

    `interval` is of that share, None where no effect differs from another.
    """

    encoders: float
    seeds: float
    rest: float
    share: float
    interval: tuple[float, float] | None


def components(effects: Array) -> Components | None:
    """Of effects, (encoder, seed); None with fewer than two of either, or where an effect is no number."""
    if min(effects.shape) < 2 or not np.isfinite(effects).all():
        return None
    if np.ptp(effects) == 0:  # sums of squares would be rounding's
        return Components(0.0, 0.0, 0.0, 0.0, None)
    squares, free = _squares(effects)
    variances = _variances(squares / free, effects.shape)
    draws = np.random.default_rng(0).chisquare(free, (DRAWS, 3))
    drawn = _variances(squares / draws, effects.shape)
    tail = (1 - judgement.LEVEL) / 2
    low, high = np.quantile(drawn[:, 0] / drawn.sum(axis=1), (tail, 1 - tail))
    sd = np.sqrt(variances)
    share = float(variances[0] / variances.sum())
    return Components(float(sd[0]), float(sd[1]), float(sd[2]), share, (float(low), float(high)))


def centre(effects: Array) -> float:
    """The seeds' interquartile mean, each seed's effect a mean over encoders; of (encoder, seed)."""
    return float(judgement.interquartile_mean(effects.mean(axis=0)))


def interval(effects: Array) -> tuple[float, float] | None:
    """Of `centre`, over encoders and seeds both, (encoder, seed); None where `components` is."""
    if min(effects.shape) < 2 or not np.isfinite(effects).all():
        return None
    encoders, seeds = effects.shape
    rng = np.random.default_rng(0)
    # How often each encoder is drawn, as a share: the mean over those drawn is then a product.
    shares = rng.multinomial(encoders, np.full(encoders, 1 / encoders), DRAWS) / encoders
    drawn = np.take_along_axis(shares @ effects, rng.integers(seeds, size=(DRAWS, seeds)), axis=1)
    return judgement.interval(judgement.interquartile_mean(drawn), min(effects.shape))


def _squares(effects: Array) -> tuple[Array, Array]:
    """(3,) sums of squares of encoders, seeds and the rest, and their degrees of freedom."""
    encoders, seeds = effects.shape
    mean, row, column = effects.mean(), effects.mean(axis=1), effects.mean(axis=0)
    rest = effects - row[:, None] - column + mean
    squares = [seeds * ((row - mean) ** 2).sum(), encoders * ((column - mean) ** 2).sum(), (rest**2).sum()]
    return np.array(squares), np.array([encoders - 1, seeds - 1, (encoders - 1) * (seeds - 1)])


def _variances(squares: Array, shape: tuple[int, ...]) -> Array:
    """(..., 3) components of mean squares (..., 3), none below 0."""
    encoders, seeds = shape
    rest = squares[..., 2]
    between = (squares[..., 0] - rest) / seeds, (squares[..., 1] - rest) / encoders
    return np.stack([*(np.maximum(own, 0) for own in between), rest], axis=-1)
