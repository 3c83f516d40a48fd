"""The library in other hands."""

import mimo  # noqa: F401  # first: it decides which kernels compute
