"""What a `dvc repro` ran, and what it computed, that is, did not find in the store."""

import itertools
import json
from collections.abc import Set
from dataclasses import dataclass
from pathlib import Path

import yaml

from mimo.record import artifact
from mimo.settings.studies import PATH
from stages.base import paths, store
from tests.pipeline import quick
from tests.pipeline.project import ran


@dataclass(frozen=True)
class Found:
    """What a `dvc repro` did: names of stages, of artifacts and of runs, and what it said."""

    code: int
    said: str
    stages: Set[str]
    made: Set[str]
    runs: Set[str]


def read(top: Path, name: str) -> Found:
    """Of the `dvc repro` that tests/pipeline/quick.py did in the folder `name` of `top`."""
    project = top / name
    *said, code = (top / f"{name}.log").read_text().rstrip().splitlines()
    if code != "0":
        return Found(int(code), "\n".join(said), frozenset(), frozenset(), frozenset())
    new = _kept(project) - (_kept(top / quick.BASE) if name != quick.BASE else set())
    p = yaml.safe_load((project / "params.yaml").read_text())
    cells = [f"{c}-{r}" for c, r in itertools.product(p["sweep"]["conditions"], p["sweep"]["rewards"])]
    studies = list(yaml.safe_load((project / PATH).read_text())["studies"])
    groups = {"runs@": cells, "film@": p["sweep"]["conditions"]}
    groups |= {f"studies:{stage}@": studies for stage in ("vary", "variants", "compare")}
    stages = ran("\n".join(said))
    for group, members in groups.items():
        own = {stage for stage in stages if stage.startswith(group)}
        stages = stages - own | {group + name for name in _patterns({s.removeprefix(group) for s in own}, members)}
    return Found(0, "\n".join(said), stages, _made(project, new), _computed(project, new, cells))


def _kept(project: Path) -> set[Path]:
    """Everything in the store."""
    return {path.relative_to(project / paths.WORK) for path in (project / paths.WORK).glob("*/*.h5")}


def _made(project: Path, new: set[Path]) -> set[str]:
    """Names of the new artifacts that are no runs."""
    single = {
        artifact.read(project / path, schema).digest: name
        for name, path, schema in (
            ("frames", paths.FRAMES, store.FRAME),
            ("encoder", paths.ENCODER, store.ENCODER),
            ("trial", paths.TRIAL, store.ENCODER),
            ("scales", paths.SCALES, store.SCALE),
        )
    }
    others = {"rests": "resting policy", "effects": "effects"}
    others |= {f"{kind}s": f"variants' {kind}s" for kind in (store.FRAME, store.ENCODER, store.SCALE)}
    return {single.get(path.stem) or others[path.parent.name] for path in new if path.parent.name != "runs"}


def _computed(project: Path, new: set[Path], cells: list[str]) -> set[str]:
    """Names of the new runs."""
    listed = {
        run["digest"]: run
        for folder in (paths.VARIANT_MANIFESTS, paths.MANIFESTS)
        for path in (project / folder).rglob("*.json")
        if path.name != paths.variant_encoders("").name
        for run in json.loads(path.read_text())
    }
    runs = [listed[path.stem] for path in new if path.parent.name == "runs"]
    for run in runs:
        about = artifact.read(project / paths.WORK / "runs" / f"{run['digest']}.h5", store.RUN).about
        assert all(about[key] == run[key] for key in ("condition", "reward", "seed"))
    names = set()
    for variant, seed in {(run["variant"], run["seed"]) for run in runs}:
        own = {f"{r['condition']}-{r['reward']}" for r in runs if (r["variant"], r["seed"]) == (variant, seed)}
        suffix = f", seed {seed}" if seed else ""
        names |= {f"{variant}: {cell}{suffix}" for cell in own} if variant else {
            f"{cell}{suffix}" for cell in _patterns(own, cells)
        }  # fmt: skip
    return names


def _patterns(names: set[str], members: list[str]) -> set[str]:
    """`*` where all members are named, `*-<reward>` where all cells with a reward are, else each name."""
    if names == set(members) and names:
        return {"*"}
    found = set()
    for name in names:
        alike = {member for member in members if member.partition("-")[2] == name.partition("-")[2]}
        found.add(f"*-{name.partition('-')[2]}" if "-" in name and alike <= names else name)
    return found
