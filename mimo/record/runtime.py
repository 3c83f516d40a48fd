"""What a process loads, in what order, and by what it draws: decided here for all that import mimo.

`prepare`, which `import mimo` calls, sets what MuJoCo and Mesa read when they are loaded; `renderer` is the one way to
a GL context.
"""

import importlib
import os
import sys
from contextlib import suppress
from typing import TYPE_CHECKING

from mimo.settings.errors import Fault

if TYPE_CHECKING:
    import mujoco

# A variable that the user has set stays.
ENVIRONMENT = {
    # Off screen, whether or not there is one. MuJoCo reads it as it is imported, and would else look for an X server.
    "MUJOCO_GL": "egl",
    # Mesa's llvmpipe draws in the thread that asks. Its own threads are lost in a fork, which then waits for them for
    # ever, and a worker has one CPU: 8 % less CPU time a frame, the same bytes.
    "LP_NUM_THREADS": "0",
}
# Libraries that bring an LLVM of their own. Loaded after Mesa has loaded its own, they end the process with a
# segmentation fault; before, all is well. torch's CUDA build brings triton, and loads it with its first optimiser.
BEFORE_GL = ("triton",)
PACKAGES = ("libegl1", "libgl1-mesa-dri")  # Debian's: EGL itself, and Mesa's drivers behind it


class RenderError(Fault, RuntimeError):
    """MuJoCo cannot draw here; the message says what to do."""


def prepare() -> None:
    """Set ENVIRONMENT where it is not set (Linux; elsewhere MuJoCo's own choice is right)."""
    if sys.platform == "linux":
        for name, value in ENVIRONMENT.items():
            if not os.environ.get(name):
                os.environ[name] = value


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
        raise RenderError(
            f"Pictures cannot be drawn off screen ({type(fault).__name__}: {fault}): {_advice()}"
        ) from fault


def _advice() -> str:
    chosen = os.environ.get("MUJOCO_GL", "")
    if chosen != "egl":
        return f"unset MUJOCO_GL (it is {chosen!r}) to use EGL."
    if "mujoco.egl" not in sys.modules:
        return "MuJoCo was imported before mimo chose EGL; import mimo first, or set MUJOCO_GL=egl."
    return f"as root run `apt-get install {' '.join(PACKAGES)}`."
