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

from mimo import params

SHIPPED = Path(__file__).parents[2] / "params.yaml"
WHOLE: dict[str, Any] = yaml.safe_load(SHIPPED.read_text())

Keys = tuple[str, ...]


def walk(section: dict[str, Any], above: Keys = ()) -> Iterator[tuple[Keys, Any]]:
    for key, value in section.items():
        yield (*above, key), value
        if isinstance(value, dict):
            yield from walk(value, (*above, key))


SECTIONS = [keys for keys, value in walk(WHOLE) if isinstance(value, dict)]
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
    path.write_text(yaml.safe_dump(changed))
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
    unsourced = []
    for line in SHIPPED.read_text().splitlines():
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
    path.write_text(yaml.safe_dump(changed))
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
        (("world", "mobile_mass"), -0.03, "must be greater than 0; it is -0.03."),
        (("world", "mobile_mass"), 0, "must be greater than 0; it is 0."),
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
    ],
)
def test_values_that_do_not_fit_each_other_are_refused(changes, words, tmp_path):
    (sentence,) = faults(tmp_path, changes)
    assert words in sentence


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
