"""What does not hold in a file of settings is refused, in one sentence for each fault."""

from pathlib import Path

import pytest

from tests.unit.settings.shipped import (
    FILES,
    FLOATS,
    MISSING,
    NUMBERS,
    PARAMS,
    PLACES,
    SECTIONS,
    STUDIES,
    Keys,
    Shipped,
    dotted,
    label,
)

TOPS: list[tuple[Shipped, Keys]] = [(file, ()) for file in FILES]


@pytest.mark.parametrize(("file", "keys"), TOPS + SECTIONS, ids=label)
def test_an_unknown_key_is_refused_in_every_section(file: Shipped, keys: Keys, tmp_path: Path) -> None:
    (sentence,) = file.faults(tmp_path, {(*keys, "zzz"): 1})
    assert sentence.startswith(f"{dotted((*keys, 'zzz'))} is not a known key; ")


def test_a_misspelt_key_is_told_the_right_one(tmp_path: Path) -> None:
    (sentence,) = PARAMS.faults(tmp_path, {("agent", "gama"): 0.1})
    assert sentence == "agent.gama is not a known key; perhaps 'gamma' is meant."
    (sentence,) = STUDIES.faults(tmp_path, {("effects", "droped"): 1})
    assert sentence == "effects.droped is not a known key; perhaps 'dropped' is meant."


@pytest.mark.parametrize(("file", "keys"), PLACES, ids=label)
def test_a_missing_key_is_named(file: Shipped, keys: Keys, tmp_path: Path) -> None:
    assert file.faults(tmp_path, {keys: MISSING}) == [f"{dotted(keys)} is missing."]


@pytest.mark.parametrize(("file", "keys"), PLACES, ids=label)
@pytest.mark.parametrize("wrong", [None, True, "text", [["nested"]]], ids=repr)
def test_a_value_of_the_wrong_type_is_refused(file: Shipped, keys: Keys, wrong: object, tmp_path: Path) -> None:
    if wrong is True and isinstance(file.at(keys), bool):
        wrong = 1  # which is as good as True to Python
    sentences = file.faults(tmp_path, {keys: wrong})
    assert all(sentence.startswith(dotted(keys)) for sentence in sentences)


@pytest.mark.parametrize(("file", "keys"), SECTIONS, ids=label)
def test_a_number_in_place_of_a_section_is_refused(file: Shipped, keys: Keys, tmp_path: Path) -> None:
    assert file.faults(tmp_path, {keys: 3}) == [f"{dotted(keys)} must be a section of keys and values."]


@pytest.mark.parametrize(("file", "keys"), FLOATS, ids=label)
def test_a_number_that_yaml_reads_as_text_is_refused_with_the_remedy(file: Shipped, keys: Keys, tmp_path: Path) -> None:
    (sentence,) = file.faults(tmp_path, {keys: "1e-3"})
    assert sentence.startswith(f"{dotted(keys)} must be a valid number; it is '1e-3', which is text: write ")
    assert "0.001" in sentence


@pytest.mark.parametrize("wrong", [float("nan"), float("inf"), -float("inf")])
@pytest.mark.parametrize(("file", "keys"), NUMBERS, ids=label)
def test_no_constant_may_be_other_than_a_finite_number(file: Shipped, keys: Keys, wrong: float, tmp_path: Path) -> None:
    (sentence,) = file.faults(tmp_path, {keys: wrong})
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
def test_a_value_out_of_range_is_refused(keys: Keys, wrong: object, rule: str, tmp_path: Path) -> None:
    assert PARAMS.faults(tmp_path, {keys: wrong}) == [f"{dotted(keys)} {rule}"]


def test_several_faults_come_in_one_go_with_a_sentence_each(tmp_path: Path) -> None:
    sentences = PARAMS.faults(
        tmp_path,
        {("world", "mobile_mass"): -1.0, ("agent", "gama"): 0.1, ("outcomes", "batch"): "eight", ("extra",): 1},
    )
    assert sorted(sentence.split()[0] for sentence in sentences) == [
        "agent.gama",
        "extra",
        "outcomes.batch",
        "world.mobile_mass",
    ]
