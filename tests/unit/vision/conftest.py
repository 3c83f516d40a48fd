"""A few frames, and an encoder that has learned from them; torch on one thread, from one seed."""

from collections.abc import Iterator

import numpy as np
import pytest
import torch

from mimo.settings import params
from mimo.vision.encoder import train
from mimo.vision.extractor import Trained


@pytest.fixture(autouse=True)
def _as_it_was() -> Iterator[None]:
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    torch.manual_seed(0)
    yield
    torch.set_num_threads(threads)


@pytest.fixture(scope="session")
def few(pairs: np.ndarray) -> np.ndarray:
    """Six pairs, of all regimes."""
    return np.ascontiguousarray(pairs.reshape(-1, *pairs.shape[2:])[4::7])


@pytest.fixture(scope="session")
def grouped(few: np.ndarray) -> np.ndarray:
    """The same, as training takes them: two groups of three."""
    return few.reshape(2, 3, *few.shape[1:])


@pytest.fixture(scope="session")
def brief(tiny: params.Params) -> params.Encoder:
    """All of `few` in every batch, so that losses can be compared."""
    return tiny.encoder.model_copy(update={"pairs": 6, "iterations": 6, "learning_rate": 0.003})


@pytest.fixture(scope="session")
def learned(brief: params.Encoder, grouped: np.ndarray) -> Trained:
    return train(brief, grouped, np.random.default_rng(3))
