"""Artifacts: the only reader and writer of HDF5.

An artifact is a set of named arrays with units and axes, a schema's name, what it was made from, and a SHA-256 over
its content. The same content gives the same file, byte for byte, whenever and wherever it is written. HDF5's user
block, the file's first 512 bytes, holds a line of text with the SHA-256 of all that follows: no byte changes unseen. A
file that is damaged, altered or of another kind is refused with one sentence; nothing is ever unpickled.
"""

import hashlib
import io
import json
import math
import os
import re
import secrets
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from mimo.record.identity import Digest, canonical
from mimo.settings.errors import Fault

SCHEMA_VERSION = 1
# The first format with checksums over HDF5's own structures, so that a flipped byte there fails loudly; fixed, since
# "latest" would move with the library.
LIBVER = ("v110", "v110")
SIGNATURE = b"\x89HDF\r\n\x1a\n"
USER_BLOCK = 512  # bytes, the least that HDF5 allows
CHUNK = 2**19  # bytes: small enough for HDF5's chunk cache, large enough that the index costs nothing
DENSEST = 1100  # deflate cannot pack more than 1032 bytes into one: a file that claims more is not to be trusted
REMEDY = "run `dvc checkout` or `dvc repro`"
_NAME = re.compile(r"[A-Za-z0-9_-][A-Za-z0-9_.-]*(/[A-Za-z0-9_-][A-Za-z0-9_.-]*)*")

About = Mapping[str, str | int | float]


class ArtifactError(Fault, ValueError):
    """An artifact cannot be read, written or trusted; one sentence names the file, the fault and the remedy."""


@dataclass(frozen=True, eq=False)
class Dataset:
    """An array with its meaning: `units` such as "m" or "1", `axes` such as "step, joint" ("" for a scalar)."""

    values: np.ndarray
    units: str
    axes: str


@dataclass(frozen=True, eq=False)
class Artifact:
    """What a verified file holds; `artifact["joints"]` is the array of that name.

    `digest` is that of `inputs`, what it was made from; `inputs` is None where the writer knew no more than the digest.
    """

    path: Path
    schema: str
    digest: str
    inputs: dict[str, Any] | None
    content: str
    about: dict[str, str | int | float]
    datasets: dict[str, Dataset]

    def __getitem__(self, name: str) -> np.ndarray:
        """The array called `name`.

        Raises:
            ArtifactError: the artifact has no such dataset.
        """
        if name not in self.datasets:
            raise ArtifactError(f"{self.path} has no dataset {name!r}; it has {', '.join(self.datasets)}.")
        return self.datasets[name].values


def write(
    path: str | Path, schema: str, digest: str, datasets: Mapping[str, Dataset], about: About | None = None
) -> str:
    """Write an artifact whole or not at all.

    Args:
        path: the file; its folder is made when missing.
        schema: name of the artifact's kind, checked by whoever reads it.
        digest: of what the artifact was made from; one by identity.Digest brings that along, and it is kept too.
        datasets: by name; "/" nests. Booleans, integers, floats up to 64 bits and byte strings, every float finite.
        about: further attributes: text, integers or finite floats.

    Returns:
        The content hash: SHA-256 over schema, version, about and every dataset.

    Raises:
        ArtifactError: a value cannot be held, or the disk refuses; `path` is then as it was.
    """
    data, content_hash = _encode(str(path), schema, digest, datasets, about or {})
    publish(data, path)
    return content_hash


def to_bytes(schema: str, digest: str, datasets: Mapping[str, Dataset], about: About | None = None) -> bytes:
    """The file that `write` would write, for a worker that has no disk to write to."""
    return _encode("the artifact", schema, digest, datasets, about or {})[0]


def read(path: str | Path, schema: str, digest: str | None = None) -> Artifact:
    """Read an artifact and verify all of it.

    Args:
        path: the file.
        schema: the kind that it must be.
        digest: what it must have been made from; None accepts any.

    Raises:
        ArtifactError: the file is missing, unreadable, damaged, altered, foreign, or of another schema or digest.
    """
    return from_bytes(_load(Path(path)), schema, digest, path)


def from_bytes(data: bytes, schema: str, digest: str | None = None, source: str | Path = "memory") -> Artifact:
    """`read` for the bytes of a file; `source` is what messages call it."""
    if not data:
        raise _refusal(source, "is empty")
    if SIGNATURE not in (data[: len(SIGNATURE)], data[USER_BLOCK : USER_BLOCK + len(SIGNATURE)]):
        raise _refusal(source, "is not an HDF5 file, or its beginning is damaged")
    if data[:USER_BLOCK] != _header(data[USER_BLOCK:]):
        raise _refusal(
            source, "is no artifact of this project, or is not as it was written (its SHA-256 does not hold)"
        )
    try:
        # The file lies in memory: no lock, no second look at a file that may have been replaced meanwhile.
        with h5py.File(io.BytesIO(data), "r") as file:
            return _decode(file, Path(source), schema, digest, len(data))
    except ArtifactError:
        raise
    except Exception as fault:  # HDF5 reports damage as any of a dozen kinds of exception
        raise _refusal(source, f"is damaged or foreign ({_brief(fault)})") from fault


