"""A small project of its own for a test: commands in it, edits of its params.yaml, what lies in it."""

import hashlib
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import yaml


def call(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """A command in `folder`, as a user's shell would run it with the project's environment active."""
    path = os.pathsep.join((str(Path(sys.executable).parent), os.environ["PATH"]))
    names = {f"GIT_{role}_{part}": "lab@example.org" for role in ("AUTHOR", "COMMITTER") for part in ("NAME", "EMAIL")}
    return subprocess.run(
        arguments, cwd=folder, env=os.environ | names | {"PATH": path}, capture_output=True, text=True, check=False
    )


def done(folder: Path, *arguments: str) -> str:
    """What the command said on its standard output; it must succeed."""
    result = call(folder, *arguments)
    assert result.returncode == 0, result.stdout + result.stderr
    return result.stdout


def python(folder: Path, module: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """`python -m module`."""
    return call(folder, sys.executable, "-m", module, *arguments)


def repro(project: Path) -> str:
    """What `dvc repro` said; it must succeed."""
    result = python(project, "dvc", "repro")
    assert result.returncode == 0, result.stdout + result.stderr
    return result.stdout + result.stderr


def edit(project: Path, *changes: tuple[str, Any]) -> None:
    """Values of params.yaml, by dotted key."""
    path = project / "params.yaml"
    whole = yaml.safe_load(path.read_text())
    for key, value in changes:
        *sections, name = key.split(".")
        part = whole
        for section in sections:
            part = part[section]
        part[name] = value
    path.write_text(yaml.safe_dump(whole, sort_keys=False))


def ran(output: str) -> set[str]:
    """The stages that DVC says it ran."""
    return set(re.findall(r"Running stage '([^']+)'", output))


def stored(project: Path) -> set[str]:
    """The runs in the store."""
    return {path.name for path in (project / ".work/runs").glob("*.h5")}


def digests(project: Path, *folders: str) -> dict[str, str]:
    """SHA-256 of every file in some folders."""
    files = [path for folder in folders for path in sorted((project / folder).rglob("*")) if path.is_file()]
    return {str(path.relative_to(project)): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}
