"""How many processes compute at once on this machine; the bytes are the same with any number."""

import os

from stages.base import console

VARIABLE = "MIMO_WORKERS"


def asked() -> int | None:
    """MIMO_WORKERS, where it is set.

    Raises:
        console.StageError: it is no such number.
    """
    given = os.environ.get(VARIABLE)
    if not given:
        return None
    if not given.isdecimal() or int(given) < 1:
        raise console.StageError(f"{VARIABLE} is {given!r}: it must be a whole number, at least 1, or unset.")
    return int(given)


def count() -> int:
    """MIMO_WORKERS where it is set, else as many as there are CPUs that this process may use, by affinity and cgroup.

    Raises:
        console.StageError: MIMO_WORKERS is no such number.
    """
    if given := asked():
        return given
    import joblib  # late: only where processes are started

    return int(joblib.cpu_count())
