"""stages.commands.gl on the real machine: it draws; where the drivers are hidden, one sentence says what to install."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from stages.commands import gl

TOP = Path(__file__).parents[3]
NO_DRIVER = {"__EGL_VENDOR_LIBRARY_FILENAMES": "/nonexistent", "MUJOCO_GL": "egl"}


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


def test_without_a_driver_one_sentence_names_the_packages(tmp_path):
    done = run_gl(tmp_path, **NO_DRIVER)
    assert done.returncode == 1
    assert done.stdout == ""
    assert done.stderr == (
        "Pictures cannot be drawn without a screen (see .work/gl.log):"
        " as root run `apt-get install libegl1 libgl1-mesa-dri`.\n"
    )
    assert "EGL" in (tmp_path / ".work" / "gl.log").read_text()


def test_another_platform_is_not_mended_by_installing_egl(tmp_path):
    done = run_gl(tmp_path, "--install", MUJOCO_GL="nonsense")
    assert done.returncode == 1
    assert done.stderr.endswith(": unset MUJOCO_GL (it is 'nonsense') to use EGL.\n")
    assert done.stderr.count("\n") == 1


@pytest.fixture
def fake_apt(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An apt-get that notes what it is asked and exits as `code` says; run as though by root, with no driver."""
    program = tmp_path / "bin" / "apt-get"
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\necho "$@" >> {tmp_path}/asked\nexit $(cat {tmp_path}/code)\n')
    program.chmod(0o755)
    (tmp_path / "code").write_text("0")
    monkeypatch.setenv("PATH", str(program.parent), prepend=os.pathsep)
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    monkeypatch.chdir(tmp_path)
    for name, value in NO_DRIVER.items():
        monkeypatch.setenv(name, value)
    return tmp_path


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
