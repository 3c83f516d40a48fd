"""Nothing wrong unnoticed: any byte flipped, any end missing, files swapped or foreign; one sentence, never numbers."""

import json
import shutil
import subprocess
import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
import yaml

from mimo.learning.experiment import Experiment, inputs
from mimo.record import artifact, identity
from mimo.settings.params import Params
from mimo.vision import extractor
from mimo.vision.extractor import Trained
from stages.base import paths, store

ROOT = Path(__file__).resolve().parents[2]
FLIPS, CUTS = 1000, 100
SEEDS = 2
REWARDS = ("mtl", "cais")


@pytest.fixture(scope="module")
def files(
    tiny: Params, trained: Trained, scales: dict[str, float], tmp_path_factory: pytest.TempPathFactory
) -> dict[Path, str]:
    """Real artifacts, by kind: the runs of two rewards in two seeds, an encoder, scales."""
    folder = tmp_path_factory.mktemp("files")
    found = {}
    for reward in REWARDS:
        for seed, record in enumerate(Experiment(tiny, "free", reward, range(SEEDS), trained, scales).run()):
            path = folder / paths.run("free", reward, seed)
            about: dict[str, str | int | float] = {"condition": "free", "reward": reward, "seed": seed}
            artifact.write(path, store.RUN, digest(tiny, reward, seed, scales), record, about)
            found[path] = store.RUN
    extractor.save(trained, folder / paths.ENCODER, identity.Digest({"trained": "by a test"}), {})
    own = {name: artifact.Dataset(np.array(value), "own units", "") for name, value in scales.items()}
    artifact.write(folder / paths.SCALES, store.SCALE, identity.Digest({"measured": "by a test"}), own)
    return found | {folder / paths.ENCODER: extractor.SCHEMA, folder / paths.SCALES: store.SCALE}


def digest(p: Params, reward: str, seed: int, scales: dict[str, float]) -> identity.Digest:
    return identity.Digest(inputs(p, "free", reward, "e" * 64, scales) | {"seed": seed})


def refused(data: bytes, schema: str, source: Path) -> bool:
    """Whether the bytes are refused by one sentence that names the file and what to do."""
    try:
        artifact.from_bytes(data, schema, source=source)
    except artifact.ArtifactError as fault:
        return str(source) in str(fault) and "; run `dvc" in str(fault) and "\n" not in str(fault)
    return False


def test_any_flipped_byte_is_refused(files: dict[Path, str], capfd: pytest.CaptureFixture[str]) -> None:
    random, through = np.random.default_rng(4), []
    contents = {path: path.read_bytes() for path in files}
    for flip in range(FLIPS):
        path = list(files)[flip % len(files)]
        damaged = bytearray(contents[path])
        where = int(random.integers(len(damaged)))
        damaged[where] ^= int(random.integers(1, 256))
        if not refused(bytes(damaged), files[path], path):
            through.append((path.name, where))
    assert capfd.readouterr() == ("", "")  # HDF5 would print a stack of its own
    print(f"{FLIPS} bytes flipped, {len(through)} got through")
    assert not through


def test_any_missing_end_is_refused_and_any_more_too(files: dict[Path, str], tmp_path: Path) -> None:
    random, through = np.random.default_rng(5), []
    for cut in range(CUTS):
        path = list(files)[cut % len(files)]
        data = path.read_bytes()
        length = int(random.integers(len(data))) if cut >= len(files) else len(data) - 1
        short = tmp_path / path.name
        short.write_bytes(data[:length])
        if not refused(short.read_bytes(), files[path], short):
            through.append((path.name, length))
        with pytest.raises(artifact.ArtifactError, match=path.name):
            artifact.read(short, files[path])
        assert refused(data + b"\0", files[path], path)
    print(f"{CUTS} files truncated, {len(through)} got through")
    assert not through


def test_damage_within_a_file_whose_checksum_was_made_to_fit_gives_no_other_numbers(files: dict[Path, str]) -> None:
    """Even then HDF5's checksums or the content hash refuse it, unless the byte is of no consequence."""
    random, seen = np.random.default_rng(6), Counter[str]()
    for flip in range(200):
        path = list(files)[flip % len(files)]
        data = bytearray(path.read_bytes())
        where = int(random.integers(artifact.USER_BLOCK, len(data)))
        data[where] ^= int(random.integers(1, 256))
        body = bytes(data[artifact.USER_BLOCK :])
        try:
            held = artifact.from_bytes(artifact._header(body) + body, files[path], source=path)
        except artifact.ArtifactError:
            seen["refused"] += 1
        else:
            seen["harmless"] += 1
            good = artifact.read(path, files[path])
            assert (held.content, held.digest, held.about) == (good.content, good.digest, good.about)
            assert all(np.array_equal(held[name], good[name]) for name in good.datasets)
    assert seen["refused"] > 180, seen


