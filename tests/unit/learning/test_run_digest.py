"""What names a run: its digest changes with everything the run reads, and with nothing else."""

from collections.abc import Sequence
from typing import Any

import pytest

from mimo.learning.experiment import Experiment, inputs
from mimo.record import identity, streams
from mimo.settings import params
from mimo.settings.params import Params
from mimo.settings.section import Section
from mimo.vision.extractor import Trained
from tests.unit.learning.recorded import ALL

P = params.load()


def digest(p: Params, condition: str, reward: str, scales: dict[str, float], seed: int = 0, encoder: str = "e") -> str:
    return identity.Digest(inputs(p, condition, reward, encoder, scales) | {"seed": seed})


Place = tuple[str, ...]


def leaves(section: Section, above: Place = ()) -> list[Place]:
    found: list[Place] = []
    for name in type(section).model_fields:
        value = getattr(section, name)
        found += leaves(value, (*above, name)) if isinstance(value, Section) else [(*above, name)]
    return found


def altered(section: Any, path: Sequence[str]) -> Any:
    """`section` with another value at `path`."""
    name, *rest = path
    value = getattr(section, name)
    if rest:
        return section.model_copy(update={name: altered(value, rest)})
    other: Any
    if isinstance(value, str):
        others = {"left_foot": "right_foot", "move": "taken", "taken": "move", "resting": "running"}
        others |= {"own": "shared", "joint": "limb", "table": "policy", "detached": "zero"}
        other = (others | {P.film.run: "mtl/seed-001"})[value]
    elif isinstance(value, bool):
        other = not value
    elif isinstance(value, list):
        other = value[1:]
    else:
        other = value + 1
    return section.model_copy(update={name: other})


def read_by(condition: str, reward: str) -> set[Place]:
    """The parameters that a run reads."""
    whole = {"protocol", "world", "agent"} | ({"outcomes"} if "cais" in reward or "surprise" in reward else set())
    found = {path for path in leaves(P) if path[0] in whole}
    found |= {("seed",), ("rewards", "gain"), ("rewards", "scale"), ("conditions", condition, "force")}
    found |= {("encoder", name) for name in ("widths", "latent", "projection", "latent_sd")}
    own = {"rtl": ("frames",), "cais": ("pays",), "surprise": ("pays", "weight")}
    return found | {("rewards", part, name) for part, names in own.items() if part in reward for name in names}


@pytest.mark.parametrize("reward", ["mtl", "cais", "rtl_surprise"])
@pytest.mark.parametrize("condition", streams.CONDITIONS)
def test_the_digest_changes_with_what_a_run_reads_alone(condition: str, reward: str, scales: dict[str, float]) -> None:
    base = digest(P, condition, reward, scales)
    assert base == digest(P.model_copy(), condition, reward, dict(reversed(scales.items())))
    changed = {path for path in leaves(P) if digest(altered(P, path), condition, reward, scales) != base}
    assert changed == read_by(condition, reward)


@pytest.mark.parametrize(("condition", "reward"), [("free", "mtl"), ("noisy", "cais_surprise"), ("noisy", "rtl")])
def test_a_run_reads_nothing_that_its_digest_leaves_out(
    condition: str,
    reward: str,
    tiny: Params,
    trained: Trained,
    scales: dict[str, float],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    places = {id(tiny): ()} | {
        id(section): path[:depth]
        for path in leaves(tiny)
        for depth in range(1, len(path))
        if isinstance(section := _at(tiny, path[:depth]), Section)
    }
    seen: set[Place] = set()

    def spy(self: Section, name: str) -> Any:
        if id(self) in places and name in type(self).model_fields:
            seen.add((*places[id(self)], name))
        return super(Section, self).__getattribute__(name)

    monkeypatch.setattr(Section, "__getattribute__", spy, raising=False)
    Experiment(tiny, condition, reward, [0], trained, scales).run()
    monkeypatch.undo()
    read = seen & set(leaves(tiny))
    assert ("agent", "temperature") in read
    assert read <= read_by(condition, reward)


def _at(section: Any, path: Place) -> Any:
    for name in path:
        section = getattr(section, name)
    return section


def test_the_digest_changes_with_run_encoder_and_scale(scales: dict[str, float]) -> None:
    digests = [
        digest(P, condition, reward, scales, seed, encoder)
        for condition in streams.CONDITIONS
        for reward in ALL
        for seed in (0, 1)
        for encoder in ("e", "f")
    ]
    assert len(set(digests)) == len(digests)
    for reward in ALL:
        base = digest(P, "free", reward, scales)
        for name, scale in scales.items():
            other = digest(P, "free", reward, scales | {name: 2 * scale})
            assert (other != base) == (name in reward.split("_"))


def test_with_running_scales_the_digest_leaves_the_resting_ones_out(scales: dict[str, float]) -> None:
    changed = params.changed(P, {"rewards.scale": "running"})
    for reward in ALL:
        assert inputs(changed, "free", reward, "e", scales)["scales"] == {}
        assert digest(changed, "free", reward, scales) == digest(changed, "free", reward, {})


def test_inputs_are_canonical_json_with_code_and_versions(scales: dict[str, float]) -> None:
    made = inputs(P, "noisy", "cais_surprise", "e", scales)
    assert identity.canonical(made)
    assert (made["condition"], made["reward"], made["encoder"]) == ("noisy", "cais_surprise", "e")
    assert made["scales"] == {"cais": scales["cais"], "surprise": scales["surprise"]}
    assert {
        "mimo.learning.experiment",
        "mimo.world.physics",
        "mimo.world.body",
        "mimo.learning.rewards",
        "mimo.vision.extractor",
    } <= set(made["code"])
    assert "mimo.vision.encoder" not in made["code"]  # training counts by what it gave
    assert made["versions"] == identity.versions()
    mtl = inputs(P, "noisy", "mtl", "e", scales)
    own = {f"mimo.learning.rewards.{name}" for name in ("mtl", "cais", "surprise")}
    assert mtl["code"].keys() & own == {"mimo.learning.rewards.mtl"}
    assert mtl["code"].keys() ^ made["code"].keys() == own
    assert all(mtl["code"][name] == made["code"][name] for name in mtl["code"].keys() - own)
