"""What a result is known by and kept in: identity, random streams, artifacts, and what a process loads."""
