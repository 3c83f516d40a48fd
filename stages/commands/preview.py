"""`python -m stages.commands.preview`: the whole pipeline, small, in a folder of its own; published results stay as they are."""

import argparse
import filecmp
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from typing import Any

import yaml

from mimo.settings import params
from stages.base import dvc

FOLDER = Path(".work/preview")
OVERRIDES = "params.preview.yaml"
MARK = ".preview"  # lies in every folder made here; no other folder is ever written to
RESULTS = ("data", "reports", "dvc.lock")  # never copied: the preview makes its own
KEPT = {*RESULTS, ".work", ".dvc", MARK, "params.yaml"}  # stays between calls, so that a second preview is quick
NO_GIT = {".git", ".venv", *RESULTS, ".work", ".dvc"}  # what to leave out where git cannot say
REPLACED = {("effects", "alternatives"), ("sweeps", "variants")}  # sections of names that the overrides choose
DVC_CONFIG = "[core]\n    no_scm = true\n    analytics = false\n    check_update = false\n"


class PreviewError(ValueError):
    """The preview cannot be prepared; the message is one sentence."""


def prepare(source: Path, folder: Path) -> None:
    """Make `folder` a small-scale copy of the project in `source`: its code, and params.yaml with the overrides.

    Args:
        source: The project's top folder.
        folder: Where the copy goes; absent, empty, or made by an earlier call, whose results are kept.

    Raises:
        PreviewError: `folder` holds something else, or the overrides do not fit params.yaml.
        mimo.settings.params.ParamsError: params.yaml, with or without the overrides, does not hold.
    """
    if folder.exists() and any(folder.iterdir()) and not (folder / MARK).is_file():
        raise PreviewError(f"{folder} was not made by an earlier preview; name an empty folder or remove it.")
    small = merged_params(source)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / MARK).touch()
    _write_params(small, folder / "params.yaml")
    wanted = {
        path
        for path in project_files(source)
        if path.parts[0] not in KEPT and not (source / path).resolve().is_relative_to(folder.resolve())
    }
    for path in wanted:
        _copy(source / path, folder / path)
    _drop_others(folder, wanted)
    _init_dvc(folder)


def merged_params(source: Path) -> dict[str, Any]:
    """params.yaml, checked first so that each fault names its file, with params.preview.yaml laid over it."""
    params.load(source / "params.yaml")
    whole: dict[str, Any] = yaml.safe_load((source / "params.yaml").read_text())
    try:
        overrides = yaml.safe_load((source / OVERRIDES).read_text())
    except FileNotFoundError:
        raise PreviewError(f"{OVERRIDES} is missing; restore it from the repository.") from None
    except yaml.YAMLError as error:
        raise PreviewError(f"{OVERRIDES} is not valid YAML: {error}") from None
    return _merge(whole, overrides, ())


def project_files(source: Path) -> set[PurePosixPath]:
    """The project's files: those git tracks or would; without git, all but results and caches."""
    try:
        listed = subprocess.run(
            ["git", "ls-files", "-coz", "--exclude-standard"], cwd=source, capture_output=True, text=True, check=True
        )
    except (OSError, subprocess.CalledProcessError):
        found = {PurePosixPath(path.relative_to(source)) for path in _walk(source, NO_GIT)}
    else:
        found = {PurePosixPath(name) for name in listed.stdout.split("\0") if name}
    return {path for path in found if (source / path).is_file()}


def main(arguments: list[str] | None = None) -> int:
    """Prepare the folder, run `dvc repro` there, and say where the report lies."""
    parser = argparse.ArgumentParser(prog="python -m stages.commands.preview", description=__doc__)
    parser.add_argument("--folder", type=Path, default=FOLDER, help="where the preview goes (default: %(default)s)")
    parser.add_argument("--prepare-only", action="store_true", help="copy, but run nothing")
    options = parser.parse_args(arguments)
    began = time.monotonic()
    try:
        prepare(Path.cwd(), options.folder)
    except (PreviewError, params.ParamsError) as error:
        print(error, file=sys.stderr)
        return 1
    if options.prepare_only:
        print(f"Prepared {options.folder}.")
        return 0
    code = dvc.run(["repro"], options.folder)
    if code:
        print(f"The preview in {options.folder} failed; what went wrong is above.", file=sys.stderr)
        return code
    minutes, seconds = divmod(round(time.monotonic() - began), 60)
    print(f"Preview: {options.folder / 'reports' / 'index.html'} ({minutes} min {seconds} s).")
    return 0


def _merge(whole: dict[str, Any], overrides: Any, above: tuple[str, ...]) -> dict[str, Any]:
    """Lay `overrides` over `whole`, section by section but for REPLACED; a key that `whole` has not is refused."""
    here = ".".join(above) or "the file"
    if not isinstance(overrides, dict):
        raise PreviewError(f"{OVERRIDES}: {here} must be a section of keys and values, as in params.yaml.")
    merged = dict(whole)
    for key, value in overrides.items():
        path = (*above, str(key))
        if key not in whole:
            raise PreviewError(f"{OVERRIDES}: {'.'.join(path)} is not in params.yaml; rename or remove it.")
        deeper = isinstance(whole[key], dict) and path not in REPLACED
        merged[key] = _merge(whole[key], value, path) if deeper else value
    return merged


def _write_params(small: dict[str, Any], target: Path) -> None:
    """Write, check under a name that says whence the values come, and only then replace what stages depend on."""
    draft = target.with_name(f"params.yaml+{OVERRIDES}")
    draft.write_text(
        f"# By `python -m stages.commands.preview` from params.yaml and {OVERRIDES}.\n"
        + yaml.safe_dump(small, sort_keys=False)
    )
    try:
        params.load(draft)
        draft.replace(target)
    finally:
        draft.unlink(missing_ok=True)


def _copy(origin: Path, target: Path) -> None:
    """Copy with mode and time, and only where something changed: DVC then need not read the file again."""
    if target.is_file() and filecmp.cmp(origin, target, shallow=False):
        shutil.copymode(origin, target)
        return
    target.parent.mkdir(parents=True, exist_ok=True)
    shutil.copy2(origin, target)


def _drop_others(folder: Path, wanted: set[PurePosixPath]) -> None:
    """Remove the code files that the project no longer has, and folders left empty."""
    for path in list(_walk(folder, KEPT)):
        if PurePosixPath(path.relative_to(folder)) not in wanted:
            path.unlink()
            for parent in path.relative_to(folder).parents[:-1]:
                if any((folder / parent).iterdir()):
                    break
                (folder / parent).rmdir()


def _walk(folder: Path, leave_out: set[str]) -> Iterator[Path]:
    """Every file below `folder`, but for the named entries at its top and for Python's caches."""
    for top, names, files in os.walk(folder):
        here = Path(top)
        skipped = leave_out if here == folder else set()
        names[:] = [name for name in names if name not in skipped and name != "__pycache__"]
        yield from (here / name for name in files if name not in skipped)


def _init_dvc(folder: Path) -> None:
    """A DVC project of its own, with its own cache: nothing of the preview enters the published one's."""
    config = folder / ".dvc" / "config"
    if not config.is_file() and dvc.run(["init", "--no-scm", "--quiet"], folder):
        raise PreviewError(f"DVC cannot be set up in {folder}; see its message above.")
    config.write_text(DVC_CONFIG)


if __name__ == "__main__":
    sys.exit(main())
