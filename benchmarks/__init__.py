"""Timing; never in a test's pass or fail."""

import mimo  # noqa: F401  # first: it decides which kernels compute
