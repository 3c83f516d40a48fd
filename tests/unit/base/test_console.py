"""What a person sees of a stage: sentences, exit codes, lines of progress."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from mimo.settings.errors import Fault
from stages.base import console, paths


@pytest.fixture(autouse=True)
def _away(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("FORCE_COLOR", "TTY_COMPATIBLE", "TTY_INTERACTIVE"):  # would make rich see a terminal
        monkeypatch.delenv(name, raising=False)


def raising(fault: BaseException) -> int:
    def work() -> None:
        raise fault

    return console.main(work)


def test_success_is_silent(capsys: pytest.CaptureFixture[str]) -> None:
    done = []
    assert console.main(lambda: done.append(1)) == 0
    assert done == [1]
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize("kind", [Fault, console.StageError])
def test_a_fault_is_one_sentence(kind: type[Fault], capsys: pytest.CaptureFixture[str]) -> None:
    assert raising(kind("The cup is empty; fill it.")) == 1
    assert capsys.readouterr() == ("", "The cup is empty; fill it.\n")
    assert paths.log().read_text() == f"{Path.cwd()}: The cup is empty; fill it.\n"


def test_the_unknown_is_a_sentence_and_a_traceback_in_the_log(capsys: pytest.CaptureFixture[str]) -> None:
    assert raising(ZeroDivisionError("cut in no parts")) == 1
    out, err = capsys.readouterr()
    assert not out
    assert err == f"ZeroDivisionError: cut in no parts (see {paths.log()})\n"
    log = paths.log().read_text()
    assert log.startswith(f"{Path.cwd()}: Traceback")
    assert "in work" in log
    assert log.endswith("ZeroDivisionError: cut in no parts\n")


def test_an_interrupt_is_130(capsys: pytest.CaptureFixture[str]) -> None:
    assert raising(KeyboardInterrupt()) == 130
    out, err = capsys.readouterr()
    assert not out
    assert err.startswith("Stopped")
    assert err.count("\n") == 1
    assert not paths.log().exists()


def test_an_exit_passes_through() -> None:
    with pytest.raises(SystemExit):
        raising(SystemExit(2))


STAGE = """import sys
import time
from pathlib import Path
from stages.base import console

sys.stderr = open("said", "w", buffering=1)


def work():
    Path("begun").touch()
    time.sleep(60)


console.main(work)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="shells and signals as on Linux")
@pytest.mark.parametrize("shell", ["/bin/sh", "bash"])
def test_a_stage_ends_with_its_dvc(shell: str, tmp_path: Path) -> None:
    """Debian's sh stays between dvc and the stage, bash does not."""
    if not shutil.which(shell):
        pytest.skip(f"no {shell}")
    (tmp_path / "stage.py").write_text(STAGE)
    (tmp_path / "dvc.yaml").write_text(json.dumps({"stages": {"long": {"cmd": f"{sys.executable} stage.py"}}}))
    dvc = [sys.executable, "-m", "dvc"]
    root = str(Path(__file__).parents[3])
    own = os.environ | {"SHELL": str(shutil.which(shell)), "PYTHONPATH": root}
    subprocess.run([*dvc, "init", "-q", "--no-scm"], check=True)
    with subprocess.Popen([*dvc, "repro", "-q"], env=own) as repro:
        until(lambda: Path("begun").exists())
        repro.send_signal(signal.SIGKILL)
    until(lambda: Path("said").read_text(encoding="utf-8") == f"{console.STOPPED}\n")


def until(reached: Callable[[], bool], seconds: float = 40) -> None:
    end = time.monotonic() + seconds
    while not reached():
        assert time.monotonic() < end
        time.sleep(0.05)


class Clock:
    """time.monotonic under control."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    made = Clock()
    monkeypatch.setattr(time, "monotonic", made)
    return made


def test_progress_prints_lines_in_a_log(clock: Clock, capsys: pytest.CaptureFixture[str]) -> None:
    """A line after LINE_SECONDS, none before, and one at the end."""
    with console.Progress("Runs", 200, "steps") as progress:
        clock.now += console.LINE_SECONDS
        progress.update(10)
        assert not capsys.readouterr().err
        clock.now += 10
        progress.update(80, "1/4 runs done")
        assert capsys.readouterr().err == "Runs: 80/200 steps, 1/4 runs done, 2/s, 1 min 0 s left\n"
        progress.update(81)
        assert not capsys.readouterr().err
        clock.now += 10
        progress.update(200)
    assert capsys.readouterr() == ("", "Runs: 200/200 steps, 4/s, 50 s\n")


def test_progress_without_work_has_no_rate(clock: Clock, capsys: pytest.CaptureFixture[str]) -> None:
    with console.Progress("Runs", 0, "steps"):
        clock.now += 1
    assert capsys.readouterr().err == "Runs: 0/0 steps\n"


def test_progress_that_fails_prints_no_end(clock: Clock, capsys: pytest.CaptureFixture[str]) -> None:
    def work() -> None:
        with console.Progress("Runs", 2, "steps") as progress:
            progress.update(1)
            raise RuntimeError

    with pytest.raises(RuntimeError):
        work()
    assert not capsys.readouterr().err


def test_progress_is_a_bar_on_a_terminal(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("COLUMNS", "120")
    with console.Progress("Runs", 200, "steps") as progress:
        progress.update(50, "1/4 runs done")
    out, err = capsys.readouterr()
    assert not out
    assert "50/200" in err
    assert "1/4 runs done" in err
    assert "Runs: " not in err
