"""What `make share` and `make fetch` say before anything travels; tests/pipeline/test_sharing.py has two labs."""

import sys
from pathlib import Path

import pytest

from stages.base import console, dvc
from stages.commands import share


@pytest.mark.parametrize(("what", "made"), [("push", "make share"), ("fetch", "make fetch")])
def test_without_a_remote_it_says_to_name_one(
    what: str, made: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert dvc.run(["init", "--no-scm", "--quiet"], tmp_path) == 0
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["share", what])
    with pytest.raises(console.StageError, match=rf"^No remote is known yet; .* {made} REMOTE=s3://bucket/folder\.$"):
        share.main()
