"""studies/params.yaml: variants of the published params, and worlds in which effects are measured."""

from pathlib import Path
from typing import Any

import pytest

from mimo.settings import params, studies
from mimo.settings.studies import Studies
from tests.unit.settings.shipped import PARAMS, STUDIES, Keys

P = params.load(PARAMS.path)
PLAIN = {"asks": "why?", "set": {"rewards.gain": 1.0}, "cells": {"free": ["mtl"], "noisy": ["mtl", "cais_surprise"]}}


def refused(folder: Path, name: Any = "plain", **changes: Any) -> list[str]:
    """The sentences that refuse PLAIN with some changes, as the only variant, less where that stands."""
    sentences = STUDIES.faults(folder, {("sweeps", "variants"): {name: PLAIN | changes}})
    return [sentence.removeprefix(f"sweeps.variants.{name}") for sentence in sentences]


def test_a_variant_is_the_published_params_with_some_values_changed() -> None:
    changes = {
        "conditions.noisy.force": 20,
        "world.rope_slack": 0.01,
        "encoder.latent_sd": 1.0,
        "agent.gamma": 0.5,
        "outcomes.memory": 7,
        "rewards.cais.pays": "taken",
    }
    variants = {"plain": PLAIN, "many": PLAIN | {"set": changes}}
    found = Studies.model_validate(STUDIES.changed({("sweeps", "variants"): variants})).sweeps.variants
    assert params.changed(P, found["plain"].set).rewards.gain == 1.0
    many = params.changed(P, found["many"].set)
    assert many.model_dump() == PARAMS.changed({tuple(key.split(".")): value for key, value in changes.items()})
    assert isinstance(many.conditions.noisy.force, float)
    assert PARAMS.whole["rewards"]["gain"] == P.rewards.gain != 1.0
    assert found["plain"].pairs == (("free", "mtl"), ("noisy", "mtl"), ("noisy", "cais_surprise"))


@pytest.mark.parametrize(
    "key",
    ["seed", "protocol.limb", "collect.steps", "encoder", "encoder.tau", "encoder.latent", "encoder.latent_sdx",
     "sweep.seeds", "calibrate.worlds"],
)  # fmt: skip
def test_a_variant_may_not_change_what_the_published_encoder_or_the_sweep_is_made_of(key: str, tmp_path: Path) -> None:
    assert refused(tmp_path, set={key: 3}) == [
        f".set has {key!r}, but a variant may change only conditions, world, agent, outcomes, rewards, "
        "encoder.latent_sd."
    ]


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"world.mobile_mas": 1.0}, "world.mobile_mas is not a known key; perhaps 'mobile_mass' is meant."),
        ({"sweeps.seeds": 1}, "sweeps is not a known key; perhaps 'sweep' is meant."),
        ({"wrld.mobile_mass": 1.0}, "wrld is not a known key; perhaps 'world' is meant."),
        ({"rewards.cias.pays": "move"}, "rewards.cias is not a known key; perhaps 'cais' is meant."),
        ({"gain": 1.0}, "gain is not a known key; known are "),
        ({"rewards.gain.size": 1.0}, "rewards.gain.size is not a known key; gain is a value, not a section."),
        ({"world": 1.0}, "world must be a section of keys and values."),
        ({"world.mobile_mass": -1.0}, "world.mobile_mass must be greater than or equal to 0.001; it is -1.0."),
        ({"world.mobile_mass": "1e-3"}, "world.mobile_mass must be a valid number; it is '1e-3', which is text: "),
        ({"world.mobile_mass": [0.1, 0.2]}, "world.mobile_mass must be a valid number."),
        ({"agent.gamma": None}, "agent.gamma must be a valid number; it is None."),
        (
            {"rewards.cais.pays": "mvoe"},
            "rewards.cais.pays must be 'move' or 'taken'; it is 'mvoe', perhaps 'move' is meant.",
        ),
    ],
)
def test_a_variant_that_sets_what_does_not_hold_is_refused(
    change: dict[str, Any], sentence: str, tmp_path: Path
) -> None:
    (found,) = refused(tmp_path, set=change)
    assert found.startswith(f".set: {sentence}")


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"asks": ""}, ".asks: string should have at least 1 character"),
        ({"set": {}}, ".set: dictionary should have at least 1 item"),
        ({"cells": {}}, ".cells: dictionary should have at least 1 item"),
        ({"cells": {"free": []}}, ".cells.free: list should have at least 1 item"),
        ({"cells": {"windy": ["mtl"]}}, ".cells.windy must be 'free' or 'noisy'; it is 'windy'."),
        ({"cells": {"free": ["rtll"]}}, ".cells.free has 'rtll', but 'rtll' is unknown; perhaps 'rtl' is meant."),
        ({"cells": {"free": ["mtl", "mtl"]}}, ".cells.free names one entry twice."),
        ({"cells": {"free": ["mtl_mtl"]}}, ".cells.free has 'mtl_mtl', which adds one reward twice."),
        ({"aks": "why?"}, ".aks is not a known key; perhaps 'asks' is meant."),
    ],
)
def test_a_variant_of_another_shape_is_refused(changes: dict[str, Any], sentence: str, tmp_path: Path) -> None:
    (found,) = refused(tmp_path, **changes)
    assert found.startswith(sentence)


