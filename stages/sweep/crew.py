"""Who computes: this process, a Ray of this machine's own, or the cluster at RAY_ADDRESS. All Ray code is here.

Ray's processes import this module, and what computes only once they do.
"""

import argparse
import importlib.metadata
import logging
import math
import os
import platform
import signal
import socket
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import ray
from ray._private import services
from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

import mimo
import stages
from mimo.record import identity, kernels, runtime
from stages.base import console, paths, provenance
from stages.base.workers import VARIABLE, count
from stages.base.workers import asked as asked_for
from stages.sweep import folder

POLL_SECONDS = 1.0
RETRIES = 3  # of a task whose worker or node was lost
STARTS = 3  # of Ray, at most
OBJECT_STORE = 256 * 2**20  # bytes: encoder and a few chunks' results
REFUSED = "The cluster is refused: {}. Install requirements.lock on every node."
SERIAL = 0  # workers: none, this process computes
REPORTS = 20  # a second, of all workers together
AHEAD = 8  # workers to a task that waits, so that none of them waits for the driver
ANSWER_SECONDS = 4  # for a connection, and for a first word
SETTINGS = b"\0\0\0\4\0\0\0\0\0"  # a frame without any (RFC 9113)
GREETING = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + SETTINGS
CHECK_SECONDS = 120.0  # for a node to say what it has

Report = Callable[[int], None]  # takes how many steps are done


class Foreign(console.StageError):
    """A node of the cluster has other libraries, or would compute other bytes."""


@dataclass(frozen=True)
class Done:
    """What a task gave, and on what machine (None: this one)."""

    result: Any
    machine: dict[str, Any] | None = None


class Crew(Protocol):
    """Computes tasks; a task is a function whose last argument is a Report."""

    def workers(self) -> int:
        """How many tasks can be computed at once, now."""

    def room(self) -> int:
        """How many tasks it should have in hand: results wait for the driver, so not all at once."""

    def share(self, value: Any) -> Any:
        """What stands for `value` among the arguments of tasks, so that it travels once."""

    def start(self, name: str, function: Callable[..., Any], *given: Any) -> None:
        """Have `function(*given, report)` computed under a name of its own."""

    def ended(self) -> list[tuple[str, Done | Exception]]:
        """The tasks that ended since, by name; waits for one, though not for long."""


def asked(parser: argparse.ArgumentParser) -> argparse.Namespace:
    """The command line, with `workers`: SERIAL for --serial, None for what workers.count gives."""
    asked_for()  # a slip of the user's, before hours of work
    parser.epilog = "\n\n".join(part for part in (parser.epilog, "The bytes are the same with any workers.") if part)
    group = parser.add_mutually_exclusive_group()
    group.add_argument("--serial", action="store_const", const=SERIAL, dest="workers", help="here, without Ray")
    group.add_argument(
        "--workers",
        type=_some,
        metavar="N",
        help=f"Ray workers here (default: {VARIABLE}, or one a CPU that may be used)",
    )
    return parser.parse_args()


