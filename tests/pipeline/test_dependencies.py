"""dvc.yaml names exactly the code that each stage's script imports: no edit goes unnoticed, none costs more."""

import ast
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[2]
STAGES = {
    name: stage.get("do", stage) for name, stage in yaml.safe_load((ROOT / "dvc.yaml").read_text())["stages"].items()
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
def test_code_dependencies_are_what_the_script_imports(name: str) -> None:
    stage = STAGES[name]
    script = stage["cmd"].split()[2]
    assert script.startswith("stages.")
    declared = {dep for dep in stage["deps"] if dep.endswith(".py")}
    assert declared == imported(script)


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
