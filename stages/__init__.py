"""One module for each DVC stage, and the commands around them. Rendering is off-screen, Ray's telemetry off."""

import os

os.environ.setdefault("MUJOCO_GL", "egl")
os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
