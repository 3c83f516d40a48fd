"""params.yaml: what is shipped loads; whatever does not hold is refused, one sentence for each fault."""

import copy
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel, ValidationError

from mimo.settings import params

SHIPPED = Path(__file__).parents[2] / "params.yaml"
WHOLE: dict[str, Any] = yaml.safe_load(SHIPPED.read_text())

Keys = tuple[str, ...]
NAMED = ("variants", "alternatives")  # sections of free names


def walk(section: dict[str, Any], above: Keys = ()) -> Iterator[tuple[Keys, Any]]:
    """Every key; variants and alternatives, whose names are free, have tests of their own."""
    for key, value in section.items():
        yield (*above, key), value
        if isinstance(value, dict) and key not in NAMED:
            yield from walk(value, (*above, key))


SECTIONS = [keys for keys, value in walk(WHOLE) if isinstance(value, dict) and keys[-1] not in NAMED]
NUMBERS = [keys for keys, value in walk(WHOLE) if isinstance(value, int | float)]
FLOATS = [keys for keys, value in walk(WHOLE) if isinstance(value, float)]
WORDS = [keys for keys, value in walk(WHOLE) if isinstance(value, str)]
LISTS = [keys for keys, value in walk(WHOLE) if isinstance(value, list)]


def dotted(keys: Keys) -> str:
    return ".".join(keys)


def faults(folder: Path, changes: dict[Keys, Any]) -> list[str]:
    """Change the shipped params, load them, and return the sentences that refuse them."""
    changed = copy.deepcopy(WHOLE)
    for keys, value in changes.items():
        section = changed
        for key in keys[:-1]:
            section = section[key]
        section[keys[-1]] = value
    path = folder / "params.yaml"
    path.write_text(yaml.dump(changed, Dumper=yaml.CSafeDumper))
    with pytest.raises(params.ParamsError) as caught:
        params.load(path)
    sentences = str(caught.value).splitlines()
    for sentence in sentences:
        assert sentence.startswith(f"{path}: ")
        assert sentence.endswith(".")
        assert not re.search(r"[?!.;,:]\.$", sentence)
    return [sentence.removeprefix(f"{path}: ") for sentence in sentences]


def test_the_shipped_file_loads():
    loaded = params.load(SHIPPED)
    assert loaded.model_dump() == WHOLE


def test_each_constant_says_where_it_comes_from():
    """Of a variant, `asks` says it."""
    unsourced = []
    text, variants = SHIPPED.read_text().split("\n  variants:")
    assert variants.count("\n      asks: ") == len(WHOLE["sweeps"]["variants"])
    for line in text.splitlines():
        code, _, comment = line.partition("#")
        is_constant = code.strip() and not code.rstrip().endswith(":")
        if is_constant and not re.search(r"\bpaper (§\d|fig|appendix)|\bours: \w", comment):
            unsourced.append(line)
    assert not unsourced


def test_exponents_have_no_place_in_the_file():
    code = "\n".join(line.partition("#")[0] for line in SHIPPED.read_text().splitlines())
    assert not re.search(r"\d[eE]-?\d", code)


@pytest.mark.parametrize("keys", [(), *SECTIONS], ids=lambda keys: dotted(keys) or "top")
def test_an_unknown_key_is_refused_in_every_section(keys, tmp_path):
    (sentence,) = faults(tmp_path, {(*keys, "zzz"): 1})
    assert sentence.startswith(f"{dotted((*keys, 'zzz'))} is not a known key; ")


def test_a_misspelt_key_is_told_the_right_one(tmp_path):
    (sentence,) = faults(tmp_path, {("agent", "gama"): 0.1})
    assert sentence == "agent.gama is not a known key; perhaps 'gamma' is meant."


@pytest.mark.parametrize("keys", [keys for keys, _ in walk(WHOLE)], ids=dotted)
def test_a_missing_key_is_named(keys, tmp_path):
    changed = copy.deepcopy(WHOLE)
    section = changed
    for key in keys[:-1]:
        section = section[key]
    del section[keys[-1]]
    path = tmp_path / "params.yaml"
    path.write_text(yaml.dump(changed, Dumper=yaml.CSafeDumper))
    with pytest.raises(params.ParamsError, match=rf"^{re.escape(f'{path}: {dotted(keys)} is missing.')}$"):
        params.load(path)


@pytest.mark.parametrize("keys", [keys for keys, _ in walk(WHOLE)], ids=dotted)
@pytest.mark.parametrize("wrong", [None, True, "text", [["nested"]]], ids=repr)
def test_a_value_of_the_wrong_type_is_refused(keys, wrong, tmp_path):
    sentences = faults(tmp_path, {keys: wrong})
    assert all(sentence.startswith(dotted(keys)) for sentence in sentences)


@pytest.mark.parametrize("keys", SECTIONS, ids=dotted)
def test_a_number_in_place_of_a_section_is_refused(keys, tmp_path):
    assert faults(tmp_path, {keys: 3}) == [f"{dotted(keys)} must be a section of keys and values."]


