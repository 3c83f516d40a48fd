"""The library on its own: a wheel, installed elsewhere, used from an empty folder."""

import re
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from tests.pipeline.project import call, done

ROOT = Path(__file__).parents[2]
USE = """
import pickle
import sys
from pathlib import Path
import mimo
from mimo.settings import params
assert Path(mimo.__file__).is_relative_to(sys.argv[1])
assert params.published().seed == int(sys.argv[2])
again = pickle.loads(pickle.dumps(env.unwrapped))
assert (again.reset(seed=0)[0]["vision"] == env.reset(seed=0)[0]["vision"]).all()
again.close()
env.close()
envs = gymnasium.make_vec("mimo/MIMoMobile-v0", num_envs=2)
assert envs.reset(seed=0)[0]["vision"].shape == (2, 128, 128, 3)
envs.close()
"""


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A clone with what git would commit now."""
    place = tmp_path_factory.mktemp("source")
    for name in done(
        ROOT, "git", "ls-files", "-co", "--exclude-standard", "mimo", "*.toml", "*.yaml", "*.md"
    ).splitlines():
        (place / name).parent.mkdir(parents=True, exist_ok=True)
        (place / name).write_bytes((ROOT / name).read_bytes())
    for name in ("LICENSE", ".gitignore"):
        (place / name).write_bytes((ROOT / name).read_bytes())
    done(place, "git", "init", "-q", ".")
    return place


@pytest.fixture(scope="module")
def wheel(source: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    target = tmp_path_factory.mktemp("wheel")
    pip = [sys.executable, "-m", "pip", "-q", "wheel", "--no-deps", "--no-build-isolation", "-w", str(target), "."]
    built = subprocess.run(pip, cwd=source, capture_output=True, text=True)
    assert built.returncode == 0, built.stderr
    (found,) = target.iterdir()
    return found


def test_it_brings_the_published_constants(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as packed:
        assert packed.read("mimo/params.yaml") == (ROOT / "params.yaml").read_bytes()
        assert "mimo/py.typed" in packed.namelist()


def test_building_it_leaves_nothing_that_git_would_see(source: Path, wheel: Path) -> None:
    done(source, "git", "add", "-A")
    assert not [name for name in done(source, "git", "ls-files").splitlines() if name.startswith(("build", "dist"))]


def test_the_readmes_lines_run_from_an_empty_folder(wheel: Path, tmp_path: Path) -> None:
    site, empty = tmp_path / "site", tmp_path / "empty"
    empty.mkdir()
    done(
        tmp_path,
        sys.executable,
        "-m",
        "pip",
        "-q",
        "install",
        "--no-deps",
        "--target",
        str(site),
        str(wheel),
    )
    (snippet,) = [
        block for block in re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
        if "gymnasium" in block
    ]  # fmt: skip
    seed = re.search(r"^seed: (\d+)", (ROOT / "params.yaml").read_text(), re.MULTILINE)
    assert seed
    script = f"import sys\nsys.path.insert(0, sys.argv[1])\n{snippet}{USE}"
    ran = call(empty, sys.executable, "-c", script, str(site), seed[1])
    assert ran.returncode == 0, ran.stderr
    assert not list(empty.iterdir())


@pytest.mark.parametrize("line", ["build/", "dist/", ".venv"])
def test_what_installing_leaves_is_ignored(line: str) -> None:
    assert line in (ROOT / ".gitignore").read_text().splitlines()
