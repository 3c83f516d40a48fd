"""`python -m stages.commands.publish` (`make publish`): reports/published-on.json, who computed what is published.

For readers, and for `make verify`, which compares this machine's class with the published results'.
"""

import json
import sys
from typing import Any

from mimo.record import artifact
from mimo.settings import params
from stages import catalogue, claims
from stages.base import command, console, paths, provenance


def main() -> None:
    """Say on which machines, and from when to when, the published artifacts were made."""
    command.parser("publish", __doc__, "make publish").parse_args()
    noted = provenance.lines()
    last = {line["digest"]: line for line in noted}  # the last time each was computed
    first = {line["digest"]: line["at"] for line in reversed(noted)}
    published = set()
    for path in (paths.ARTIFACTS, paths.STUDIES_ARTIFACTS):
        listed = (
            [entry["digest"] for entry in catalogue.published(path.read_text(encoding="utf-8")).values()]
            if path.exists()
            else []
        )
        published |= set(listed)
        if missing := sum(digest not in last for digest in listed):
            raise console.StageError(
                f"{missing} of {len(listed)} artifacts that {path} lists were not computed in this folder: run "
                f"{paths.made_by(path)}, or `make publish` where they were computed, and copy {paths.PUBLISHED_ON}."
            )
    last = {digest: line for digest, line in last.items() if digest in published}
    machines: list[dict[str, Any]] = []
    for line in last.values():
        own = {key: line.get(key) for key in provenance.machine()}
        if own not in machines:
            machines.append(own)
    made: dict[str, dict[str, Any]] = {}
    for digest, line in last.items():
        entry = made.setdefault(line["schema"], {"artifacts": 0, "first": first[digest], "last": line["at"]})
        entry["artifacts"] += 1
        entry["first"], entry["last"] = min(entry["first"], first[digest]), max(entry["last"], line["at"])
    text = json.dumps({"machines": machines, "made": made}, indent=2)
    artifact.publish(f"{text}\n".encode(), paths.PUBLISHED_ON)
    if told := claims.stale(params.load()):
        print(told)


if __name__ == "__main__":
    sys.exit(console.main(main))
