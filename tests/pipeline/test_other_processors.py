"""Other processors compute the same bytes, as far as QEMU can stand for them: their vendors' names and instructions.

It computes with this machine's arithmetic, so it shows which kernels libraries choose there, not what they would round.
Our own kernels are compiled beforehand for a Haswell, as that takes minutes under QEMU; `make same-bytes` takes them.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests import elsewhere

ROOT = Path(__file__).parents[2]
QEMU = shutil.which("qemu-x86_64-static") or shutil.which("qemu-x86_64")  # Debian's qemu-user-static, or qemu-user
WHOLE = "MIMO_SAME_BYTES"  # set by `make same-bytes`
PROCESSORS = ("EPYC-Milan", "Haswell") if os.environ.get(WHOLE) else ("EPYC-Milan",)
SIZES = elsewhere.MOST if os.environ.get(WHOLE) else elsewhere.LEAST

pytestmark = pytest.mark.timeout(3600)


def hashes(*emulated: str, **variables: str) -> dict[str, str]:
    """By name, in a process of its own."""
    python = str(Path(sys.executable).resolve())
    settings = {"PYTHONPATH": os.pathsep.join((str(ROOT), *filter(None, sys.path))), "OMP_WAIT_POLICY": "PASSIVE"}
    command = [*emulated, python, "-m", "tests.elsewhere", *map(str, SIZES)]
    own = os.environ | settings | variables
    done = subprocess.run(command, cwd=ROOT, env=own, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-2000:]
    return dict(line.split() for line in done.stdout.splitlines())


@pytest.mark.skipif(QEMU is None, reason="there is no qemu-x86_64 (Debian's qemu-user-static), so it was not shown")
@pytest.mark.parametrize("processor", PROCESSORS)
def test_another_processor_computes_the_same_bytes(processor: str, tmp_path: Path) -> None:
    assert QEMU is not None
    here = hashes()
    assert len(here) >= 15
    variables = {"NUMBA_CACHE_DIR": str(tmp_path)}
    if not os.environ.get(WHOLE):
        variables |= {"NUMBA_CPU_NAME": "haswell", "NUMBA_CPU_FEATURES": ""}
        assert hashes(**variables) == here
    assert hashes(QEMU, "-cpu", processor, **variables) == here


def test_no_arithmetic_is_used_that_differs_between_vendors() -> None:
    """MKL's square root, which neither MKL_CBWR nor QEMU shows: it is another on AMD's processors than on Intel's."""
    for path in (ROOT / "mimo").rglob("*.py"):
        text = path.read_text()
        for banned in (".sqrt()", "torch.sqrt", ".rsqrt", ".square().sum("):
            assert banned not in text, f"{path} has {banned}; use torch.linalg.vector_norm"
        assert text.count("torch.optim.AdamW(") == text.count("fused=True"), f"{path} has an AdamW that is not fused"
