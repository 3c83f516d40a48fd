"""Read back what stages.sweep.curves wrote into data/results.h5 and data/variants.h5: phases and curves."""

import numpy as np

from mimo.record import artifact
from mimo.science import analysis
from mimo.world.protocol import PHASES


def phases_of(held: artifact.Artifact) -> dict[str, slice]:
    """The phases' steps."""
    baseline, attached, extinction = (int(held.about[f"{name}_steps"]) for name in PHASES)
    return analysis.phases(baseline, attached, extinction)


def curves_of(held: artifact.Artifact, above: str = "") -> dict[tuple[str, str], dict[str, np.ndarray]]:
    """Curves, (seed, step) by name, of each condition and reward.

    Args:
        held: its datasets are `<above><condition>/<reward>/<curve>`, beside others.
        above: `<variant>/` for those of a variant.
    """
    found: dict[tuple[str, str], dict[str, np.ndarray]] = {}
    for name, dataset in held.datasets.items():
        parts = name.removeprefix(above).split("/", 2)
        if name.startswith(above) and len(parts) == 3:
            condition, reward, curve = parts
            found.setdefault((condition, reward), {})[curve] = dataset.values
    return found
