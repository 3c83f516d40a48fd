"""Where and when artifacts were made: what depends on the machine, and so enters no artifact and no report.

Each artifact that is computed adds a line to the store's provenance.jsonl. `make publish` sums up those of the
published artifacts in reports/published-on.json.
"""

import functools
import json
import os
import platform
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from mimo.record import identity
from stages.base import paths


def note(schema: str, digest: str, where: dict[str, Any] | None = None) -> None:
    """Remember that the artifact was computed now, on the machine `where` or (None) on this one."""
    now = datetime.now(UTC).isoformat(timespec="seconds")
    line = {"schema": schema, "digest": digest, "at": now, "folder": str(Path.cwd())} | (where or machine())
    paths.provenance().parent.mkdir(parents=True, exist_ok=True)
    # One write to a file opened for appending; a line begins anew even where the one before was cut short.
    with paths.provenance().open("ab", buffering=0) as file:
        file.write(f"\n{json.dumps(line)}".encode())


def lines(start: int = 0) -> list[dict[str, Any]]:
    """What was noted from byte `start` on, for any folder; a line that was cut short, or is none, is passed over."""
    if not paths.provenance().exists():
        return []
    found = []
    for line in paths.provenance().read_bytes()[start:].decode(errors="replace").splitlines():
        try:
            noted = json.loads(line)
        except ValueError:
            continue
        if isinstance(noted, dict):
            found.append(noted)
    return found


@functools.cache
def machine() -> dict[str, Any]:
    """The machine and its software, as far as they decide bits or time."""
    told = paths.renderer()
    drawn = told.read_text(encoding="utf-8").strip() if told.exists() else "unknown"
    return {
        "class": machine_class(),
        "cpu": _cpuinfo().get("model name", platform.processor()),
        "cores": os.cpu_count(),
        "system": f"{platform.system()} {platform.machine()}, {'-'.join(platform.libc_ver())}",
        "python": platform.python_version(),
        "renderer": drawn,
        "versions": identity.versions(),
        "builds": {name: identity.build(distribution) for name, distribution in identity.LIBRARIES.items()},
    }


def machine_class() -> str:
    """Machines that agree in it, and in the libraries' releases, are to give the same bytes: see runtime.KERNELS.

    The C library is part of it, as it has the sine and exponential that MuJoCo computes with.
    """
    return f"{platform.machine()}, {' '.join(platform.libc_ver())}"


def foreign() -> str:
    """How this machine's class differs from the published results', in words; empty if not, or if none is known."""
    if not paths.PUBLISHED_ON.exists():
        return ""
    here = machine()
    machines = json.loads(paths.PUBLISHED_ON.read_text(encoding="utf-8"))["machines"]
    if any(all(other[key] == here[key] for key in ("class", "versions")) for other in machines):
        return ""
    return (
        f"This machine ({here['class']}; {here['versions']}) is of another class than the published results' "
        f"({'; '.join(str((other['class'], other['versions'])) for other in machines)})"
    )


@functools.cache
def _cpuinfo() -> dict[str, str]:
    """The first processor's entries in /proc/cpuinfo; empty where there is none."""
    path = Path("/proc/cpuinfo")
    first = path.read_text(encoding="utf-8").split("\n\n")[0] if path.exists() else ""
    return {
        key.strip(): value.strip()
        for key, colon, value in (line.partition(":") for line in first.splitlines())
        if colon
    }
