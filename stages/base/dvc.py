"""How the project's commands run DVC: by this interpreter, and without git where there is none."""

import os
import subprocess
import sys
from pathlib import Path


def run(arguments: list[str], folder: Path = Path()) -> int:
    """Run DVC in `folder`; `python` in its commands is the interpreter that runs this. Returns the exit code."""
    _allow_no_git(folder)
    return _call(arguments, folder)


def _allow_no_git(folder: Path) -> None:
    """Have DVC do without git in an archive of the project, as people download it; else it refuses to work there."""
    configs = [folder / ".dvc" / name for name in ("config", "config.local")]
    if not configs[0].is_file() or (folder / ".git").exists():
        return
    if not any("no_scm" in config.read_text(encoding="utf-8") for config in configs if config.is_file()):
        _call(["config", "--local", "core.no_scm", "true"], folder)


def _call(arguments: list[str], folder: Path) -> int:
    path = os.pathsep.join((str(Path(sys.executable).parent), os.environ.get("PATH", "")))
    environment = os.environ | {"PATH": path, "DVC_NO_ANALYTICS": "1"}
    return subprocess.run(
        [sys.executable, "-m", "dvc", *arguments], check=False, cwd=folder, env=environment
    ).returncode
