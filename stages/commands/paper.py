"""`python -m stages.commands.paper` (`make paper`): `dvc repro`, then a line: how many artifacts are new, how many as published.

Published is what git's HEAD says in reports/artifacts.json, or, where there is no git, what the file says beforehand.
"""

import subprocess
import sys
from pathlib import Path

from stages import catalogue
from stages.base import dvc, paths, provenance

SHOWN = 3  # paths that differ
GIT = Path(".git")  # not there in an archive of the project


def main() -> int:
    """Reproduce, then compare; the exit code is that of `dvc repro`, since a changed result is no fault by itself."""
    start = paths.PROVENANCE.stat().st_size if paths.PROVENANCE.exists() else 0
    listed = _listed()
    code = dvc.run(["repro"])
    if code:
        print("`dvc repro` did not finish; what was finished is kept, and the same command goes on.", file=sys.stderr)
        return code
    print(summary(start, listed))
    return 0


def _listed() -> str | None:
    """reports/artifacts.json as published; None if nothing is."""
    if not GIT.exists():
        return paths.ARTIFACTS.read_text() if paths.ARTIFACTS.exists() else None
    shown = subprocess.run(["git", "show", f"HEAD:./{paths.ARTIFACTS}"], check=False, capture_output=True, text=True)
    return shown.stdout if shown.returncode == 0 else None


def summary(start: int, listed: str | None) -> str:
    """How many artifacts there are, were computed since byte `start` of the provenance, and equal the published."""
    here = catalogue.published(paths.ARTIFACTS.read_text())
    computed = {line["digest"] for line in provenance.lines(start)}
    anew = sum(entry["digest"] in computed for entry in here.values())
    said = f"{len(here)} artifacts, {anew} of them recomputed"
    if listed is None:
        return f"{said}; there are no published ones to compare with."
    published = catalogue.published(listed)
    contents = {path: entry["content"] for path, entry in published.items()}
    differ = [str(path) for path, entry in here.items() if contents.get(path) != entry["content"]]
    gone = len(published.keys() - here.keys())
    said += f"; {len(here) - len(differ)} equal the {len(published)} published"
    if differ:
        said += f", {len(differ)} do not: {', '.join(differ[:SHOWN])}{', ...' if len(differ) > SHOWN else ''}"
    if gone:
        said += f", {gone} published are no more"
    if not GIT.exists():
        return f"{said}."
    changed = subprocess.run(
        ["git", "status", "--porcelain", "--", "dvc.lock", "reports"], check=False, capture_output=True, text=True
    ).stdout.split("\n")[:-1]
    same = (
        f"{len(changed)} files of dvc.lock and reports/ differ"
        if changed
        else "dvc.lock and reports/ are the same bytes"
    )
    return f"{said}; {same}."


if __name__ == "__main__":
    sys.exit(main())
