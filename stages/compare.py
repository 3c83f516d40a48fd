"""`python -m stages.compare`: from the variants' runs to data/variants.h5."""

import sys

from mimo.record import artifact, identity
from mimo.science import analysis
from mimo.settings import params
from stages.base import console, paths, provenance, store
from stages.sweep import curves


def main() -> None:
    """Read every run of every variant, write what comes of them."""
    p = params.load()
    variants, seeds = p.sweeps.variants, p.sweeps.seeds
    windows = analysis.windows(curves.phases(p))
    with console.Progress("Variants", seeds * sum(len(v.pairs) for v in variants.values()), "runs") as progress:
        found = {name: curves.read(p, own.pairs, seeds, progress, name) for name, own in variants.items()}
    datasets = curves.ends(windows)
    for name, stacked in found.items():
        datasets |= curves.datasets(stacked, f"{name}/")
    about = curves.about(p, seeds)
    digest = identity.Digest({"runs": {name: stacked.runs for name, stacked in found.items()}, "about": about})
    artifact.write(paths.VARIANT_RESULTS, store.VARIANTS, digest, datasets, about)
    provenance.note(store.VARIANTS, digest)


if __name__ == "__main__":
    sys.exit(console.main(main))
