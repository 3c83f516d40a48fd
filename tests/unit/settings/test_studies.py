"""studies/params.yaml: studies of variants of the published params, and worlds in which effects are measured."""

from pathlib import Path
from typing import Any

import pytest
import yaml

from mimo.settings import params, studies
from mimo.settings.files import ParamsError
from mimo.settings.studies import Studies
from tests.unit.settings.shipped import MISSING, PARAMS, STUDIES, Keys

P = params.load(PARAMS.path)
PLAIN = {"asks": "why?", "set": {"rewards.gain": 1.0}, "cells": {"free": ["mtl"], "noisy": ["mtl", "cais_surprise"]}}
STUDY = {
    "title": "A study",
    "asks": "Why?",
    "expects": "Nothing.",
    "limits": "Much.",
    "seeds": 2,
    "measures": ["lead", "locked"],
    "cells": {"noisy": ["rtl"]},
    "variants": {"plain": PLAIN},
}


def refused(folder: Path, name: Any = "plain", **changes: Any) -> list[str]:
    """The sentences that refuse PLAIN with some changes, as the only variant of STUDY, less where that stands."""
    sentences = asked(folder, variants={name: PLAIN | changes})
    return [sentence.removeprefix(f".variants.{name}") for sentence in sentences]


def asked(folder: Path, **changes: Any) -> list[str]:
    """The sentences that refuse STUDY with some changes, as the only study, less where that stands."""
    study = {key: value for key, value in (STUDY | changes).items() if value is not MISSING}
    sentences = STUDIES.faults(folder, {("studies",): {"own": study}})
    return [sentence.removeprefix("studies.own") for sentence in sentences]


def found(**changes: Any) -> studies.Study:
    """STUDY with some changes, which holds."""
    return Studies.model_validate(STUDIES.changed({("studies",): {"own": STUDY | changes}})).studies["own"]


# Variants.


def test_a_variant_is_the_published_params_with_some_values_changed() -> None:
    changes = {
        "conditions.noisy.force": 20,
        "world.rope_slack": 0.01,
        "world.rope_holds": 0.5,
        "encoder.latent_sd": 1.0,
        "agent.gamma": 0.5,
        "outcomes.memory": 7,
        "rewards.cais.pays": "taken",
        "protocol.limb": "right_hand",
        "collect.limbs": "all",
        "collect.draw": 3,
    }
    variants = {"plain": PLAIN, "many": {"set": changes}}
    study = found(variants=variants)
    assert params.changed(P, study.variants["plain"].set).rewards.gain == 1.0
    many = params.changed(P, study.variants["many"].set)
    assert many.model_dump() == PARAMS.changed({tuple(key.split(".")): value for key, value in changes.items()})
    assert isinstance(many.conditions.noisy.force, float)
    assert PARAMS.whole["rewards"]["gain"] == P.rewards.gain != 1.0
    assert study.pairs("plain") == (("free", "mtl"), ("noisy", "mtl"), ("noisy", "cais_surprise"))
    assert study.pairs("many") == (("noisy", "rtl"),)  # the study's own


@pytest.mark.parametrize(
    "key",
    ["seed", "protocol", "protocol.limbs", "protocol.attached_steps", "collect", "collect.steps", "encoder",
     "encoder.tau", "encoder.latent", "encoder.latent_sdx", "sweep.seeds", "calibrate.worlds", "film.steps"],
)  # fmt: skip
def test_a_variant_may_not_change_what_all_share(key: str, tmp_path: Path) -> None:
    assert refused(tmp_path, set={key: 3}) == [
        f".set has {key!r}, but a variant may change only conditions, world, agent, outcomes, rewards, "
        "encoder.latent_sd, protocol.limb, collect.limbs, collect.draw."
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
        ({"collect.draw": -1}, "collect.draw must be greater than or equal to 0; it is -1."),
    ],
)
def test_a_variant_that_sets_what_does_not_hold_is_refused(
    change: dict[str, Any], sentence: str, tmp_path: Path
) -> None:
    (said,) = refused(tmp_path, set=change)
    assert said.startswith(f".set: {sentence}")


