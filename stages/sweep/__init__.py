"""Which runs are missing, and their computation in parallel; the curves of many runs."""
