"""`python -m stages.claims`: reports/claims.json, the verdict on each of the paper's claims.

What matters most is in reports/headline/ too, few enough numbers for `dvc metrics` and `dvc exp`.
"""

import sys
from collections import Counter
from typing import Any

from mimo.record import artifact
from mimo.science import analysis, claims, judgement
from mimo.settings import params
from stages.base import console, numbers, paths, store
from stages.sweep import curves


def main() -> None:
    """Evaluate every claim."""
    params.load()
    held = artifact.read(paths.RESULTS, store.RESULTS)
    own = curves.judged(held)
    numbers.write({"results": held.content, "level": judgement.LEVEL, "claims": own}, paths.CLAIMS)
    for name, found in headline(held, own).items():
        numbers.write(found, paths.HEADLINE / f"{name}.json")


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
    cells, windows = curves.curves_of(held), analysis.windows(curves.phases_of(held))
    for condition, reward in cells:
        rises = claims.singled_out((condition, reward), "move_probability")(cells, windows)
        found.setdefault(f"lead-{condition}", {})[reward] = round(float(judgement.interquartile_mean(rises)), 3)
    return found


if __name__ == "__main__":
    sys.exit(console.main(main))
