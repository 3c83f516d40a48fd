"""With RAY_ADDRESS unset, Ray is private: nothing listens beyond loopback."""

import json
import os
import subprocess
import sys
from ipaddress import ip_address
from pathlib import Path

ROOT = Path(__file__).parents[2]
SCRIPT = """
import json
import psutil
from stages import crew

with crew.assembled(2, False, print) as team:
    team.start("one", lambda report: 1)
    while not (ended := team.ended()):
        pass
    assert ended == [("one", crew.Done(1))]
    own = psutil.Process()
    pids = {process.pid for process in [own, *own.children(recursive=True)]}
    listening = [c.laddr.ip for c in psutil.net_connections("inet") if c.status == "LISTEN" and c.pid in pids]
print(json.dumps(listening))
"""


def test_nothing_listens_beyond_loopback(tmp_path: Path) -> None:
    environment = {name: value for name, value in os.environ.items() if not name.startswith("RAY_")}
    environment["PYTHONPATH"] = str(ROOT)
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT], cwd=tmp_path, env=environment, capture_output=True, text=True, check=True
    )
    addresses = [ip_address(ip.removeprefix("::ffff:")) for ip in json.loads(done.stdout.splitlines()[-1])]
    assert len(addresses) >= 4  # the control store, raylet, object manager and a worker at least
    assert all(address.is_loopback for address in addresses)
