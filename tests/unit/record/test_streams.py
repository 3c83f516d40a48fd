"""Random streams: one for each key, none shared, the same whatever else was drawn."""

import inspect
import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mimo.record import streams

ROOT = 20260
KEYS = st.tuples(st.integers(0, 2**32), st.sampled_from(streams.CONDITIONS), st.integers(0, 10**6),
                 st.sampled_from(streams.PURPOSES))  # fmt: skip


def first(root: int, condition: str, seed: int, purpose: str) -> bytes:
    return streams.generator(root, condition, seed, purpose).bytes(16)


@given(KEYS)
def test_a_stream_is_the_same_on_repetition(key: tuple[int, str, int, str]) -> None:
    assert first(*key) == first(*key)


@given(KEYS, KEYS)
def test_two_keys_are_two_streams(one: tuple[int, str, int, str], other: tuple[int, str, int, str]) -> None:
    assert (first(*one) == first(*other)) == (one == other)


NAMES = ("", "mtl", "rtl", "rt", "lm", "surprise")


def test_a_name_tells_streams_of_one_purpose_apart() -> None:
    """And from those of every other purpose; no name is the stream that there was before names."""
    drawn = {
        streams.generator(ROOT, "free", seed, purpose, name).bytes(16)
        for seed in range(3)
        for purpose in streams.PURPOSES
        for name in NAMES
    }
    assert len(drawn) == 3 * len(streams.PURPOSES) * len(NAMES)
    assert streams.generator(ROOT, "free", 1, "reward", "").bytes(16) == first(ROOT, "free", 1, "reward")
    again = [streams.generator(ROOT, "free", 1, "reward", "rtl").bytes(16) for _ in range(2)]
    assert again[0] == again[1]


def test_no_two_streams_of_a_sweep_begin_alike() -> None:
    keys = list(itertools.product((ROOT, ROOT + 1), streams.CONDITIONS, range(20), streams.PURPOSES))
    assert len({first(*key) for key in keys}) == len(keys)


def test_streams_are_uncorrelated() -> None:
    """No two of the streams correlate, lagged or not, beyond what chance gives 4000 draws."""
    keys = itertools.product(streams.CONDITIONS, range(4), streams.PURPOSES)
    draws = np.stack([streams.generator(ROOT, *key).standard_normal(4001) for key in keys])
    for lag in (0, 1):
        found = np.corrcoef(draws[:, :4000], draws[:, lag : 4000 + lag])[: len(draws), len(draws) :]
        off = found[~np.eye(len(draws), dtype=bool)]
        assert np.abs(off).max() < 6 / np.sqrt(4000)
        assert off.std() == pytest.approx(1 / np.sqrt(4000), rel=0.1)


def test_drawing_from_one_stream_leaves_the_others_alone() -> None:
    noise, policy = (streams.generator(ROOT, "noisy", 0, purpose) for purpose in ("noise", "policy"))
    noise.standard_normal(1000)
    assert policy.bytes(16) == first(ROOT, "noisy", 0, "policy")


def test_the_reward_is_no_part_of_the_key() -> None:
    """`name` tells streams apart that share a purpose: here, what each reward draws for itself."""
    assert list(inspect.signature(streams.generator).parameters) == ["root", "condition", "seed", "purpose", "name"]


def test_streams_stay_what_they_were() -> None:
    """A purpose or condition put in another place would change every number of the project."""
    drawn = streams.generator(ROOT, "noisy", 3, "policy").integers(0, 10**6, 3).tolist()
    sequence = np.random.SeedSequence(ROOT, spawn_key=(1, 3, 2))
    assert drawn == np.random.Generator(np.random.PCG64(sequence)).integers(0, 10**6, 3).tolist()
    assert streams.PURPOSES == (
        "noise", "direction", "policy", "weights", "memory",
        "collect", "collect_noise", "encoder", "calibrate", "calibrate_memory", "calibrate_noise",
        "rope", "reward", "calibrate_reward",
    )  # fmt: skip
    assert streams.CONDITIONS == ("free", "noisy")


@pytest.mark.parametrize(("condition", "purpose"), [("free", "lunch"), ("windy", "noise"), ("free", "")])
def test_unknown_names_raise(condition: str, purpose: str) -> None:
    with pytest.raises(ValueError, match="not in"):
        streams.generator(ROOT, condition, 0, purpose)
