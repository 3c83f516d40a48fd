"""`python -m stages.claims`: reports/claims.json, the verdicts on each of the paper's claims.

What matters most is in reports/headline/ too, few enough numbers for `dvc metrics` and `dvc exp`.
"""

import itertools
import json
import sys
from collections import Counter
from typing import Any

from mimo.record import artifact
from mimo.science import analysis, claims, judgement
from mimo.settings import params
from stages.base import console, numbers, paths, registration, store
from stages.sweep import curves


def main() -> None:
    """Evaluate every claim."""
    p = params.load()
    held = artifact.read(paths.RESULTS, store.RESULTS)
    own = curves.judged(held)
    found: dict[str, Any] = {"results": held.content, "level": judgement.LEVEL}
    found |= {"registration": standing(p), "claims": own}
    numbers.write(found, paths.CLAIMS)
    for name, found in headline(held, own).items():
        numbers.write(found, paths.HEADLINE / f"{name}.json")


def standing(p: params.Params) -> dict[str, Any]:
    """Whether the verdicts are confirmatory, by git's history and the runs' times as they are now."""
    runs = curves.digests(paths.manifest(*pair) for pair in itertools.product(p.sweep.conditions, p.sweep.rewards))
    return registration.standing(p, runs.values())


def stale(p: params.Params) -> str:
    """A sentence if reports/claims.json says otherwise; DVC knows neither git's history nor times."""
    try:
        said = json.loads(paths.CLAIMS.read_text(encoding="utf-8"))["registration"]
    except (OSError, ValueError, KeyError):
        return f"{paths.CLAIMS} cannot be read; run `dvc repro claims`."
    if said == standing(p):
        return ""
    return (
        f"{paths.CLAIMS} says of its registration what no longer is so: run `dvc repro -f -s claims`, then `dvc repro`."
    )


def headline(held: artifact.Artifact, judged: list[dict[str, Any]]) -> dict[str, dict[str, float]]:
    """By file's name: how many claims have which verdicts; by reward, the rise of the attached limb's lead in P(MOVE).

    Args:
        held: data/results.h5.
        judged: the claims with their verdicts.

    Returns:
        `shown`, `said`, and `lead-` and each condition; DVC shows files as rows, and what is in them as columns.
    """
    found: dict[str, dict[str, float]] = {}
    for group in judgement.GROUPS:
        verdicts = Counter(claim[group]["verdict"] for claim in judged)
        found[group] = {word: verdicts[word] for word in judgement.VERDICTS}
    cells, windows = curves.curves_of(held), analysis.windows(curves.phases_of(held))
    for condition, reward in cells:
        rises = claims.singled_out((condition, reward), "move_probability")(cells, windows)
        found.setdefault(f"lead-{condition}", {})[reward] = round(float(judgement.interquartile_mean(rises)), 3)
    return found


if __name__ == "__main__":
    sys.exit(console.main(main))
