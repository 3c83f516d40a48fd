"""Two labs and an S3-compatible server: what one has computed the other need not. By a folder: test_published.py."""

import logging
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from urllib.request import urlopen

import boto3  # type: ignore[import-untyped]
import pytest
from moto.server import ThreadedMotoServer

from tests.pipeline.project import digests, done, edit, python, ran, repro, stored

BUCKET = "lab"
ONE_BY_ONE = "[core]\n    remote = shared\n['remote \"shared\"']\n    url = {}\n    jobs = 1\n"

pytestmark = pytest.mark.timeout(900)


@pytest.fixture
def s3(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Any]:
    """A client of a server on loopback, which has BUCKET; processes find it by their environment."""
    logging.getLogger("werkzeug").setLevel(logging.ERROR)  # a line for each request
    server = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    (none := tmp_path / "aws").touch()  # the user's own settings are not for this server
    for name, value in {
        "AWS_ENDPOINT_URL": f"http://{host}:{port}",
        "AWS_ACCESS_KEY_ID": "lab",
        "AWS_SECRET_ACCESS_KEY": "lab",
        "AWS_DEFAULT_REGION": "us-east-1",
        "AWS_CONFIG_FILE": str(none),
        "AWS_SHARED_CREDENTIALS_FILE": str(none),
    }.items():
        monkeypatch.setenv(name, value)
    client = boto3.client("s3")
    client.create_bucket(Bucket=BUCKET)
    yield client
    urlopen(f"http://{host}:{port}/moto-api/reset", b"").close()  # a server's buckets outlive it
    server.stop()


def share(project: Path, *arguments: str) -> None:
    said = python(project, "stages.commands.share", *arguments)
    assert said.returncode == 0, said.stdout + said.stderr


def test_what_one_lab_computes_the_other_gets(project: Path, clone: Path, tmp_path: Path, s3: Any) -> None:
    remote = f"s3://{BUCKET}/results"
    share(project, "push", remote)

    share(clone, "fetch", remote)
    assert "Running stage" not in repro(clone)
    assert digests(clone, "data", "reports") == digests(project, "data", "reports")
    before = digests(clone, "data/runs", "data/variants")
    edit(clone, ("rewards.cais.pays", "taken"))
    refused = python(clone, "stages.commands.share", "push")
    assert refused.returncode == 1
    assert refused.stderr.splitlines()[-1].startswith("dvc.lock does not fit the files here")
    said = repro(clone)
    assert {name for name in ran(said) if "@" in name} == {
        "runs@free-cais", "runs@noisy-cais", "studies:vary@own", "studies:vary@drawn", "studies:variants@own",
        "studies:compare@own", "studies:compare@drawn", "film@free", "film@noisy",
    }  # fmt: skip
    assert "4 runs, 2 of them in the store." in said  # those came with data/
    assert "3 runs, 2 of them in the store." in said
    assert "1 runs, 1 of them in the store." in said
    after = digests(clone, "data/runs", "data/variants")
    assert {name for name in after if after[name] != before[name]} == {
        *(f"data/runs/{condition}/cais/seed-000.h5" for condition in ("free", "noisy")),
        "data/variants/own/greedy/free/cais/seed-000.h5",
    }
    done(clone, "git", "commit", "-qam", "CAIS pays for the action taken")
    share(clone, "push")

    # By git: the lab that was first takes over the commit.
    computed = stored(project)
    done(project, "git", "pull", "-q", "--ff-only", str(clone), "HEAD")
    share(project, "fetch")
    assert "Running stage" not in repro(project)
    assert digests(project, "data", "reports") == digests(clone, "data", "reports")
    assert stored(project) == computed

    # By the run cache: a third, at the first commit, makes the same edit.
    third = tmp_path / "third"
    done(tmp_path, "git", "clone", "-q", str(clone), str(third))
    done(third, "git", "checkout", "-q", "HEAD~1")
    share(third, "fetch", remote)
    edit(third, ("rewards.cais.pays", "taken"))
    said = done(third, "dvc", "repro", "--pull", "runs", "studies/dvc.yaml:variants")
    assert "Running stage" not in said
    assert "is cached - skipping run" in said
    assert digests(third, "data/runs", "data/variants") == after
    assert not stored(third)


def test_an_interrupted_push_or_fetch_is_repeated(project: Path, clone: Path, s3: Any) -> None:
    """Each is killed after some files, one after the other."""
    remote = f"s3://{BUCKET}/results"
    for lab in (project, clone):
        (lab / ".dvc/config.local").write_text(ONE_BY_ONE.format(remote))

    def sent() -> int:
        return int(s3.list_objects_v2(Bucket=BUCKET)["KeyCount"])

    def had() -> int:
        return sum(path.is_file() for path in (clone / ".dvc/cache").rglob("*"))

    killed(project, "push", lambda: sent() > 2)
    partly = sent()
    share(project, "push")
    assert 2 < partly < sent()
    killed(clone, "fetch", lambda: had() > 2)
    partly = had()
    share(clone, "fetch")
    assert 2 < partly < had()
    assert "Running stage" not in repro(clone)
    assert digests(clone, "data", "reports") == digests(project, "data", "reports")


def killed(project: Path, what: str, reached: Callable[[], bool]) -> None:
    """`make share` or `make fetch`, and all that it started, by SIGKILL."""
    with subprocess.Popen(
        [sys.executable, "-m", "stages.commands.share", what], cwd=project, start_new_session=True
    ) as process:
        while not reached():
            assert process.poll() is None
            time.sleep(0.005)
        os.killpg(process.pid, signal.SIGKILL)
