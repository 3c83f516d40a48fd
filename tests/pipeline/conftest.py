"""One small project, published as the real one is, for the tests that start from there."""

import shutil
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml

from stages.commands import preview
from tests import once
from tests.pipeline.project import done, edit, study

ROOT = Path(__file__).parents[2]
GAIN = yaml.safe_load((ROOT / "params.yaml").read_text())["rewards"]["gain"]
CELLS = [f"{condition}-{reward}" for condition in ("free", "noisy") for reward in ("mtl", "cais")]
VARIANTS: dict[str, dict[str, Any]] = {  # the first changes nothing, the second no scale, the third scales too
    "same": {"set": {"rewards.gain": GAIN}, "cells": {"free": ["mtl"]}},
    "greedy": {"set": {"rewards.gain": 7 * GAIN}, "cells": {"free": ["cais"]}},
    "heavy": {"set": {"world.mobile_mass": 1.5}, "cells": {"noisy": ["mtl"]}},
}
STUDIES = {  # the second's encoder is its own
    "own": study(VARIANTS),
    "drawn": study({"draw1": {"set": {"collect.draw": 1}, "cells": {"free": ["mtl"]}}}),
}
DVC_CONFIG = (
    "[core]\n    analytics = false\n    check_update = false\n    remote = lab\n['remote \"lab\"']\n    url = {}\n"
)


@pytest.fixture(scope="session")
def published(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """A project made from nothing, its results committed, its data pushed to a folder; and what `make paper` said."""
    top, said = once.made(tmp_path_factory, "published", _publish)
    return top / "project", said


def _publish(top: Path) -> str:
    project = top / "project"
    preview.prepare(ROOT, project)
    edit(
        project,
        ("sweep.rewards", ["mtl", "cais"]),
        ("protocol.baseline_steps", 3),
        ("protocol.attached_steps", 5),
        ("protocol.extinction_steps", 3),
        ("encoder.widths", [2, 4, 4, 4]),
        ("encoder.pairs", 4),
        ("encoder.iterations", 4),
        ("calibrate.steps", 6),
        ("collect.steps", 6),
        ("effects.steps", 40),
        ("effects.alternatives", {}),
        ("studies", STUDIES),
    )
    (project / ".dvc/config").write_text(DVC_CONFIG.format(top / "remote"))
    (project / ".dvc/.gitignore").write_text("/config.local\n/tmp\n/cache\n")
    (project / ".gitignore").write_text((project / ".gitignore").read_text() + preview.MARK + "\n")
    done(project, "git", "init", "-q", ".")
    said = done(project, sys.executable, "-m", "stages.commands.paper")
    said += done(project, sys.executable, "-m", "stages.commands.studies")
    done(project, "git", "add", "-A")
    done(project, "git", "commit", "-qm", "Published")
    done(project, sys.executable, "-m", "stages.commands.share", "push")
    return said


@pytest.fixture
def project(published: tuple[Path, str], tmp_path: Path) -> Path:
    """A copy of its own for each test."""
    return Path(shutil.copytree(published[0], tmp_path / "project", symlinks=True))


@pytest.fixture
def clone(published: tuple[Path, str], tmp_path: Path) -> Path:
    """As another lab gets it: no data, no store, an empty cache."""
    done(tmp_path, "git", "clone", "-q", str(published[0]), "clone")
    return tmp_path / "clone"
