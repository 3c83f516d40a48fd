"""`python -m stages.claims`: reports/claims.json and variants.json, the verdict on each of the paper's claims.

The former from data/results.h5, the paper's own runs; the latter from data/variants.h5, for each variant.
"""

import operator
import sys
from typing import Any

from mimo import analysis, artifact, claims, judgement, params
from stages import console, numbers, paths, store
from stages.results import curves_of, phases_of


def main() -> None:
    """Evaluate every claim."""
    p = params.load()
    held = artifact.read(paths.RESULTS, store.RESULTS)
    numbers.write({"results": held.content, "level": judgement.LEVEL, "claims": judged(held)}, paths.CLAIMS)
    held = artifact.read(paths.VARIANT_RESULTS, store.VARIANTS)
    variants = {
        name: {
            "asks": variant.asks,
            "set": variant.set,
            "published": {key: operator.attrgetter(key)(p) for key in variant.set},
            "seeds": p.sweeps.seeds,
            "claims": judged(held, f"{name}/"),
        }
        for name, variant in p.sweeps.variants.items()
    }
    numbers.write({"results": held.content, "level": judgement.LEVEL, "variants": variants}, paths.VARIANT_CLAIMS)


def judged(held: artifact.Artifact, above: str = "") -> list[dict[str, Any]]:
    """The claims of mimo.claims with their verdicts, from an artifact of curves; `above` as in `curves_of`."""
    return judgement.evaluate(curves_of(held, above), analysis.windows(phases_of(held)), claims.CLAIMS)


if __name__ == "__main__":
    sys.exit(console.main(main))
