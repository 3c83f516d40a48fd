"""What every stage and command needs: paths, the store, provenance, how a stage runs."""