# A stage on files gone wrong.


@pytest.fixture
def project(files: dict[Path, str], tiny: Params, scales: dict[str, float], tmp_path: Path) -> Path:
    """A folder in which stages.analyse has all it needs."""
    for path in files:
        relative = path.relative_to(next(parent for parent in path.parents if parent.name == "data").parent)
        (tmp_path / relative).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(path, tmp_path / relative)
    sizes = {"conditions": ["free"], "rewards": list(REWARDS), "seeds": SEEDS}
    whole = yaml.safe_load((ROOT / "params.yaml").read_text())
    whole["sweep"] |= sizes
    for section in ("protocol", "encoder", "outcomes", "collect"):
        whole[section] = getattr(tiny, section).model_dump()
    (tmp_path / "params.yaml").write_text(yaml.safe_dump(whole))
    for reward in REWARDS:
        listed = [
            {"variant": "", "condition": "free", "reward": reward, "seed": s, "digest": digest(tiny, reward, s, scales)}
            for s in range(SEEDS)
        ]
        manifest = tmp_path / paths.manifest("free", reward)
        manifest.parent.mkdir(exist_ok=True)
        manifest.write_text(json.dumps(listed))
    return tmp_path


def analyse(project: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "stages.analyse"]
    environment = {"PYTHONPATH": str(ROOT), "PATH": "/usr/bin:/bin"}
    return subprocess.run(command, cwd=project, env=environment, capture_output=True, text=True, check=False)


def flip(one: Path, other: Path) -> None:
    data = bytearray(one.read_bytes())
    data[len(data) // 2] ^= 1
    one.write_bytes(data)


def truncate(one: Path, other: Path) -> None:
    one.write_bytes(one.read_bytes()[:-100])


def swap(one: Path, other: Path) -> None:
    kept = one.read_bytes()
    one.write_bytes(other.read_bytes())
    other.write_bytes(kept)


def make_foreign(one: Path, other: Path) -> None:
    with h5py.File(one, "w") as file:
        file["reward"] = np.ones((10, 12))


def imitate(one: Path, other: Path) -> None:
    """Another program's file, as complete as it can know to make it."""
    with h5py.File(other) as source, h5py.File(one, "w") as file:
        for key, value in source.attrs.items():
            file.attrs[key] = value
        file["reward"] = np.ones((10, 12))


def remove(one: Path, other: Path) -> None:
    one.unlink()


RUN, SEED, REWARD = (paths.run("free", *cell) for cell in (("cais", 0), ("cais", 1), ("mtl", 0)))
WRONG = [
    (flip, RUN, SEED),
    (truncate, RUN, SEED),
    (swap, RUN, SEED),
    (swap, RUN, REWARD),
    (swap, RUN, paths.ENCODER),
    (swap, paths.SCALES, paths.ENCODER),
    (make_foreign, RUN, SEED),
    (imitate, RUN, SEED),
    (make_foreign, paths.ENCODER, SEED),
    (remove, RUN, SEED),
    (truncate, paths.manifest("free", "cais"), SEED),
]


def test_a_stage_works_on_sound_files(project: Path) -> None:
    done = analyse(project)
    assert done.returncode == 0, done.stderr
    assert (project / paths.RESULTS).exists()


@pytest.mark.parametrize(("wrong", "one", "other"), WRONG, ids=lambda x: getattr(x, "__name__", str(x)))
def test_a_stage_on_wrong_files_says_one_sentence_and_makes_nothing(
    wrong: Callable[[Path, Path], None], one: Path, other: Path, project: Path
) -> None:
    wrong(project / one, project / other)
    done = analyse(project)
    assert done.returncode == 1
    sentences = [line for line in done.stderr.splitlines() if not line.startswith("Analysis: ")]
    assert len(sentences) == 1, done.stderr
    assert "run `dvc" in sentences[0]
    assert str(one) in sentences[0] or str(other) in sentences[0]
    assert "Traceback" not in done.stderr
    assert not (project / paths.RESULTS).exists()
    assert not (project / paths.METRICS).exists()
