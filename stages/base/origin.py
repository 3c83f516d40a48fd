"""What a stage's output for readers was made by: a small JSON beside it, which the stage writes and the page shows.

It names no git commit, since a page cannot name the commit that will hold it, but the command, digests of the code and
the parameters, and content hashes of the data.
"""

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import yaml

from mimo.record import artifact, identity
from stages.base import console, paths

CODE = ("mimo/", "stages/")
NAME = "origin.json"  # in a folder that one stage fills


def write(stage: str, target: Path, data: Iterable[Path]) -> None:
    """Publish what the stage's output was made by; for the end of its `main`.

    It has `stage`, `command`, `digest` (of `code` and `params` together), `code` (by file or folder, hash of the syntax
    trees there), `params` (values by key) and `data` (content hash by path). dvc.yaml says which code and parameters.

    Args:
        stage: as `dvc repro` takes it, so with its cell if it has a matrix: `film@free`.
        target: `<output>.json`, or NAME in a folder; an output of the stage.
        data: the artifacts that the stage has read, and so verified.
    """
    entry = yaml.safe_load((identity.ROOT / "dvc.yaml").read_text(encoding="utf-8"))["stages"][stage.partition("@")[0]]
    code = {dep: _syntax(identity.ROOT / dep) for dep in entry["deps"] if dep.startswith(CODE)}
    settings = yaml.safe_load(paths.PARAMS.read_text(encoding="utf-8"))
    values = {key: _value(settings, key) for key in entry.get("params", [])}
    made = {
        "stage": stage,
        "command": f"dvc repro {stage}",
        "digest": identity.Digest({"code": code, "params": values}),
        "code": code,
        "params": values,
        "data": {path.as_posix(): artifact.content(path) for path in data},
    }
    artifact.publish(f"{json.dumps(made, indent=1)}\n".encode(), target)


def read(path: Path) -> dict[str, Any]:
    """What `write` wrote.

    Raises:
        console.StageError: it is not there, or not JSON.
    """
    try:
        made: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as fault:
        raise console.StageError(f"{path} is missing or damaged; run {paths.made_by(path)}.") from fault
    return made


def _syntax(place: Path) -> str:
    """Of a file, or of all Python files in a folder."""
    if place.is_file():
        return identity.syntax(place)
    return identity.Digest({str(file.relative_to(place)): identity.syntax(file) for file in place.rglob("*.py")})


def _value(settings: Any, key: str) -> Any:
    for part in key.split("."):
        settings = settings[part]
    return settings
