"""The page of one study of each kind, for the tests of what it says."""

from collections.abc import Iterator
from typing import Any

import pytest

from mimo.science import components, judgement
from mimo.settings.studies import Studies
from tests.unit.page import fabricated
from tests.unit.page.kinds import ASKED, computed, written


@pytest.fixture(scope="module")
def few_resamples() -> Iterator[None]:
    """Of the bootstrap: what the page says does not hang on an interval's third digit."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(judgement, "RESAMPLES", 1999)
        patch.setattr(components, "DRAWS", 1999)
        yield


@pytest.fixture(scope="module")
def asked() -> Studies:
    return fabricated.studies(**ASKED)


@pytest.fixture(scope="module")
def made(asked: Studies) -> dict[str, dict[str, Any]]:
    return computed(asked)


@pytest.fixture(scope="module")
def html(asked: Studies, made: dict[str, dict[str, Any]], few_resamples: None) -> str:
    return written(asked, made)