@pytest.mark.parametrize("keys", FLOATS, ids=dotted)
def test_a_number_that_yaml_reads_as_text_is_refused_with_the_remedy(keys, tmp_path):
    (sentence,) = faults(tmp_path, {keys: "1e-3"})
    assert sentence.startswith(f"{dotted(keys)} must be a valid number; it is '1e-3', which is text: write ")
    assert "0.001" in sentence


@pytest.mark.parametrize("wrong", [float("nan"), float("inf"), -float("inf")])
@pytest.mark.parametrize("keys", NUMBERS, ids=dotted)
def test_no_constant_may_be_other_than_a_finite_number(keys, wrong, tmp_path):
    (sentence,) = faults(tmp_path, {keys: wrong})
    assert sentence.startswith(f"{dotted(keys)} must ")


@pytest.mark.parametrize(
    ("keys", "wrong", "rule"),
    [
        (("world", "mobile_mass"), -0.03, "must be greater than or equal to 0.001; it is -0.03."),
        (("world", "mobile_mass"), 11, "must be less than or equal to 10; it is 11."),
        (("conditions", "noisy", "force"), -1.0, "must be greater than or equal to 0; it is -1.0."),
        (("agent", "gamma"), 1.0, "must be less than 1; it is 1.0."),
        (("protocol", "attached_steps"), 0, "must be greater than 0; it is 0."),
        (("protocol", "attached_steps"), 1.5, "must be a valid integer; it is 1.5."),
        (("protocol", "limb"), "tail", "must be 'left_foot', 'right_foot', 'left_hand' or 'right_hand'; it is 'tail'."),
        (("seed",), -1, "must be greater than or equal to 0; it is -1."),
    ],
)
def test_a_value_out_of_range_is_refused(keys, wrong, rule, tmp_path):
    assert faults(tmp_path, {keys: wrong}) == [f"{dotted(keys)} {rule}"]


def test_several_faults_come_in_one_go_with_a_sentence_each(tmp_path):
    sentences = faults(
        tmp_path,
        {("world", "mobile_mass"): -1.0, ("agent", "gama"): 0.1, ("outcomes", "batch"): "eight", ("extra",): 1},
    )
    assert sorted(sentence.split()[0] for sentence in sentences) == [
        "agent.gama",
        "extra",
        "outcomes.batch",
        "world.mobile_mass",
    ]


@pytest.mark.parametrize(
    ("keys", "wrong", "words"),
    [
        (("sweep", "rewards"), ["mtl", "rtll"], "'rtll' is unknown; perhaps 'rtl' is meant"),
        (("sweep", "rewards"), ["mtl_xyzzy"], "'mtl_xyzzy', but 'xyzzy' is unknown; known are "),
        (("sweep", "rewards"), ["mtl", "mtl"], "names one entry twice"),
        (("sweep", "rewards"), ["mtl_mtl"], "adds one reward twice"),
        (("sweep", "rewards"), [], "at least 1 item"),
        (("sweep", "conditions"), ["free", "free"], "names one entry twice"),
        (("sweep", "conditions"), ["windy"], "must be 'free' or 'noisy'; it is 'windy'"),
    ],
)
def test_a_sweep_of_unknown_or_repeated_entries_is_refused(keys, wrong, words, tmp_path):
    (sentence,) = faults(tmp_path, {keys: wrong})
    assert words in sentence


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({("protocol", "torque_updates"): 121}, "torque_updates must not exceed updates_per_step"),
        ({("collect", "pair_updates"): 120}, "pair_updates must be less than protocol.updates_per_step"),
        ({("film", "run"): "cais/seed-010"}, "film.run must be one of the runs of sweep"),
    ],
)
def test_values_that_do_not_fit_each_other_are_refused(changes, words, tmp_path):
    (sentence,) = faults(tmp_path, changes)
    assert words in sentence


# Variants.

PLAIN = {"asks": "why?", "set": {"rewards.gain": 1.0}, "cells": {"free": ["mtl"], "noisy": ["mtl", "cais_surprise"]}}


def refused(folder: Path, name: Any = "plain", **changes: Any) -> list[str]:
    """The sentences that refuse PLAIN with some changes, as the only variant, less where that stands."""
    sentences = faults(folder, {("sweeps", "variants"): {name: PLAIN | changes}})
    return [sentence.removeprefix(f"sweeps.variants.{name}") for sentence in sentences]


