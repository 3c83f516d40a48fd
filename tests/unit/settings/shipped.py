"""The two shipped files of settings: their keys, and what is said when some of them are changed."""

import copy
import functools
import re
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
import yaml

from mimo.settings import params, studies
from mimo.settings.files import ParamsError
from mimo.settings.params import Params
from mimo.settings.section import Section
from mimo.settings.studies import Studies

ROOT = Path(__file__).parents[3]
NAMED = ("studies", "alternatives")  # sections of free names
MISSING = object()  # in place of a value

Keys = tuple[str, ...]


class Shipped:
    """One of the files.

    Attributes:
        path: where it is.
        whole: its values, as YAML has them.
        model: what it is checked by.
        load: reads and checks such a file.
    """

    def __init__(self, name: str, model: type[Section], load: Callable[[Path], Section]) -> None:
        self.path, self.model, self.load = ROOT / name, model, load
        self.whole: dict[str, Any] = yaml.safe_load(self.path.read_text())

    def __repr__(self) -> str:
        return self.path.relative_to(ROOT).as_posix()

    def at(self, keys: Keys) -> Any:
        """The value there."""
        return functools.reduce(lambda section, key: section[key], keys, self.whole)

    def changed(self, changes: Mapping[Keys, Any]) -> dict[str, Any]:
        """Its values with others at some keys."""
        whole = copy.deepcopy(self.whole)
        for keys, value in changes.items():
            section = whole
            for key in keys[:-1]:
                section = section[key]
            section[keys[-1]] = value
            if value is MISSING:
                del section[keys[-1]]
        return whole

    def faults(self, folder: Path, changes: Mapping[Keys, Any]) -> list[str]:
        """Load it with the changes, from a file in `folder`, and return the sentences that refuse it."""
        path = folder / "params.yaml"
        path.write_text(yaml.dump(self.changed(changes), Dumper=yaml.CSafeDumper))
        with pytest.raises(ParamsError) as caught:
            self.load(path)
        sentences = str(caught.value).splitlines()
        for sentence in sentences:
            assert sentence.startswith(f"{path}: ")
            assert sentence.endswith(".")
            assert not re.search(r"[?!.;,:]\.$", sentence)
        return [sentence.removeprefix(f"{path}: ") for sentence in sentences]


PARAMS = Shipped("params.yaml", Params, params.load)
STUDIES = Shipped("studies/params.yaml", Studies, functools.partial(studies.load, params.load(PARAMS.path)))
FILES = (PARAMS, STUDIES)


def dotted(keys: Keys) -> str:
    return ".".join(keys)


def walk(section: dict[str, Any], above: Keys = ()) -> Iterator[tuple[Keys, Any]]:
    """Every key; studies and alternatives, whose names are free, have tests of their own."""
    for key, value in section.items():
        yield (*above, key), value
        if isinstance(value, dict) and key not in NAMED:
            yield from walk(value, (*above, key))


def label(part: object) -> str | None:
    """The name, in a test's name, of one of FILES or of keys."""
    return dotted(part) or "top" if isinstance(part, tuple) else repr(part) if isinstance(part, Shipped) else None


VALUES = [(file, keys, value) for file in FILES for keys, value in walk(file.whole)]
PLACES = [(file, keys) for file, keys, _ in VALUES]
SECTIONS = [(file, keys) for file, keys, value in VALUES if isinstance(value, dict) and keys[-1] not in NAMED]
NUMBERS = [(file, keys) for file, keys, value in VALUES if type(value) in (int, float)]
FLOATS = [(file, keys) for file, keys, value in VALUES if isinstance(value, float)]
