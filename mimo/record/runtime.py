"""What a process loads, in what order, what it draws by and which kernels compute: decided here for all of mimo.

`prepare`, which `import mimo` calls, sets what libraries read as they are loaded; `renderer` is the one way to a GL
context; `check` refuses to compute where the settings came too late.
"""

import functools
import hashlib
import importlib
import importlib.metadata
import os
import platform
import sys
import textwrap
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mimo.settings.errors import Fault

if TYPE_CHECKING:
    import mujoco
    import numpy as np

# A variable that the user has set stays.
ENVIRONMENT = {
    # Off screen, whether or not there is one. MuJoCo reads it as it is imported, and would else look for an X server.
    "MUJOCO_GL": "egl",
    # Mesa's llvmpipe draws in the thread that asks. Its own threads are lost in a fork, which then waits for them for
    # ever, and a worker has one CPU: 8 % less CPU time a frame, the same bytes.
    "LP_NUM_THREADS": "0",
}
# Kernels that every x86-64 processor with AVX2 and FMA has, whatever else it has and whoever made it. Libraries would
# choose by vendor and instructions, and then last bits differ. These go over what the user has set, which would decide
# bytes. Nothing is set for sums, norms, pooling, fused AdamW, random numbers and llvmpipe, as nothing differed there.
KERNELS = {
    "NPY_DISABLE_CPU_FEATURES": "X86_V4,AVX512_ICL,AVX512_SPR",  # numpy's exp, log, power, arctan2
    "OPENBLAS_CORETYPE": "Haswell",  # numpy's matrix products, least squares, eigenvalues
    "ATEN_CPU_CAPABILITY": "avx2",  # torch's own loops
    "ONEDNN_MAX_CPU_ISA": "AVX2",  # torch's convolutions and GELU
    "MKL_CBWR": "COMPATIBLE",  # torch's matrix products, exp, erf, log, tanh
    "NUMBA_DISABLE_JIT": "0",  # Python would round float32 otherwise than compiled kernels do
}
INSTRUCTIONS = ("avx2", "fma")
# What `_computed` gives under KERNELS with these releases.
FINGERPRINTS = {("numpy", "2.4.6"): "0d8b041a6d88fc35", ("torch", "2.13.0"): "bd5ef02e6f733b20"}
# Libraries that bring an LLVM of their own. Loaded after Mesa has loaded its own, they end the process with a
# segmentation fault; before, all is well. torch's CUDA build brings triton, and loads it with its first optimiser.
BEFORE_GL = ("triton",)
# Variables by which MuJoCo, PyOpenGL, EGL and Mesa choose what draws; where nothing does, one of them may be why.
CHOOSING = ("MUJOCO_GL", "PYOPENGL_PLATFORM", "MUJOCO_EGL_DEVICE_ID", "__EGL_VENDOR_LIBRARY_FILENAMES",
            "__EGL_VENDOR_LIBRARY_DIRS", "LIBGL_DRIVERS_PATH", "GALLIUM_DRIVER")  # fmt: skip
PACKAGES = ("libegl1", "libgl1-mesa-dri")  # Debian's: EGL itself, and Mesa's drivers behind it


class KernelError(Fault, RuntimeError):
    """This process would compute other bytes than the others; the message says why."""


class RenderError(Fault, RuntimeError):
    """MuJoCo cannot draw here; the message says what to do."""


def prepare() -> None:
    """Set ENVIRONMENT where it is not set (Linux; elsewhere MuJoCo's own choice is right), and KERNELS in any case.

    Raises:
        RenderError: MuJoCo does not take the MUJOCO_GL that the user has set.
    """
    os.environ.update(KERNELS)
    if sys.platform == "linux":
        for name, value in ENVIRONMENT.items():
            if not os.environ.get(name):
                os.environ[name] = value
        if os.environ["MUJOCO_GL"].strip().lower() != "egl":
            _load()


def _load() -> None:
    """MuJoCo, which may refuse the user's choice as it is imported.

    Raises:
        RenderError: it does.
    """
    try:
        importlib.import_module("mujoco")
    except Exception as fault:  # MuJoCo's or PyOpenGL's
        raise RenderError(f"MuJoCo cannot be loaded ({_said(fault)}): {advice()}") from fault


LATE = [name for name in ("numpy", "torch") if name in sys.modules]  # loaded before KERNELS were set


@functools.cache
def check(*libraries: str) -> None:
    """Make sure that this process computes as all others do; for all that makes an artifact. Takes 20 ms, once.

    Seen by its effect, with the releases of FINGERPRINTS; with others, by whether libraries were loaded too early. On
    other architectures nothing is promised, and nothing is checked.

    Args:
        libraries: those that compute, numpy or torch.

    Raises:
        KernelError: it does not.
    """
    if platform.machine() != "x86_64":
        return
    if lacking := _lacking():
        raise KernelError(f"This processor lacks {' and '.join(lacking)}, without which results are other bytes.")
    for library in libraries:
        expected = FINGERPRINTS.get((library, _release(library)))
        if LATE if expected is None else _computed(library) != expected:
            early = " and ".join(LATE) or "a library"
            settings = " ".join(f"{name}={value}" for name, value in KERNELS.items())
            raise KernelError(
                f"Results would be other bytes here: {early} came before mimo, which chooses the kernels that compute. "
                f"Import mimo first, or set {settings}."
            )