@pytest.mark.parametrize("key", ["world", "rewards.cais", "conditions.free"])
def test_a_section_in_place_of_its_values_is_refused(key: str, tmp_path: Path) -> None:
    """Else the keys that it leaves out would be lost, and those of a key below it could be set twice."""
    assert refused(tmp_path, set={key: {"pays": "move"}}) == [f".set has {key!r}, a section; give its values."]


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"asks": ""}, ".asks: string should have at least 1 character"),
        ({"set": 3}, ".set must be a valid dictionary; it is 3."),
        ({"cells": {}}, ".cells: dictionary should have at least 1 item"),
        ({"cells": {"free": []}}, ".cells.free: list should have at least 1 item"),
        ({"cells": {"windy": ["mtl"]}}, ".cells.windy must be 'free' or 'noisy'; it is 'windy'."),
        ({"cells": {"free": ["rtll"]}}, ".cells.free has 'rtll', but 'rtll' is unknown; perhaps 'rtl' is meant."),
        ({"cells": {"free": ["mtl", "mtl"]}}, ".cells.free names one entry twice."),
        ({"cells": {"free": ["mtl_mtl"]}}, ".cells.free has 'mtl_mtl', which adds one reward twice."),
        ({"aks": "why?"}, ".aks is not a known key; perhaps 'asks' is meant."),
        ({"yoked": ""}, ".yoked: string should have at least 1 character"),
        ({"yoked": "cias"}, ".yoked has 'cias', but 'cias' is unknown; perhaps 'cais' is meant."),
    ],
)
def test_a_variant_of_another_shape_is_refused(changes: dict[str, Any], sentence: str, tmp_path: Path) -> None:
    (said,) = refused(tmp_path, **changes)
    assert said.startswith(sentence)


# Spaces.

SPAN = {
    "set": {"agent.gamma": 0.5},
    "points": 20,
    "over": {
        "rewards.gain": {"low": 0.1, "high": 1.0, "log": True},
        "outcomes.batch": {"low": 2, "high": 32},
        "rewards.cais.pays": {"of": ["move", "taken"]},
        "agent.bias_in_target": {"of": [True, False]},
    },
}


def spanned(**changes: Any) -> studies.Study:
    return studies.spanned(P, found(variants={"p": SPAN | changes, "plain": PLAIN}))


def test_a_variant_with_points_is_so_many_of_its_ranges() -> None:
    study = spanned()
    assert [*study.variants] == [*(f"p{place:02d}" for place in range(20)), "plain"]
    values = [variant.set for name, variant in study.variants.items() if name != "plain"]
    assert all(own["agent.gamma"] == 0.5 for own in values)
    gains, batches = [own["rewards.gain"] for own in values], [own["outcomes.batch"] for own in values]
    assert all(0.1 <= gain < 1 and float(f"{gain:.3g}") == gain for gain in gains)
    assert 8 <= sum(gain < 0.1**0.5 for gain in gains) <= 12  # half of it, in the logarithm
    assert all(type(batch) is int and 2 <= batch <= 32 for batch in batches)
    assert 8 <= sum(batch < 17 for batch in batches) <= 12
    assert 8 <= sum(own["rewards.cais.pays"] == "move" for own in values) <= 12
    assert {own["agent.bias_in_target"] for own in values} == {True, False}
    assert all(params.changed(P, own) for own in values)


def test_with_more_points_the_first_are_the_same() -> None:
    few, many = spanned(), spanned(points=40)
    assert all(
        many.variants[name] == variant.model_copy(update={"points": 40})
        for name, variant in few.variants.items()
        if name != "plain"
    )


def test_a_study_of_one_space_alone_has_it() -> None:
    whole = studies.spanned(P, found(variants={"p": SPAN}))
    assert whole.space.keys() == {"rewards.gain", "outcomes.batch", "rewards.cais.pays", "agent.bias_in_target"}
    assert spanned().space == {}
    assert found().space == {}
    two = studies.spanned(
        P, found(variants={name: SPAN | {"set": {"agent.gamma": gamma}} for name, gamma in (("p", 0.1), ("q", 0.2))})
    )
    assert len(two.variants) == 40
    assert two.space == {}


@pytest.mark.parametrize("values", [{"low": 0.1, "high": 1.0, "log": True}, {"low": -1.0, "high": 2.0}])
def test_a_share_of_a_range_and_its_value_are_each_others(values: dict[str, Any]) -> None:
    own = studies.Range.model_validate(values)
    for share in (0.0, 0.2, 0.99):
        assert own.share(own.value(share, float)) == pytest.approx(share, abs=0.01)