def _some(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError("must be a number, at least 1")
    return int(text)


@contextmanager
def assembled(workers: int | None, little: bool, report: Callable[[Mapping[str, int]], None]) -> Iterator[Crew]:
    """A crew; what it started ends with the block.

    Args:
        workers: as `asked` has it.
        little: there is less to do than it takes to start Ray.
        report: is told now and then how many steps are done of each task in flight.

    Raises:
        console.StageError: Ray does not start, or the cluster is not to be had, or not as it should be.
    """
    address = os.environ.get("RAY_ADDRESS")
    if address == "local":  # as Ray has it: none
        address = None
    if workers == SERIAL or (workers is None and little and not address):
        yield _Here(report)
    elif address:
        if workers is not None:
            raise console.StageError(
                "--workers is for this machine alone; with RAY_ADDRESS, the nodes of the cluster have as many as they "
                "were started with (`ray start --num-cpus`). Leave one of the two out."
            )
        with _ray(lambda: _join(address)):
            versions = identity.versions()
            _same_everywhere(versions)
            yield _OnRay(report, versions)
    else:
        with _ray(lambda: _start(workers)):
            yield _OnRay(report)


def room(workers: int) -> int:
    """How many tasks so many workers should have in hand."""
    return workers + math.ceil(workers / AHEAD)


def reason(fault: BaseException) -> tuple[BaseException, str]:
    """What a task raised and its last line; all of it goes to the log."""
    with suppress(OSError):  # a disk that takes no log must not hide what happened
        paths.log().parent.mkdir(parents=True, exist_ok=True)
        with paths.log().open("a", encoding="utf-8") as log:
            log.write(f"{fault}\n")
    cause = getattr(fault, "cause", None) or fault
    return cause, (str(cause).strip().splitlines() or [type(cause).__name__])[-1]


class _Here:
    """This process, one task after the other."""

    def __init__(self, report: Callable[[Mapping[str, int]], None]) -> None:
        self._report = report
        self._tasks: deque[tuple[str, Callable[..., Any], tuple[Any, ...]]] = deque()

    def workers(self) -> int:
        return 1

    def room(self) -> int:
        return 1

    def share(self, value: Any) -> Any:
        return value

    def start(self, name: str, function: Callable[..., Any], *given: Any) -> None:
        self._tasks.append((name, function, given))

    def ended(self) -> list[tuple[str, Done | Exception]]:
        name, function, given = self._tasks.popleft()
        try:
            return [(name, Done(function(*given, lambda steps: self._report({name: steps}))))]
        except Exception as fault:
            return [(name, fault)]


class _OnRay:
    """Ray's workers; `versions`, where given, are what all nodes must have."""

    def __init__(self, report: Callable[[Mapping[str, int]], None], versions: Mapping[str, str] | None = None) -> None:
        self._report, self._versions = report, versions
        self._board = _Board.remote()  # type: ignore[attr-defined]
        self._flying: dict[Any, str] = {}
        self._size, self._counted = 1, -POLL_SECONDS

    def workers(self) -> int:
        if time.monotonic() - self._counted > POLL_SECONDS:
            held = ray.cluster_resources()  # type: ignore[no-untyped-call]
            self._size = max(1, int(held.get("CPU", 1)))
            self._counted = time.monotonic()
        return self._size

    def room(self) -> int:
        return room(self.workers())

    def share(self, value: Any) -> Any:
        return ray.put(value)

    def start(self, name: str, function: Callable[..., Any], *given: Any) -> None:
        every = max(POLL_SECONDS, self.workers() / REPORTS)
        self._flying[_compute.remote(self._versions, self._board, every, name, function, *given)] = name

    def ended(self) -> list[tuple[str, Done | Exception]]:
        ready, _ = ray.wait(list(self._flying), timeout=POLL_SECONDS)
        if ready:  # and whatever else is
            ready, _ = ray.wait(list(self._flying), num_returns=len(self._flying), timeout=0)
        found: list[tuple[str, Done | Exception]] = []
        for reference in ready:
            name = self._flying.pop(reference)
            try:
                found.append((name, ray.get(reference)))
            except ray.exceptions.RayError as fault:
                if isinstance(cause := getattr(fault, "cause", None), Foreign):
                    raise cause from fault
                found.append((name, fault))
        # The board may be lost or slow: that costs the bar a moment, not the sweep.
        with suppress(ray.exceptions.RayError, TimeoutError):
            steps = ray.get(self._board.get.remote(), timeout=10 * POLL_SECONDS)
            self._report({name: steps[name] for name in self._flying.values() if name in steps})
        return found


@ray.remote(num_cpus=0, max_restarts=-1)
class _Board:
    """Where workers write how far they are."""

    def __init__(self) -> None:
        console.die_with_parent()
        self._steps: dict[str, int] = {}

    def put(self, name: str, steps: int) -> None:
        self._steps[name] = steps

    def get(self) -> dict[str, int]:
        return self._steps


@ray.remote(num_cpus=1, max_retries=RETRIES)
def _compute(
    versions: Mapping[str, str] | None, board: Any, every: float, name: str, function: Callable[..., Any], *given: Any
) -> Done:
    console.die_with_parent()  # when the driver was killed, Ray lets a worker live for another minute
    if versions is not None and (other := _other(versions)):  # a node that joined late
        raise Foreign(REFUSED.format(other))
    last = 0.0

    def report(steps: int) -> None:
        nonlocal last
        if time.monotonic() - last > every:
            last = time.monotonic()
            board.put.remote(name, steps)

    return Done(function(*given, report), None if versions is None else provenance.machine())


@ray.remote(num_cpus=0, max_retries=RETRIES)
def _other_here(versions: Mapping[str, str]) -> str:
    return _other(versions)


def _other(versions: Mapping[str, str]) -> str:
    """Which libraries this node has in other versions, or why it computes other bytes; empty if neither."""
    found = []
    for name, version in versions.items():
        try:
            own = identity.release(identity.LIBRARIES[name])
        except importlib.metadata.PackageNotFoundError:
            own = "missing"
        if own != version:
            found.append(f"{name} {own} instead of {version}")
    node = f"node {platform.node()} ({ray.util.get_node_ip_address()})"  # type: ignore[no-untyped-call]
    if found:
        return f"{node} has {', '.join(found)}"
    try:
        runtime.check("numpy")
        kernels.check()
    except runtime.KernelError as fault:
        return f"{node}: {fault}"
    return ""


def _same_everywhere(versions: Mapping[str, str]) -> None:
    """All nodes must have the driver's libraries, by which runs are identified.

    Raises:
        Foreign: some have not.
    """
    asked = [
        _other_here.options(scheduling_strategy=NodeAffinitySchedulingStrategy(node["NodeID"], soft=False)).remote(
            versions
        )
        for node in ray.nodes()  # type: ignore[no-untyped-call]
        if node["Alive"]
    ]
    try:
        found = [other for other in ray.get(asked, timeout=CHECK_SECONDS) if other]
    except (ray.exceptions.RayError, TimeoutError) as fault:
        raise console.StageError(f"A node of the cluster cannot run the code ({reason(fault)[1]}).") from fault
    if found:
        raise Foreign(REFUSED.format("; ".join(found)))


@contextmanager
def _ray(begin: Callable[[], None]) -> Iterator[None]:
    """Ray until the end of the block."""
    on_sigterm = signal.getsignal(signal.SIGTERM)
    try:
        begin()
        signal.signal(signal.SIGTERM, on_sigterm)  # Ray puts one of its own in place
        yield
    finally:
        ray.shutdown()


def _start(workers: int | None) -> None:
    """A Ray for this process, on loopback (see stages/__init__.py), without dashboard."""
    cpus, place = workers or count(), str(folder.found())
    for left in reversed(range(STARTS)):
        try:
            ray.init(
                address="local",
                num_cpus=cpus,
                include_dashboard=False,
                log_to_driver=False,
                logging_level=logging.ERROR,
                object_store_memory=OBJECT_STORE,
                _temp_dir=place,
            )
            return
        except Exception as fault:  # on a machine under load its daemons may miss Ray's own time limit
            ray.shutdown()
            if not left:
                said = "Ray did not start; run it again when the machine is less busy, or with --serial"
                raise console.StageError(f"{said} ({reason(fault)[1]}).") from fault


def _unanswered(address: str) -> str:
    """Why no Ray answers there, in words; empty if one does. Ray itself would ask for a quarter of an hour.

    Ray's servers speak HTTP/2, in which each side begins by its settings. With TLS, nothing is asked.
    """
    if os.environ.get("RAY_USE_TLS", "0") not in ("", "0"):
        return ""
    try:
        where = services.canonicalize_bootstrap_address(address) if address == "auto" else address
        host, colon, port = (where or "").rpartition(":")
        if not colon or not port.isdecimal():
            return "it must be HOST:PORT, or auto"
        with socket.create_connection((host.strip("[]"), int(port)), timeout=ANSWER_SECONDS) as link:
            link.sendall(GREETING)
            said = b""
            while len(said) < len(SETTINGS) and (more := link.recv(len(SETTINGS) - len(said))):
                said += more
    except TimeoutError:
        return f"no answer within {ANSWER_SECONDS} s"
    except (OSError, OverflowError, ConnectionError) as fault:
        return str(fault)
    return "" if said[3:4] == SETTINGS[3:4] else "what answers there is no Ray"


def _join(address: str) -> None:
    """The cluster; the code travels there, so that its nodes need but Python and requirements.lock."""
    if address.startswith("ray://"):
        raise console.StageError(
            f"RAY_ADDRESS is {address}, for Ray's client, which this pipeline does not use: make this machine a node "
            "(`ray start --address=HOST:6379 --num-cpus=0`), then set RAY_ADDRESS=auto."
        )
    if silence := _unanswered(address):
        raise console.StageError(
            f"The cluster at RAY_ADDRESS={address} cannot be joined ({silence}). Start it, or mend the address."
        )
    code = [str(Path(package.__path__[0])) for package in (mimo, stages)]
    passed = {name: os.environ[name] for name in (*runtime.ENVIRONMENT, *runtime.KERNELS) if name in os.environ}
    try:
        ray.init(
            address=address,
            log_to_driver=False,
            logging_level=logging.ERROR,
            runtime_env={"py_modules": code, "env_vars": passed, "excludes": ["__pycache__"]},
        )
    except Exception as fault:
        raise console.StageError(
            f"The cluster at RAY_ADDRESS={address} cannot be joined ({reason(fault)[1]})."
        ) from fault
