"""`python -m stages.compare`: from the variants' runs to data/variants.h5, and how each judges the paper's claims."""

import operator
import sys

from mimo.record import artifact, identity
from mimo.science import analysis, judgement
from mimo.settings import params, studies
from stages.base import console, numbers, paths, provenance, store
from stages.sweep import curves


def main() -> None:
    """Read every run of every variant, write what comes of them."""
    p = params.load()
    sweeps = studies.load(p).sweeps
    variants, seeds = sweeps.variants, sweeps.seeds
    windows = analysis.windows(curves.phases(p))
    with console.Progress("Variants", seeds * sum(len(v.pairs) for v in variants.values()), "runs") as progress:
        found = {
            name: curves.read(params.changed(p, own.set), own.pairs, seeds, progress, name)
            for name, own in variants.items()
        }
    datasets = curves.ends(windows)
    for name, stacked in found.items():
        datasets |= curves.datasets(stacked, f"{name}/")
    about = curves.about(p, seeds)
    digest = identity.Digest({"runs": {name: stacked.runs for name, stacked in found.items()}, "about": about})
    artifact.write(paths.VARIANT_RESULTS, store.VARIANTS, digest, datasets, about)
    provenance.note(store.VARIANTS, digest)
    held = artifact.read(paths.VARIANT_RESULTS, store.VARIANTS)
    judged = {
        name: {
            "asks": variant.asks,
            "set": variant.set,
            "published": {key: operator.attrgetter(key)(p) for key in variant.set},
            "seeds": seeds,
            "claims": curves.judged(held, f"{name}/"),
        }
        for name, variant in variants.items()
    }
    numbers.write({"results": held.content, "level": judgement.LEVEL, "variants": judged}, paths.VARIANT_CLAIMS)


if __name__ == "__main__":
    sys.exit(console.main(main))
