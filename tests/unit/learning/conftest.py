"""Small runs, each computed once."""

from functools import cache

import pytest

from mimo.learning.experiment import Experiment, Record
from mimo.settings import params
from mimo.settings.params import Params
from mimo.vision.extractor import Trained
from tests.unit.learning.recorded import Records, Runs, arrays


@pytest.fixture(scope="session")
def records(tiny: Params, trained: Trained, scales: dict[str, float]) -> Records:
    """The records of (condition, reward, *seeds), computed once."""

    @cache
    def run(condition: str, reward: str, *seeds: int) -> list[Record]:
        return Experiment(tiny, condition, reward, seeds, trained, scales).run()

    return run


@pytest.fixture(scope="session")
def running(tiny: Params, trained: Trained) -> Records:
    """Likewise with running scales, so that no scale is given."""
    changed = params.changed(tiny, {"rewards.scale": "running"})

    @cache
    def run(condition: str, reward: str, *seeds: int) -> list[Record]:
        return Experiment(changed, condition, reward, seeds, trained, {}).run()

    return run


@pytest.fixture(scope="session")
def runs(records: Records) -> Runs:
    """Likewise, their arrays."""
    return lambda *key: [arrays(record) for record in records(*key)]
