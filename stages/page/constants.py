"""A file of settings as a table: every constant, its value, whether it is the paper's or ours, and why."""

import re
from dataclasses import dataclass

import yaml

LISTED = ("seeds", "variants")  # of a study; its section shows the rest


@dataclass(frozen=True)
class Constant:
    """A line of the file; `source` is paper, ours, or both."""

    key: str
    value: str
    source: str
    comment: str


def constants(text: str) -> list[Constant]:
    """Every constant with the comment on its line or, without one, on its section's; every variant with what it asks.

    Args:
        text: params.yaml or studies/params.yaml.
    """
    root = yaml.compose(text)
    assert root is not None  # mimo.settings has checked the file
    return _constants(root, text.splitlines(), ())


def _constants(node: yaml.Node, lines: list[str], above: tuple[str, ...], common: str = "") -> list[Constant]:
    found = []
    assert isinstance(node, yaml.MappingNode)
    for key, value in node.value:
        name = (*above, key.value)
        if above[:1] == ("studies",) and above[2:] == ("variants",) and "over" not in _keys(value):
            found.append(_variant(".".join(name), value))
            continue
        if above[:1] == ("studies",) and len(above) == 2 and key.value not in LISTED:
            continue
        if isinstance(value, yaml.MappingNode) and not value.flow_style:
            found += _constants(value, lines, name, _comment(lines, key.end_mark))
            continue
        # A list over several lines ends where the next key begins: its comment, if any, is beside its own key.
        end = key.end_mark if isinstance(value, yaml.SequenceNode) and not value.flow_style else value.end_mark
        comment = _comment(lines, end) or common
        sources = [
            kind
            for kind, sign in (("paper", r"\bpaper (§|fig|appendix)"), ("ours", r"\bours:"))
            if re.search(sign, comment)
        ]
        found.append(Constant(".".join(name), _text(value), " and ".join(sources), comment))
    return found


def _variant(key: str, node: yaml.Node) -> Constant:
    """What it changes, and what it asks if it asks something of its own."""
    own = {part.value: value for part, value in node.value}
    changes = [f"{changed.value}: {_text(value)}" for changed, value in (own["set"].value if "set" in own else [])]
    changes += [f"seeds from {own['first'].value} on"] if "first" in own else []
    changes += [f"yoked: {own['yoked'].value}"] if "yoked" in own else []
    return Constant(key, ", ".join(changes) or "as published", "ours", own["asks"].value if "asks" in own else "")


def _keys(node: yaml.Node) -> list[str]:
    return [key.value for key, _ in node.value] if isinstance(node, yaml.MappingNode) else []


def _comment(lines: list[str], end: yaml.Mark) -> str:
    """What the line has from there."""
    return lines[end.line][end.column :].partition("#")[2].strip()


def _text(value: yaml.Node) -> str:
    if isinstance(value, yaml.SequenceNode):
        return ", ".join(item.value for item in value.value)
    if isinstance(value, yaml.MappingNode):
        return ", ".join(f"{key.value}: {_text(item)}" for key, item in value.value)
    return str(value.value)
