"""From recorded runs to curves, and from curves to verdicts on the paper's claims."""
