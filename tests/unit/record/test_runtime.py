"""mimo.record.runtime: MuJoCo draws without screen or variable, whatever is loaded later, and in forks."""

import importlib.util
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from mimo.record import runtime
from mimo.settings.params import Params
from mimo.vision import collect, encoder, extractor

ROOT = Path(__file__).parents[3]
TRITON = ROOT / ".venv/triton"  # `make .venv/triton`
SCREEN = ("MUJOCO_GL", "LP_NUM_THREADS", "DISPLAY", "WAYLAND_DISPLAY")
DRAW = """
import numpy as np
from mimo.settings import params; from mimo.world import scene
from mimo.world.eye import Eye
p = params.load()
built = scene.build(p.world, p.protocol)
eye = Eye(built)
assert eye.frames(built.model.key_qpos).any()
"""
TORCH_LATER = """
import torch
torch.optim.AdamW([torch.zeros(1, requires_grad=True)])
"""
VECTOR = """
import gymnasium
envs = gymnasium.make_vec("mimo.world.env:mimo/MIMoMobile-v0", num_envs=2, vectorization_mode="async")
seen, _ = envs.reset(seed=0)
assert seen["vision"].shape == (2, 128, 128, 3) and seen["vision"].any(axis=(1, 2, 3)).all()
assert envs.step(envs.action_space.sample())[0]["vision"].any()
envs.close()
"""
FORKED = """
from stable_baselines3.common.vec_env import SubprocVecEnv
from mimo.world.env import MIMoMobileEnv
own = MIMoMobileEnv()
seen = own.reset(seed=0)[0]["vision"]
envs = SubprocVecEnv([MIMoMobileEnv, MIMoMobileEnv], start_method="fork")
envs.seed(0)
assert (envs.reset()["vision"] == seen).all()
envs.close()
own.close()
"""


def run(script: str, *path: Path, **variables: str) -> subprocess.CompletedProcess[str]:
    """A script in a process of its own, as on a machine without a screen where nobody has set a variable."""
    bare = {name: value for name, value in os.environ.items() if name not in SCREEN}
    found = bare | {"PYTHONPATH": os.pathsep.join(map(str, (ROOT, *path)))} | variables
    return subprocess.run(
        [sys.executable, "-c", script], cwd=ROOT, env=found, capture_output=True, text=True, timeout=120
    )


def test_pictures_need_neither_a_screen_nor_a_variable() -> None:
    done = run(f"{DRAW}\nimport os\nprint(os.environ['MUJOCO_GL'])")
    assert (done.returncode, done.stdout) == (0, "egl\n"), done.stderr


def test_what_the_user_has_set_stays() -> None:
    done = run("import mimo, os\nprint(os.environ['MUJOCO_GL'], os.environ['LP_NUM_THREADS'])", MUJOCO_GL="osmesa")
    assert done.stdout == "osmesa 0\n"


@pytest.mark.parametrize(
    ("before", "variables", "advice"),
    [
        ("import mujoco", {}, "MuJoCo was imported before mimo chose EGL; import mimo first, or set MUJOCO_GL=egl."),
        *(
            ("", {name: value}, f"unset what chooses another way to draw, {name}={value}.")
            for name, value in (
                ("MUJOCO_GL", "off"),
                ("MUJOCO_GL", "wgl"),  # refused as MuJoCo is imported
                ("MUJOCO_GL", "glfw"),
                ("MUJOCO_GL", "osmesa"),
                ("PYOPENGL_PLATFORM", "osmesa"),
                ("MUJOCO_EGL_DEVICE_ID", "99"),
                ("__EGL_VENDOR_LIBRARY_FILENAMES", "/none"),
                ("GALLIUM_DRIVER", "none"),
            )
        ),
    ],
)
def test_where_nothing_can_be_drawn_a_sentence_says_what_to_do(
    before: str, variables: dict[str, str], advice: str
) -> None:
    """In one line, since the last is all that a worker's fault comes through with."""
    done = run(f"{before}\n{DRAW}", **variables)
    assert done.returncode == 1
    last = done.stderr.strip().splitlines()[-1]
    assert re.match(
        r"mimo\.record\.runtime\.RenderError: (Pictures cannot be drawn off screen|MuJoCo cannot be) ", last
    )
    assert last.endswith(f": {advice}")


