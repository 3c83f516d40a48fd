"""What pydantic finds wrong with a file of settings, as sentences for people."""

import difflib
import re
from collections.abc import Iterable
from typing import Any, TypeVar, get_args, get_origin

from pydantic import BaseModel, ValidationError

from mimo.settings.files import dotted, shown

S = TypeVar("S", bound=BaseModel)


def sentences(error: ValidationError, root: type[BaseModel]) -> list[str]:
    """A sentence for each fault: the key, what it must be, what it is, the nearest that is known.

    Args:
        error: of `root`.
        root: the model that was to be made, for the keys it knows.
    """
    return [_sentence(dict(fault), root) for fault in error.errors()]


def unless(faults: list[str], section: S) -> S:
    """`section`, unless there are faults; for the end of a model's validator."""
    if faults:
        raise ValueError("; ".join(faults))
    return section


def bad_names(where: str, names: Iterable[str]) -> list[str]:
    """Which names, at the key `where`, could not be those of files."""
    bad = ", ".join(shown(name) for name in names if not re.fullmatch("[a-z0-9_]{1,40}", name))
    return [f"{where} has {bad}: use small letters, digits and '_' alone, at most 40"] if bad else []


def bad_rewards(where: str, given: list[str], known: Iterable[str]) -> list[str]:
    """What is wrong with the rewards given at the key `where`: a name that is not known, a reward twice."""
    faults = []
    if len(set(given)) < len(given):
        faults.append(f"{where} names one entry twice")
    for reward in given:
        parts = reward.split("_")
        unknown = [part for part in parts if part not in known]
        faults += [
            f"{where} has {shown(reward)}, but {shown(part)} is unknown; {_nearest(part, list(known))}"
            for part in unknown
        ]
        if len(set(parts)) < len(parts):
            faults.append(f"{where} has {shown(reward)}, which adds one reward twice")
    return faults


def _sentence(fault: dict[str, object], root: type[BaseModel]) -> str:
    location = fault["loc"]
    assert isinstance(location, tuple)
    key = dotted(location)
    if fault["type"] == "extra_forbidden":
        return f"{key} is not a known key; {_nearest(str(location[-1]), _keys(root, location[:-1]))}."
    if fault["type"] == "missing":
        return f"{key} is missing."
    if fault["type"] == "model_type":
        return f"{key} must be a section of keys and values."
    message = str(fault["msg"])
    if fault["type"] == "value_error":  # of a section, about the key that its text begins with
        return f"{f'{key}.' if location else ''}{message.removeprefix('Value error, ')}."
    rule = f" must {message[13:]}" if message.startswith("Input should ") else f": {message[:1].lower()}{message[1:]}"
    near = ""
    if fault["type"] == "literal_error" and isinstance(fault["input"], str):
        near = _near(fault["input"], re.findall(r"'(\w+)'", message))
    return f"{key}{rule}{_given(fault['input'])}{near and f', {near}'}."


def _given(value: object) -> str:
    if not isinstance(value, str | int | float | None):
        return ""
    looks_a_number = isinstance(value, str) and re.fullmatch(r"[-+]?[\d.]+([eE][-+]?\d+)?", value)
    hint = ", which is text: write it without quotes, and as 0.001 rather than 1e-3" if looks_a_number else ""
    return f"; it is {shown(value)}{hint}"


def _keys(root: type[BaseModel], location: tuple[object, ...]) -> list[str]:
    kind: Any = root
    for part in location:
        kind = get_args(kind)[1] if get_origin(kind) is dict else kind.model_fields[str(part)].annotation
    return list(kind.model_fields)


def _nearest(name: str, known: list[str]) -> str:
    return _near(name, known) or f"known are {', '.join(known)}"


def _near(name: str, known: list[str]) -> str:
    near = difflib.get_close_matches(name.lower(), known, n=1, cutoff=0.5)
    return f"perhaps {near[0]!r} is meant" if near else ""
