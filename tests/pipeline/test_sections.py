"""Each section of params.yaml, edited: exactly which stages run again, and which runs are computed anew.

EDITS says what is expected, docs/what-reruns.md shows it (`python -m tests.pipeline.test_sections` writes it), and a
`dvc repro` shows for each edit, in a tiny pipeline of its own, that it is so. As plain `dvc repro` all these would take
a quarter of an hour, most of it for importing torch, so DVC forks its stages from one process: tests/pipeline/quick.py.
What a plain one does for a variant, a seed and a reward: test_repro.py, test_published.py, test_sharing.py.
"""

import json
import shutil
from collections.abc import Iterable, Iterator, Set
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import yaml

from mimo.settings.params import Params
from mimo.settings.studies import Studies
from stages.base import overlay, paths
from stages.commands import preview
from tests.pipeline import quick, reruns
from tests.pipeline.project import edit, python, study

ROOT = Path(__file__).parents[2]
TABLE = ROOT / "docs/what-reruns.md"
WRITE = "python -m tests.pipeline.test_sections"
STUDIES = {
    "gain": study({"eager": {"set": {"rewards.gain": 2.0}, "cells": {"free": ["cais"]}}}),
    "mass": study({"heavy": {"set": {"world.mobile_mass": 1.5}, "cells": {"noisy": ["mtl"]}}}),
    "draw": study({"other": {"set": {"collect.draw": 1}, "cells": {"free": ["mtl"]}}}),
}
TINY = {
    "protocol.baseline_steps": 2,
    "protocol.attached_steps": 2,
    "protocol.extinction_steps": 2,
    "collect.steps": 5,
    "encoder.widths": [2, 4, 4, 4],
    "encoder.pairs": 4,
    "encoder.iterations": 2,
    "calibrate.steps": 4,
    "effects.steps": 40,
    "effects.alternatives": {},
    "sweep.rewards": ["mtl", "cais"],
    "studies": STUDIES,
}
TRIAL = "encoder: {iterations: 1}\n"  # in place of params.preview.yaml, which the stage `trial` reads

# Stages in the order of dvc.yaml and studies/dvc.yaml, those of cells and studies by patterns.
STAGES = [
    "collect", "encoder", "trial", "calibrate", "train", "runs@*", "analyse", "claims", "explore", "figures", "film@*",
    "catalogue", "report", "studies:effects", "studies:vary@*", "studies:variants@*", "studies:compare@*",
    "studies:catalogue", "studies:page",
]  # fmt: skip
ALL = frozenset(STAGES)
PAGES = frozenset({"report", "studies:page"})
OF_RUNS = PAGES | {"train", "runs@*", "analyse", "claims", "explore", "figures", "film@*", "catalogue"}
OF_VARIANTS = frozenset({
    "studies:vary@*", "studies:variants@*", "studies:compare@*", "studies:catalogue", "studies:page"
})  # fmt: skip
OF_CAIS = OF_RUNS - {"runs@*"} | OF_VARIANTS - {"studies:variants@*"} | {"runs@*-cais", "studies:variants@gain"}
AFTER = frozenset({"studies:vary@*", "studies:compare@*"})  # of the paper's runs, and of its results
SETTLED = OF_RUNS | OF_VARIANTS
OTHERS = frozenset({"collect", "calibrate", "studies:effects"})  # which read more of a section
OF_SCIENCE = PAGES | {"analyse", "claims", "explore", "figures", "film@*", "studies:compare@*"}
OF_VISION = ALL - {
    "runs@*", "analyse", "claims", "explore", "catalogue", "report", "studies:variants@*", "studies:catalogue",
    "studies:page",
}  # fmt: skip
# What is computed before any run, and the runs: the sweep's by patterns, a variant's after its name.
FRAMES = frozenset({"frames", "variants' frames"})
SCALES = frozenset({"scales", "variants' scales"})
REST = "resting policy"
BEFORE = FRAMES | SCALES | {"encoder", "variants' encoders", "trial", "effects", REST}
EAGER, HEAVY, OTHER = "gain/eager: free-cais", "mass/heavy: noisy-mtl", "draw/other: free-mtl"
RUNS = frozenset({"*", EAGER, HEAVY, OTHER})
NONE: Set[str] = frozenset()
COMMENT = "a comment"


