"""Artifacts: same content, same bytes; whatever is damaged, altered or foreign is refused with one sentence."""

import hashlib
import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pytest

from mimo.record import artifact, identity
from mimo.record.artifact import Artifact, ArtifactError, Dataset

DIGEST = "d" * 64
ABOUT: dict[str, str | int | float] = {"reward": "cais", "seed": 3, "rate": 0.5, "note": "", "unit": "µm"}


def datasets() -> dict[str, Dataset]:
    random = np.random.default_rng(0)
    return {
        "joints": Dataset(random.normal(size=(60, 47)).astype(np.float32), "rad", "step, joint"),
        "actions": Dataset(random.random((60, 32)) < 0.5, "1", "step, joint"),
        "unet/conv1/weight": Dataset(random.normal(size=(4, 2, 3, 3)), "1", "out, in, row, column"),
        "scale": Dataset(np.array(3.5), "m", ""),
        "none": Dataset(np.zeros((0, 3)), "m", "step, axis"),
        "labels": Dataset(np.array([b"cais", b"mtl"]), "1", "reward"),
        "images": Dataset(np.arange(48, dtype=np.uint8).reshape(3, 4, 4), "1", "frame, row, column"),
    }


def same(one: Artifact, other: Artifact) -> bool:
    def facts(held: Artifact) -> list[object]:
        arrays = [
            (name, d.values.dtype, d.values.shape, d.values.tobytes(), d.units, d.axes)
            for name, d in held.datasets.items()
        ]
        return [held.schema, held.digest, held.content, held.about, arrays]

    return facts(one) == facts(other)


def stamped(data: bytes) -> bytes:
    """`data` with the user block that belongs to it."""
    body = data[512:] if data[512:520] == artifact.SIGNATURE else data
    line = f"mimo-agency artifact; SHA-256 of the bytes from 512 on: {hashlib.sha256(body).hexdigest()}\n"
    return line.encode().ljust(512, b"\0") + body


@pytest.fixture
def path(tmp_path: Path) -> Path:
    artifact.write(tmp_path / "run.h5", "run", DIGEST, datasets(), ABOUT)
    return tmp_path / "run.h5"


def test_round_trip(path: Path) -> None:
    held = artifact.read(path, "run", DIGEST)
    assert (held.path, held.schema, held.digest, held.about) == (path, "run", DIGEST, ABOUT)
    assert held.content == artifact.content(path)
    assert set(held.datasets) == set(datasets())
    for name, made in datasets().items():
        np.testing.assert_array_equal(held[name], made.values, strict=True)
        assert (held.datasets[name].units, held.datasets[name].axes) == (made.units, made.axes)
    with pytest.raises(ArtifactError, match="no dataset 'joint'"):
        held["joint"]


def test_same_content_same_bytes_at_any_time_and_in_any_order(path: Path) -> None:
    time.sleep(1.1)  # HDF5 keeps times to the second
    turned = dict(reversed(datasets().items()))
    assert artifact.to_bytes("run", DIGEST, turned, dict(reversed(ABOUT.items()))) == path.read_bytes()
    script = (
        "import sys; from test_artifact import ABOUT, DIGEST, artifact, datasets;"
        "sys.stdout.buffer.write(artifact.to_bytes('run', DIGEST, datasets(), ABOUT))"
    )
    paths = os.pathsep.join((str(Path(__file__).parent), str(Path(artifact.__file__).parents[1])))
    environment = os.environ | {"PYTHONPATH": paths}
    elsewhere = subprocess.run([sys.executable, "-c", script], env=environment, capture_output=True, check=True)
    assert elsewhere.stdout == path.read_bytes()


def test_layout_does_not_count_but_values_do(tmp_path: Path) -> None:
    def content(values: np.ndarray, units: str = "m", **about: float) -> str:
        return artifact.write(tmp_path / "a.h5", "run", DIGEST, {"x": Dataset(values, units, "x")}, about)

    values = np.arange(8, dtype=np.int32)
    assert content(values) == content(values.astype(">i4")) == content(np.repeat(values, 2)[::2])
    others = [content(values[:7]), content(values.astype(np.int64)), content(values, "1"), content(values, seed=1)]
    assert len({content(values), content(values.reshape(2, 4)), content(values + 1), *others}) == 7


@pytest.mark.parametrize(
    ("values", "fault"),
    [
        (np.array([0.0, np.nan]), "'x' holds NaN or infinity"),
        (np.array([[-np.inf]], dtype=np.float16), "'x' holds NaN or infinity"),
        (np.array([{}], dtype=object), "'x' is object"),
        (np.array(["text"]), "'x' is <U4"),
        (np.array([1j]), "'x' is complex128"),
        (np.zeros(2, dtype=np.longdouble), "'x' is float128"),
    ],
)
def test_what_cannot_be_held_is_refused_and_leaves_no_file(tmp_path: Path, values: np.ndarray, fault: str) -> None:
    with pytest.raises(ArtifactError, match=re.escape(fault)):
        artifact.write(tmp_path / "a.h5", "run", DIGEST, {"x": Dataset(values, "1", "x")})
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["", "/x", "x/", "a//b", "../x", ".", "a b", "é"])
def test_names_that_hdf5_would_bend_are_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(ArtifactError, match="no name"):
        artifact.write(tmp_path / "a.h5", "run", DIGEST, {name: Dataset(np.zeros(1), "1", "x")})


@pytest.mark.parametrize("value", [float("nan"), True, None, "a\0b", "\ud800", 2**70])
def test_about_takes_text_and_finite_numbers(tmp_path: Path, value: float) -> None:
    with pytest.raises(ArtifactError):
        artifact.write(tmp_path / "a.h5", "run", DIGEST, {}, {"x": value})


