"""What was decided before the runs that judge it: reports/registered.json, and whether git's history bears it out.

`make register` writes the file, which is committed alone. The claims stage calls its verdicts confirmatory only if what
is here is what was registered, and if that commit is older than the first of the runs.
"""

import hashlib
import json
import subprocess
from collections.abc import Iterable, Iterator
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from mimo.record import identity
from mimo.settings.params import Params
from stages.base import paths, provenance

CLAIMS = tuple(Path(f"mimo/science/{name}.py") for name in ("analysis", "judgement", "claims"))


def registered(p: Params) -> dict[str, Any]:
    """What there is to decide: the root seed, and digests of constants, claims and readings of the paper."""
    readings = paths.READINGS.read_text(encoding="utf-8")  # whatever line ends git gave it
    # But for the film and the sweep's chunk, which change no number that a claim is judged by.
    constants = {name: getattr(p, name) for name in Params.model_fields if name not in ("film", "sweep")}
    constants["sweep"] = p.sweep.model_dump(mode="json", exclude={"chunk"})
    return {
        "seed": p.seed,
        "params": str(identity.Digest(constants)),
        "claims": {path.as_posix(): identity.syntax(path) for path in CLAIMS},
        "readings": hashlib.sha256(readings.encode()).hexdigest(),
    }


def standing(p: Params, runs: Iterable[str]) -> dict[str, Any]:
    """Whether verdicts on these runs, named by their digests, are confirmatory, and why.

    Returns:
        `confirmatory`, `seed`, and `at`, when the registration was committed, in UTC, or else `why` not, a clause. It
        says the same wherever there is git's history.
    """
    why = _differs(p) or _unborne(p, runs)
    committed = _committed()
    if why or not committed:
        return {"confirmatory": False, "seed": p.seed, "why": why}
    return {"confirmatory": True, "seed": p.seed, "at": committed.strftime("%Y-%m-%d %H:%M UTC")}


def _differs(p: Params) -> str:
    """How what is here is not what was registered; empty if it is."""
    try:
        held = json.loads(paths.REGISTERED.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return f"{paths.REGISTERED} cannot be read"
    changed = [name for name, own in registered(p).items() if not isinstance(held, dict) or held.get(name) != own]
    return f"not as registered: {', '.join(changed)}" if changed else ""


def _unborne(p: Params, runs: Iterable[str]) -> str:
    """Why git's history does not bear it out; empty if it does."""
    committed = _committed()
    if committed is None:
        return f"git's history has no {paths.REGISTERED} as it is here"
    own = registered(p)
    if any(held.get("seed") == p.seed and held != own for held in _held()):
        return "the root seed was registered with something else, too"
    made = _first(runs)
    if made is None:
        return "when the runs were made is not known here"
    return "a run was made before the registration was committed" if made <= committed else ""


def _committed() -> datetime | None:
    """When the file got its present content, by git; None if it is not HEAD's, or if git or its history is lacking."""
    file = paths.REGISTERED.as_posix()
    if _git("diff", "--quiet", "HEAD", "--", file) is None or _git("rev-parse", "--is-shallow-repository") != "false":
        return None
    at = _git("log", "-1", "--format=%cI", "--", file)
    return datetime.fromisoformat(at).astimezone(UTC) if at else None


def _held() -> Iterator[dict[str, Any]]:
    """All that the file ever held, on whatever branch that was merged."""
    file = paths.REGISTERED.as_posix()
    for commit in (_git("log", "--full-history", "--format=%H", "--", file) or "").split():
        with suppress(ValueError):
            held = json.loads(_git("show", f"{commit}:./{file}") or "{}")
            if isinstance(held, dict):
                yield held


def _first(runs: Iterable[str]) -> datetime | None:
    """When the first of the runs was first computed; of runs that were fetched, the published ones' sum has it."""
    wanted = set(runs)
    times: dict[str, str] = {}
    for line in provenance.lines():
        if line.get("digest") in wanted:
            times[line["digest"]] = min(line["at"], times.get(line["digest"], line["at"]))
    if len(times) < len(wanted):
        try:
            published = json.loads(paths.PUBLISHED_ON.read_text(encoding="utf-8"))
            times["published"] = published["made"]["run"]["first"]
        except (OSError, ValueError, KeyError):
            return None
    return min((datetime.fromisoformat(at) for at in times.values()), default=None)


def _git(*arguments: str) -> str | None:
    """What git says; None where it fails, or is not there."""
    try:
        shown = subprocess.run(["git", *arguments], check=True, capture_output=True, text=True, encoding="utf-8")
    except (OSError, subprocess.CalledProcessError):
        return None
    return shown.stdout.strip()