def test_of_a_few_values_each_has_the_middle_of_its_stretch() -> None:
    own = studies.Range.model_validate({"of": ["a", "b"]})
    assert [own.value(share, str) for share in (0.0, 0.49, 0.5, 0.99)] == ["a", "a", "b", "b"]
    assert [own.share(value) for value in "ab"] == [0.25, 0.75]


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"points": None}, ".points and over must be given together, or neither."),
        ({"over": None}, ".points and over must be given together, or neither."),
        ({"points": 7}, ".points must be greater than or equal to 8; it is 7."),
        ({"set": {"rewards.gain": 1.0}}, ".set has 'rewards.gain', which is in over, too."),
        ({"over": {"agent.gamma": {"of": ["a"] * 3}}}, ".over.'agent.gamma'.of: list should have at most 2 items"),
        ({"over": {}}, ".over: dictionary should have at least 1 item"),
        ({"over": {"seed": {"low": 0, "high": 3}}}, ".over has 'seed', but a variant may change only "),
        ({"over": {"agent.gamma": {"low": 1.0, "high": 0.1}}}, ".over.'agent.gamma'.low must be less than high, and "),
        ({"over": {"agent.gamma": {"low": 0.0, "high": 0.1, "log": True}}}, ".over.'agent.gamma'.low must be "),
        ({"over": {"agent.gamma": {"low": 0.1}}}, ".over.'agent.gamma'.low and high, or else of, must be given."),
        ({"over": {"agent.gamma": {"low": 0.1, "high": 0.2, "of": [True, False]}}}, ".over.'agent.gamma'.low and "),
        ({"over": {"agent.gamma": {"of": ["a"]}}}, ".over.'agent.gamma'.of: list should have at least 2 items"),
        ({"over": {"agent.gamma": {"of": ["a", "a"]}}}, ".over.'agent.gamma'.of must have two values, not one twice."),
    ],
)  # fmt: skip
def test_a_space_of_another_shape_is_refused(changes: dict[str, Any], sentence: str, tmp_path: Path) -> None:
    (said,) = refused(tmp_path, **SPAN | changes)
    assert said.startswith(sentence)


@pytest.mark.parametrize("key", ["agent.gama", "worl.mass", "rewards.gain.size"])  # each has its sentence above
def test_a_range_of_an_unknown_constant_is_told_at_its_points(key: str, tmp_path: Path) -> None:
    said = asked(tmp_path, variants={"p": SPAN | {"over": {key: {"low": 0.1, "high": 0.2}}}})
    assert len(said) == 20
    assert said[0].startswith(f".variants.p00.set: {key.split('.', maxsplit=1)[0]}")


def test_a_variant_may_not_have_the_name_of_a_point(tmp_path: Path) -> None:
    said = asked(tmp_path, variants={"p": SPAN, "p03": PLAIN})
    assert said == [".variants has 'p03', which is the name of a point."]


def test_a_value_beyond_a_range_has_no_place_in_it() -> None:
    own = studies.Range.model_validate({"low": 0.1, "high": 1.0, "log": True})
    assert [own.place(value) for value in (0.0, 0.1, 1.0, 1.1)] == [None, 0, 1, None]
    assert studies.Range.model_validate({"of": ["a", "b"]}).place("c") is None


def test_seeds_may_begin_at_any(tmp_path: Path) -> None:
    assert found(seeds=5).numbers() == range(5)
    assert found(variants={"plain": PLAIN | {"first": 2}}, seeds=5).numbers() == range(2, 7)
    said = asked(tmp_path, variants={"plain": PLAIN | {"first": 998}}, seeds=5)
    assert said == [".seeds and the first of variants come to more than 1000; files have three digits."]
    said = asked(tmp_path, variants={"plain": PLAIN | {"first": 2}, "other": PLAIN})
    assert said == [".variants must have one first seed for all."]


def test_a_yoked_variant_has_the_papers_runs_for_donors(tmp_path: Path) -> None:
    assert found(variants={"plain": PLAIN | {"set": {}, "yoked": "cais"}}).variants["plain"].yoked == "cais"
    assert refused(tmp_path, yoked="cais") == [" is yoked, so its set must be empty: donors' worlds are the paper's."]
    assert refused(tmp_path, set={}, yoked="mtl_cais") == [" is yoked to 'mtl_cais', which is not among sweep.rewards."]
    small = P.model_copy(update={"sweep": P.sweep.model_copy(update={"conditions": ["free"]})})
    path = tmp_path / "studies.yaml"
    study = STUDY | {"variants": {"plain": PLAIN | {"set": {}, "yoked": "cais"}}}
    path.write_text(yaml.safe_dump(STUDIES.changed({("studies",): {"own": study}})))
    with pytest.raises(ParamsError, match=r"variants\.plain is yoked in 'noisy', which is not among sweep\.conditions"):
        studies.load(small, path)


@pytest.mark.parametrize("name", ["Gain", "gain-1", "gain 1", "", "gain/1"])
def test_a_name_is_small_letters_digits_and_underscores(name: str, tmp_path: Path) -> None:
    said = f" has {name!r}: use small letters, digits and '_' alone, at most 40."
    assert asked(tmp_path, variants={name: PLAIN}) == [f".variants{said}"]
    assert STUDIES.faults(tmp_path, {("studies",): {name: STUDY}}) == [f"studies{said}"]