def content(path: str | Path) -> str:
    """The content hash that the file states; nothing is verified, so use it only where a later `read` will.

    Raises:
        ArtifactError: the file is missing or states none.
    """
    return _stated(path, "content")


def part(held: Artifact, *starts: str) -> str:
    """SHA-256 over the datasets whose names begin with one of `starts`, for what depends on them alone."""
    return _hash(held.schema, {name: data for name, data in held.datasets.items() if name.startswith(starts)}, {})


def schema(path: str | Path) -> str:
    """The schema that the file states; nothing is verified.

    Raises:
        ArtifactError: the file is missing or states none.
    """
    return _stated(path, "schema")


def publish(data: bytes, path: str | Path) -> None:
    """Put a file in place in one step: a reader sees the old file or the new one, never a part.

    The temporary neighbour is `.<name>.<token>.part`; only a killed process or a power cut leaves one behind.

    Raises:
        ArtifactError: the disk refuses.
    """
    path = Path(path)
    part = path.with_name(f".{path.name}.{secrets.token_hex(8)}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            with part.open("xb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)
        # The new name itself must survive a power cut.
        folder = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)
    except OSError as fault:
        raise ArtifactError(
            f"{path} could not be written ({_brief(fault)}); free space or mend permissions, then run again."
        ) from fault


def copy(source: str | Path, target: str | Path) -> None:
    """Copy a file in one step, unverified.

    Raises:
        ArtifactError: `source` cannot be read or `target` not written.
    """
    publish(_load(Path(source)), target)


def _encode(source: str, schema: str, digest: str, datasets: Mapping[str, Dataset], about: About) -> tuple[bytes, str]:
    held = {name: _checked(source, name, datasets[name]) for name in sorted(datasets)}
    notes = {key: _note(source, key, about[key]) for key in sorted(about)}
    content_hash = _hash(schema, held, notes)
    buffer = io.BytesIO()
    try:
        options = {"libver": LIBVER, "userblock_size": USER_BLOCK, "track_order": False, "track_times": False}
        with h5py.File(buffer, "w", **options) as file:
            _put(file, "schema", schema)
            _put(file, "version", SCHEMA_VERSION)
            _put(file, "digest", digest)
            if isinstance(digest, Digest):
                _put(file, "inputs", canonical(digest.inputs).decode())
            _put(file, "content", content_hash)
            for key, value in notes.items():
                _put(file, f"about.{key}", value)
            for name, dataset in held.items():
                target = file.create_dataset(name, data=dataset.values, track_times=False, **_packing(dataset.values))
                _put(target, "units", dataset.units)
                _put(target, "axes", dataset.axes)
    except Exception as fault:
        raise ArtifactError(f"{source} cannot be written as HDF5 ({_brief(fault)}).") from fault
    body = buffer.getvalue()[USER_BLOCK:]
    return _header(body) + body, content_hash


def _header(body: bytes) -> bytes:
    """The user block: for `head -n 1`, and for whoever checks the file without HDF5."""
    text = f"mimo-agency artifact; SHA-256 of the bytes from {USER_BLOCK} on: {hashlib.sha256(body).hexdigest()}\n"
    return text.encode().ljust(USER_BLOCK, b"\0")


def _decode(file: h5py.File, path: Path, schema: str, digest: str | None, size: int) -> Artifact:
    root = _attributes(file)
    missing = [key for key in ("schema", "version", "digest", "content") if key not in root]
    if missing:
        raise _refusal(path, f"is not an artifact of this project (it lacks {', '.join(missing)})")
    if root["schema"] != schema:
        raise _refusal(path, f"holds {root['schema']!r} where {schema!r} is expected")
    if root["version"] != SCHEMA_VERSION:
        raise _refusal(path, f"has version {root['version']} where this code reads version {SCHEMA_VERSION}")
    found: dict[str, h5py.Dataset] = {}
    file.visititems(lambda name, node: found.update({name: node}) if isinstance(node, h5py.Dataset) else None)
    if sum(node.nbytes for node in found.values()) > DENSEST * size:
        raise _refusal(path, "claims more data than it can hold")
    datasets = {name: _take(path, name, found[name]) for name in sorted(found)}
    about = {key.removeprefix("about."): root[key] for key in sorted(root) if key.startswith("about.")}
    made, stated = str(root["digest"]), str(root["content"])
    if _hash(schema, datasets, about) != stated:
        raise _refusal(path, "was altered after it was written (its content hash does not hold)")
    inputs = json.loads(str(root["inputs"])) if "inputs" in root else None
    if inputs is not None and Digest(inputs) != made:
        raise _refusal(path, "was altered after it was written (its digest does not hold)")
    if digest is not None and made != digest:
        raise _refusal(
            path, f"was made from other inputs (digest {made[:12]}, expected {digest[:12]})", "run `dvc repro`"
        )
    return Artifact(path, schema, made, inputs, stated, about, datasets)


