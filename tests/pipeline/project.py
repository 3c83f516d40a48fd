"""A small project of its own for a test: commands in it, edits of its params.yaml, what lies in it."""

import hashlib
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import yaml

from mimo.settings import studies
from mimo.settings.params import Params
from tests import forks


def call(folder: Path, *arguments: str, plain: bool = False) -> subprocess.CompletedProcess[str]:
    """A command in `folder`, as a user's shell would run it with the project's environment active.

    Python's modules, and the stages that `dvc` starts, are forks of a process that has the libraries loaded, unless
    `plain`.
    """
    environment = os.environ | {
        "PATH": os.pathsep.join((str(Path(sys.executable).parent), os.environ["PATH"])),
        **{f"GIT_{role}_{part}": "lab@example.org" for role in ("AUTHOR", "COMMITTER") for part in ("NAME", "EMAIL")},
    }
    if not plain:
        environment["SHELL"] = forks.program("shell")
        if arguments[0] == "dvc":
            arguments = (sys.executable, "-m", *arguments)
        if arguments[:2] == (sys.executable, "-m"):
            arguments = (forks.program("python"), *arguments[1:])
    return subprocess.run(arguments, cwd=folder, env=environment, capture_output=True, text=True, check=False)


def done(folder: Path, *arguments: str) -> str:
    """What the command said on its standard output; it must succeed."""
    result = call(folder, *arguments)
    assert result.returncode == 0, result.stdout + result.stderr
    return result.stdout


def python(folder: Path, module: str, *arguments: str, plain: bool = False) -> subprocess.CompletedProcess[str]:
    """`python -m module`."""
    return call(folder, sys.executable, "-m", module, *arguments, plain=plain)


def repro(project: Path, *targets: str) -> str:
    """What `dvc repro` said, of both pipelines where no target is given; it must succeed."""
    result = python(project, "dvc", "repro", *(targets or ["--all-pipelines"]))
    assert result.returncode == 0, result.stdout + result.stderr
    return result.stdout + result.stderr


def edit(project: Path, *changes: tuple[str, Any]) -> None:
    """Values of params.yaml and studies/params.yaml, by dotted key."""
    for file, known in ((project / "params.yaml", Params), (project / studies.PATH, studies.Studies)):
        whole = yaml.safe_load(file.read_text())
        for key, value in changes:
            *sections, name = key.split(".")
            if key.split(".")[0] in known.model_fields:
                part = whole
                for section in sections:
                    part = part[section]
                part[name] = value
        file.write_text(yaml.safe_dump(whole, sort_keys=False))


def study(variants: dict[str, Any]) -> dict[str, Any]:
    """A study of some variants, which have cells of their own, one seed each."""
    words = dict.fromkeys(("title", "asks", "expects", "limits"), "?")
    return {**words, "seeds": 1, "measures": ["lead"], "cells": {"free": ["mtl"]}, "variants": variants}


def ran(output: str) -> set[str]:
    """The stages that DVC says it ran, those of studies/dvc.yaml as `studies:<name>`."""
    return {name.replace("/dvc.yaml", "") for name in re.findall(r"Running stage '([^']+)'", output)}


def stored(project: Path) -> set[str]:
    """The runs in the store."""
    return {path.name for path in (project / ".work/runs").glob("*.h5")}


def digests(project: Path, *folders: str) -> dict[str, str]:
    """SHA-256 of every file in some folders."""
    files = [path for folder in folders for path in sorted((project / folder).rglob("*")) if path.is_file()]
    return {str(path.relative_to(project)): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}
