"""stages.commands.preview --prepare-only: a small copy in its own folder; the project itself is only read."""

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from mimo.settings import params, studies
from mimo.settings.files import ParamsError
from stages.base import overlay
from stages.commands import preview

TOP = Path(__file__).parents[2]


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A little project in git: the real parameters, code both tracked and new, an ignored file, and results."""
    top = tmp_path / "project"
    texts = {
        **{str(name): (TOP / name).read_text() for pair in overlay.FILES.items() for name in pair},
        ".gitignore": "/data/\n.work/\n*.log\n",
        ".dvcignore": ".work\n",
        ".dvc/config": "[core]\n    remote = lab\n",
        "dvc.yaml": "stages: {}\n",
        "dvc.lock": "schema: '2.0'\n",
        "code/used.py": "one\n",
        "code/old/dropped.py": "two\n",
        "reports/index.html": "published\n",
        "data/runs/a.h5": "run\n",
        "noise.log": "noise\n",
    }
    for name, text in texts.items():
        (top / name).parent.mkdir(parents=True, exist_ok=True)
        (top / name).write_text(text)
    subprocess.run(["git", "init", "-q", "."], cwd=top, check=True)
    subprocess.run(["git", "add", "."], cwd=top, check=True)
    (top / "code" / "new.py").write_text("untracked\n")
    return top


def files(folder: Path) -> set[str]:
    names = {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}
    return {name for name in names if not name.startswith((".dvc/", ".git/"))}


def state(folder: Path) -> dict[str, tuple[int, str]]:
    return {
        path.relative_to(folder).as_posix(): (path.stat().st_mtime_ns, hashlib.sha256(path.read_bytes()).hexdigest())
        for path in folder.rglob("*")
        if path.is_file()
    }


OVERRIDES = overlay.FILES[Path("params.yaml")]
CODE = {".gitignore", ".dvcignore", "dvc.yaml", "code/used.py", "code/new.py", "code/old/dropped.py"} | {
    str(overrides) for overrides in overlay.FILES.values()
}
MADE = {preview.MARK, *map(str, overlay.FILES)}


def test_code_is_copied_results_are_not_and_the_project_stays_as_it_was(project, tmp_path):
    before = state(project)
    small = tmp_path / "small"
    preview.prepare(project, small)
    assert files(small) == CODE | MADE
    assert state(project) == before
    assert "remote" not in (small / ".dvc" / "config").read_text()


def laid(whole, over):
    """Keys of `over` in place of those of `whole`, section by section."""
    return whole | {key: laid(whole[key], own) if isinstance(own, dict) else own for key, own in over.items()}


def test_params_are_the_projects_with_the_overrides_laid_over_them(project, tmp_path):
    preview.prepare(project, tmp_path / "small")
    for file, beside in overlay.FILES.items():
        whole, small, overrides = (
            yaml.safe_load(path.read_text()) for path in (project / file, tmp_path / "small" / file, project / beside)
        )
        for name, value in whole.items():
            own = overrides.get(name, {})
            if overlay.EACH in own:
                each = own.pop(overlay.EACH)
                own = {key: laid(value[key], own.get(key, each)) for key in value}
            assert small[name] == (value | own if own else value)
    studies.load(params.load(tmp_path / "small/params.yaml"), tmp_path / "small" / studies.PATH)


def test_the_preview_keeps_every_cell_of_the_sweep():
    whole = yaml.safe_load((TOP / "params.yaml").read_text())["sweep"]
    small = overlay.merged(TOP, Path("params.yaml"))["sweep"]
    assert (small["conditions"], small["rewards"]) == (whole["conditions"], whole["rewards"])


def test_a_second_call_follows_the_code_and_keeps_the_previews_own_results(project, tmp_path):
    small = tmp_path / "small"
    preview.prepare(project, small)
    own = ["data/runs/mine.h5", "reports/index.html", "dvc.lock", "studies/dvc.lock", ".work/runs/x.h5", ".dvc/cache/y"]
    for name in own:
        (small / name).parent.mkdir(parents=True, exist_ok=True)
        (small / name).write_text("the preview's\n")
    (small / "code" / "stray.py").write_text("stray\n")
    (project / "code" / "old" / "dropped.py").unlink()
    (project / "code" / "used.py").write_text("changed\n")
    kept_time = (small / "code" / "new.py").stat().st_mtime_ns
    os.utime(project / "code" / "new.py")

    preview.prepare(project, small)

    assert (small / "code" / "used.py").read_text() == "changed\n"
    assert not (small / "code" / "old").exists()
    assert not (small / "code" / "stray.py").exists()
    assert {(small / name).read_text() for name in own} == {"the preview's\n"}
    assert (small / "code" / "new.py").stat().st_mtime_ns == kept_time


def test_a_folder_inside_the_project_is_not_copied_into_itself(project):
    small = project / "small"
    preview.prepare(project, small)
    preview.prepare(project, small)
    assert files(small) == CODE | MADE


def test_without_git_the_same_code_is_found(project, tmp_path, monkeypatch):
    (project / ".git").rename(tmp_path / "gone")
    monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(tmp_path))
    small = tmp_path / "small"
    preview.prepare(project, small)
    assert files(small) == CODE | MADE | {"noise.log"}


def test_a_folder_with_other_contents_is_never_touched(project, tmp_path):
    other = tmp_path / "thesis"
    other.mkdir()
    (other / "chapter.tex").write_text("years of work\n")
    with pytest.raises(preview.PreviewError, match="was not made by an earlier preview"):
        preview.prepare(project, other)
    assert files(other) == {"chapter.tex"}
    with pytest.raises(preview.PreviewError, match="was not made by an earlier preview"):
        preview.prepare(project, project)


@pytest.mark.parametrize(
    ("overrides", "sentence"),
    [
        ("agnet: {hidden: 8}", "params.preview.yaml: agnet is not in params.yaml; rename or remove it."),
        ("sweep: {sedes: 1}", "params.preview.yaml: sweep.sedes is not in params.yaml; rename or remove it."),
        ("sweep: 3", "params.preview.yaml: sweep must be a section of keys and values, as in params.yaml."),
        ("", "params.preview.yaml: the file must be a section of keys and values, as in params.yaml."),
        ("sweep: {seeds: 0}", "params.yaml+params.preview.yaml: sweep.seeds must be greater than 0; it is 0."),
    ],
)
def test_overrides_that_do_not_fit_are_refused_and_nothing_changes(overrides, sentence, project, tmp_path):
    small = tmp_path / "small"
    preview.prepare(project, small)
    before = state(small)
    (project / OVERRIDES).write_text(overrides)
    with pytest.raises((overlay.OverlayError, ParamsError)) as caught:
        preview.prepare(project, small)
    assert str(caught.value).endswith(sentence)
    assert {name: seen for name, seen in state(small).items() if name != preview.MARK} == {
        name: seen for name, seen in before.items() if name != preview.MARK
    }


def test_the_command_prepares_the_real_project(tmp_path):
    small = tmp_path / "small"
    command = [sys.executable, "-m", "stages.commands.preview", "--prepare-only", "--folder", str(small)]
    done = subprocess.run(command, cwd=TOP, capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, f"Prepared {small}.\n", "")
    assert (small / "mimo" / "settings" / "params.py").is_file()
    p = params.load(small / "params.yaml")
    assert p.sweep.seeds == 1
    assert {study.seeds for study in studies.load(p, small / studies.PATH).studies.values()} == {1}
    assert not (small / "dvc.lock").exists()
