"""`python -m tests.pipeline.quick TOP`: both pipelines in TOP/base, then in an edited copy of it for each edit.

What DVC decides and what each stage's `main` computes is real. What is not, as it takes minutes and decides nothing:
stages are forks of one process that has the libraries loaded and the scene built, sweeps are without Ray, DVC does not
lock files against other DVCs, reads YAML by another library and writes JSON (which is YAML), and figures and films are
stand-ins with their data's hashes. What an edit runs without any of that: test_repro.py, test_published.py.

TOP/edits.json has, by name, which keys of the settings get which values, or which file of code a comment more.
TOP/<name>.log has what `dvc repro` said and, as its last line, the exit code.
"""

import gc
import importlib
import json
import os
import shlex
import shutil
import sys
from contextlib import nullcontext
from pathlib import Path
from typing import Any

from mimo.record import identity
from tests import forks
from tests.pipeline.project import edit

AT_ONCE = 2
BASE = "base"
LENGTHS = {"baseline_steps", "attached_steps", "extinction_steps"}  # of which the scene knows nothing
SWEEPS = {"stages.effects", "stages.train", "stages.vary"}  # these take --serial


def main() -> None:
    top = Path(sys.argv[1])
    _load()
    _patch()
    _reproduce(top, BASE, {})
    if os.wait()[1]:
        sys.exit((top / f"{BASE}.log").read_text())
    edits = json.loads((top / "edits.json").read_text())
    for count, (name, changes) in enumerate(edits.items()):
        if count >= AT_ONCE:
            os.wait()
        _reproduce(top, name, changes)
    for _ in range(min(AT_ONCE, len(edits))):
        os.wait()


def _load() -> None:
    """All that stages would load, also what libraries load late, and the code's digests."""
    os.environ["OMP_NUM_THREADS"] = "1"  # two at once on two cores
    import dvc.cli  # noqa: F401
    import dvc.commands.repro  # noqa: F401
    import dvc.repo.reproduce  # noqa: F401
    import torch

    torch.optim.AdamW([torch.zeros(1)])
    for path in sorted(Path("stages").glob("*.py")):
        if "console.main(main)" in path.read_text():
            importlib.import_module(f"stages.{path.stem}")
    identity.versions()
    for path in (*identity.ROOT.glob("mimo/**/*.py"), *identity.ROOT.glob("stages/**/*.py")):
        identity.syntax(path)
    gc.freeze()  # collecting garbage would copy it into every fork


def _patch() -> None:
    import dvc.rwlock
    from dvc.stage import run

    forks.hasten()
    dvc.rwlock.rwlock = lambda *given: nullcontext()
    run._run = _stage
    _share_the_scene()
    figures: Any = sys.modules["stages.drawing.figures"]
    figures.plan = lambda p, results, held, frames: {"fig3": f"<svg><!-- {results.content} {held.content} --></svg>"}
    figures.files = lambda text: {"svg": text.encode()}
    film: Any = sys.modules["stages.drawing.film"]
    film.filmed = lambda p, run, trained: (run.content.encode(), b"")


def _share_the_scene() -> None:
    """Build the scene of params.yaml, for all forks; where an edit asks for another, that is built as ever."""
    from mimo.settings import params
    from mimo.world import scene

    def key(world: params.World, protocol: params.Protocol) -> str:
        return world.model_dump_json() + protocol.model_dump_json(exclude=LENGTHS)

    p = params.load()
    build, own, built = scene.build, key(p.world, p.protocol), scene.build(p.world, p.protocol)
    scene.build = lambda world, protocol: built if key(world, protocol) == own else build(world, protocol)


def _reproduce(top: Path, name: str, changes: dict[str, Any]) -> None:
    """Start a process that copies, edits, and does `dvc repro`."""
    import dvc.cli

    if os.fork():
        return
    code = 1
    try:
        log = os.open(top / f"{name}.log", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(log, 1)
        os.dup2(log, 2)
        project = top / name
        if name != BASE:
            shutil.copytree(top / BASE, project)
            edit(project, *((key, value) for key, value in changes.items() if "/" not in key))
            for file in (project / key for key in changes if "/" in key):
                file.write_text(f"{file.read_text()}\n# A comment.\n")
        os.chdir(project)
        code = dvc.cli.main(["repro", "--all-pipelines"])
    finally:
        print(f"\n{code}", flush=True)
        os._exit(code)


def _stage(executable: str, command: str, **given: Any) -> None:
    """In place of DVC's own: the command in a fork of this process."""
    from dvc.stage.exceptions import StageCmdFailedError

    from stages.base import console

    python, flag, module, *arguments = shlex.split(command)
    assert (python, flag) == ("python", "-m"), command
    sys.stdout.flush()
    sys.stderr.flush()
    if not (child := os.fork()):
        code = 1
        try:
            os.chdir(given["cwd"])
            sys.argv = [module, *arguments, *(["--serial"] if module in SWEEPS else [])]
            code = console.main(sys.modules[module].main)
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(code)
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    if code:
        raise StageCmdFailedError(command, code)


if __name__ == "__main__":
    main()
