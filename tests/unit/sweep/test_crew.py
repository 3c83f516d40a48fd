"""How many workers a sweep has on this machine."""

import os
import subprocess
import sys

SCRIPT = """
import os
os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
from stages.sweep import crew
with crew.assembled(None, False, lambda steps: None) as team:
    print(team.workers())
"""


def test_there_are_no_more_workers_than_cpus_that_the_process_may_use() -> None:
    """Under a real Ray."""
    own = {name: value for name, value in os.environ.items() if name != "RAY_ADDRESS"}
    done = subprocess.run([sys.executable, "-c", SCRIPT], env=own, capture_output=True, text=True)
    assert done.stdout == "1\n", done.stderr
