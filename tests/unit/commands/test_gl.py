"""stages.commands.gl on the real machine: it draws; where the drivers are hidden, one sentence says what to install."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from mimo.record import runtime
from stages.commands import gl

TOP = Path(__file__).parents[3]


@pytest.fixture
def no_driver(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder to be in where EGL finds no driver, as though none were installed: no variable counts as the reason."""
    monkeypatch.setattr(runtime, "CHOOSING", ("MUJOCO_GL", "PYOPENGL_PLATFORM"))
    monkeypatch.setenv("__EGL_VENDOR_LIBRARY_FILENAMES", "/nonexistent")
    monkeypatch.setenv("MUJOCO_GL", "egl")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run_gl(folder: Path, *arguments: str, **changes: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "stages.commands.gl", *arguments],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(TOP)} | changes,
        capture_output=True,
        text=True,
    )


def test_this_machine_draws_and_little_is_said(tmp_path):
    done = run_gl(tmp_path)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_without_a_driver_one_sentence_names_the_packages(no_driver, capsys):
    assert gl.main([]) == 1
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err == (
        "Pictures cannot be drawn without a screen (see .work/gl.log):"
        " as root run `apt-get install libegl1 libgl1-mesa-dri`.\n"
    )
    assert "EGL" in (no_driver / ".work" / "gl.log").read_text()


def test_another_platform_is_not_mended_by_installing_egl(tmp_path):
    done = run_gl(tmp_path, "--install", MUJOCO_GL="nonsense")
    assert done.returncode == 1
    assert done.stderr.endswith(": unset what chooses another way to draw, MUJOCO_GL=nonsense.\n")
    assert done.stderr.count("\n") == 1


def test_what_chooses_another_way_to_draw_is_named_before_anything_is_installed(fake_apt, monkeypatch, capsys):
    monkeypatch.setenv("PYOPENGL_PLATFORM", "osmesa")
    assert gl.main(["--install"]) == 1
    assert not (fake_apt / "asked").exists()
    assert capsys.readouterr().err.endswith(": unset what chooses another way to draw, PYOPENGL_PLATFORM=osmesa.\n")


@pytest.fixture
def fake_apt(no_driver: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An apt-get that notes what it is asked and exits as `code` says; run as though by root, with no driver."""
    program = no_driver / "bin" / "apt-get"
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\necho "$@" >> {no_driver}/asked\nexit $(cat {no_driver}/code)\n')
    program.chmod(0o755)
    (no_driver / "code").write_text("0")
    monkeypatch.setenv("PATH", str(program.parent), prepend=os.pathsep)
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    return no_driver


def test_install_asks_apt_once_and_admits_what_did_not_help(fake_apt, capsys):
    assert gl.main(["--install"]) == 1
    asked = (fake_apt / "asked").read_text().splitlines()
    assert asked == ["-q update", "-q install -y --no-install-recommends libegl1 libgl1-mesa-dri"]
    assert capsys.readouterr().err.endswith("could not be installed or did not help.\n")


def test_install_stops_where_apt_fails(fake_apt, capsys):
    (fake_apt / "code").write_text("100")
    assert gl.main(["--install"]) == 1
    assert (fake_apt / "asked").read_text() == "-q update\n"
    assert capsys.readouterr().err.count("\n") == 1


def test_nothing_is_installed_unasked_or_without_root(fake_apt, monkeypatch):
    assert gl.main([]) == 1
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    assert gl.main(["--install"]) == 1
    assert not (fake_apt / "asked").exists()


def test_a_machine_that_draws_installs_nothing(fake_apt, monkeypatch):
    monkeypatch.delenv("__EGL_VENDOR_LIBRARY_FILENAMES")
    assert gl.main(["--install"]) == 0
    assert not (fake_apt / "asked").exists()
