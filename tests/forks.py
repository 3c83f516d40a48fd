"""Python modules as commands, sooner: as forks of one process that has the libraries loaded.

A tiny stage takes seconds to import torch, and `dvc` takes two to import DVC. A fork imports the project's own code
from the folder it is started in, as ever, and has its own environment, streams and exit code: only libraries are
shared, and `hasten` has made DVC quicker. `program("shell")` stands in for SHELL, by which DVC runs a stage,
`program("python")` for Python.
"""

import atexit
import gc
import importlib
import json
import os
import runpy
import signal
import socket
import subprocess
import sys
import threading
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NoReturn

ROOT = Path(__file__).parents[1]
FOLDER = "TESTS_FORKS"  # environment variable: where socket and programs lie
PROGRAM = """\
#!{python} -SE
import shlex
import sys
sys.path.insert(0, {root!r})
from tests import forks
sys.exit(forks.ask({socket!r}, {words}))
"""
WORDS = {"shell": "shlex.split(sys.argv[2])[1:]", "python": "sys.argv[1:]"}  # what each program is given
REQUEST = 2**17  # bytes at most
LIBRARIES = (  # but not Ray, which reads its environment as it is loaded
    "dvc.cli", "dvc.commands.repro", "dvc.repo.reproduce", "h5py", "matplotlib.figure", "mujoco.batch", "pandas",
    "pydantic", "rich.progress", "scipy.stats", "torch",
)  # fmt: skip


def program(name: str) -> str:
    """`shell`, which takes `-c "python -m MODULE ..."`, or `python`, which takes what Python takes."""
    return str(Path(os.environ[FOLDER]) / name)


@contextmanager
def served(folder: Path) -> Iterator[None]:
    """Commands can be given, by this process and all below it."""
    path = folder / "socket"
    for name, words in WORDS.items():
        text = PROGRAM.format(python=sys.executable, root=str(ROOT), socket=str(path), words=words)
        (folder / name).write_text(text)
        (folder / name).chmod(0o755)
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as listener:
        listener.bind(str(path))
        listener.listen(64)
        server = subprocess.Popen(
            [sys.executable, "-m", "tests.forks", str(listener.fileno())], cwd=ROOT, pass_fds=[listener.fileno()]
        )
    os.environ[FOLDER] = str(folder)
    try:
        yield
    finally:
        del os.environ[FOLDER]
        server.kill()
        server.wait()


def ask(path: str, arguments: list[str]) -> int:
    """Have a module run in this folder, with this environment and these streams; returns its exit code."""
    if arguments[0] != "-m":
        os.execv(sys.executable, [sys.executable, *arguments])
    request = json.dumps({"words": arguments[1:], "folder": str(Path.cwd()), "environment": dict(os.environ)}).encode()
    assert len(request) < REQUEST
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as server:
        server.connect(path)
        socket.send_fds(server, [request], [0, 1, 2])
        return int(server.recv(16))


def _serve(listener: socket.socket) -> None:
    """Take requests, each in a fork."""
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # the kernel takes away what has ended
    loaded = False
    while True:
        connection, _ = listener.accept()
        loaded = loaded or _load()
        if not os.fork():
            listener.close()
            break
        connection.close()
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    data, streams, *_ = socket.recv_fds(connection, REQUEST, 3)
    if child := os.fork():
        code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        connection.send(str(code if code >= 0 else 128 - code).encode())
        os._exit(0)
    connection.close()
    for number, stream in enumerate(streams):
        os.dup2(stream, number)
        os.close(stream)
    # Anew, as the server's own may be files, which can be sought in, where these are pipes; buffered as Python's are.
    sys.stdout = os.fdopen(1, "w", encoding="utf-8", closefd=False)
    sys.stderr = os.fdopen(2, "w", buffering=1, encoding="utf-8", closefd=False)
    request = json.loads(data)
    os.chdir(request["folder"])
    os.environ.clear()
    os.environ.update(request["environment"])
    sys.executable = program("python")
    sys.path[0] = request["folder"]
    sys.argv = ["", *request["words"][1:]]
    ended: object = 1
    try:
        runpy.run_module(request["words"][0], run_name="__main__", alter_sys=True)
        ended = 0
    except SystemExit as end:
        ended = end.code
    except BaseException:
        traceback.print_exc()
    _end(ended)


def _end(code: object) -> NoReturn:
    """As Python ends, but for taking all libraries to pieces, which takes a second."""
    if isinstance(code, str):
        print(code, file=sys.stderr)
    threading._shutdown()  # type: ignore[attr-defined]
    atexit._run_exitfuncs()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code if isinstance(code, int) else code is not None)


def _load() -> bool:
    """Import LIBRARIES, and what torch loads late."""
    for name in LIBRARIES:
        importlib.import_module(name)
    torch = sys.modules["torch"]
    torch.optim.AdamW([torch.zeros(1)])
    hasten()
    gc.freeze()  # collecting garbage would copy it into every fork
    return True


def hasten() -> None:
    """Have DVC read YAML by another library, and write JSON, which is YAML.

    For each stage DVC reads dvc.lock twice and writes all of it, by a library that keeps comments.
    """
    import ruamel.yaml
    import yaml

    def load(self: object, text: str) -> object:
        return json.loads(text) if text.startswith("{") else yaml.load(text, yaml.CSafeLoader)

    library: Any = ruamel.yaml.YAML
    library.load = load
    library.dump = lambda self, data, stream: stream.write(json.dumps(data))


if __name__ == "__main__":
    _serve(socket.socket(fileno=int(sys.argv[1])))
