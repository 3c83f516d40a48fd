"""`python -m stages.claims`: reports/claims.json and variants.json, the verdict on each of the paper's claims.

The former from data/results.h5, the paper's own runs; the latter from data/variants.h5, for each variant. What matters
most of the former is in reports/headline/ too, few enough numbers for `dvc metrics` and `dvc exp`.
"""

import operator
import sys
from collections import Counter
from typing import Any

from mimo.record import artifact
from mimo.science import analysis, claims, judgement
from mimo.settings import params
from stages.base import console, numbers, paths, store
from stages.sweep.results import curves_of, phases_of


def main() -> None:
    """Evaluate every claim."""
    p = params.load()
    held = artifact.read(paths.RESULTS, store.RESULTS)
    own = judged(held)
    numbers.write({"results": held.content, "level": judgement.LEVEL, "claims": own}, paths.CLAIMS)
    for name, found in headline(held, own).items():
        numbers.write(found, paths.HEADLINE / f"{name}.json")
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
    """The claims of mimo.science.claims with their verdicts, from an artifact of curves; `above` as in `curves_of`."""
    return judgement.evaluate(curves_of(held, above), analysis.windows(phases_of(held)), claims.CLAIMS)


def headline(held: artifact.Artifact, judged: list[dict[str, Any]]) -> dict[str, dict[str, float]]:
    """By file's name: how many claims have which verdict; by reward, the rise of the attached limb's lead in P(MOVE).

    Args:
        held: data/results.h5.
        judged: the claims with their verdicts.

    Returns:
        `verdicts`, and `lead-` and each condition; DVC shows files as rows, and what is in them as columns.
    """
    verdicts = Counter(claim["verdict"] for claim in judged)
    found: dict[str, dict[str, float]] = {"verdicts": {word: verdicts[word] for word in judgement.VERDICTS}}
    curves, windows = curves_of(held), analysis.windows(phases_of(held))
    for condition, reward in curves:
        rises = claims.singled_out((condition, reward), "move_probability")(curves, windows)
        found.setdefault(f"lead-{condition}", {})[reward] = round(float(judgement.interquartile_mean(rises)), 3)
    return found


if __name__ == "__main__":
    sys.exit(console.main(main))