def _take(path: Path, name: str, node: h5py.Dataset) -> Dataset:
    if not _plain(node.dtype) or node.is_virtual or node.external:
        raise _refusal(path, f"has dataset {name!r} of a kind that is never read ({node.dtype})")
    meaning = _attributes(node)
    if set(meaning) != {"units", "axes"}:
        raise _refusal(path, f"has dataset {name!r} without units and axes alone")
    return Dataset(np.asarray(node[()]), str(meaning["units"]), str(meaning["axes"]))


def _checked(source: str, name: str, dataset: Dataset) -> Dataset:
    values = np.asarray(dataset.values)
    if not _NAME.fullmatch(name):
        raise ArtifactError(f"{source}: {name!r} is no name for a dataset; use letters, digits, '_', '-', '.' and '/'.")
    if not _plain(values.dtype):
        raise ArtifactError(f"{source}: dataset {name!r} is {values.dtype}; use booleans, numbers or byte strings.")
    if values.dtype.kind == "f" and not np.isfinite(values).all():
        raise ArtifactError(f"{source}: dataset {name!r} holds NaN or infinity; look for what made it.")
    little = np.asarray(values, dtype=values.dtype.newbyteorder("<"), order="C")
    return Dataset(little, dataset.units, dataset.axes)


def _note(source: str, key: str, value: object) -> str | int | float:
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, bool) or not isinstance(value, str | int | float):
        raise ArtifactError(f"{source}: about {key!r} is {type(value).__name__}; use text, an integer or a float.")
    if isinstance(value, float) and not math.isfinite(value):
        raise ArtifactError(f"{source}: about {key!r} is {value}; look for what made it.")
    return value


def _plain(dtype: np.dtype) -> bool:
    """Fixed-size booleans, numbers of at most 64 bits, and byte strings: what every platform reads alike."""
    return dtype.kind == "S" or (dtype.kind in "biuf" and dtype.itemsize <= 8)


def _packing(values: np.ndarray) -> dict[str, object]:
    """Only gzip with fletcher32 was seen to fail loudly on damage; scalars and empty arrays cannot be packed."""
    if values.ndim == 0 or values.size == 0:
        return {}
    rows = max(1, min(len(values), CHUNK * len(values) // values.nbytes))
    chunks = (rows, *values.shape[1:])
    return {"chunks": chunks, "compression": "gzip", "compression_opts": 4, "shuffle": True, "fletcher32": True}


def _put(node: h5py.File | h5py.Dataset, key: str, value: str | int | float) -> None:
    if isinstance(value, str):
        # Fixed length: HDF5 keeps text of variable length in a heap without checksum.
        if "\0" in value:
            raise ValueError(f"{key} holds a NUL")
        length = max(1, len(value.encode()))
        node.attrs.create(key, value.encode(), dtype=h5py.string_dtype("utf-8", length))
    else:
        node.attrs.create(key, value, dtype="<i8" if isinstance(value, int) else "<f8")


def _attributes(node: h5py.File | h5py.Dataset) -> dict[str, str | int | float]:
    found: dict[str, str | int | float] = {}
    for key in node.attrs:
        value = node.attrs[key]
        if not isinstance(value, np.generic) or value.dtype.kind not in "Sif":
            raise ValueError(f"attribute {key} is not text or a number")
        found[str(key)] = value.decode() if isinstance(value, bytes) else value.item()
    return found


def _hash(schema: str, datasets: Mapping[str, Dataset], about: About) -> str:
    """SHA-256 over a line of canonical JSON, then a line and the bytes of each dataset in the order of names.

    The digest is left out: other code that makes the same content must not make what follows from it stale.
    """
    head = {"schema": schema, "version": SCHEMA_VERSION, "about": about}
    total = hashlib.sha256(canonical(head) + b"\n")
    for name in sorted(datasets):
        dataset = datasets[name]
        values = dataset.values
        line = [name, values.dtype.str, list(values.shape), dataset.units, dataset.axes]
        total.update(canonical(line) + b"\n")
        total.update(values.data)
    return total.hexdigest()


def _stated(path: str | Path, key: str) -> str:
    try:
        with h5py.File(path, "r", locking=False) as file:
            return str(_attributes(file)[key])
    except FileNotFoundError:
        raise _refusal(path, "is missing") from None
    except Exception as fault:
        raise _refusal(path, f"is no artifact of this project: it states no {key} ({_brief(fault)})") from fault


def _load(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise _refusal(path, "is missing") from None
    except (OSError, MemoryError) as fault:
        raise _refusal(path, f"cannot be read ({_brief(fault)})") from fault


def _brief(fault: BaseException) -> str:
    text = fault.strerror if isinstance(fault, OSError) and fault.strerror else str(fault)
    return " ".join(text.split()).strip(".'")[:120] or type(fault).__name__


def _refusal(path: str | Path, fault: str, remedy: str = REMEDY) -> ArtifactError:
    return ArtifactError(f"{path} {fault}; {remedy}.")
