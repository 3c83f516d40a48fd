"""The intrinsic rewards (paper §3.3 to §3.5), a file each.

To add one, put a file here with a subclass of Reward: params.yaml then accepts its name, alone or joined to others by
`_`. These files load without params.py, which reads the rewards: a section is made from `mimo.settings.section`.
"""

import importlib
import pkgutil
from collections.abc import Callable, Iterable, Sequence

import numpy as np

from mimo.learning.rewards.reward import REWARDS, Reward, Transition
from mimo.settings.errors import Fault
from mimo.settings.section import Section

__all__ = [
    "REWARDS",
    "Reward",
    "Transition",
    "UnknownRewardError",
    "frames",
    "modules",
    "needs_outcomes",
    "paid",
    "parts",
]


class RewardFileError(Fault):
    """A file in this folder cannot be used; the message names it."""


for _file in pkgutil.iter_modules(__path__):
    try:
        importlib.import_module(f"{__name__}.{_file.name}")
    except Exception as fault:  # whatever its author's code raises
        path = "/".join((*__name__.split("."), f"{_file.name}.py"))
        said = str(fault).removesuffix(".")
        raise RewardFileError(f"{path} cannot be used: {type(fault).__name__}: {said}.") from fault


class UnknownRewardError(LookupError):
    """A reward's name that no class has; the message is a sentence."""


class RewardError(Fault, RuntimeError):
    """A reward gave something that is none; the message names it."""


def parts(
    name: str, settings: Section, draws: Callable[[str], Sequence[np.random.Generator]] = lambda reward: ()
) -> list[Reward]:
    """The rewards that `name` adds up, in its order: `mtl_surprise` is MTL and Surprise.

    Args:
        name: of one reward, or of several joined by `_`.
        settings: the section `rewards` of params.yaml.
        draws: a generator for each seed, by reward's name; for rewards that learn.

    Raises:
        UnknownRewardError: a part is no reward's name.
    """
    return [kind(getattr(settings, kind.name) if kind.Constants else None, draws(kind.name)) for kind in _kinds(name)]


def paid(terms: Iterable[Reward], t: Transition) -> list[np.ndarray]:
    """What each reward gives for a step: (N, 12) float32, in its own units.

    Raises:
        RewardError: a reward gives another shape, or no numbers.
    """
    found = []
    for term in terms:
        values = np.asarray(term(t))
        if values.shape != t.action.shape or values.dtype.kind not in "biuf":
            raise RewardError(
                f"reward {term.name} must give numbers {t.action.shape}, one a joint of each seed; "
                f"it gave {values.shape} of {values.dtype}."
            )
        found.append(values.astype(np.float32))
    return found


def needs_outcomes(name: str) -> bool:
    """Whether any part of `name` needs the outcome models.

    Raises:
        UnknownRewardError: a part is no reward's name.
    """
    return any(kind.needs_outcomes for kind in _kinds(name))


def frames(terms: Iterable[Reward]) -> int:
    """How many pictures of a step rewards need, evenly in time, the last at its end.

    Raises:
        RewardError: some need other pictures than others, none of which are at the same times.
    """
    asked = {term.frames for term in terms} - {1}
    if len(asked) > 1:
        raise RewardError(
            f"rewards that are paid together ask for {' and '.join(map(str, sorted(asked)))} pictures a step."
        )
    return asked.pop() if asked else 1


def modules(name: str) -> list[str]:
    """The modules that `name` is computed by, which decide its runs and no others.

    Raises:
        UnknownRewardError: a part is no reward's name.
    """
    return [kind.__module__ for kind in _kinds(name)]


def _kinds(name: str) -> list[type[Reward]]:
    unknown = [part for part in name.split("_") if part not in REWARDS]
    if unknown:
        raise UnknownRewardError(f"{name!r} has an unknown part, {unknown[0]!r}: known are {', '.join(REWARDS)}.")
    return [REWARDS[part] for part in name.split("_")]