def test_variants_cannot_be_none_nor_nameless(tmp_path: Path) -> None:
    (sentence,) = asked(tmp_path, variants={})
    assert sentence.startswith(".variants: dictionary should have at least 1 item")
    (sentence,) = asked(tmp_path, variants={500: PLAIN})
    assert sentence == ".variants.500 must be a valid string; it is 500."


def test_every_variant_at_fault_is_named(tmp_path: Path) -> None:
    variants = {name: PLAIN | {"set": {"agent.gamma": 1.0}} for name in ("one", "two")}
    assert asked(tmp_path, variants=variants) == [
        f".variants.{name}.set: agent.gamma must be less than 1; it is 1.0." for name in variants
    ]


# Studies.


@pytest.mark.parametrize("key", [key for key in STUDY if key != "axis"])
def test_a_key_that_a_study_lacks_is_named(key: str, tmp_path: Path) -> None:
    assert asked(tmp_path, **{key: MISSING}) == [f".{key} is missing."]


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"titel": "?"}, ".titel is not a known key; perhaps 'title' is meant."),
        ({"title": " "}, ".title: string should have at least 1 character"),
        ({"expects": 3}, ".expects must be a valid string; it is 3."),
        ({"seeds": 0}, ".seeds must be greater than 0; it is 0."),
        ({"measures": []}, ".measures: list should have at least 1 item"),
        ({"measures": ["lead", "limb", "lead"]}, ".measures names one entry twice."),
        ({"cells": {}}, ".cells: dictionary should have at least 1 item"),
        ({"cells": {"noisy": ["rtl", "cias"]}},
         ".cells.noisy has 'cias', but 'cias' is unknown; perhaps 'cais' is meant."),
        ({"cells": {"noisy": ["rtl", "rtl"]}}, ".cells.noisy names one entry twice."),
        ({"axis": ""}, ".axis: string should have at least 1 character"),
        ({"variants": {"encoders": PLAIN}}, ".variants has 'encoders', which another file is named."),
        ({"variants": {name: {"set": {"collect.draw": 3}} for name in ("one", "two")}},
         ".variants.two and variants.one have one value of 'collect.draw'."),
        ({"variants": {"one": {"set": {"collect.draw": P.collect.draw}}}},
         ".variants.one sets 'collect.draw' alone, to what it is as published."),
        ({"axis": "world.rope_holds"},
         ".variants.plain.set must give 'world.rope_holds', the axis, a number."),
        ({"axis": "rewards.cais.pays", "variants": {"plain": {"set": {"rewards.cais.pays": "taken"}}}},
         ".variants.plain.set must give 'rewards.cais.pays', the axis, a number."),
        ({"axis": "agent.bias_in_target", "variants": {"plain": {"set": {"agent.bias_in_target": True}}}},
         ".variants.plain.set must give 'agent.bias_in_target', the axis, a number."),
    ],
)  # fmt: skip
def test_a_study_of_another_shape_is_refused(changes: dict[str, Any], sentence: str, tmp_path: Path) -> None:
    (said,) = asked(tmp_path, **changes)
    assert said.startswith(sentence)


def test_an_axis_is_set_to_a_number_by_every_variant(tmp_path: Path) -> None:
    own = {"axis": "conditions.noisy.force", "variants": {name: {"set": {}} for name in ("one", "two")}}
    (said,) = asked(tmp_path, **own)
    assert (
        said
        == "; ".join(
            [f".variants.{name}.set must give 'conditions.noisy.force', the axis, a number" for name in ("one", "two")]
        ).replace("; .", "; ")
        + "."
    )
    same = {name: {"set": {"conditions.noisy.force": value}} for name, value in (("one", 1), ("two", 1.0))}
    (said,) = asked(tmp_path, **own | {"variants": same})
    assert said == ".variants.two and variants.one have one value of 'conditions.noisy.force'."
    doses = {"one": {"set": {"conditions.noisy.force": 1.0}}, "two": {"set": {"conditions.noisy.force": 2}}}
    assert found(**own | {"variants": doses}).axis == "conditions.noisy.force"


@pytest.mark.parametrize("name", ["artifacts", "effects"])
def test_a_study_may_not_have_the_name_of_another_file(name: str, tmp_path: Path) -> None:
    said = f"studies has {name!r}, which another file is named."
    assert STUDIES.faults(tmp_path, {("studies",): {name: STUDY}}) == [said]


def test_studies_cannot_be_none(tmp_path: Path) -> None:
    (sentence,) = STUDIES.faults(tmp_path, {("studies",): {}})
    assert sentence.startswith("studies: dictionary should have at least 1 item")


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
