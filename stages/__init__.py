"""One module for each DVC stage, and the commands around them. Ray's telemetry is off."""

import os
import sys

try:
    import mimo  # noqa: F401  # first: it decides which kernels compute, before Ray loads numpy
except RuntimeError as fault:  # MuJoCo does not take what the user chose to draw with
    sys.exit(str(fault))

os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
if os.environ.get("RAY_ADDRESS", "local") in ("", "local"):
    # A Ray that may not become a cluster keeps to loopback; otherwise its servers listen on every interface.
    os.environ.setdefault("RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER", "0")

from stages.base import console  # noqa: F401  # early: it words what goes wrong while a stage is loaded
