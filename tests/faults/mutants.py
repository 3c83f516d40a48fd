"""Mutants of params.yaml and studies/params.yaml: misspelt, removed, wrong, extreme, repeated, torn.

Each comes with what a refusal must say.
"""

import copy
import functools
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml
from hypothesis import assume
from hypothesis import strategies as st

from mimo.settings import studies

Keys = tuple[str | int, ...]
Made = tuple[bytes, tuple[str, ...]]  # the file, words that a refusal must have

ROOT = Path(__file__).parents[2]
NAMED = (("studies",), ("variants",), ("alternatives",))  # sections of free names
TEXTS = ("title", "asks", "expects", "limits")
EXTREMES = (0, -1, 1, 1e-300, 1e300, float("nan"), float("inf"), -float("inf"), 10**12, -(10**12), 10**400, 1e-9, 1e9)
WRONG: tuple[Any, ...] = (None, True, "text", "1e-3", "0.3", [], {}, [[1]], {"a": 1}, 3, 1.5, [1, 2], "")


def walk(value: Any, above: Keys = ()) -> Iterator[Keys]:
    inner = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, held in inner:
        yield (*above, key)
        yield from walk(held, (*above, key))


def at(tree: Any, place: Keys) -> Any:
    return functools.reduce(lambda part, key: part[key], place, tree)


class Shipped:
    """A file of settings as it is shipped: its text, its values, and what there is to mutate."""

    def __init__(self, path: Path) -> None:
        self.path, self.text = path, (ROOT / path).read_text()
        self.whole: dict[str, Any] = yaml.safe_load(self.text)
        self.places = list(walk(self.whole))
        held = {place: at(self.whole, place) for place in self.places}
        self.numbers = [place for place, value in held.items() if type(value) in (int, float)]
        self.lists = [place for place, value in held.items() if isinstance(value, list)]
        self.words = [place for place, value in held.items() if isinstance(value, str) and place[-1] not in TEXTS]
        self.known = [
            place
            for place in self.places
            if isinstance(place[-1], str) and place[-2:-1] not in NAMED and not self._on_axis(place)
        ]
        self.lines = [i for i, line in enumerate(self.text.splitlines()) if re.match(r" *\w+:(?!( #.*)?$)", line)]
        self.scalars = [match.span(1) for match in re.finditer(r"^ *\w+: ([\w.-]+)(?: #|$)", self.text, re.MULTILINE)]

    def __repr__(self) -> str:
        return str(self.path)

    def _on_axis(self, place: Keys) -> bool:
        """Whether a study's axis is this key: misspelt, the axis is what is missed."""
        study = at(self.whole, place[:2]) if place[0] == "studies" and len(place) > 2 else {}
        return study.get("axis") == place[-1]

    def put(self, place: Keys, value: Any) -> dict[str, Any]:
        """The values, with another at a place."""
        tree = copy.deepcopy(self.whole)
        at(tree, place[:-1])[place[-1]] = copy.deepcopy(value)
        return tree


PARAMS, STUDIES = Shipped(Path("params.yaml")), Shipped(studies.PATH)


def dump(tree: Any) -> bytes:
    return yaml.dump(tree, Dumper=yaml.CSafeDumper, sort_keys=False).encode()


def words(place: Keys) -> tuple[str, ...]:
    """What names a place: its section, and its last key."""
    return str(place[0]), [key for key in place if isinstance(key, str)][-1].split(".")[-1]


@st.composite
def typos(draw: st.DrawFn, word: str) -> str:
    index = draw(st.integers(0, len(word) - 1))
    dropped, doubled = word[:index] + word[index + 1 :], word[:index] + word[index] + word[index:]
    swapped = word[:index] + word[index : index + 2][::-1] + word[index + 2 :]
    typo = draw(st.sampled_from([dropped, doubled, swapped, word.upper()]))
    assume(typo not in {word, ""})
    return typo


@st.composite
def misspelt_key(draw: st.DrawFn, file: Shipped) -> Made:
    place = draw(st.sampled_from(file.known))
    name = str(place[-1])
    *before, last = name.split(".")
    typo = ".".join([*before, draw(typos(last))])
    tree = copy.deepcopy(file.whole)
    section = at(tree, place[:-1])
    items = [(typo if key == name else key, value) for key, value in section.items()]
    section.clear()
    section.update(items)
    return dump(tree), (typo.split(".")[-1], last if name in studies.VARIED else f"'{last}'")


@st.composite
def removed_key(draw: st.DrawFn, file: Shipped) -> Made:
    place = draw(st.sampled_from(file.places))
    tree = copy.deepcopy(file.whole)
    del at(tree, place[:-1])[place[-1]]
    return dump(tree), (str(place[0]),)


@st.composite
def wrong_value(draw: st.DrawFn, file: Shipped) -> Made:
    place = draw(st.sampled_from(file.places))
    return dump(file.put(place, draw(st.sampled_from(WRONG)))), words(place)


