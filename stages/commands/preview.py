"""`python -m stages.commands.preview` (`make preview`): both pipelines, small, in a folder of their own.

Published results stay as they are.
"""

import filecmp
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path, PurePosixPath

from mimo.settings.errors import Fault
from stages.base import command, dvc, overlay, paths

FOLDER = Path(".work/preview")
REGISTERED = PurePosixPath(paths.REGISTERED)  # beside the results, but none
MARK = ".preview"  # lies in every folder made here; no other folder is ever written to
RESULTS = {"data", "reports", "dvc.lock", "studies/dvc.lock"}  # never copied: the preview makes its own
# What stays between calls, so that a second preview is quick.
KEPT = {*RESULTS, ".work", ".dvc", MARK, *map(str, overlay.FILES)}
NO_GIT = {".git", ".venv", *RESULTS, ".work", ".dvc"}  # what to leave out where git cannot say
DVC_CONFIG = "[core]\n    no_scm = true\n    analytics = false\n    check_update = false\n"


class PreviewError(Fault, ValueError):
    """The preview cannot be prepared; the message is one sentence."""


def prepare(source: Path, folder: Path) -> None:
    """Make `folder` a small-scale copy of the project in `source`: its code, and its settings with the overrides.

    Args:
        source: The project's top folder.
        folder: Where the copy goes; absent, empty, or made by an earlier call, whose results are kept.

    Raises:
        PreviewError: `folder` holds something else.
        OverlayError: overrides do not fit params.yaml or studies/params.yaml.
        mimo.settings.files.ParamsError: one of these, with or without the overrides, does not hold.
    """
    if folder.exists() and any(folder.iterdir()) and not (folder / MARK).is_file():
        raise PreviewError(f"{folder} was not made by an earlier preview; name an empty folder or remove it.")
    folder.mkdir(parents=True, exist_ok=True)
    (folder / MARK).touch()
    overlay.write(source, folder)
    wanted = {
        path
        for path in project_files(source)
        if (path == REGISTERED or not _among(path, KEPT))
        and not (source / path).resolve().is_relative_to(folder.resolve())
    }
    for path in wanted:
        _copy(source / path, folder / path)
    _drop_others(folder, wanted)
    _init_dvc(folder)


def project_files(source: Path) -> set[PurePosixPath]:
    """The project's files: those git tracks or would; without git, all but results and caches."""
    try:
        listed = subprocess.run(
            ["git", "ls-files", "-coz", "--exclude-standard"],
            cwd=source,
            capture_output=True,
            text=True,
            encoding="utf-8",
            check=True,
        )
    except (OSError, subprocess.CalledProcessError):
        found = {PurePosixPath(path.relative_to(source)) for path in _walk(source, NO_GIT)} | {REGISTERED}
    else:
        found = {PurePosixPath(name) for name in listed.stdout.split("\0") if name}
    return {path for path in found if (source / path).is_file()}


def main(arguments: list[str] | None = None) -> int:
    """Prepare the folder, run `dvc repro` there, and say where the report lies."""
    parser = command.parser("preview", __doc__, "make preview", "python -m stages.commands.preview --folder /tmp/small")
    parser.add_argument("--folder", type=Path, default=FOLDER, help="where the preview goes (default: %(default)s)")
    parser.add_argument("--prepare-only", action="store_true", help="copy, but run nothing")
    options = parser.parse_args(arguments)
    began = time.monotonic()
    try:
        prepare(Path.cwd(), options.folder)
    except Fault as error:
        print(error, file=sys.stderr)
        return 1
    if options.prepare_only:
        print(f"Prepared {options.folder}.")
        return 0
    code = dvc.run(["repro", "--all-pipelines"], options.folder)
    if code:
        print(f"The preview in {options.folder} failed; what went wrong is above.", file=sys.stderr)
        return code
    minutes, seconds = divmod(round(time.monotonic() - began), 60)
    reports = options.folder / "reports"
    print(f"Preview: {reports / 'index.html'}, {reports / 'studies.html'} ({minutes} min {seconds} s).")
    return 0


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
    """Every file below `folder`, but for the named files and folders and Python's caches."""
    for top, names, files in os.walk(folder):
        here = PurePosixPath(Path(top).relative_to(folder))
        names[:] = [name for name in names if name != "__pycache__" and not _among(here / name, leave_out)]
        yield from (Path(top) / name for name in files if not _among(here / name, leave_out))


def _among(path: PurePosixPath, named: set[str]) -> bool:
    """Whether a file is named, or is in a folder that is."""
    return any(path.is_relative_to(name) for name in named)


def _init_dvc(folder: Path) -> None:
    """A DVC project of its own, with its own cache: nothing of the preview enters the published one's."""
    config = folder / ".dvc" / "config"
    if not config.is_file() and dvc.run(["init", "--no-scm", "--quiet"], folder):
        raise PreviewError(f"DVC cannot be set up in {folder}; see its message above.")
    config.write_text(DVC_CONFIG, encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
