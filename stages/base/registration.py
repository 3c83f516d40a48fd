"""What was decided before the runs that judge it: reports/registered.json, and whether git's history bears it out.

`make register` writes the file, which is committed alone. The claims stage calls its verdicts confirmatory only if what
is here is what was registered, and if that commit is older than the first of the runs.
"""

import hashlib
import json
import subprocess
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from mimo.record import identity
from mimo.settings.params import Params
from stages.base import paths, provenance

# Constants that came after the registration that stands, and the value of each at which it changes nothing.
LATER = {
    "collect": {"draw": 0, "limbs": "own"},
    "outcomes": {"action": "joint"},
    "world": {"rope_holds": 1.0},
    "rewards": {"surprise": {"weight": 1.0}},
}
CLAIMS = tuple(Path(f"mimo/science/{name}.py") for name in ("analysis", "judgement", "claims"))


def registered(p: Params) -> dict[str, Any]:
    """What there is to decide: the root seed, and digests of constants, claims and readings of the paper."""
    readings = paths.READINGS.read_text(encoding="utf-8")  # whatever line ends git gave it
    # But for the film and the sweep's chunk, which change no number that a claim is judged by.
    sections = [name for name in Params.model_fields if name not in ("seed", "film", "sweep")]
    constants: dict[str, Any] = {name: getattr(p, name).model_dump(mode="json") for name in sections}
    constants |= {"seed": p.seed, "sweep": p.sweep.model_dump(mode="json", exclude={"chunk"})}
    parts = {part for reward in p.sweep.rewards for part in reward.split("_")}
    constants["rewards"] = {
        name: value
        for name, value in constants["rewards"].items()
        if name in parts or not isinstance(value, dict)  # of rewards that no claim is of
    }
    _drop(constants, LATER)
    return {
        "seed": p.seed,
        "params": str(identity.Digest(constants)),
        "claims": {path.as_posix(): identity.syntax(path) for path in CLAIMS},
        "readings": hashlib.sha256(readings.encode()).hexdigest(),
    }


def _drop(values: dict[str, Any], neutral: Mapping[str, Any]) -> None:
    """Take out of `values` what is as in `neutral`."""
    for name, value in neutral.items():
        if isinstance(value, dict):
            _drop(values.get(name, {}), value)
        elif values.get(name) == value:
            del values[name]


def standing(p: Params, runs: Iterable[str]) -> dict[str, Any]:
    """Whether verdicts on these runs, named by their digests, are confirmatory, and why.

    Returns:
        `confirmatory`, `seed`, `before`, the other root seeds that were ever registered, and `at`, when the
        registration was committed, in UTC, or else `why` not, a clause. It says the same wherever git's history is.
    """
    held = _all()
    found: dict[str, Any] = {"seed": p.seed, "before": sorted({own["seed"] for own in held} - {p.seed})}
    try:
        committed = _borne(p, held, runs)
    except _UnborneError as why:
        return {"confirmatory": False, **found, "why": str(why)}
    return {"confirmatory": True, **found, "at": committed.strftime("%Y-%m-%d %H:%M UTC")}


def used(p: Params) -> bool:
    """Whether the root seed was ever registered with something else."""
    own = registered(p)
    return any(held["seed"] == p.seed and held != own for held in _all())


class _UnborneError(Exception):
    """The verdicts are exploratory; the message is a clause, why."""


def _borne(p: Params, held: Sequence[Mapping[str, Any]], runs: Iterable[str]) -> datetime:
    """When what is here was registered, if that was before the runs.

    Raises:
        _UnborneError: it was not, or is not known to have been.
    """
    try:
        here = json.loads(paths.REGISTERED.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        raise _UnborneError(f"{paths.REGISTERED} cannot be read") from None
    own = registered(p)
    if not isinstance(here, dict) or here.keys() != own.keys():
        raise _UnborneError(f"{paths.REGISTERED} is no registration")
    if changed := [name for name in own if here[name] != own[name]]:
        raise _UnborneError(f"not as registered: {', '.join(changed)}")
    committed = _committed(here)
    if any(other["seed"] == p.seed and other != own for other in held):
        raise _UnborneError("the root seed was registered with something else, too")
    made = _first(runs)
    if made is None:
        raise _UnborneError("when the runs were made is not known here")
    if made <= committed:
        raise _UnborneError("a run was made before the registration was committed")
    return committed


def _committed(here: Mapping[str, Any]) -> datetime:
    """When the file got its present content, by git.

    Raises:
        _UnborneError: it is not HEAD's, or git, or its history, is lacking.
    """
    file = paths.REGISTERED.as_posix()
    shallow = _git("rev-parse", "--is-shallow-repository")
    if shallow is None:
        raise _UnborneError("git is not here, or refuses to read this folder")
    if shallow != "false":
        raise _UnborneError("this clone is shallow; `git fetch --unshallow` brings git's history")
    at = _git("log", "-1", "--format=%cI", "--", file)
    if not at or _parsed(_git("show", f"HEAD:./{file}")) != here:
        raise _UnborneError(f"{file} is not committed as it is here")
    return datetime.fromisoformat(at).astimezone(UTC)


def _all() -> list[dict[str, Any]]:
    """All that the file ever held in the history of this commit, on whatever branch that was merged."""
    file = paths.REGISTERED.as_posix()
    commits = (_git("log", "--full-history", "--format=%H", "--", file) or "").split()
    found = [_parsed(_git("show", f"{commit}:./{file}")) for commit in commits]
    return [held for held in found if isinstance(held, dict) and isinstance(held.get("seed"), int)]


def _parsed(text: str | None) -> Any:
    try:
        return json.loads(text or "null")
    except ValueError:
        return None


def _first(runs: Iterable[str]) -> datetime | None:
    """When the first of the runs was first computed; of runs that were fetched, the published ones' sum has it."""
    wanted = set(runs)
    times: dict[str, datetime] = {}
    for line in provenance.lines():
        digest, at = line.get("digest"), _time(line.get("at"))
        if isinstance(digest, str) and digest in wanted and at:
            times[digest] = min(at, times.get(digest, at))
    if len(times) < len(wanted):
        try:
            published = _time(json.loads(paths.PUBLISHED_ON.read_text(encoding="utf-8"))["made"]["run"]["first"])
        except (OSError, ValueError, KeyError, TypeError):
            return None
        if published is None:
            return None
        times["published"] = published
    return min(times.values(), default=None)


def _time(text: Any) -> datetime | None:
    """A time with its zone; None if it is none."""
    try:
        at = datetime.fromisoformat(text)
    except (ValueError, TypeError):
        return None
    return at if at.tzinfo else None


def _git(*arguments: str) -> str | None:
    """What git says; None where it fails, or is not there."""
    try:
        shown = subprocess.run(
            ["git", "-c", "log.showSignature=false", *arguments],
            check=True, capture_output=True, text=True, encoding="utf-8",
        )  # fmt: skip
    except (OSError, subprocess.CalledProcessError):
        return None
    return shown.stdout.strip()
