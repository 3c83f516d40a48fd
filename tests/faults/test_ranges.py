"""The ranges of settings: what lies outside could not be computed and is refused; both ends of each really run."""

import functools
import itertools
from collections import Counter
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from mimo.learning import calibrate, effects, resting
from mimo.learning.experiment import Experiment
from mimo.settings import params
from mimo.settings.files import ParamsError
from mimo.settings.params import Params
from mimo.vision import collect
from tests.faults.mutants import PARAMS
from tests.faults.running import ALL, STUDIES, P, Run, train


@pytest.mark.parametrize(
    "changes",
    [
        {"sweep.seeds": 10**12}, {"sweep.chunk": 33}, {"protocol.attached_steps": 10**6},
        {"protocol.updates_per_step": 10**6}, {"collect.worlds": 10**4}, {"collect.steps": 10**5},
        {"encoder.widths": [10**6, 8, 16, 16]}, {"encoder.latent": 10**6}, {"encoder.pairs": 10**6},
        {"encoder.iterations": 10**9}, {"agent.hidden": 10**9}, {"outcomes.memory": 10**9}, {"outcomes.batch": 10**6},
        {"outcomes.quantiles": 10**6}, {"calibrate.steps": 10**9}, {"world.rope_slack": 5.0}, {"agent.move_bias": -9.0},
    ],
    ids=str,
)  # fmt: skip
def test_what_could_not_be_computed_is_refused(changes: dict[str, object]) -> None:
    with pytest.raises(ParamsError) as caught:
        params.changed(P, changes)
    assert str(caught.value).startswith(next(iter(changes)))


@pytest.mark.parametrize(
    "changes",
    [{"worlds": 10**6}, {"steps": 10**6}, {"dropped": 10**6}, {"steps": 39, "dropped": 20, "worlds": 1}],
    ids=str,
)
def test_effects_that_could_not_be_computed_are_refused(changes: dict[str, object]) -> None:
    with pytest.raises(ParamsError) as caught:
        params.checked(STUDIES, {"effects": STUDIES.effects.model_dump() | changes})
    named = "effects.steps less dropped, times worlds," if len(changes) > 1 else f"effects.{next(iter(changes))}"
    assert str(caught.value).startswith(named)


def test_more_seeds_than_files_can_be_numbered_are_refused() -> None:
    noise = STUDIES.studies["noise"]
    with pytest.raises(ParamsError, match=r"^studies\.noise\.seeds must"):
        params.checked(STUDIES, {"studies": {"noise": noise.model_dump() | {"seeds": 1001}}})


# The ends of every range.

LIMITS = {"ge": 0, "gt": 1, "le": 0, "lt": -1}  # from a whole number's limit to the end of its range
REACHING = (
    "protocol",
    "conditions.noisy",
    "world",
    "encoder",
    "agent",
    "outcomes",
    "rewards",
    "rewards.rtl",
    "rewards.kl",
    "rewards.mmd",
    "rewards.rnd",
    "rewards.progress",
    "rewards.cai",
)  # sections a run reads
WITH: dict[tuple[str, float], dict[str, Any]] = {  # what an end needs to fit the other values
    ("protocol.updates_per_step", 1): {"protocol.torque_updates": 1, "protocol.updates_per_step": 2,
                                       "collect.pair_updates": 1},
    ("protocol.torque_updates", 2000): {"protocol.torque_updates": 120},
    ("agent.temperature", 0.001): {"agent.move_bias": -0.001},
    ("agent.gamma", 1): {"agent.gamma": 0.999999},
}  # fmt: skip


def ends(section: str) -> Iterator[dict[str, Any]]:
    """The least and the greatest value of each number in a section, with what must go with it."""
    for name, field in type(functools.reduce(getattr, section.split("."), P)).model_fields.items():
        for limit, (sign, step) in itertools.product(field.metadata, LIMITS.items()):
            if field.annotation in (int, float) and (value := getattr(limit, sign, None)) is not None:
                end = value + step if field.annotation is int else value
                yield {f"{section}.{name}": end} | WITH.get((f"{section}.{name}", end), {})


ROWS = 8
ENDS: list[list[dict[str, Any]]] = [list(ends(section)) for section in REACHING]
ENDS += [[{"encoder.widths": [width] * 4} for width in (1, 32)], [{"agent.move_bias": bias} for bias in (-1.5, 1.5)]]


@pytest.mark.parametrize("row", range(ROWS))
def test_the_ends_of_ranges_run(row: int, run: Run) -> None:
    """At most two ends of each section at a time."""
    changes: dict[str, Any] = {}
    for section in ENDS:
        for end in section[row::ROWS]:
            assert not changes.keys() & end.keys()
            changes |= end
    run(params.changed(P, changes))


def test_every_number_that_a_run_reads_has_two_ends() -> None:
    ended = Counter(next(iter(end)) for section in ENDS for end in section)
    assert set(ended.values()) == {2}
    places = [tuple(section.split(".")) for section in REACHING]
    assert set(ended) - {"encoder.widths"} == {".".join(map(str, n)) for n in PARAMS.numbers if n[:-1] in places}


def test_the_least_that_may_be_asked_for_runs(tiny: Params) -> None:
    """All stages that compute, with the least of everything that is counted, but for the protocol."""
    least = {
        "collect.worlds": 1, "collect.steps": 5, "collect.pair_updates": 1, "encoder.widths": [1, 1, 1, 1],
        "encoder.latent": 1, "encoder.projection": 1, "encoder.pairs": 2, "encoder.iterations": 1, "agent.hidden": 1,
        "outcomes.quantiles": 1, "outcomes.batch": 1, "outcomes.memory": 1, "calibrate.steps": 4,
        "calibrate.worlds": 1,
    }  # fmt: skip
    p = params.changed(tiny, least)
    frames, _ = collect.collect(p)
    sight = train(p.encoder, frames.reshape(len(frames), -1, *frames.shape[3:]), np.random.default_rng(0))
    scales = calibrate.scales(p, sight, resting.record(p, sight))
    for dataset in Experiment(p, "noisy", ALL, [0], sight, scales).run()[0].values():
        assert np.isfinite(dataset.values).all()
    asked = params.checked(STUDIES.effects, {"steps": 40, "worlds": 1})
    found = effects.measure(p, asked, sight)
    assert np.isfinite(found["noisy"]["rtl"]["attached"]).all()
