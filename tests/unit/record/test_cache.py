"""Compiled kernels are kept by what they are compiled from, and whatever happens to their files costs time alone."""

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

from mimo.record import identity

SCRIPT = """
import numpy as np
from mimo.learning.agent import move_probability
print(repr(move_probability(*map(np.float32, (0.1, 0.7, -0.2, 0.3)))))
"""
PATCHED = """
from mimo.record import kernels
import numpy as np
kernels.E0 = np.float32(0.4)
"""
COMPILING = "Compiling kernels for this processor, to be kept in"


def run(package: Path, before: str = "", **variables: str) -> tuple[str, str]:
    """P(MOVE) by the package in that folder, and what it told."""
    own = os.environ | {"PYTHONPATH": str(package), "PYTHONDONTWRITEBYTECODE": "1"} | variables
    script = f"import mimo\n{before}\n{SCRIPT}"
    done = subprocess.run([sys.executable, "-c", script], cwd=package, env=own, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout, done.stderr


@pytest.fixture
def cache(tmp_path: Path) -> Path:
    return tmp_path / "cache"


@pytest.fixture(scope="module")
def right() -> str:
    """P(MOVE), as it is."""
    return run(identity.ROOT)[0]


def copied(folder: Path) -> Path:
    shutil.copytree(identity.ROOT / "mimo", folder / "mimo", ignore=shutil.ignore_patterns("__pycache__"))
    return folder


def edit(folder: Path, file: str, old: str, new: str) -> None:
    path = folder / "mimo" / file
    assert path.read_text().count(old) == 1
    path.write_text(path.read_text().replace(old, new))


def test_a_kernel_is_compiled_once_and_anew_when_the_code_changes_that_it_is_compiled_from(
    tmp_path: Path, cache: Path, right: str
) -> None:
    """Also code in another file than its own, which numba itself does not look at."""
    one, two, three = (copied(tmp_path / name) for name in ("one", "two", "three"))
    kept = {"NUMBA_CACHE_DIR": str(cache)}
    assert run(one, **kept) == (right, f"{COMPILING} {cache}.\n")
    edit(two, "record/kernels.py", "@kernel\ndef exp", "# A comment.\n@kernel\ndef exp")
    assert run(two, **kept) == (right, "")  # another place, other line numbers
    edit(three, "record/kernels.py", "5.0000001201e-1", "4.0000001201e-1")
    other, told = run(three, **kept)
    assert told.startswith(COMPILING)
    assert other != right
    assert run(one, **kept) == (right, "")


def test_a_process_that_changed_a_constant_neither_gives_nor_takes_what_is_kept(cache: Path, right: str) -> None:
    kept = {"NUMBA_CACHE_DIR": str(cache)}
    other, _ = run(identity.ROOT, PATCHED, **kept)
    assert other != right
    assert run(identity.ROOT, **kept)[0] == right
    assert run(identity.ROOT, PATCHED, **kept) == (other, "")


@pytest.mark.parametrize("content", [b"", b"\x80\x04garbage", None], ids=["empty", "garbage", "half"])
def test_a_damaged_file_is_compiled_again_and_mended(content: bytes | None, cache: Path, right: str) -> None:
    kept = {"NUMBA_CACHE_DIR": str(cache)}
    run(identity.ROOT, **kept)
    for path in cache.glob("*.kernel"):
        path.write_bytes(path.read_bytes()[: path.stat().st_size // 2] if content is None else content)
    found, told = run(identity.ROOT, **kept)
    assert (found, told.startswith(COMPILING)) == (right, True)
    assert run(identity.ROOT, **kept) == (right, "")


@pytest.mark.parametrize("folder", ["/proc/nowhere", "/dev/full/nowhere", "/dev/null"])
def test_a_folder_that_takes_no_file_costs_the_compiling_each_time(folder: str, right: str) -> None:
    for _ in range(2):
        found, told = run(identity.ROOT, NUMBA_CACHE_DIR=folder)
        assert (found, told.startswith(COMPILING)) == (right, True)


def test_a_folder_that_can_only_be_read_is_used(cache: Path, right: str) -> None:
    run(identity.ROOT, NUMBA_CACHE_DIR=str(cache))
    cache.chmod(0o555)
    assert run(identity.ROOT, NUMBA_CACHE_DIR=str(cache)) == (right, "")
    cache.chmod(0o755)


def test_a_file_that_others_can_write_is_not_loaded(cache: Path, right: str) -> None:
    run(identity.ROOT, NUMBA_CACHE_DIR=str(cache))
    for path in cache.iterdir():
        path.chmod(0o666)
    found, told = run(identity.ROOT, NUMBA_CACHE_DIR=str(cache))
    assert (found, told.startswith(COMPILING)) == (right, True)


def test_a_user_without_a_home_computes(right: str) -> None:
    lost = "import os\nfrom pathlib import Path\ndef none(*given):\n    raise RuntimeError\nPath.expanduser = none\n"
    lost += "import platformdirs\nplatformdirs.user_cache_dir = none"
    for _ in range(2):
        found, told = run(identity.ROOT, lost)
        assert (found, told.startswith(COMPILING)) == (right, True)


def test_what_no_process_has_loaded_for_long_is_dropped(cache: Path, right: str) -> None:
    kept = {"NUMBA_CACHE_DIR": str(cache)}
    run(identity.ROOT, PATCHED, **kept)
    theirs = set(cache.iterdir())
    for path in theirs:
        os.utime(path, (time.time() - 100 * 86400,) * 2)
    assert run(identity.ROOT, **kept)[0] == right
    assert not theirs & set(cache.iterdir())
    assert run(identity.ROOT, **kept) == (right, "")


@pytest.mark.parametrize("variables", [{"NUMBA_DISABLE_JIT": "1"}, {"NUMBA_OPT": "0"}], ids=str)
def test_numbers_are_the_same_whatever_the_user_has_set(variables: dict[str, str], cache: Path, right: str) -> None:
    assert run(identity.ROOT, **variables, NUMBA_CACHE_DIR=str(cache))[0] == right


def test_numba_that_came_before_without_compiling_is_refused() -> None:
    own = os.environ | {"NUMBA_DISABLE_JIT": "1"}
    script = f"import numba\n{SCRIPT}"
    done = subprocess.run([sys.executable, "-c", script], cwd=identity.ROOT, env=own, capture_output=True, text=True)
    assert done.returncode == 1
    assert done.stderr.strip().endswith("KernelError: numba came before mimo, with NUMBA_DISABLE_JIT set; unset it.")


def test_of_other_peoples_kernels_nothing_is_said() -> None:
    script = "import numba\nassert numba.njit(lambda x: x + 1)(1) == 2"
    assert run(identity.ROOT, f"from mimo.record import kernels\n{script}")[1] == ""
