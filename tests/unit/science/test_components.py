"""Components of variance against worked numbers and simulated worlds whose truth is known."""

import numpy as np
import pytest

from mimo.science import components


def simulated(
    rng: np.random.Generator, encoders: float, seeds: float, rest: float, shape: tuple[int, int]
) -> np.ndarray:
    """Effects of mean 1 with SDs as given, (encoder, seed)."""
    rows, columns = shape
    own = encoders * rng.normal(size=(rows, 1)) + seeds * rng.normal(size=(1, columns))
    return np.asarray(1 + own + rest * rng.normal(size=shape))


def test_by_hand() -> None:
    """Means of rows 1, 3, of columns 1, 3, of all 2: three sums of squares of 4, each of one degree of freedom."""
    found = components.components(np.array([[1.0, 1.0], [1.0, 5.0]]))
    assert found is not None
    assert (found.encoders, found.seeds, found.rest, found.share) == (0, 0, 2, 0)


def test_without_a_rest_it_is_exact() -> None:
    """Rows differ by an SD of 2, columns by one of 1: shares are 4 to 1."""
    found = components.components(np.array([[-2.0], [0.0], [2.0]]) + np.array([-1.0, 0.0, 1.0]))
    assert found is not None
    assert (found.encoders, found.seeds) == pytest.approx((2, 1))
    assert found.rest == pytest.approx(0, abs=1e-12)
    assert found.share == pytest.approx(0.8)


def test_in_large_worlds_the_truth_is_found() -> None:
    effects = simulated(np.random.default_rng(1), 0.3, 0.2, 0.1, (400, 400))
    found = components.components(effects)
    assert found is not None
    assert (found.encoders, found.seeds, found.rest) == pytest.approx((0.3, 0.2, 0.1), rel=0.1)
    assert found.interval is not None
    assert found.interval[0] < found.share < found.interval[1]
    assert found.share == pytest.approx(0.09 / 0.14, rel=0.1)


def test_intervals_cover_the_truth_about_as_often_as_they_say(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 200 worlds with 5 encoders and 5 seeds; two SEs of a share of .95 are .03."""
    monkeypatch.setattr(components, "DRAWS", 999)
    rng, truth, worlds = np.random.default_rng(2), 0.04 / 0.09, 200
    shares, means = [], []
    for _ in range(worlds):
        effects = simulated(rng, 0.2, 0.2, 0.1, (5, 5))
        found, bounds = components.components(effects), components.interval(effects)
        assert found is not None
        assert found.interval is not None
        assert bounds is not None
        shares.append(found.interval[0] <= truth <= found.interval[1])
        means.append(bounds[0] <= 1 <= bounds[1])
    assert np.mean(shares) > 0.9
    assert 0.88 < np.mean(means) <= 1


def test_an_interval_over_encoders_too_is_wider_where_they_differ() -> None:
    rng = np.random.default_rng(3)
    alike, apart = (simulated(rng, sd, 0.1, 0.02, (5, 5)) for sd in (0.0, 0.5))
    wide, narrow = components.interval(apart), components.interval(alike)
    assert wide is not None
    assert narrow is not None
    assert wide[1] - wide[0] > 2 * (narrow[1] - narrow[0])
    assert narrow[0] <= components.centre(alike) <= narrow[1]


def test_the_same_effects_give_the_same() -> None:
    effects = simulated(np.random.default_rng(4), 0.1, 0.1, 0.1, (3, 4))
    assert components.components(effects) == components.components(effects)
    assert components.interval(effects) == components.interval(effects)


@pytest.mark.parametrize("effects", [np.ones((1, 5)), np.ones((5, 1)), np.array([[1.0, np.nan], [1.0, 2.0]])])
def test_too_few_or_no_numbers_give_none(effects: np.ndarray) -> None:
    assert components.components(effects) is None
    assert components.interval(effects) is None


@pytest.mark.parametrize("effect", [1.0, 0.1, 1 / 12])  # of the last two a mean over five differs in its last bit
def test_effects_that_do_not_differ_have_no_share_to_bound(effect: float) -> None:
    found = components.components(np.full((5, 5), effect))
    assert found == components.Components(0, 0, 0, 0, None)
