"""Two hosts that share no network and no files but through Ray, as network and mount namespaces of this machine."""

import os
import secrets
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

import psutil  # type: ignore[import-untyped]

from tests.faults.harness import ENDING, wait

PORT = 6379
SESSIONS = Path("/tmp/ray")  # where Ray's nodes keep their sockets and logs
FIRST, SECOND = "10.213.74.1", "10.213.74.2"  # on a link of their own


@dataclass
class Host:
    """A machine, as far as Ray can tell; `within` runs a command on it."""

    address: str
    within: tuple[str, ...]
    folder: Path  # for logs
    hides: tuple[Path, ...] = ()  # folders of the other host
    nodes: list[psutil.Popen] = field(default_factory=list)

    def start(self, *arguments: str, environment: Mapping[str, str]) -> psutil.Popen:
        """`ray start` with arguments; returns when the node runs."""
        log = self.folder / f"node-{self.address}-{len(self.nodes)}.log"
        ray = [str(Path(sys.executable).parent / "ray"), "start", "--block", "--disable-usage-stats", "--num-cpus=1"]
        command = [*ray, f"--node-ip-address={self.address}", *arguments]
        if self.hides:
            script = "".join(f"mount -t tmpfs hidden '{folder}' && " for folder in self.hides) + 'exec "$@"'
            command = ["unshare", "--mount", "sh", "-c", script, "sh", *command]
        with log.open("wb") as out:
            node = psutil.Popen(
                [*self.within, *command], cwd="/", env=environment, stdin=subprocess.DEVNULL, stdout=out, stderr=out
            )
        self.nodes.append(node)
        wait(lambda: node.poll() is not None or "Ray runtime started" in log.read_text(), log.read_text)
        assert node.poll() is None, log.read_text()
        return node

    def computing(self) -> list[psutil.Process]:
        """Its workers that compute a run just now."""
        found = []
        for process in self._processes():
            with suppress(psutil.Error):
                if "ray::_compute" in " ".join(process.cmdline()):
                    found.append(process)
        return found

    @contextmanager
    def held(self) -> Iterator[None]:
        """What it computes just now stands still for as long as the block."""
        processes = self.computing()
        for process in processes:
            process.suspend()
        try:
            yield
        finally:
            for process in processes:
                with suppress(psutil.Error):
                    process.resume()

    def fail(self) -> None:
        """All of it is gone at once."""
        for process in self._processes():
            with suppress(psutil.Error):
                process.kill()
        for node in self.nodes:
            node.wait(ENDING)
        self.nodes.clear()

    def _processes(self) -> list[psutil.Process]:
        found = []
        for node in self.nodes:
            with suppress(psutil.Error):
                found += [*node.children(recursive=True), node]
        return found


@contextmanager
def two_hosts(folder: Path, hidden: Path) -> Iterator[tuple[Host, Host]]:
    """Two hosts on one link; `hidden` lies on the first alone.

    Raises:
        PermissionError: this process may not make namespaces.
    """
    names = [f"host-{secrets.token_hex(3)}" for _ in range(2)]
    links = [f"v{name[5:]}" for name in names]
    with ExitStack() as stack:
        for name in names:
            _ip("netns", "add", name)
            stack.callback(_ip, "netns", "delete", name)
        _ip("link", "add", links[0], "netns", names[0], "type", "veth", "peer", "name", links[1], "netns", names[1])
        SESSIONS.mkdir(exist_ok=True)
        hosts = []
        for name, link, address in zip(names, links, (FIRST, SECOND), strict=True):
            _ip("-n", name, "address", "add", f"{address}/30", "dev", link)
            _ip("-n", name, "link", "set", link, "up")
            _ip("-n", name, "link", "set", "lo", "up")
            hosts.append(Host(address, ("ip", "netns", "exec", name), folder))
            stack.callback(hosts[-1].fail)
        hosts[1].hides = (SESSIONS, hidden)
        yield hosts[0], hosts[1]


def environment(**changes: str) -> dict[str, str]:
    """A shell's environment on any host: no trace of this project but the Python that has its libraries."""
    path = os.pathsep.join((str(Path(sys.executable).parent), os.environ["PATH"]))
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("RAY_", "PYTHON"))}
    return kept | {"PATH": path} | changes


def _ip(*arguments: str) -> None:
    try:
        done = subprocess.run(["ip", *arguments], capture_output=True, text=True, check=False)
    except FileNotFoundError as fault:
        raise PermissionError("there is no `ip` (iproute2)") from fault
    if done.returncode:
        raise PermissionError(done.stderr.strip())
