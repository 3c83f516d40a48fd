"""params.yaml: values that do not fit each other, and copies with other values."""

from pathlib import Path
from typing import Any

import pytest
from dvc.utils import hydra

from mimo.settings import params
from mimo.settings.files import ParamsError
from tests.unit.settings.shipped import PARAMS, Keys

ROOT = Path(__file__).parents[3]
P = params.load(PARAMS.path)


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
def test_a_sweep_of_unknown_or_repeated_entries_is_refused(keys: Keys, wrong: object, words: str, tmp_path) -> None:
    (sentence,) = PARAMS.faults(tmp_path, {keys: wrong})
    assert words in sentence


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({("protocol", "torque_updates"): 121}, "torque_updates must not exceed updates_per_step"),
        ({("collect", "pair_updates"): 120}, "pair_updates must be less than protocol.updates_per_step"),
        (
            {
                ("protocol", "updates_per_step"): 11,
                ("protocol", "torque_updates"): 11,
                ("collect", "pair_updates"): 1,
                ("rewards", "rtl", "frames"): 12,
            },
            "rewards.rtl must need no more pictures of a step than protocol.updates_per_step",
        ),
        (
            {("collect", "limbs"): "all", ("collect", "worlds"): 3},
            "collect.worlds must be at least 4 where collect.limbs is 'all'",
        ),
        (
            {("outcomes", "action"): "limb", ("rewards", "cais", "pays"): "taken"},
            "rewards.cais.pays must be 'move' where outcomes.action is 'limb'",
        ),
        ({("film", "run"): "cais/seed-020"}, "film.run must be one of the runs of sweep"),
    ],
)
def test_values_that_do_not_fit_each_other_are_refused(changes: dict[Keys, Any], words: str, tmp_path: Path) -> None:
    (sentence,) = PARAMS.faults(tmp_path, changes)
    assert words in sentence


def test_fewer_worlds_than_limbs_do_for_the_protocols_own() -> None:
    assert params.changed(P, {"collect.worlds": 3}).collect.limbs == "own"
    assert params.changed(P, {"collect.worlds": 4, "collect.limbs": "all"}).collect.worlds == 4


def test_a_copy_with_other_values_is_checked_and_leaves_the_first_alone() -> None:
    other = params.changed(P, {"world.mobile_mass": 1, "rewards.cais.pays": "taken"})
    world = P.world.model_copy(update={"mobile_mass": 1.0})
    cais = P.rewards.cais.model_copy(update={"pays": "taken"})
    rewards = P.rewards.model_copy(update={"cais": cais})
    assert other == P.model_copy(update={"world": world, "rewards": rewards})
    assert isinstance(other.world.mobile_mass, float)
    assert P.model_dump() == PARAMS.whole
    assert params.checked(P.agent, {"gamma": 0.5}) == P.agent.model_copy(update={"gamma": 0.5})


def test_a_copy_that_does_not_hold_is_refused_with_all_its_faults() -> None:
    with pytest.raises(ParamsError) as caught:
        params.changed(P, {"agent.gamma": 1.0, "world.rope_slac": 0.0, "sweeps.seeds": 1})
    assert sorted(str(caught.value).splitlines()) == [
        "agent.gamma must be less than 1; it is 1.0.",
        "sweeps is not a known key; perhaps 'sweep' is meant.",
        "world.rope_slac is not a known key; perhaps 'rope_slack' is meant.",
    ]
    with pytest.raises(ParamsError, match=r"^gamma must be less than 1; it is 1\.0\.$"):
        params.checked(P.agent, {"gamma": 1.0})


@pytest.mark.parametrize(
    ("file", "change"), [("params.yaml", "world.mobile_mass=0.03"), ("studies/params.yaml", "effects.worlds=4")]
)
def test_dvcs_writer_leaves_the_file_as_it_is(file: str, change: str, tmp_path: Path) -> None:
    """`dvc exp run -S` reads, changes and writes it: all but the value stays byte for byte, comments and all."""
    shipped = (ROOT / file).read_bytes()
    (copy := tmp_path / "params.yaml").write_bytes(shipped)
    hydra.apply_overrides(copy, [change])
    assert copy.read_bytes() == shipped
    key, _, value = change.rpartition("=")
    hydra.apply_overrides(copy, [f"{key}=7{value}"])
    before, after = shipped.splitlines(), copy.read_bytes().splitlines()
    (changed,) = [pair for pair in zip(before, after, strict=True) if pair[0] != pair[1]]
    assert changed[1] == changed[0].replace(f": {value} ".encode(), f": 7{value} ".encode())
