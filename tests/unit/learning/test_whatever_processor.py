"""Agent, outcome models and rewards are the same bytes for whatever processor their kernels are compiled."""

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from mimo.learning import rewards
from mimo.record import identity
from mimo.settings import params
from tests.unit.learning import test_agent, test_outcomes, test_rewards

SCRIPT = """
import mimo
from tests.unit.learning.test_whatever_processor import hashed
print(hashed())
"""


def hashed() -> str:
    """Of all that these give over 20 updates of two seeds, outcome models by other readings too."""
    made = hashlib.sha256()
    outcomes = (test_outcomes.history([0, 1], 20, **changes) for changes in ({}, test_outcomes.OTHER))
    for history in (test_agent.history([0, 1], 20), *outcomes):
        for seen in history.values():
            made.update(seen)
    settings, draws = params.load().rewards, [np.random.default_rng(seed) for seed in (0, 1)]
    terms = rewards.parts("_".join(rewards.REWARDS), settings, lambda _: draws)
    for fields in test_rewards.steps(2, 20):
        for paid in rewards.paid(terms, rewards.Transition(**fields)):
            made.update(paid.tobytes())
    return made.hexdigest()


@pytest.mark.parametrize("processor", ["generic", "haswell"])
def test_the_bytes_are_the_same_for_whatever_processor_they_are_compiled(processor: str, tmp_path: Path) -> None:
    """`generic` has neither AVX nor FMA."""
    own = os.environ | {"NUMBA_CPU_NAME": processor, "NUMBA_CPU_FEATURES": "", "NUMBA_CACHE_DIR": str(tmp_path)}
    done = subprocess.run([sys.executable, "-c", SCRIPT], cwd=identity.ROOT, env=own, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == hashed()
