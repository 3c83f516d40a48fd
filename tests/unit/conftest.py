"""The small project of tests/unit/reported.py, made once for all tests of what is analysed, drawn and shown."""

from __future__ import annotations

import contextlib
import shutil
from pathlib import Path

import pytest

from tests import once


@pytest.fixture(scope="session")
def reported(tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest) -> Path:
    """The project, for reading."""

    def make(folder: Path) -> str:
        from tests.unit import reported  # late, as it loads torch

        tiny, (frames, _), trained = (request.getfixturevalue(name) for name in ("tiny", "collected", "trained"))
        with contextlib.chdir(folder):
            reported.make(tiny, frames, trained)
        return ""

    return once.made(tmp_path_factory, "reported", make)[0]


@pytest.fixture
def project(reported: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The project as working directory, for reading."""
    monkeypatch.chdir(reported)
    return reported


@pytest.fixture
def copied(reported: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of it as working directory, for writing."""
    folder = Path(shutil.copytree(reported, tmp_path / "project"))
    monkeypatch.chdir(folder)
    return folder