@pytest.mark.parametrize("name", ["Gain", "gain-1", "gain 1", "", "gain/1"])
def test_a_variants_name_is_small_letters_digits_and_underscores(name: str, tmp_path: Path) -> None:
    (sentence,) = STUDIES.faults(tmp_path, {("sweeps", "variants"): {name: PLAIN}})
    assert sentence == f"sweeps.variants has {name!r}: use small letters, digits and '_' alone, at most 40."


def test_variants_cannot_be_none_nor_nameless(tmp_path: Path) -> None:
    (sentence,) = STUDIES.faults(tmp_path, {("sweeps", "variants"): {}})
    assert sentence.startswith("sweeps.variants: dictionary should have at least 1 item")
    (sentence,) = STUDIES.faults(tmp_path, {("sweeps", "variants"): {500: PLAIN}})
    assert sentence == "sweeps.variants.500 must be a valid string; it is 500."


def test_every_variant_at_fault_is_named(tmp_path: Path) -> None:
    variants = {name: PLAIN | {"set": {"agent.gamma": 1.0}} for name in ("one", "two")}
    assert STUDIES.faults(tmp_path, {("sweeps", "variants"): variants}) == [
        f"sweeps.variants.{name}.set: agent.gamma must be less than 1; it is 1.0." for name in variants
    ]


# Worlds in which effects are measured besides the published one.


def test_an_alternative_is_the_published_params_in_another_world() -> None:
    alternatives = {"heavy": {"world.mobile_mass": 1, "world.rope_slack": 0.05}}
    found = Studies.model_validate(STUDIES.changed({("effects", "alternatives"): alternatives}))
    other = params.changed(P, found.effects.alternatives["heavy"])
    world = P.world.model_copy(update={"mobile_mass": 1.0, "rope_slack": 0.05})
    assert other == P.model_copy(update={"world": world})
    assert isinstance(other.world.mobile_mass, float)


@pytest.mark.parametrize(
    ("alternatives", "sentence"),
    [
        ({"a": {"agent.gamma": 0.5}},
         "effects.alternatives.a has 'agent.gamma', but an alternative may change only world."),
        ({"a": {"world": 1.0}}, "effects.alternatives.a has 'world', but an alternative may change only world."),
        ({"a-b": {"world.rope_slack": 0.05}},
         "effects.alternatives has 'a-b': use small letters, digits and '_' alone, at most 40."),
        ({"published": {"world.rope_slack": 0.05}},
         "effects.alternatives has 'published', which is the world of params.yaml itself."),
        ({"a": {"world.mobile_mas": 1.0}},
         "effects.alternatives.a: world.mobile_mas is not a known key; perhaps 'mobile_mass' is meant."),
        ({"a": {"world.mobile_mass": -1.0}},
         "effects.alternatives.a: world.mobile_mass must be greater than or equal to 0.001; it is -1.0."),
        ({"a": {}}, "effects.alternatives.a: dictionary should have at least 1 item after validation, not 0."),
        ({"a": 1.0}, "effects.alternatives.a must be a valid dictionary; it is 1.0."),
    ],
)  # fmt: skip
def test_an_alternative_that_does_not_hold_is_refused(
    alternatives: dict[str, Any], sentence: str, tmp_path: Path
) -> None:
    assert STUDIES.faults(tmp_path, {("effects", "alternatives"): alternatives}) == [sentence]


def test_enough_steps_are_left_for_every_joint_to_move_and_to_rest(tmp_path: Path) -> None:
    few: dict[Keys, int] = {("effects", "dropped"): 30, ("effects", "steps"): 31, ("effects", "worlds"): studies.FEWEST}
    assert Studies.model_validate(STUDIES.changed(few)).effects.steps == 31
    changes: tuple[dict[Keys, int], ...] = (
        {("effects", "worlds"): studies.FEWEST - 1},
        {("effects", "steps"): 30},
        {("effects", "steps"): 9},
    )
    for change in changes:
        assert STUDIES.faults(tmp_path, few | change) == [
            "effects.steps less dropped, times worlds, must be at least 20, for every joint to move and to rest."
        ]