def _lacking() -> list[str]:
    info = Path("/proc/cpuinfo")
    if not info.exists():
        return []
    flags = next(
        (line for line in info.read_text(encoding="utf-8").splitlines() if line.startswith("flags")), ""
    ).split()
    return [name.upper() for name in INSTRUCTIONS if name not in flags]


def _release(distribution: str) -> str:
    return importlib.metadata.version(distribution).partition("+")[0]


def _computed(library: str) -> str:
    """A hash of what differs between processors under other settings."""
    made = hashlib.sha256()
    for values in {"numpy": _numpy, "torch": _torch}[library]():
        made.update(values.tobytes())
    return made.hexdigest()[:16]


def _numpy() -> Iterator[Any]:
    import numpy as np

    x = np.linspace(0.1, 3.0, 4096)
    square = np.outer(x[:96], x[::-1][:96]) % 1.0
    yield from (np.exp(x), np.log(x), np.power(x, 1.3), np.arctan2(x, x[::-1]), square @ square.T)
    yield np.float32(1e-38) * x.astype(np.float32)  # below the normal numbers, which some libraries have set to 0


def _torch() -> Iterator[Any]:
    import numpy as np
    import torch

    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    x = np.linspace(0.1, 3.0, 4096)
    y = torch.from_numpy(x).float()
    matrix = y.outer(y.flip(0))[:96, :96].frac()
    images = torch.from_numpy(np.resize(x, (2, 8, 32, 32))).float()
    filters = torch.from_numpy(np.resize(x % 0.7, (16, 8, 3, 3))).float()
    found = [y.exp(), y.erf(), y.log(), y.tanh(), matrix @ matrix.T, torch.softmax(matrix, -1)]
    found += [torch.nn.functional.conv2d(batch, filters, padding=1) for batch in (images, images[:1])]
    found += [torch.nn.functional.gelu(images)]
    torch.set_num_threads(threads)
    yield from (values.contiguous().numpy() for values in found)


def renderer(model: "mujoco.MjModel", height: int, width: int) -> "mujoco.Renderer":
    """An off-screen renderer of (height, width) pictures, made in a process that has BEFORE_GL loaded.

    Raises:
        RenderError: there is no GL context to be had.
    """
    import mujoco

    for library in BEFORE_GL:
        with suppress(ImportError):  # not there: then nothing will load it
            importlib.import_module(library)
    try:
        return mujoco.Renderer(model, height, width)
    except Exception as fault:  # of MuJoCo, PyOpenGL or the driver, each with its own
        raise RenderError(f"Pictures cannot be drawn off screen ({_said(fault)}): {advice()}") from fault


def drawn(renderer: "mujoco.Renderer", out: "np.ndarray | None" = None) -> "np.ndarray":
    """What a renderer's scene looks like, (height, width, 3) uint8, in `out` where given.

    Raises:
        RenderError: another thread has the renderer.
    """
    with _own_thread():
        picture: np.ndarray = renderer.render(out=out)
    return picture


def close(renderer: "mujoco.Renderer") -> None:
    """Free the GL context.

    Raises:
        RenderError: another thread has the renderer.
    """
    with _own_thread():
        renderer.close()


@contextmanager
def _own_thread() -> Iterator[None]:
    try:
        yield
    except Exception as fault:  # PyOpenGL's, of the driver
        if "EGL_BAD_ACCESS" not in str(fault):
            raise
        raise RenderError(
            f"This thread cannot draw ({_said(fault)}): what draws belongs to the thread that drew first, so let each "
            "thread make, reset, step and close an environment of its own."
        ) from fault


def _said(fault: Exception) -> str:
    """In one line, which is all that comes through from a worker; PyOpenGL's are many."""
    return textwrap.shorten(f"{type(fault).__name__}: {fault}", 120, placeholder=" ...")


def chosen() -> str:
    """What is set in the environment that chooses another way to draw, as `NAME=value NAME=value`; empty if nothing."""
    found = {name: value for name in CHOOSING if (value := os.environ.get(name, "")) and value.strip().lower() != "egl"}
    if found.get("PYOPENGL_PLATFORM") == os.environ.get("MUJOCO_GL"):
        found.pop("PYOPENGL_PLATFORM", None)  # MuJoCo's doing
    return " ".join(f"{name}={value}" for name, value in found.items())


def advice() -> str:
    """What to do where nothing can be drawn."""
    if listed := chosen():
        return f"unset what chooses another way to draw, {listed}."
    if "mujoco" in sys.modules and "mujoco.egl" not in sys.modules:
        return "MuJoCo was imported before mimo chose EGL; import mimo first, or set MUJOCO_GL=egl."
    return f"as root run `apt-get install {' '.join(PACKAGES)}`."