def test_a_variant_is_the_published_params_with_some_values_changed():
    changes = {
        "conditions.noisy.force": 20,
        "world.rope_slack": 0.01,
        "encoder.latent_sd": 1.0,
        "agent.gamma": 0.5,
        "outcomes.memory": 7,
        "rewards.cais.pays": "taken",
    }
    whole = params.Params.model_validate(
        WHOLE | {"sweeps": {"seeds": 2, "variants": {"plain": PLAIN, "many": PLAIN | {"set": changes}}}}
    )
    assert params.varied(whole, "plain").rewards.gain == 1.0
    changed = copy.deepcopy(whole.model_dump())
    for key, value in changes.items():
        *sections, last = key.split(".")
        section = changed
        for name in sections:
            section = section[name]
        section[last] = value
    assert params.varied(whole, "many").model_dump() == changed
    assert isinstance(params.varied(whole, "many").conditions.noisy.force, float)
    assert whole.rewards.gain == WHOLE["rewards"]["gain"]
    assert whole.sweeps.variants["plain"].pairs == (("free", "mtl"), ("noisy", "mtl"), ("noisy", "cais_surprise"))


@pytest.mark.parametrize(
    "key",
    ["seed", "protocol.limb", "collect.steps", "encoder", "encoder.tau", "encoder.latent", "encoder.latent_sdx",
     "sweep.seeds", "sweeps.seeds", "calibrate.worlds"],
)  # fmt: skip
def test_a_variant_may_not_change_what_the_published_encoder_or_the_sweep_is_made_of(key, tmp_path):
    assert refused(tmp_path, set={key: 3}) == [
        f".set has {key!r}, but a variant may change only conditions, world, agent, outcomes, rewards, "
        "encoder.latent_sd."
    ]


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"world.mobile_mas": 1.0}, "world.mobile_mas is not a known key; perhaps 'mobile_mass' is meant."),
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
def test_a_variant_that_sets_what_does_not_hold_is_refused(change, sentence, tmp_path):
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
def test_a_variant_of_another_shape_is_refused(changes, sentence, tmp_path):
    (found,) = refused(tmp_path, **changes)
    assert found.startswith(sentence)


@pytest.mark.parametrize("name", ["Gain", "gain-1", "gain 1", "", "gain/1"])
def test_a_variants_name_is_small_letters_digits_and_underscores(name, tmp_path):
    (sentence,) = faults(tmp_path, {("sweeps", "variants"): {name: PLAIN}})
    assert sentence == f"sweeps.variants has {name!r}: use small letters, digits and '_' alone, at most 40."


def test_variants_cannot_be_none_nor_nameless(tmp_path):
    (sentence,) = faults(tmp_path, {("sweeps", "variants"): {}})
    assert sentence.startswith("sweeps.variants: dictionary should have at least 1 item")
    (sentence,) = faults(tmp_path, {("sweeps", "variants"): {500: PLAIN}})
    assert sentence == "sweeps.variants.500 must be a valid string; it is 500."


def test_every_variant_at_fault_is_named(tmp_path):
    variants = {name: PLAIN | {"set": {"agent.gamma": 1.0}} for name in ("one", "two")}
    assert faults(tmp_path, {("sweeps", "variants"): variants}) == [
        f"sweeps.variants.{name}.set: agent.gamma must be less than 1; it is 1.0." for name in variants
    ]


# Worlds in which effects are measured besides the published one.


def test_an_alternative_is_the_published_params_in_another_world():
    whole = params.load(SHIPPED)
    other = params.changed(whole, {"world.mobile_mass": 1, "world.rope_slack": 0.05})
    world = whole.world.model_copy(update={"mobile_mass": 1.0, "rope_slack": 0.05})
    assert other == whole.model_copy(update={"world": world})
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
def test_an_alternative_that_does_not_hold_is_refused(alternatives, sentence, tmp_path):
    assert faults(tmp_path, {("effects", "alternatives"): alternatives}) == [sentence]


# Files.


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "must be a section"),
        ("- 1\n", "must be a section"),
        ("a: [1", "is not valid YAML"),
        ("\t", "not valid YAML"),
    ],
    ids=["empty", "list", "open bracket", "tab"],
)
def test_a_file_that_is_no_params_file_is_refused(text, words, tmp_path):
    path = tmp_path / "params.yaml"
    path.write_text(text)
    with pytest.raises(params.ParamsError, match=words):
        params.load(path)


def test_a_missing_file_is_named(tmp_path):
    path = tmp_path / "params.yaml"
    with pytest.raises(params.ParamsError, match=re.escape(f"{path} is missing; ")):
        params.load(path)


@given(st.sampled_from(FLOATS), st.floats(allow_nan=False, allow_infinity=False))
def test_a_float_is_either_taken_as_it_is_or_refused(keys, value):
    changed = copy.deepcopy(WHOLE)
    section = changed
    for key in keys[:-1]:
        section = section[key]
    section[keys[-1]] = value
    try:
        loaded = params.Params.model_validate(changed)
    except ValidationError:
        return
    assert loaded.model_dump() == changed


def test_nothing_can_be_changed_after_loading():
    def models(model: BaseModel) -> Iterator[BaseModel]:
        yield model
        for name in type(model).model_fields:
            value = getattr(model, name)
            if isinstance(value, BaseModel):
                yield from models(value)

    for model in models(params.load(SHIPPED)):
        for name in type(model).model_fields:
            with pytest.raises(ValidationError, match="frozen"):
                setattr(model, name, getattr(model, name))