def test_the_first_line_tells_what_the_file_is_and_checks_without_hdf5(path: Path) -> None:
    line, rest = path.read_bytes().split(b"\n", 1)[0].decode(), path.read_bytes()[512:]
    assert line == f"mimo-agency artifact; SHA-256 of the bytes from 512 on: {hashlib.sha256(rest).hexdigest()}"
    with h5py.File(path) as file:
        assert file.userblock_size == 512


def test_the_inputs_of_a_digest_are_kept_with_it(tmp_path: Path) -> None:
    inputs = {"params": {"rate": 0.1, "widths": [1, 2]}, "seed": 3, "many": {str(i): "x" * 64 for i in range(2000)}}
    digest = identity.Digest(inputs)
    artifact.write(tmp_path / "a.h5", "run", digest, {})
    held = artifact.read(tmp_path / "a.h5", "run", digest)
    assert (held.digest, held.inputs) == (digest, inputs)
    artifact.write(tmp_path / "b.h5", "run", str(digest), {})
    assert artifact.read(tmp_path / "b.h5", "run").inputs is None
    assert artifact.content(tmp_path / "a.h5") == artifact.content(tmp_path / "b.h5")


def test_a_missing_or_foreign_file_is_refused_with_one_sentence(tmp_path: Path) -> None:
    def fault(name: str) -> str:
        with pytest.raises(ArtifactError) as caught:
            artifact.read(tmp_path / name, "run")
        message = str(caught.value)
        assert str(tmp_path / name) in message
        assert "dvc" in message
        assert "\n" not in message
        return message

    (tmp_path / "text.h5").write_text("not HDF5\n")
    (tmp_path / "empty.h5").touch()
    with h5py.File(tmp_path / "foreign.h5", "w") as file:
        file["x"] = [1, 2]
    assert "is missing" in fault("none.h5")
    assert "Is a directory" in fault(".")
    assert "is not an HDF5 file" in fault("text.h5")
    assert "is empty" in fault("empty.h5")
    assert "is no artifact of this project" in fault("foreign.h5")
    (tmp_path / "stamped.h5").write_bytes(stamped((tmp_path / "foreign.h5").read_bytes()))
    assert "lacks schema, version, digest, content" in fault("stamped.h5")


def test_what_does_not_belong_is_refused(path: Path) -> None:
    with pytest.raises(ArtifactError, match="holds 'run' where 'encoder' is expected"):
        artifact.read(path, "encoder")
    with pytest.raises(ArtifactError, match=r"made from other inputs .*run `dvc repro`"):
        artifact.read(path, "run", "e" * 64)


@pytest.mark.parametrize(
    ("edit", "fault"),
    [
        (lambda file: file["joints"].write_direct(np.zeros((60, 47), np.float32)), "altered"),
        (lambda file: file["joints"].attrs.modify("units", np.bytes_(b"deg")), "altered"),
        (lambda file: file.attrs.modify("about.seed", 4), "altered"),
        (lambda file: file.attrs.create("inputs", np.bytes_(b"{}")), "its digest does not hold"),
        (lambda file: file.attrs.create("inputs", np.bytes_(b"{")), "damaged or foreign"),
        (lambda file: file.attrs.__delitem__("content"), "lacks content"),
        (lambda file: file.attrs.modify("version", 99), "version 99"),
        (lambda file: file.attrs.create("schema", "run"), "damaged or foreign"),
        (lambda file: file.move("joints", "hinges"), "altered"),
        (lambda file: file.__delitem__("joints"), "altered"),
        (lambda file: file["joints"].attrs.__delitem__("units"), "without units"),
        (lambda file: file.create_dataset("x", data="text"), "of a kind that is never read"),
        (lambda file: file.create_dataset("x", (10**15,), "f8", chunks=(1,)), "more data than it can hold"),
        (lambda file: file.create_dataset("x", (1,), "f8", external=[("/etc/passwd", 0, 8)]), "never read"),
    ],
)
def test_an_altered_file_is_refused(path: Path, edit: object, fault: str) -> None:
    with h5py.File(path, "r+") as file:
        edit(file)  # type: ignore[operator]
    with pytest.raises(ArtifactError, match=r"its SHA-256 does not hold"):
        artifact.read(path, "run")
    path.write_bytes(stamped(path.read_bytes()))  # what the first line says of the bytes holds again
    with pytest.raises(ArtifactError, match=fault):
        artifact.read(path, "run")


def test_publishing_replaces_whole_files_and_leaves_nothing_behind(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    target = path.parent / "deep" / "copy.h5"
    artifact.copy(path, target)
    assert target.read_bytes() == path.read_bytes()
    assert target.stat().st_mode == path.stat().st_mode
    link = path.parent / "link.h5"
    link.symlink_to(path)  # as DVC's cache may lie behind a link
    before = path.read_bytes()
    artifact.publish(b"new", link)
    assert (path.read_bytes(), link.read_bytes(), link.is_symlink()) == (before, b"new", False)

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("mimo.record.artifact.os.fsync", full)
    with pytest.raises(ArtifactError, match=r"run\.h5 could not be written \(No space left on device\)"):
        artifact.write(path, "run", DIGEST, {})
    assert path.read_bytes() == before
    shutil.rmtree(target.parent)
    assert {entry.name for entry in path.parent.iterdir()} == {"run.h5", "link.h5"}


@pytest.mark.parametrize("text", ["", "no HDF5"])
def test_content_of_a_foreign_file_is_refused(tmp_path: Path, text: str) -> None:
    with pytest.raises(ArtifactError, match="is missing"):
        artifact.content(tmp_path / "a.h5")
    (tmp_path / "a.h5").write_text(text)
    with pytest.raises(ArtifactError, match="states no content"):
        artifact.content(tmp_path / "a.h5")
