"""A file of settings in YAML, read strictly: plain values alone, no key twice, no more than there is room for."""

import re
from pathlib import Path
from typing import Any

import yaml

from mimo.settings.errors import Fault

TEXTS = ("str", "timestamp", "merge", "value")  # what YAML reads as text, or would without these inventions of its own
HUGE = 2**63  # too large for numpy's and HDF5's integers
DEEPEST, MOST = 20, 10_000  # levels and values of YAML; params.yaml has six and some hundred
LONGEST = 60  # characters of a value in a sentence


class ParamsError(Fault, ValueError):
    """params.yaml does not hold; the message has one sentence for each fault."""


class _Loader(yaml.SafeLoader):
    """Composes no deeper than needed, and counts what `_values` makes: aliases can stand for more than memory holds."""

    depth = made = 0

    def compose_node(self, parent: Any, index: Any) -> Any:
        self.depth += 1
        self.check(self.depth, self.get_mark())
        node = super().compose_node(parent, index)
        self.depth -= 1
        return node

    def check(self, depth: int, mark: yaml.Mark) -> None:
        if depth > DEEPEST or self.made > MOST:
            raise yaml.MarkedYAMLError(problem="it holds too much, or too deeply nested", problem_mark=mark)


def read(path: Path) -> object:
    """The file's values.

    Raises:
        ParamsError: it cannot be read, is not YAML, or holds other than plain values; a sentence each.
    """
    faults: list[str] = []
    try:
        loader = _Loader(path.read_bytes().decode())
        root = loader.get_single_node()
        values = _values(loader, root, (), faults) if root else None
    except FileNotFoundError:
        raise ParamsError(f"{path} is missing; run from the project's top folder.") from None
    except OSError as error:
        raise ParamsError(f"{path} must be a file that can be read: {error.strerror}.") from None
    except UnicodeDecodeError as error:
        line = error.object.count(b"\n", 0, error.start) + 1
        raise ParamsError(f"{path} must be text in UTF-8; line {line} is not.") from None
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f" (line {mark.line + 1}, column {mark.column + 1})" if mark else ""
        problem = getattr(error, "problem", None) or str(error).splitlines()[0]
        raise ParamsError(f"{path} is not valid YAML: {problem}{where}.") from None
    if faults:
        raise ParamsError("\n".join(f"{path}: {fault}." for fault in faults))
    return values


def _values(loader: _Loader, node: yaml.Node, above: tuple[object, ...], faults: list[str]) -> object:
    """A node's value. Other tags than YAML's plain ones, huge numbers and repeated keys go to `faults`."""
    loader.made += 1
    loader.check(len(above), node.start_mark)
    kind = node.tag.removeprefix("tag:yaml.org,2002:")
    if kind == "map" and isinstance(node, yaml.MappingNode):
        found: dict[object, object] = {}
        for left, right in node.value:
            line = left.start_mark.line + 1
            if not isinstance(left, yaml.ScalarNode):
                faults.append(f"{dotted(above)} must have text for keys; line {line} has a list or a section")
                continue
            key = _values(loader, left, above, faults)
            if key in found:
                faults.append(f"{dotted((*above, key))} must be given once; line {line} has it again")
            found[key] = _values(loader, right, (*above, key), faults)
        return found
    if kind == "seq" and isinstance(node, yaml.SequenceNode):
        return [_values(loader, item, (*above, place), faults) for place, item in enumerate(node.value)]
    if kind in TEXTS and isinstance(node, yaml.ScalarNode):
        return node.value
    try:
        value: object = loader.construct_object(node) if kind in ("int", "float", "bool", "null") else HUGE
    except (ValueError, LookupError):
        value = HUGE
    if isinstance(value, int) and abs(value) >= HUGE:
        given = shown(loader.buffer[node.start_mark.index : node.end_mark.index])
        faults.append(f"{dotted(above)} must be plain text or a number of at most 64 bits; it is {given}")
    return value


def dotted(location: tuple[object, ...]) -> str:
    """A value's place, for people."""
    parts = [str(part) if re.fullmatch(r"[\w-]+", str(part)) else shown(part) for part in location if part != "[key]"]
    return ".".join(parts) or "the file"


def shown(value: object) -> str:
    """A value, for people: in one line, and not all of it if it is long."""
    text = repr(value)
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}…"
