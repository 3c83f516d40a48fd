"""`make share`, `make fetch`: results to a DVC remote, and from it.

What travels is what dvc.lock lists, and DVC's run cache: the results by what they were made from. Code, params.yaml,
dvc.lock and reports/ travel by git.
"""

import sys
from pathlib import Path

from dvc.config import Config

from stages.base import command, console, dvc

REMOTE = "shared"
MADE = {"push": "make share", "fetch": "make fetch"}


def main() -> None:
    """Push or fetch, as the command line says."""
    parser = command.parser(
        "share",
        __doc__,
        "make share REMOTE=s3://bucket/folder",
        "make fetch",
        "python -m stages.commands.share push /mnt/shared",
    )
    parser.add_argument("what", choices=["push", "fetch"])
    parser.add_argument(
        "remote", nargs="?", help="folder or URL (s3://..., ssh://...), kept in .dvc/config.local; default: DVC's own"
    )
    given = parser.parse_args()
    if given.remote:
        _dvc("remote", "add", "--local", "--force", "--default", REMOTE, given.remote)
    elif not Config.from_cwd()["core"].get("remote"):
        raise console.StageError(
            f"No remote is known yet; name one, which is then kept: {MADE[given.what]} REMOTE=s3://bucket/folder."
        )
    if given.what == "push":
        push()
    else:
        fetch()


def push() -> None:
    """Send this tree's results.

    Raises:
        console.StageError: dvc.lock is not what the tree gives, so others could not tell what they get; or DVC fails.
    """
    for pipeline, remedy in _pipelines().items():
        if dvc.run(["status", "--quiet", pipeline]):
            raise console.StageError(
                f"dvc.lock does not fit the files here (`dvc status {pipeline}` says where); run {remedy} first."
            )
    _dvc("push", "--run-cache", *_pipelines())  # of the run cache's results only those that dvc.lock lists


def fetch() -> None:
    """Get the results that dvc.lock lists, and the run cache, by which `dvc repro --pull` finds others' results."""
    _dvc("fetch", "--run-cache", *_pipelines())
    _dvc("checkout", *_pipelines())


def _pipelines() -> dict[str, str]:
    """What makes anew what each pipeline lists; the studies' only where they have been made."""
    found = {"dvc.yaml": "`dvc repro`"}
    return found | ({"studies/dvc.yaml": "`make studies`"} if Path("studies/dvc.lock").exists() else {})


def _dvc(*arguments: str) -> None:
    if dvc.run([*arguments]):
        raise console.StageError(f"`dvc {' '.join(arguments)}` failed; what has arrived stays, so run it again.")


if __name__ == "__main__":
    sys.exit(console.main(main))
