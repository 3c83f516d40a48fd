"""`python -m stages.commands.paper` (`make paper`): `dvc repro`, and how many artifacts are new, how many as published.

Published is what git's HEAD says in the catalogue, or, where there is no git, what the file says beforehand.
"""

import subprocess
import sys
from pathlib import Path

from stages import catalogue
from stages.base import command, dvc, paths, provenance

SHOWN = 3  # paths that differ
GIT = Path(".git")  # not there in an archive of the project


def main() -> int:
    """Reproduce the paper, then compare."""
    command.parser("paper", __doc__, "make paper", "MIMO_WORKERS=4 make paper").parse_args()
    return reproduce(["repro"], paths.ARTIFACTS, ["dvc.lock", "reports", ":!reports/studies*"])


def reproduce(asked: list[str], listed: Path, made: list[str]) -> int:
    """Run DVC, then compare; the exit code is DVC's, since a changed result is no fault by itself.

    Args:
        asked: of DVC.
        listed: the catalogue of the artifacts that the command makes.
        made: what else it makes that git holds, as git names it.
    """
    start = paths.provenance().stat().st_size if paths.provenance().exists() else 0
    before = _published(listed)
    code = run(asked)
    if code == 0:
        print(f"{_compared(listed, before, start)}{_changed(made)}.")
    return code


def run(asked: list[str]) -> int:
    """Run DVC, and say so if it did not finish; returns its exit code."""
    code = dvc.run(asked)
    if code:
        told = f"`{' '.join(['dvc', *asked])}` did not finish"
        print(f"{told}; what was finished is kept, and the same command goes on.", file=sys.stderr)
    return code


def _published(listed: Path) -> str | None:
    """The catalogue as published; None if nothing is."""
    if not GIT.exists():
        return listed.read_text(encoding="utf-8") if listed.exists() else None
    shown = subprocess.run(
        ["git", "show", f"HEAD:./{listed}"], check=False, capture_output=True, text=True, encoding="utf-8"
    )
    return shown.stdout if shown.returncode == 0 else None


def _compared(listed: Path, before: str | None, start: int) -> str:
    """How many artifacts there are, were computed since byte `start` of the provenance, and equal the published."""
    here = catalogue.published(listed.read_text(encoding="utf-8"))
    here_alone = str(Path.cwd())  # others may use the store meanwhile
    computed = {line["digest"] for line in provenance.lines(start) if line.get("folder") == here_alone}
    anew = sum(entry["digest"] in computed for entry in here.values())
    said = f"{len(here)} artifacts, {anew} of them recomputed"
    if before is None:
        return f"{said}; there are no published ones to compare with"
    published = catalogue.published(before)
    contents = {path: entry["content"] for path, entry in published.items()}
    differ = [str(path) for path, entry in here.items() if contents.get(path) != entry["content"]]
    gone = len(published.keys() - here.keys())
    said += f"; {len(here) - len(differ)} equal the {len(published)} published"
    if differ:
        said += f", {len(differ)} do not: {', '.join(differ[:SHOWN])}{', ...' if len(differ) > SHOWN else ''}"
    if gone:
        said += f", {gone} published are no more"
    return said


def _changed(made: list[str]) -> str:
    """What git says of the files that the command made; empty where git knows none of them."""
    if (
        not GIT.exists()
        or not subprocess.run(["git", "ls-files", "--", *made], capture_output=True, check=False).stdout
    ):
        return ""
    status = ["git", "status", "--porcelain", "--", *made]
    changed = subprocess.run(status, check=False, capture_output=True, text=True, encoding="utf-8").stdout.splitlines()
    if changed:
        return f"; {len(changed)} other files that git holds differ"
    return "; dvc.lock and reports are the same bytes"


if __name__ == "__main__":
    sys.exit(main())
