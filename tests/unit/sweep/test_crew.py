"""How many workers a sweep has on this machine."""

import http.server
import os
import re
import socket
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator

import psutil  # type: ignore[import-untyped]
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
def servers() -> Iterator[dict[str, str]]:
    """One that takes a connection and says nothing, and one that answers as the web does."""
    with (
        socket.create_server(("127.0.0.1", 0)) as mute,
        http.server.ThreadingHTTPServer(("127.0.0.1", 0), http.server.BaseHTTPRequestHandler) as web,
    ):
        threading.Thread(target=web.serve_forever, daemon=True).start()
        yield {name: f"127.0.0.1:{one.getsockname()[1]}" for name, one in (("mute", mute), ("web", web.socket))}
        web.shutdown()


@pytest.mark.parametrize(
    ("address", "why"),
    [
        ("127.0.0.1:1", "[Errno 111] Connection refused"),
        ("nohost.invalid:6379", "[Errno "),
        ("127.0.0.1", "it must be HOST:PORT, or auto"),
        ("http://127.0.0.1:80", "[Errno "),
        ("mute", "no answer within 4 s"),
        ("web", "what answers there is no Ray"),
    ],
)
def test_a_cluster_that_is_not_there_is_said_before_ray_is_asked(
    address: str, why: str, servers: dict[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ray would ask for a quarter of an hour."""
    address = servers.get(address, address)
    monkeypatch.setenv("RAY_ADDRESS", address)
    sentence = f"The cluster at RAY_ADDRESS={address} cannot be joined ({why}"
    with (
        pytest.raises(console.StageError, match=f"^{re.escape(sentence)}"),
        crew.assembled(None, False, lambda steps: None),
    ):
        pass


JOIN = """
from stages.sweep import crew
with crew.assembled(None, False, lambda steps: None) as team:
    print(team.workers())
"""


@pytest.mark.parametrize("by", ["auto", "address"])
def test_a_cluster_as_ray_starts_it_is_joined(by: str, tmp_path_factory: pytest.TempPathFactory) -> None:
    """With the token that Ray makes for its user."""
    with (
        tempfile.TemporaryDirectory(dir="/tmp", prefix="ray-") as place,
        socket.create_server(("127.0.0.1", 0)) as free,
    ):
        port = free.getsockname()[1]
        free.close()
        own = {name: value for name, value in os.environ.items() if name != "RAY_ADDRESS"} | {"RAY_TMPDIR": place}
        ray = [
            sys.executable,
            "-m",
            "ray.scripts.scripts",
            "start",
            "--head",
            "--block",
            f"--port={port}",
            "--num-cpus=3",
        ]
        head = subprocess.Popen(
            [*ray, "--node-ip-address=127.0.0.1", "--include-dashboard=false"], env=own,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        )  # fmt: skip
        assert head.stdout is not None
        try:
            said = ""
            while "Ray runtime started" not in said:
                line = head.stdout.readline()
                assert line, said
                said += line
            there = own | {"RAY_ADDRESS": "auto" if by == "auto" else f"127.0.0.1:{port}", "RAY_AUTH_MODE": "token"}
            if by == "auto":
                del there["RAY_AUTH_MODE"]  # Ray sees to it
            joined = subprocess.run([sys.executable, "-c", JOIN], env=there, capture_output=True, text=True)
            assert joined.stdout == "3\n", joined.stderr
        finally:
            below = psutil.Process(head.pid).children(recursive=True)
            head.terminate()
            head.wait()
            psutil.wait_procs(below, 20)
            head.stdout.close()
