"""Compiled kernels are kept by what they are compiled from, wherever that lies; and anew when it changes."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from mimo.record import identity

SCRIPT = """
import numpy as np
from mimo.learning.agent import move_probability
print(repr(move_probability(*map(np.float32, (0.1, 0.7, -0.2, 0.3)))))
"""


def run(package: Path, **variables: str) -> tuple[str, str]:
    """P(MOVE) by the package in that folder, and what it told."""
    own = os.environ | {"PYTHONPATH": str(package), "PYTHONDONTWRITEBYTECODE": "1"} | variables
    done = subprocess.run([sys.executable, "-c", SCRIPT], cwd=package, env=own, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout, done.stderr


def copied(folder: Path) -> Path:
    shutil.copytree(identity.ROOT / "mimo", folder / "mimo", ignore=shutil.ignore_patterns("__pycache__"))
    return folder


def edit(folder: Path, file: str, old: str, new: str) -> None:
    path = folder / "mimo" / file
    assert path.read_text().count(old) == 1
    path.write_text(path.read_text().replace(old, new))


def test_a_kernel_is_compiled_once_and_anew_when_the_code_changes_that_it_is_compiled_from(tmp_path: Path) -> None:
    """Also code in another file than its own, which numba itself does not look at."""
    cache = str(tmp_path / "cache")
    one, two, three = (copied(tmp_path / name) for name in ("one", "two", "three"))
    first, told = run(one, NUMBA_CACHE_DIR=cache)
    assert told == f"Compiling kernels for this processor; they are kept in {cache}.\n"
    assert run(one, NUMBA_CACHE_DIR=cache) == (first, "")
    edit(two, "record/kernels.py", "@kernel\ndef exp", "# A comment.\n@kernel\ndef exp")
    assert run(two, NUMBA_CACHE_DIR=cache) == (first, "")
    edit(three, "record/kernels.py", "5.0000001201e-1", "4.0000001201e-1")
    other, told = run(three, NUMBA_CACHE_DIR=cache)
    assert told.startswith("Compiling")
    assert other != first
    assert run(one, NUMBA_CACHE_DIR=cache) == (first, "")


@pytest.mark.parametrize("folder", ["/proc/nowhere", "/dev/full/nowhere"])
def test_a_folder_that_takes_no_file_costs_the_compiling_each_time(folder: str, tmp_path: Path) -> None:
    for _ in range(2):
        _, told = run(identity.ROOT, NUMBA_CACHE_DIR=folder)
        assert told == "Compiling kernels for this processor; as each time, since they cannot be kept.\n"


def test_kernels_are_compiled_whatever_the_user_has_set() -> None:
    expected, _ = run(identity.ROOT)
    assert run(identity.ROOT, NUMBA_DISABLE_JIT="1") == (expected, "")


def test_numba_that_came_before_without_compiling_is_refused() -> None:
    own = os.environ | {"NUMBA_DISABLE_JIT": "1"}
    script = f"import numba\n{SCRIPT}"
    done = subprocess.run([sys.executable, "-c", script], cwd=identity.ROOT, env=own, capture_output=True, text=True)
    assert done.returncode == 1
    assert done.stderr.strip().endswith("KernelError: numba came before mimo, with NUMBA_DISABLE_JIT set; unset it.")
