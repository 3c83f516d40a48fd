"""`python -m stages.compare STUDY`: curves of every variant, its effects in every seed, and its verdicts or its map.

data/studies/STUDY.h5 has the curves, reports/studies/STUDY.json the numbers, reports/studies/explore/STUDY.json what
the page's explorer draws. How effects are summed up and shown is the page's affair.
"""

import argparse
import operator
import sys
from typing import Any

import numpy as np

from mimo.record import artifact, identity
from mimo.science import analysis, claims, judgement, measures, space, summary
from mimo.settings import params, studies
from stages.base import console, numbers, paths, provenance, store
from stages.sweep import curves, encoders

EXPLORED = ("reward", "q_move", "move_probability")  # as in stages.explore, by groups of joints


def main() -> None:
    """Read every run of every variant of the study, write what comes of them."""
    parser = argparse.ArgumentParser(prog="python -m stages.compare")
    parser.add_argument("study", help="a name in studies/params.yaml")
    name = parser.parse_args().study
    p = params.load()
    study = studies.study(p, name)
    check(name, study)
    windows = analysis.windows(curves.phases(p))
    total = study.seeds * sum(len(study.pairs(own)) for own in study.variants)
    with console.Progress(study.title, total, "runs") as progress:
        found = {
            own: curves.read(
                params.changed(p, variant.set), study.pairs(own), study.numbers(), progress, f"{name}/{own}"
            )
            for own, variant in study.variants.items()
        }
    datasets = curves.ends(windows)
    for own, stacked in found.items():
        datasets |= curves.datasets(stacked, f"{own}/")
    about = curves.about(p, study.seeds) | ({"first": study.first} if study.first else {})
    digest = identity.Digest({"runs": {own: stacked.runs for own, stacked in found.items()}, "about": about})
    artifact.write(paths.study(name), store.STUDY, digest, datasets, about)
    provenance.note(store.STUDY, digest)
    held, published = artifact.read(paths.study(name), store.STUDY), artifact.read(paths.RESULTS, store.RESULTS)
    made: dict[str, Any] = {
        "results": held.content,
        "published": published.content,
        "level": judgement.LEVEL,
        "variants": {
            own: {
                "set": variant.set,
                "published": {key: operator.attrgetter(key)(p) for key in variant.set},
                "seeds": study.seeds,
                "cells": _effects(curves.curves_of(held, f"{own}/"), windows),
                "probe": _probe(f"{name}/{own}"),
                "claims": [] if study.space else curves.judged(held, f"{own}/"),
            }
            for own, variant in study.variants.items()
        },
        "paper": _effects(curves.curves_of(published), windows),
    }
    if study.space:
        points = [curves.curves_of(held, f"{own}/") for own in study.variants]
        asked = _space(p, study)
        made["space"] = space.mapped(points, curves.curves_of(published), windows, asked, claims.CLAIMS, study.measures)
    numbers.write(made, paths.STUDIES_NUMBERS / f"{name}.json")
    explored = [] if study.space else list(study.variants)  # a map's curves are too many for a page
    numbers.write(_explored(p, study, held, explored), paths.STUDIES_EXPLORE / f"{name}.json")


def check(name: str, study: studies.Study) -> None:
    """That what the study asks to be shown is measured, which its settings alone cannot tell.

    Raises:
        console.StageError: it is not.
    """
    if unknown := [measure for measure in study.measures if measure not in measures.MEASURES]:
        raise console.StageError(
            f"{studies.PATH}: studies.{name}.measures has {', '.join(map(repr, unknown))}; "
            f"known are {', '.join(measures.MEASURES)}."
        )
    if study.space and not space.complete(claims.CLAIMS, study.pairs(next(iter(study.variants)))):
        raise console.StageError(
            f"{studies.PATH}: studies.{name}.cells complete no claim, so that there is no map of any."
        )


def _space(p: params.Params, study: studies.Study) -> space.Space:
    """Where the study's variants, and the published params, are in it."""
    ranges = study.space
    published = [own.place(operator.attrgetter(key)(p)) for key, own in ranges.items()]
    points = [[own.share(variant.set[key]) for key, own in ranges.items()] for variant in study.variants.values()]
    choices = {place: [own.share(value) for value in own.of] for place, own in enumerate(ranges.values()) if own.of}
    return space.Space(np.array(points), choices, None if None in published else np.array(published, np.float64))


def _effects(cells: curves.Cells, windows: dict[str, slice]) -> dict[str, dict[str, list[float]]]:
    """By `condition/reward`, then by measure: the effect in each seed."""
    return {"/".join(pair): measures.effects(cell, windows) for pair, cell in cells.items()}


def _probe(variant: str) -> dict[str, float]:
    """How well the variant's own encoder sees the mobile; nothing where it is the paper's."""
    path = paths.variant_encoder(variant)
    return encoders.measures(artifact.read(path, store.ENCODER)) if path.exists() else {}


def _explored(p: params.Params, study: studies.Study, held: artifact.Artifact, variants: list[str]) -> dict[str, Any]:
    """As reports/explore.json has the paper's runs; in place of joints are the attached limb and the others."""
    phases = curves.phases(p)
    width = summary.window(phases)
    steps, _ = summary.blocks(np.zeros(phases["extinction"].stop), phases, width)

    def packed(cell: dict[str, np.ndarray], curve: str) -> dict[str, Any]:
        groups = [summary.blocks(cell[f"{curve}/{group}"], phases, width)[1] for group in analysis.GROUPS]
        return numbers.packed(np.stack(groups, axis=1))

    cells = {
        f"{own}/{condition}/{reward}": {curve: packed(cell, curve) for curve in EXPLORED}
        for own in variants
        for (condition, reward), cell in curves.curves_of(held, f"{own}/").items()
    }
    return {
        "block": width,
        "levels": numbers.LEVELS,
        "seeds": study.seeds,
        "first": study.first,
        "steps": steps.tolist(),
        "phases": {name: [phase.start + 1, phase.stop] for name, phase in phases.items()},
        "joints": ["attached limb", "other limbs"],
        "attached": [True, False],
        "cells": cells,
    }


if __name__ == "__main__":
    sys.exit(console.main(main))
