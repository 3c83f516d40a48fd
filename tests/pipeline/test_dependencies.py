"""dvc.yaml and studies/dvc.yaml name the rooms that each stage's script imports and the sections that it reads.

No edit goes unnoticed, and no room or section is named for nothing.
"""

import ast
import importlib
import operator
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml

from mimo.settings import params
from mimo.settings.params import Params
from mimo.settings.section import Section
from mimo.settings.studies import VARIED, Studies, Study
from stages.base import overlay, paths
from stages.commands import preview
from tests.pipeline.project import edit, study
from tests.pipeline.test_sections import TINY, TRIAL

ROOT = Path(__file__).parents[2]
PIPELINES = {"": "dvc.yaml", "studies:": "studies/dvc.yaml"}
STAGES = {
    start + name: stage.get("do", stage)
    for start, file in PIPELINES.items()
    for name, stage in yaml.safe_load((ROOT / file).read_text())["stages"].items()
}


def module_file(module: str) -> Path | None:
    stem = ROOT.joinpath(*module.split("."))
    return next((path for path in (stem.with_suffix(".py"), stem / "__init__.py") if path.is_file()), None)


def imported(module: str) -> set[str]:
    """Project files that importing `module` runs, found in the source; type checkers' imports left out."""
    found: set[str] = set()
    pending = [module]
    while pending:
        name = pending.pop()
        path = module_file(name)
        if path is None or str(path.relative_to(ROOT)) in found:
            continue
        found.add(str(path.relative_to(ROOT)))
        pending.append(name.rpartition(".")[0] or name)
        tree = ast.parse(path.read_text())
        for node in ast.walk(tree):
            if isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING":
                node.body = [ast.Pass()]
        for node in ast.walk(tree):
            if isinstance(node, ast.Import):
                pending += [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom) and node.module:
                pending += [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
    return found


@pytest.mark.parametrize("name", STAGES)
def test_code_dependencies_are_the_rooms_that_the_script_imports(name: str) -> None:
    stage = STAGES[name]
    script = stage["cmd"].split()[2]
    assert script.startswith("stages.")
    declared = {dep for dep in stage["deps"] if dep.startswith(("mimo/", "stages/"))}
    assert declared == {room(path) for path in imported(script)}


def room(path: str) -> str:
    """`mimo/world` for all below it; files at the top stand for themselves."""
    return "/".join(path.split("/")[:2])


@pytest.mark.parametrize("name", STAGES)
def test_every_stage_checks_all_parameters_first(name: str) -> None:
    script = STAGES[name]["cmd"].split()[2]
    source = (ROOT / f"{script.replace('.', '/')}.py").read_text()
    main = next(node for node in ast.parse(source).body if isinstance(node, ast.FunctionDef) and node.name == "main")
    calls = [ast.unparse(node.func) for node in ast.walk(main) if isinstance(node, ast.Call)]
    assert "params.load" in calls


def test_no_dependency_or_output_lies_in_the_work_folder() -> None:
    for stage in STAGES.values():
        for entry in [*stage["deps"], *stage.get("outs", []), *stage.get("metrics", [])]:
            assert not str(entry if isinstance(entry, str) else next(iter(entry))).startswith(".work")


SPEED = {"sweep.chunk", "studies.*.title"}  # read, but of no effect on any byte
SWEEPS = {"studies:effects", "train", "studies:vary"}  # these take --serial
SEEN = {"free": ["cais_surprise"], "noisy": ["mtl"]}
STUDY = "studies.*"  # where a study is, whichever


def leaves(kind: Any, above: str = "") -> set[str]:
    """Dotted keys of all values of a file of settings; lists, variants and alternatives are each one value."""
    found = set()
    for name, field in kind.model_fields.items():
        if f"{above}{name}" == "studies":
            found |= leaves(Study, f"{STUDY}.")
            continue
        section = isinstance(field.annotation, type) and issubclass(field.annotation, Section)
        found |= leaves(field.annotation, f"{above}{name}.") if section else {f"{above}{name}"}
    return found


LEAVES = leaves(Params) | leaves(Studies)


def below(key: str) -> set[str]:
    """The values of a section, or the one value."""
    return {leaf for leaf in LEAVES if f"{leaf}.".startswith(f"{key}.")}


def recorded(monkeypatch: pytest.MonkeyPatch) -> set[str]:
    """A set that takes up each value that is read from now on; but mimo.settings itself reads all, to check them."""
    read: set[str] = set()
    known: dict[int, tuple[Section, str]] = {}  # sections, by id, and where they are in params.yaml

    def watched(section: Section, name: str) -> Any:
        value = object.__getattribute__(section, name)
        itself, where = (section, "") if type(section) in (Params, Studies) else known.get(id(section), (None, ""))
        reader = sys._getframe(1).f_globals["__name__"]
        if type(section) is Studies and name == "studies":
            known.update({id(own): (own, STUDY) for own in value.values()})
            return value
        if itself is not section or reader.startswith("mimo.settings."):  # a variant, say, is part of a value
            pass
        elif type(section) is Study and name == "pairs":
            read.update({f"{STUDY}.cells", f"{STUDY}.variants"})
        elif type(section) is Study and name == "numbers":
            read.update({f"{STUDY}.seeds", f"{STUDY}.variants"})
        elif name.startswith("model_dump"):
            read.update(below(where) if where else leaves(type(section)))
        elif name in type(section).model_fields:
            key = f"{where}.{name}".lstrip(".")
            if isinstance(value, Section):
                known[id(value)] = (value, key)
            else:
                read.add(key)
        return value

    monkeypatch.setattr(Section, "__getattribute__", watched)
    return read


def run(name: str) -> None:
    """A stage in this process, without Ray; all cells, where it is for one."""
    module, *given = STAGES[name]["cmd"].split()[2:]
    main = importlib.import_module(module).main
    conditions = params.Conditions.model_fields if name == "film" else ()
    matrix = name == "runs"
    cells = conditions or (sorted(Path(given[0]).parent.glob("*.json")) if matrix else [])
    each = [[str(cell)] for cell in cells] or [[part.replace("${key}", "own") for part in given]]
    for arguments in [[*one, *(["--serial"] if name in SWEEPS else [])] for one in each]:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(sys, "argv", [module, *arguments])
            main()


@pytest.fixture(scope="module")
def read(tmp_path_factory: pytest.TempPathFactory) -> dict[str, set[str]]:
    """By stage, the values that it reads: all stages run, on a tiny scale.

    A variant sets all that variants may, to what it is anyway: what stages read on behalf of variants is then all that
    they might.
    """
    project = tmp_path_factory.mktemp("read") / "project"
    preview.prepare(ROOT, project)
    edit(project, *TINY.items())
    p = params.load(project / "params.yaml")
    same = {key: operator.attrgetter(key)(p) for section in VARIED for key in sorted(below(section))}
    edit(
        project,
        ("effects.alternatives", {"slack": {"world.rope_slack": 0.01}}),
        ("sweep.rewards", ["mtl", "cais_surprise"]),
        ("film.run", "cais_surprise/seed-000"),
        ("studies", {"own": study({"same": {"set": same, "cells": SEEN}, "other": {"set": {"collect.draw": 1}}})}),
    )
    (project / overlay.FILES[paths.PARAMS]).write_text(TRIAL)
    found = {}
    for name in STAGES:
        with pytest.MonkeyPatch.context() as patch:
            patch.chdir(project)
            patch.setattr(
                "stages.drawing.figures.files", lambda draw: {"svg": str(draw()).encode()}
            )  # no value is read after
            found[name] = recorded(patch)
            run(name)
    return found


@pytest.mark.parametrize("name", STAGES)
def test_params_are_the_sections_that_the_script_reads(name: str, read: dict[str, set[str]]) -> None:
    stage = STAGES[name]
    declared: set[str] = set()
    for given in stage.get("params", []):
        for file, sections in given.items() if isinstance(given, dict) else [("params.yaml", [given])]:
            kind = Studies if file.startswith("studies/") else Params
            named = {key.replace("${key}", "*") for key in sections}
            assert named <= {part(leaf) for leaf in leaves(kind)}, f"{file} has no such section"
            declared |= named
    if "params.yaml" in stage["deps"]:
        assert not declared, "the whole file is a dependency already"
        return
    assert {part(key) for key in read[name] - SPEED} == declared


def part(key: str) -> str:
    """What a stage names of a value's key: its section, or the key itself of a study."""
    return key if key.startswith(STUDY) else key.partition(".")[0]


@pytest.mark.parametrize("file", PIPELINES.values())
def test_the_published_lock_is_of_stages_that_there_are(file: str) -> None:
    """DVC itself never forgets a stage that is gone."""
    lock = (ROOT / file).with_suffix(".lock")
    locked = yaml.safe_load(lock.read_text())["stages"]
    assert {stage.partition("@")[0] for stage in locked} == set(yaml.safe_load((ROOT / file).read_text())["stages"])
