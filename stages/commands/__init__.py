"""What `make` calls, beside DVC."""