@st.composite
def extreme_number(draw: st.DrawFn, file: Shipped) -> Made:
    place = draw(st.sampled_from(file.numbers))
    return dump(file.put(place, draw(st.sampled_from(EXTREMES)))), words(place)


@st.composite
def other_number(draw: st.DrawFn, file: Shipped) -> Made:
    """Up to three numbers, by up to 30 times more or less."""
    tree = copy.deepcopy(file.whole)
    for place in draw(st.lists(st.sampled_from(file.numbers), min_size=1, max_size=3, unique=True)):
        value = at(file.whole, place)
        changed = value * 10 ** draw(st.floats(-1.5, 1.5))
        at(tree, place[:-1])[place[-1]] = type(value)(changed)
    return dump(tree), ()


@st.composite
def misspelt_name(draw: st.DrawFn, file: Shipped) -> Made:
    place = draw(st.sampled_from(file.words))
    typo = draw(typos(str(at(file.whole, place))))
    return dump(file.put(place, typo)), (str(place[0]), repr(typo))


@st.composite
def other_list(draw: st.DrawFn, file: Shipped) -> Made:
    place = draw(st.sampled_from(file.lists))
    value = at(file.whole, place)
    return dump(
        file.put(place, draw(st.sampled_from([[], [*value, value[0]], value[:1], [value], [None], value[0]])))
    ), ()


@st.composite
def repeated_line(draw: st.DrawFn, file: Shipped) -> Made:
    lines = file.text.splitlines()
    at_line = draw(st.sampled_from(file.lines))
    lines.insert(at_line, lines[at_line])
    return "\n".join(lines).encode(), (lines[at_line].split(":")[0].strip(), "once")


@st.composite
def other_character(draw: st.DrawFn, file: Shipped) -> Made:
    """One character in, out or changed, or a line indented, in front of a comment or in it."""
    index = draw(st.integers(0, len(file.text) - 1))
    inserted = draw(
        st.sampled_from([*":[]{}&*!|>-\t'\"#\0,?%@`~=\n 0é\x85\u2028", "<<", "- ", ": ", "---\n", "\ufeff"])
    )
    return (file.text[:index] + inserted + file.text[index + draw(st.integers(0, 1)) :]).encode(), ()


@st.composite
def other_byte(draw: st.DrawFn, file: Shipped) -> Made:
    data = file.text.encode()
    index = draw(st.integers(0, len(data)))
    return data[:index] + draw(st.sampled_from([b"\xff", b"\xfe\xff", b"\xc3\x28", b"\x80"])) + data[index:], ("UTF-8",)


@st.composite
def odd_scalar(draw: st.DrawFn, file: Shipped) -> Made:
    """A value that YAML reads in ways of its own."""
    first, last = draw(st.sampled_from(file.scalars))
    odd = draw(
        st.sampled_from(
            ["!!python/object/apply:pathlib.Path.touch [made]", "!!python/name:os.system x", "!!python/none", "!mine 1",
             "!!binary aGk=", "!!set {a, b}", "!!int abc", "!!float abc", "!!bool abc", "!!timestamp abc", "!!int [1]",
             "2024-01-01", "2024-99-99", "9" * 5000, "0x" + "f" * 5000, "0b_", "1" * 5000 + "x", "1:30", "1_000", "010",
             "=", "<<", "*none", "&a [*a]", "&a {? *a : *a}", "{<<: {a: 1}}", "{? [a] : 1}", "[" * 3000,
             "'" + "x" * 5000, "[" * 50 + "]" * 50, "&a [1, *a]",
             "yes", ".inf", "-.INF", ".NaN", "0o17", "1e-3", "1e3", "1.e+3", "", "~",
             "'a\\nb'", '"a\\nb"', '"\\ud800"', '"\\0"', "x" * 5000, "|\n  text", "1 2", "[a, b", "{a: 1", "a: b"]
        )
    )  # fmt: skip
    return (file.text[:first] + odd + file.text[last:]).encode(), ()


BOMB = ", ".join(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]" for i in range(1, 12))


@st.composite
def bomb(draw: st.DrawFn, file: Shipped) -> Made:
    first, last = draw(st.sampled_from(file.scalars))
    return (file.text[:first] + f"{{a0: &a0 [x, x, x, x], {BOMB}}}" + file.text[last:]).encode(), ("too much",)


KINDS: tuple[Callable[[Shipped], st.SearchStrategy[Made]], ...] = (
    misspelt_key, removed_key, wrong_value, extreme_number, other_number, misspelt_name, other_list, repeated_line,
    other_character, other_byte, odd_scalar, bomb
)  # fmt: skip


@dataclass(frozen=True)
class Mutant:
    """One of the files, changed.

    Attributes:
        file: which.
        kind: how.
        data: what it is now.
        named: words that a refusal must have.
    """

    file: Shipped
    kind: str
    data: bytes
    named: tuple[str, ...]


@st.composite
def mutants(draw: st.DrawFn) -> Mutant:
    file, kind = draw(st.sampled_from([PARAMS, STUDIES])), draw(st.sampled_from(KINDS))
    return Mutant(file, kind.__name__, *draw(kind(file)))
