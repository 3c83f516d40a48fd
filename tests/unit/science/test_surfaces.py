"""Response surfaces against functions whose means, shares and noise are known."""

import numpy as np
import pytest
from scipy.stats import qmc

from mimo.science import surfaces
from mimo.science.surfaces import Surface

CHOICE = {2: (0.25, 0.75)}


def points(number: int, constants: int = 4, seed: int = 0) -> np.ndarray:
    whole = qmc.Sobol(constants, rng=np.random.default_rng(seed)).random_base2((number - 1).bit_length())
    found = whole[:number]
    found[:, 2] = np.where(found[:, 2] < 0.5, 0.25, 0.75)
    return found


def truth(at: np.ndarray) -> np.ndarray:
    """Over the cube: mean 1; of the variance 1/3 is constant 0's, 1/4 the choice's, 1/144 both 1's and the choice's."""
    sign = np.where(at[:, 2] < 0.5, -1.0, 1.0)
    return np.asarray(1 + 2 * (at[:, 0] - 0.5) + 0.5 * sign + 2 * (at[:, 1] - 0.5) * sign)


VARIANCES = {0: 4 / 12, 2: 0.25, (1, 2): 4 / 12}
TOTAL = sum(VARIANCES.values())


def fitted(noise: float, seed: int = 0, number: int = 64) -> Surface:
    at = points(number)
    rng = np.random.default_rng(seed)
    found = surfaces.surface(at, truth(at)[:, None] + noise * rng.normal(size=(number, 2)), CHOICE)
    assert found is not None
    return found


@pytest.fixture(scope="module")
def clear() -> Surface:
    return fitted(0.02)


def test_without_noise_it_foretells_what_it_has_not_seen(clear: Surface) -> None:
    other = points(64, seed=1)
    assert clear.at(other)[0] == pytest.approx(truth(other), abs=0.1)
    assert (clear.q2 or 0) > 0.98
    assert (clear.ceiling or 0) > 0.99
    assert clear.noise == pytest.approx(0.02, rel=0.3)


def test_what_it_does_not_know_is_as_large_as_its_faults() -> None:
    """Away from its points: nearly all faults lie within three SD, and not all within a third of one."""
    noisy, other = fitted(0.5), points(512, seed=1)
    found, unknown = noisy.at(other)
    faults = np.abs(found - truth(other)) / unknown
    assert (faults < 3).mean() > 0.95
    assert (faults < 1 / 3).mean() < 0.7
    assert noisy.at(points(64))[1].mean() < unknown.mean()


def test_means_variance_main_effects_and_pairs_are_the_functions(clear: Surface) -> None:
    assert clear.mean == pytest.approx(1, abs=0.02)
    assert clear.variance == pytest.approx(TOTAL, rel=0.05)
    own = [VARIANCES.get(constant, 0) / TOTAL for constant in range(4)]
    assert clear.shares == pytest.approx(own, abs=0.02)
    assert clear.pairs.keys() == {(a, b) for b in range(4) for a in range(b)}
    for pair, share in clear.pairs.items():
        assert share == pytest.approx(VARIANCES.get(pair, 0) / TOTAL, abs=0.02)
    assert clear.main(0, np.array([0.0, 0.5, 1.0])) == pytest.approx([0, 1, 2], abs=0.1)
    assert clear.main(2, np.array([0.25, 0.75])) == pytest.approx([0.5, 1.5], abs=0.05)
    assert clear.main(3, np.array([0.0, 1.0])) == pytest.approx([1, 1], abs=0.05)


def test_what_is_integrated_is_what_a_dense_sample_of_the_same_surface_says() -> None:
    noisy = fitted(0.5)
    values = noisy.at(points(4096, seed=2))[0]
    assert noisy.mean == pytest.approx(values.mean(), abs=0.005)
    assert noisy.variance == pytest.approx(values.var(), rel=0.02)
    assert noisy.shares.sum() + sum(noisy.pairs.values()) <= 1 + 1e-9


def test_noise_lowers_what_can_be_foretold_and_the_ceiling_says_so() -> None:
    """Means of two seeds with noise of SD 1: half a unit of variance beside TOTAL."""
    found = [fitted(1.0, seed) for seed in range(4)]
    ceilings, q2 = [own.ceiling or 0 for own in found], [own.q2 or 0 for own in found]
    assert np.mean(ceilings) == pytest.approx(TOTAL / (TOTAL + 0.5), abs=0.1)
    assert all(one < most + 0.1 for one, most in zip(q2, ceilings, strict=True))
    assert np.mean([own.noise for own in found]) == pytest.approx(1.0, rel=0.15)


def test_what_a_seed_has_at_all_points_is_no_noise_between_them() -> None:
    at = points(64)
    effects = truth(at)[:, None] + np.array([[-1.0, 1.0]])
    found = surfaces.surface(at, effects, CHOICE)
    assert found is not None
    assert found.ceiling == pytest.approx(1)
    assert found.noise == pytest.approx(2**0.5)


def test_where_nothing_hangs_on_the_constants_nothing_is_foretold() -> None:
    at = points(48)
    rng = np.random.default_rng(3)
    found = [surfaces.surface(at, rng.normal(size=(48, 2)), CHOICE) for _ in range(3)]
    assert all(own is not None and own.q2 is not None and own.q2 < 0.3 for own in found)


def test_effects_that_do_not_differ_are_a_flat_surface() -> None:
    at = points(16)
    found = surfaces.surface(at, np.full((16, 2), 3.0), CHOICE)
    assert found is not None
    assert found.at(at)[0] == pytest.approx(np.full(16, 3.0))
    assert found.variance == pytest.approx(0, abs=1e-9)
    assert (found.q2, found.ceiling) == (None, None)


def test_of_one_seed_noise_is_what_no_constant_explains() -> None:
    at, rng = points(64), np.random.default_rng(5)
    found = surfaces.surface(at, (truth(at) + 0.3 * rng.normal(size=64))[:, None], CHOICE)
    assert found is not None
    assert found.noise == pytest.approx(0.3, rel=0.3)
    assert found.ceiling is None


def test_one_constant_is_a_space() -> None:
    at = np.linspace(0, 1, 16)[:, None]
    found = surfaces.surface(at, np.hstack([at, at]), {})
    assert found is not None
    assert found.shares == pytest.approx([1])
    assert found.pairs == {}
    assert found.mean == pytest.approx(0.5, abs=0.01)


def test_points_without_numbers_are_left_out_and_too_few_give_no_surface() -> None:
    at = points(surfaces.FEWEST)
    effects = np.stack([truth(at)] * 2, axis=1)
    assert surfaces.surface(at, effects, CHOICE) is not None
    effects[0, 1] = np.nan
    assert surfaces.surface(at, effects, CHOICE) is None
