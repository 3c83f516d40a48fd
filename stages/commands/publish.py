"""`python -m stages.commands.publish` (`make publish`): reports/published-on.json, who computed what is published.

For readers, and for `make verify`, which compares this machine's class with the published results'.
"""

import json
import sys
from typing import Any

from mimo.record import artifact
from stages.base import console, paths, provenance


def main() -> None:
    """Say on which machines, and from when to when, the published artifacts were made."""
    listed = [json.loads(path.read_text()) for path in (paths.ARTIFACTS, paths.STUDIES_ARTIFACTS) if path.exists()]
    published = {entry["digest"]: entry["schema"] for each in listed for entry in each.values()}
    known = [line for line in provenance.lines() if line["digest"] in published]
    missing = published.keys() - {line["digest"] for line in known}
    if missing:
        raise console.StageError(
            f"{len(missing)} of {len(published)} published artifacts were not computed in this folder; "
            "run `make publish` where they were, and copy reports/published-on.json."
        )
    last = {line["digest"]: line for line in known}  # the last time each was computed
    machines: list[dict[str, Any]] = []
    for line in last.values():
        own = {key: line.get(key) for key in provenance.machine()}
        if own not in machines:
            machines.append(own)
    made: dict[str, dict[str, Any]] = {}
    for line in sorted(last.values(), key=lambda line: line["at"]):
        entry = made.setdefault(line["schema"], {"artifacts": 0, "first": line["at"]})
        entry["artifacts"] += 1
        entry["last"] = line["at"]
    text = json.dumps({"machines": machines, "made": made}, indent=2)
    artifact.publish(f"{text}\n".encode(), paths.PUBLISHED_ON)


if __name__ == "__main__":
    sys.exit(console.main(main))
