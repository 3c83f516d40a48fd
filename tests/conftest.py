"""What every test runs under: off-screen rendering, no telemetry, the same examples each time."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import mimo  # noqa: F401  # chooses how MuJoCo draws, before anything imports it

# Set before anything imports ray or dvc, and inherited by the processes that tests start.
os.environ.setdefault("DVC_NO_ANALYTICS", "1")
os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
os.environ.pop("MIMO_STORE", None)
os.environ.pop("MIMO_WORKERS", None)

import tempfile
from contextlib import ExitStack
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

if TYPE_CHECKING:
    import numpy as np

    from mimo.settings.params import Params
    from mimo.vision.extractor import Trained

from tests import forks

settings.register_profile(
    "same", derandomize=True, deadline=None, database=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("same")


def pytest_configure(config: pytest.Config) -> None:
    """One server of forks for all of pytest's workers; it loads the libraries when it is first asked."""
    if not hasattr(config, "workerinput"):
        stack = ExitStack()
        folder = stack.enter_context(tempfile.TemporaryDirectory())
        stack.enter_context(forks.served(Path(folder)))
        config.add_cleanup(stack.close)


LONGEST = (  # these begin first, so that none is left alone at the end
    "test_sections.py", "test_other_processors.py", "test_interruptions.py", "test_sharing.py",
    "test_published.py", "test_cluster.py", "test_guide.py", "test_same_bytes.py", "test_repro.py",
    "test_experiment.py", "test_figures_stage.py", "test_bad_input.py", "test_dependencies.py", "test_effects.py",
    "test_training.py", "test_complaints.py",
)  # fmt: skip


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Files in the order of LONGEST, then the others."""
    rank = {name: number for number, name in enumerate(LONGEST)}
    items.sort(key=lambda item: rank.get(item.path.name, len(rank)))


# Late imports below: torch would cost every test that does without it two seconds.


@pytest.fixture(scope="session")
def tiny() -> Params:
    """The project's parameters, with ten agent steps a run and as little as will do before it."""
    from mimo.settings import params

    p = params.load()
    changes: dict[str, dict[str, object]] = {
        "protocol": {"baseline_steps": 3, "attached_steps": 4, "extinction_steps": 3},
        "collect": {"worlds": 2, "steps": 5},
        "encoder": {"widths": [2, 4, 4, 4], "pairs": 4, "iterations": 3},
        "outcomes": {"memory": 4},
        "calibrate": {"steps": 6, "worlds": 2},
        "sweep": {"conditions": ["free"], "rewards": ["mtl", "cais"], "seeds": 2, "chunk": 2},
    }
    return p.model_copy(update={name: getattr(p, name).model_copy(update=own) for name, own in changes.items()})


@pytest.fixture(scope="session")
def collected(tiny: Params) -> tuple[np.ndarray, np.ndarray]:
    """Frames and the mobile's centres, as mimo.vision.collect gives them."""
    from mimo.vision import collect

    return collect.collect(tiny)


@pytest.fixture(scope="session")
def pairs(collected: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """(4, 10, 2, 128, 128, 3) uint8 frame pairs of all regimes."""
    frames = collected[0]
    return frames.reshape(len(frames), -1, *frames.shape[3:])


@pytest.fixture(scope="session")
def trained(tiny: Params, pairs: np.ndarray) -> Trained:
    """A barely trained encoder: enough, since a run's laws hold for any."""
    from mimo.record import streams
    from mimo.vision import encoder

    return encoder.train(tiny.encoder, pairs, streams.generator(tiny.seed, "free", 0, "encoder"))


@pytest.fixture(scope="session")
def encoder_file(trained: Trained, tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """`trained` as an artifact."""
    from mimo.vision import extractor

    path = tmp_path_factory.mktemp("encoder") / "encoder.h5"
    extractor.save(trained, path, "d" * 64, {})
    return path.read_bytes()


@pytest.fixture(scope="session")
def scales() -> dict[str, float]:
    """By reward name; all differ, of the size that calibration finds."""
    return {"mtl": 0.006, "rtl": 1.25, "cais": 0.0012, "surprise": 0.38}