THREADS = """
import threading
from mimo.world.env import MIMoMobileEnv
def tried(*calls):
    try:
        for call in calls:
            call()
        said.append("drawn")
    except Exception as fault:
        said.append(f"{type(fault).__name__}: {fault}")
said = []
own, others = MIMoMobileEnv(), [MIMoMobileEnv(), MIMoMobileEnv()]
threads = [threading.Thread(target=tried, args=(env.reset, env.close)) for env in others]
own.reset(seed=0)
threads += [threading.Thread(target=tried, args=[call]) for call in (own.reset, own.close)]
for thread in threads:
    thread.start()
    thread.join()
own.reset(seed=0)
print(*said, sep="\\n")
"""


def test_an_environment_draws_in_the_thread_that_resets_it_and_says_so_elsewhere() -> None:
    done = run(THREADS)
    assert done.returncode == 0, done.stderr
    *drawn, reset, closed = done.stdout.splitlines()
    assert drawn == ["drawn", "drawn"]
    for said in (reset, closed):
        assert said.startswith("RenderError: This thread cannot draw (EGLError: ")
        assert said.endswith("let each thread make, reset, step and close an environment of its own.")


def test_torch_after_a_picture_does_not_end_the_process() -> None:
    """It does, by a segmentation fault, if the picture is drawn before triton is loaded."""
    brought = importlib.util.find_spec("triton") is not None
    if not brought and not TRITON.exists():
        pytest.skip("PyTorch is the CPU build, and triton is not beside it: `make .venv/triton`")
    done = run(DRAW + TORCH_LATER, *([] if brought else [TRITON]))
    assert done.returncode == 0, done.stderr


def test_there_is_one_way_to_a_renderer() -> None:
    files = [path for top in ("mimo", "stages", "examples", "benchmarks") for path in (ROOT / top).rglob("*.py")]
    made = {str(path.relative_to(ROOT)) for path in files if "mujoco.Renderer(" in path.read_text()}
    assert made == {
        "mimo/record/runtime.py",
        "stages/commands/gl.py",
    }  # the latter's is in a process that draws and ends
    assert runtime.BEFORE_GL == ("triton",)


@pytest.mark.parametrize("script", [VECTOR, FORKED], ids=["gymnasium", "stable-baselines3"])
def test_environments_draw_in_forks(script: str) -> None:
    """They would wait for ever for threads of llvmpipe that stayed behind."""
    done = run(script)
    assert done.returncode == 0, done.stderr


CHECK = "from mimo.record import runtime\nruntime.check('numpy', 'torch')\nprint('the same')"


def test_a_process_that_loads_mimo_first_computes_as_all_do() -> None:
    """Whatever the user has set."""
    done = run(CHECK, OPENBLAS_CORETYPE="Prescott", ATEN_CPU_CAPABILITY="default", MKL_CBWR="SSE2")
    assert (done.returncode, done.stdout) == (0, "the same\n"), done.stderr


def test_a_process_with_other_kernels_is_refused_by_what_they_compute() -> None:
    early = "import torch\ntorch.ones(64).exp()\n"
    done = run(early + CHECK, ATEN_CPU_CAPABILITY="default", MKL_CBWR="SSE2")
    assert done.returncode == 1
    last = done.stderr.strip().splitlines()[-1]
    assert last.startswith(
        "mimo.record.runtime.KernelError: Results would be other bytes here: numpy and torch came before"
    )
    assert all(f"{name}={value}" in last for name, value in runtime.KERNELS.items())


def test_a_library_that_came_early_with_the_right_kernels_is_no_fault() -> None:
    done = run(f"import numpy, torch\n{CHECK}", **runtime.KERNELS)
    assert (done.returncode, done.stdout) == (0, "the same\n"), done.stderr


def test_a_processor_without_the_instructions_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runtime, "INSTRUCTIONS", ("fma", "avx1024"))
    with pytest.raises(
        runtime.KernelError, match="This processor lacks AVX1024, without which results are other bytes"
    ):
        runtime.check.__wrapped__()


def test_what_computes_checks_first(monkeypatch: pytest.MonkeyPatch, tiny: Params, pairs: np.ndarray) -> None:
    def refuse(*libraries: str) -> None:
        raise runtime.KernelError("no")

    trained = encoder.train(tiny.encoder, pairs, np.random.default_rng(0))
    monkeypatch.setattr(runtime, "check", refuse)
    for compute in (
        lambda: encoder.train(tiny.encoder, pairs, np.random.default_rng(0)),
        lambda: extractor.Extractor(tiny.encoder, trained),
        lambda: collect.collect(tiny),
    ):
        with pytest.raises(runtime.KernelError):
            compute()
