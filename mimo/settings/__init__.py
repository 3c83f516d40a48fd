"""What the user sets: params.yaml, strictly read, and what is said of its faults."""
