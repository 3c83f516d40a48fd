"""`make watch`: what others on this clone do, and nothing of those that are gone."""

import json
import os
import platform
import subprocess
import sys
import time
from pathlib import Path

import pytest

from stages.base import console, paths, watched
from stages.commands import watch


@pytest.fixture(autouse=True)
def _away(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


WORK = """
import sys
from stages.base import console, watched
with watched.at_work(), console.Progress("Runs", 350, "agent steps") as progress:
    print("begun", flush=True)
    for line in sys.stdin:
        watched._last[0] = -9.0  # a second has passed
        progress.update(35, "1/4 runs done, 2 in flight")
        print("said", flush=True)
"""


def test_another_process_says_how_far_it_is_until_it_ends(capsys: pytest.CaptureFixture[str]) -> None:
    environment = os.environ | {"PYTHONPATH": str(Path(console.__file__).parents[2]), "DVC_STAGE": "dvc.yaml:train"}
    with subprocess.Popen(
        [sys.executable, "-c", WORK], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment
    ) as worker:
        assert worker.stdin is not None
        assert worker.stdout is not None
        assert worker.stdout.readline() == "begun\n"
        assert [word.text for word in watched.words()] == ["Runs: 0/350 agent steps"]
        worker.stdin.write("go on\n")
        worker.stdin.flush()
        assert worker.stdout.readline() == "said\n"
        assert watch.main(["--once"]) == 0
        said = capsys.readouterr().out.splitlines()
        assert said[0].startswith(f"train in {Path.cwd()}, process {worker.pid} on ")
        assert said[1].startswith("  Runs: 35/350 agent steps, 1/4 runs done, 2 in flight, ")
        assert " left" in said[1]
        worker.kill()
    assert list(watch.lines()) == ["No stage is at work (by .work)."]
    assert not list(paths.progress().glob("*.json"))


def test_a_stage_without_a_bar_is_at_work_too_and_says_no_more_when_it_ends() -> None:
    seen: list[str] = []

    def work() -> None:
        seen.extend(word.text for word in watched.words())
        with console.Progress("Frames", 10, "agent steps") as progress:
            progress.update(3)
        seen.extend(word.text for word in watched.words())

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(console, "STARTER", None)
        assert console.main(work) == 0
    assert seen == ["at work", "at work"]
    assert not list(watched.words())


def test_of_a_process_whose_number_another_has_nothing_is_said() -> None:
    word = {"stage": "train", "folder": "/x", "text": "Runs", "at": 5.0, "node": platform.node(), "pid": os.getpid()}
    paths.progress().mkdir(parents=True)
    (paths.progress() / "reused.json").write_text(json.dumps(word))
    (paths.progress() / "old.json").write_text(json.dumps(word | {"node": "gone"}))
    assert not list(watched.words())


def test_another_node_is_shown_and_its_silence_told() -> None:
    word = {"stage": "train", "folder": "/x", "text": "Runs", "at": time.time() - 500, "node": "other", "pid": 7}
    paths.progress().mkdir(parents=True)
    (paths.progress() / "other-7.json").write_text(json.dumps(word))
    (paths.progress() / "broken.json").write_text("{")
    assert list(watch.lines()) == ["train in /x, process 7 on other (silent for 500 s)", "  Runs"]


def test_the_last_fault_is_shown() -> None:
    paths.log().parent.mkdir(parents=True)
    paths.log().write_text("Traceback\n  somewhere\nValueError: no such joint\n")
    assert list(watch.lines())[-1].endswith(": ValueError: no such joint (see .work/error.log)")


def test_a_store_that_takes_no_file_stops_no_work(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MIMO_STORE", "/proc/1/none")
    with watched.at_work(), console.Progress("Frames", 10, "agent steps") as progress:
        progress.update(3)
