"""How many workers a sweep has on this machine."""

import os
import socket
import subprocess
import sys
import time
from collections.abc import Iterator

import pytest

from stages.base import console, workers
from stages.sweep import crew

ONE_CPU = "os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})"
SCRIPT = """
import os
import socket
{}
from stages.sweep import crew
with crew.assembled(None, False, lambda steps: None) as team:
    print(team.workers())
"""


@pytest.mark.parametrize(
    ("first", "variables", "expected"),
    [(ONE_CPU, {}, 1), (ONE_CPU, {"MIMO_WORKERS": "3"}, 3)],
    ids=["CPUs", "variable"],
)
def test_there_are_as_many_workers_as_cpus_that_the_process_may_use_or_as_asked(
    first: str, variables: dict[str, str], expected: int
) -> None:
    """Under a real Ray."""
    own = {name: value for name, value in os.environ.items() if name != "RAY_ADDRESS"} | variables
    done = subprocess.run([sys.executable, "-c", SCRIPT.format(first)], env=own, capture_output=True, text=True)
    assert done.stdout == f"{expected}\n", done.stderr


@pytest.mark.parametrize("given", ["0", "-1", "two", "1.5"])
def test_a_number_of_workers_that_is_none_is_refused_in_a_sentence(given: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(workers.VARIABLE, given)
    with pytest.raises(console.StageError, match=f"^MIMO_WORKERS is '{given}': it must be a whole number, at least 1"):
        workers.count()


@pytest.fixture
def listening() -> Iterator[str]:
    """A server that takes a connection and says nothing."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield f"127.0.0.1:{server.getsockname()[1]}"


@pytest.mark.parametrize("address", ["127.0.0.1:1", "nohost.invalid:6379", "127.0.0.1", "http://127.0.0.1:80", "mute"])
def test_a_cluster_that_is_not_there_is_said_within_ten_seconds(
    address: str, listening: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    address = listening if address == "mute" else address
    monkeypatch.setenv("RAY_ADDRESS", address)
    began = time.monotonic()
    with (
        pytest.raises(
            console.StageError, match=rf"^The cluster at RAY_ADDRESS={address} cannot be joined \(.+\)\. Start"
        ),
        crew.assembled(None, False, lambda steps: None),
    ):
        pass
    assert time.monotonic() - began < 2 * crew.ANSWER_SECONDS  # machines under load have their time
