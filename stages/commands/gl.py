"""`python -m stages.commands.gl`: can this machine draw without a screen? `--install` makes it so (Debian, as root)."""

import os
import shutil
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

from mimo.record import artifact, runtime
from mimo.record.runtime import PACKAGES
from stages.base import command, paths

SECONDS = 120  # a first picture takes 2 s; a machine this slow is a broken one

# A real picture, by the way the eye takes: the renderer, the off-screen buffer, the pixels.
PROBE = """
import mujoco
from OpenGL.GL import GL_RENDERER, GL_VERSION, glGetString
model = mujoco.MjModel.from_xml_string(
    '<mujoco><visual><quality shadowsize="0" offsamples="0"/></visual>'
    '<worldbody><light pos="0 0 3"/><geom type="plane" size="1 1 .1"/></worldbody></mujoco>'
)
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
with mujoco.Renderer(model, 16, 16) as renderer:
    renderer.update_scene(data)
    assert renderer.render().any(), "the picture is black"
    print(*(glGetString(name).decode() for name in (GL_RENDERER, GL_VERSION)), sep=", ")
"""


def draws() -> bool:
    """Draw a 16x16 picture; what draws goes to paths.renderer(), a traceback to the log.

    In a process of its own: a GL library that was missing at import stays missing there, even once it is installed.
    """
    command = [sys.executable, "-c", PROBE]
    try:
        done = subprocess.run(command, check=False, capture_output=True, text=True, encoding="utf-8", timeout=SECONDS)
    except subprocess.TimeoutExpired:
        _log(f"no picture within {SECONDS} s\n")
        return False
    if done.returncode:
        _log(done.stderr)
        return False
    with suppress(artifact.ArtifactError):  # it is for provenance alone
        artifact.publish(f"{done.stdout.splitlines()[-1]}\n".encode(), paths.renderer())
    return True


def install() -> bool:
    """Install PACKAGES by apt-get; what it says goes to the log."""
    environment = os.environ | {"DEBIAN_FRONTEND": "noninteractive"}
    for arguments in (["update"], ["install", "-y", "--no-install-recommends", *PACKAGES]):
        done = subprocess.run(
            ["apt-get", "-q", *arguments],
            check=False,
            env=environment,
            capture_output=True,
            text=True,
            encoding="utf-8",
        )
        if done.returncode:
            _log(done.stdout + done.stderr)
            return False
    return True


def main(arguments: list[str] | None = None) -> int:
    """Check, install if asked and needed, check again; the exit code is 0 if pictures can be drawn."""
    parser = command.parser("gl", __doc__, "python -m stages.commands.gl --install")
    parser.add_argument("--install", action="store_true", help="as root on Debian: install what is missing")
    wanted = parser.parse_args(arguments).install
    if draws():
        return 0
    advice = runtime.advice()
    others = {name for name in ("MUJOCO_GL", "PYOPENGL_PLATFORM") if f"{name}=" in runtime.chosen()}  # not Mesa's EGL
    if wanted and not others and os.geteuid() == 0 and shutil.which("apt-get"):
        print(f"Installing {' and '.join(PACKAGES)} for off-screen rendering.", flush=True)
        if install() and draws():
            return 0
        unset = f"; perhaps it helps to unset {runtime.chosen()}." if runtime.chosen() else "."
        advice = f"{' and '.join(PACKAGES)} could not be installed or did not help{unset}"
    print(f"Pictures cannot be drawn without a screen (see {_log_file()}): {advice}", file=sys.stderr)
    return 1


def _log_file() -> Path:
    return paths.store() / "gl.log"


def _log(text: str) -> None:
    with suppress(artifact.ArtifactError):
        artifact.publish(text.encode(), _log_file())


if __name__ == "__main__":
    sys.exit(main())