@dataclass(frozen=True)
class Edit:
    """A key of params.yaml or studies/params.yaml gets a value, or a file of code a COMMENT.

    Which stages run, and what is computed, that is, not found in the store.
    """

    key: str
    value: Any
    stages: Set[str]
    made: Set[str] = NONE
    runs: Set[str] = NONE

    @property
    def name(self) -> str:
        """Of the folder where it is made."""
        return self.key.replace("/", ".")


def of_study(name: str) -> Set[str]:
    """What a study's own settings run."""
    return {
        *(f"studies:{stage}@{name}" for stage in ("vary", "variants", "compare")),
        "studies:catalogue",
        "studies:page",
    }


EDITS = (
    Edit("seed", 1, ALL, BEFORE, RUNS),
    Edit("protocol.attached_steps", 3, SETTLED | OTHERS, NONE, RUNS),
    # The encoder has seen both conditions, so each decides all runs.
    Edit("conditions.noisy.force", 20.0, ALL, BEFORE, RUNS),
    Edit("world.mobile_mass", 0.05, ALL, BEFORE, RUNS),
    Edit("collect.held_out", 0.4, ALL, BEFORE - FRAMES, RUNS),
    Edit("encoder.latent_sd", 0.2, ALL - {"collect"}, BEFORE - FRAMES, RUNS),
    Edit("agent.gamma", 0.2, SETTLED | OTHERS, NONE, RUNS),
    Edit("outcomes.quantiles", 5, OF_CAIS | {"calibrate", "studies:effects"}, SCALES | {"effects"}, {"*-cais", EAGER}),
    Edit("calibrate.steps", 5, SETTLED | {"calibrate"}, SCALES | {REST}, RUNS),
    Edit("rewards.cais.pays", "taken", OF_CAIS | {"calibrate"}, SCALES, {"*-cais", EAGER}),
    Edit("sweep.conditions", ["free"], OF_RUNS - {"runs@*", "film@*"} | AFTER),
    Edit(
        "sweep.rewards",
        ["mtl", "cais", "rtl"],
        OF_RUNS - {"runs@*", "film@*"} | AFTER | {"runs@*-rtl"},
        NONE,
        {"*-rtl"},
    ),
    Edit("sweep.seeds", 2, OF_RUNS - {"film@*"} | AFTER, NONE, {"*, seed 1"}),
    Edit("sweep.chunk", 2, {"train", "analyse", "claims", "explore"} | PAGES),
    Edit("film.steps", 2, {"film@*"} | PAGES),
    Edit("effects.steps", 41, {"studies:effects", "studies:page"}, {"effects"}),
    Edit(
        "studies.gain.variants.eager.set",
        {"rewards.gain": 3.0},
        of_study("gain"),
        NONE,
        {EAGER},
    ),
    Edit(
        "studies.mass.variants.heavy.set",
        {"world.mobile_mass": 2.0},
        of_study("mass"),
        {"variants' scales", REST},
        {HEAVY},
    ),
    Edit(
        "studies.draw.variants.other.set",
        {"collect.draw": 2},
        of_study("draw"),
        {"variants' frames", "variants' encoders", "variants' scales", REST},
        {OTHER},
    ),
    Edit("studies.gain.measures", ["limb"], {"studies:compare@gain", "studies:page"}),
    Edit("studies.gain.asks", "!", {"studies:page"}),
    Edit("mimo/vision/encoder.py", COMMENT, OF_VISION),
    Edit("mimo/science/claims.py", COMMENT, OF_SCIENCE),
    Edit("stages/drawing/style.py", COMMENT, {"figures", "film@*"} | PAGES),
)


pytestmark = pytest.mark.timeout(1200)


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, reruns.Found]]:
    """What came of each edit by its name."""
    top = tmp_path_factory.mktemp("sections")
    base = top / quick.BASE
    preview.prepare(ROOT, base)
    edit(base, *TINY.items())
    (base / overlay.FILES[paths.PARAMS]).write_text(TRIAL)
    edits = {each.name: each for each in EDITS}
    (top / "edits.json").write_text(json.dumps({name: {each.key: each.value} for name, each in edits.items()}))
    done = python(base, "tests.pipeline.quick", str(top), plain=True)
    assert done.returncode == 0, done.stderr
    first = reruns.read(top, quick.BASE)
    assert (first.code, first.stages, first.made, first.runs) == (0, ALL, BEFORE, RUNS), first.said
    yield {name: reruns.read(top, name) for name in edits}
    shutil.rmtree(top)


