"""The store: nothing computed twice, nothing damaged believed, nothing foreign taken in."""

from pathlib import Path

import numpy as np
import pytest

from mimo.record import artifact
from stages.base import paths, store

ONE, OTHER = "1" * 64, "2" * 64
TARGET = Path("data/scales.h5")


@pytest.fixture(autouse=True)
def _away(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


class Maker:
    """Gives an artifact's file and counts how often it was asked to."""

    def __init__(self, digest: str = ONE) -> None:
        self.digest, self.calls = digest, 0

    def __call__(self) -> bytes:
        self.calls += 1
        return artifact.to_bytes(store.SCALE, self.digest, datasets())


def datasets() -> dict[str, artifact.Dataset]:
    return {"mtl": artifact.Dataset(np.arange(1000) / 7, "m", "reward")}


def write(path: Path, digest: str = ONE, schema: str = store.SCALE) -> None:
    artifact.write(path, schema, digest, datasets())


def damage(path: Path) -> None:
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)


def test_an_empty_store_has_nothing() -> None:
    assert not store.has(store.SCALE, ONE)
    assert not paths.store().exists()


def test_what_is_made_is_kept_and_never_made_again() -> None:
    make = Maker()
    assert store.publish(store.SCALE, ONE, TARGET, make)
    assert store.has(store.SCALE, ONE)
    assert artifact.read(TARGET, store.SCALE, ONE)["mtl"][7] == 1.0
    assert TARGET.read_bytes() == store.place(store.SCALE, ONE).read_bytes()
    TARGET.unlink()
    assert not store.publish(store.SCALE, ONE, TARGET, make)
    assert artifact.read(TARGET, store.SCALE, ONE).digest == ONE
    assert make.calls == 1


def test_digest_and_kind_tell_artifacts_apart() -> None:
    store.publish(store.SCALE, ONE, TARGET, Maker())
    assert not store.has(store.SCALE, OTHER)
    assert not store.has(store.FRAME, ONE)
    places = {store.place(schema, digest) for schema in (store.SCALE, store.RUN) for digest in (ONE, OTHER)}
    assert len(places) == 4
    assert all(place.is_relative_to(paths.store()) for place in places)


def test_publishing_replaces_what_the_target_held() -> None:
    store.publish(store.SCALE, ONE, TARGET, Maker())
    store.publish(store.SCALE, OTHER, TARGET, Maker(OTHER))
    assert artifact.read(TARGET, store.SCALE).digest == OTHER
    assert store.has(store.SCALE, ONE)


def test_a_damaged_file_is_set_aside_and_made_again(capsys: pytest.CaptureFixture[str]) -> None:
    make = Maker()
    store.publish(store.SCALE, ONE, TARGET, make)
    place = store.place(store.SCALE, ONE)
    good = place.read_bytes()
    damage(place)
    bad = place.read_bytes()
    assert store.publish(store.SCALE, ONE, TARGET, make)
    assert make.calls == 2
    assert place.read_bytes() == TARGET.read_bytes() == good
    assert place.with_suffix(".damaged").read_bytes() == bad
    said = capsys.readouterr().err
    assert said.startswith(str(place))
    assert f"set aside as {place.with_suffix('.damaged')}" in said
    assert said.count("\n") == 1


def test_a_file_under_the_wrong_name_is_set_aside(capsys: pytest.CaptureFixture[str]) -> None:
    write(store.place(store.SCALE, ONE), OTHER)
    assert not store.has(store.SCALE, ONE)
    assert "made from other inputs" in capsys.readouterr().err


def test_taken_in_from_elsewhere_when_the_digest_fits() -> None:
    write(TARGET)
    assert store.has(store.SCALE, ONE, elsewhere=[Path("missing.h5"), TARGET])
    TARGET.unlink()
    assert store.has(store.SCALE, ONE)


def test_nothing_else_is_taken_in() -> None:
    stale, foreign, broken, text = Path("stale.h5"), Path("foreign.h5"), Path("broken.h5"), Path("text.h5")
    write(stale, OTHER)
    write(foreign, ONE, store.RUN)
    write(broken)
    damage(broken)
    text.write_text("hello", encoding="utf-8")
    assert not store.has(store.SCALE, ONE, elsewhere=[stale, foreign, broken, text])
    assert not store.place(store.SCALE, ONE).exists()
    write(good := Path("good.h5"))
    assert store.has(store.SCALE, ONE, elsewhere=[stale, broken, good])


def test_a_damaged_file_is_mended_from_elsewhere(capsys: pytest.CaptureFixture[str]) -> None:
    write(TARGET)
    write(store.place(store.SCALE, ONE))
    damage(store.place(store.SCALE, ONE))
    assert store.has(store.SCALE, ONE, elsewhere=[TARGET])
    assert "set aside" in capsys.readouterr().err
    assert store.place(store.SCALE, ONE).read_bytes() == TARGET.read_bytes()


def test_what_fails_leaves_the_target_as_it_was() -> None:
    store.publish(store.SCALE, ONE, TARGET, Maker())
    before = TARGET.read_bytes()

    def fail() -> bytes:
        raise FloatingPointError("flat")

    with pytest.raises(FloatingPointError, match="flat"):
        store.publish(store.SCALE, OTHER, TARGET, fail)
    assert TARGET.read_bytes() == before
    assert not store.has(store.SCALE, OTHER)


def test_an_encoder_is_called_as_it_calls_itself() -> None:
    from mimo.vision import extractor  # late, as it loads torch

    assert store.ENCODER == extractor.SCHEMA