def test_every_section_is_edited() -> None:
    edited = {each.key.split(".")[0] for each in EDITS if each.value is not COMMENT}
    assert edited == {*Params.model_fields, *Studies.model_fields}


@pytest.mark.parametrize("each", EDITS, ids=lambda each: each.key)
def test_an_edit_runs_only_what_it_affects(found: dict[str, reruns.Found], each: Edit) -> None:
    assert found[each.name].code == 0, found[each.name].said
    assert found[each.name].stages == each.stages
    assert found[each.name].made == each.made
    assert found[each.name].runs == each.runs


def test_the_table_in_the_docs_says_so() -> None:
    assert TABLE.read_text() == table(), f"{TABLE.name} says other than EDITS; write it with `{WRITE}`"


def table() -> str:
    """What docs/what-reruns.md holds."""
    rows = (
        (code([_edited(each)]), _stages(each.stages), _all_but(each.made, BEFORE), _runs(each.runs)) for each in EDITS
    )
    return TEXT.format(write=WRITE, rows="\n".join(f"| {' | '.join(row)} |" for row in rows))


def code(names: Iterable[str]) -> str:
    return ", ".join(f"`{name}`" for name in names)


TEXT = """\
# What an edit runs again

One value of params.yaml or studies/params.yaml is edited, or a comment is added to a file of code, then both pipelines
run (`dvc repro --all-pipelines`; `dvc repro` alone runs the paper's). A stage depends on whole sections and on whole
rooms of the code, so it often runs without need. That costs seconds, since a stage that runs need not compute: what it
finds in the run store, under the digest of all that it depends on, it takes from there. The last two columns have what
it does not find: frames, encoder, `trial` (which `make verify` repeats), effects, the record of the resting policy that
scales are measured on, scales, and what variants have of their own of these; and runs.

The table is of a tiny sweep: free and noisy, MTL and CAIS, one seed each, and three studies of one variant each:
`gain/eager` has another `rewards.gain` in the cell free-cais, `mass/heavy` another `world.mobile_mass` in noisy-mtl,
`draw/other` an encoder of its own in free-mtl. tests/pipeline/test_sections.py makes each edit and holds its row to
what then happens; `{write}` writes this file.

| edited | stages that run | computed, runs apart | runs computed |
|---|---|---|---|
{rows}

`runs@*` stands for all cells of the sweep, `runs@*-cais` for those with CAIS; likewise `*` and `*-cais` for runs.
`film@*` stands for both conditions; the films are of CAIS, seed 0. `studies:` begins the stages of studies/dvc.yaml, of
which `vary@*`, `variants@*` and `compare@*` stand for all studies'.
Every edit of params.yaml runs `report` and `studies:page`, which print all of it or say what it is. A value set back
comes from DVC's cache, and nothing is computed.
"""


def _edited(each: Edit) -> str:
    if each.value is COMMENT:
        return f"{each.key}: {COMMENT}"
    value = yaml.safe_dump(each.value, default_flow_style=True, width=1000).removesuffix("...\n").strip()
    return f"{each.key}: {value}" if len(value) < 40 else each.key


def _stages(names: Set[str]) -> str:
    missing = [name for name in STAGES if name not in names]
    if len(missing) < 5:
        return f"all but {code(missing)}" if missing else "all"
    return code(sorted(names, key=lambda name: STAGES.index(name if name in ALL else f"{name.split('@')[0]}@*")))


def _all_but(names: Set[str], known: Set[str]) -> str:
    missing = ", ".join(sorted(known - names))
    if len(known - names) < 3:
        return f"all but {missing}" if missing else "all"
    return ", ".join(sorted(names)) or "none"


def _runs(names: Set[str]) -> str:
    return "all" if names == RUNS else code(sorted(names)) or "none"


if __name__ == "__main__":
    TABLE.parent.mkdir(exist_ok=True)
    TABLE.write_text(table())
