"""Bad input: whatever is done to params.yaml, it is refused in sentences before work begins, or it really runs."""

import functools
import itertools
import re
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import Phase, event, given, settings

from mimo.learning import calibrate, effects
from mimo.learning.experiment import Experiment
from mimo.learning.rewards import REWARDS
from mimo.settings import params
from mimo.settings.params import Params, ParamsError
from mimo.vision import collect, encoder
from mimo.vision.encoder import Trained
from mimo.world import scene
from stages.commands import preview
from tests.faults.mutants import MUTANTS, NUMBERS, TEXT, WHOLE, Mutant, dump

Run = Callable[[Params], None]

ROOT = Path(__file__).parents[2]
P = params.load(ROOT / "params.yaml")
TALLY: Counter[str] = Counter()


@pytest.fixture(scope="module", autouse=True)
def _told() -> Iterator[None]:
    yield
    names = ("tried", "refused", "accepted", "computed")
    print("\nMutants:", ", ".join(f"{TALLY[name]} {name}" for name in names))
    print(*(f"{kind}: {count}" for kind, count in sorted(TALLY.items()) if kind not in names), sep="; ")


@pytest.fixture(scope="module")
def target(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("mutants") / "params.yaml"


# What runs.


def train(*given: Any) -> Trained:
    """encoder.train in one thread: with so little to do, two would wait for each other."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(encoder, "THREADS", 1)
        return encoder.train(*given)


@pytest.fixture(scope="module")
def run(trained: Trained, tiny: Params, pairs: np.ndarray) -> Iterator[Run]:
    """Calibration and some steps in each phase with all rewards at once; all numbers are finite.

    There are fewer worlds, steps and iterations than asked for, but every size within a step is as asked for. What does
    not reach a run is taken to run as it did before.
    """
    done: set[str] = set()

    def eye(own: params.Encoder) -> tuple[params.Encoder, Trained]:
        published = P.encoder.model_copy(update={"latent_sd": own.latent_sd})
        if own == published:
            ratio = np.float32(own.latent_sd / tiny.encoder.latent_sd)
            small = tiny.encoder.model_copy(update={"latent_sd": own.latent_sd})
            return small, replace(trained, quantiles=trained.quantiles * ratio)
        brief = own.model_copy(update={"iterations": min(2, own.iterations)})
        return own, train(brief, pairs[::5], np.random.default_rng(0))  # of all regimes

    def compute(p: Params) -> None:
        if key(p) in done:
            return
        done.add(key(p))
        sizes, sight = eye(p.encoder)
        brief = p.calibrate.model_copy(update={"steps": 6, "worlds": 1})
        own = p.model_copy(update={"encoder": sizes, "calibrate": brief})
        scales = calibrate.scales(own, sight)
        condition = "noisy" if p.conditions.free == P.conditions.free else "free"
        made = Experiment(own, condition, "_".join(REWARDS), [0], sight, scales)
        attached = own.protocol.baseline_steps
        with made.eye:
            for step in (0, attached, attached + own.protocol.attached_steps):
                made.step(step)
        for name, dataset in made.log.records()[0].items():
            assert np.isfinite(dataset.values).all(), name
        TALLY["computed"] += 1

    with pytest.MonkeyPatch.context() as patch:  # a scene takes half a second, and most mutants leave it as it is
        patch.setattr(scene, "build", functools.lru_cache(4)(scene.build))
        yield compute


def changed(p: Params) -> Iterator[Params]:
    """The settings that a mutant makes others of: its own, and those of the variants and alternatives it touches."""
    yield p
    for name, variant in p.sweeps.variants.items():
        if name not in P.sweeps.variants or variant.set != P.sweeps.variants[name].set:
            yield params.varied(p, name)
    for values in p.effects.alternatives.values():
        if values not in P.effects.alternatives.values():
            yield params.changed(p, values)


def key(p: Params) -> str:
    """All that a run reads."""
    return p.model_dump_json(exclude={"collect", "calibrate", "effects", "sweep", "sweeps"})


def refusal(target: Path, data: bytes) -> list[str]:
    """The sentences that refuse a file; none if it is accepted."""
    target.write_bytes(data)
    try:
        params.load(target)
    except ParamsError as error:
        sentences = str(error).splitlines()
        for sentence in sentences:
            assert sentence.startswith(str(target))
            assert re.search(r"[^?!.;,:]\.$", sentence)
            assert len(sentence) < 600
        return sentences
    return []


# Mutants.


@settings(max_examples=160, phases=[Phase.generate])
@given(mutant=MUTANTS)
def test_a_mutant_is_refused_in_sentences_or_runs(mutant: Mutant, target: Path, run: Run) -> None:
    kind, data, named = mutant
    began = time.monotonic()
    sentences = refusal(target, data)
    assert time.monotonic() - began < 5
    assert not Path("made").exists()
    TALLY["tried"] += 1
    TALLY[f"{kind} {'refused' if sentences else 'accepted'}"] += 1
    TALLY["refused" if sentences else "accepted"] += 1
    event(f"{kind} {'refused' if sentences else 'accepted'}")
    if sentences:
        assert all(word in "\n".join(sentences) for word in named), sentences
        return
    for p in changed(params.load(target)):
        run(p)


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (b"", "the file must be a section"),
        (b"- 1\n", "the file must be a section"),
        (b"3\n", "the file must be a section"),
        (b"{}\n", "seed is missing"),
        (TEXT.encode() + b"---\n" + TEXT.encode(), r"another document"),
        (TEXT.encode("utf-16"), "must be text in UTF-8; line 1 "),
        (b"\x89HDF\r\n\x1a\n\0\0", "must be text in UTF-8; line 1 "),
        (TEXT.replace("paper §2.2", "\0").encode(), "special characters are not allowed"),
        (b"[" * 10**5, "too deeply nested"),
    ],
    ids=["empty", "list", "number", "no key", "two documents", "UTF-16", "HDF5", "NUL", "brackets"],
)
def test_another_file_is_refused(data: bytes, says: str, target: Path) -> None:
    (sentence, *_) = refusal(target, data)
    assert re.search(says, sentence)


def test_a_folder_and_a_missing_file_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ParamsError, match=rf"^{re.escape(str(tmp_path))} must be a file that can be read: Is a dir"):
        params.load(tmp_path)
    with pytest.raises(ParamsError, match=r"is missing; run from the project's top folder\.$"):
        params.load(tmp_path / "params.yaml")


def test_aliases_are_read_as_what_they_stand_for(target: Path) -> None:
    text = TEXT.replace("learning_rate: 0.001", "learning_rate: &rate 0.001", 1)
    target.write_text(text.replace("learning_rate: 0.001", "learning_rate: *rate"))
    assert params.load(target) == P


@pytest.mark.parametrize(
    "changes",
    [
        {"sweep.seeds": 10**12}, {"sweeps.seeds": 1001}, {"sweep.chunk": 33}, {"protocol.attached_steps": 10**6},
        {"protocol.updates_per_step": 10**6}, {"collect.worlds": 10**4}, {"collect.steps": 10**5},
        {"encoder.widths": [10**6, 8, 16, 16]}, {"encoder.latent": 10**6}, {"encoder.pairs": 10**6},
        {"encoder.iterations": 10**9}, {"agent.hidden": 10**9}, {"outcomes.memory": 10**9}, {"outcomes.batch": 10**6},
        {"outcomes.quantiles": 10**6}, {"calibrate.steps": 10**9}, {"effects.worlds": 10**6},
        {"effects.steps": 21, "effects.worlds": 1}, {"world.rope_slack": 5.0}, {"agent.move_bias": -9.0},
    ],
    ids=str,
)  # fmt: skip
def test_what_could_not_be_computed_is_refused(changes: dict[str, object]) -> None:
    with pytest.raises(ParamsError) as caught:
        params.changed(P, changes)
    assert str(caught.value).startswith(next(iter(changes)))


# The ends of every range.

LIMITS = {"ge": 0, "gt": 1, "le": 0, "lt": -1}  # from a whole number's limit to the end of its range
REACHING = ("protocol", "conditions.noisy", "world", "encoder", "agent", "outcomes", "rewards")  # sections a run reads
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
    assert set(ended) - {"encoder.widths"} == {".".join(map(str, n)) for n in NUMBERS if n[:-1] in places}


def test_the_least_that_may_be_asked_for_runs(tiny: Params) -> None:
    """All stages that compute, with the least of everything that is counted, but for the protocol."""
    least = {
        "collect.worlds": 1, "collect.steps": 5, "collect.pair_updates": 1, "encoder.widths": [1, 1, 1, 1],
        "encoder.latent": 1, "encoder.projection": 1, "encoder.pairs": 2, "encoder.iterations": 1, "agent.hidden": 1,
        "outcomes.quantiles": 1, "outcomes.batch": 1, "outcomes.memory": 1, "calibrate.steps": 4,
        "calibrate.worlds": 1, "effects.steps": 40, "effects.worlds": 1,
    }  # fmt: skip
    p = params.changed(tiny, least)
    frames, _ = collect.collect(p)
    sight = train(p.encoder, frames.reshape(-1, *frames.shape[3:]), np.random.default_rng(0))
    scales = calibrate.scales(p, sight)
    for dataset in Experiment(p, "noisy", "_".join(REWARDS), [0], sight, scales).run()[0].values():
        assert np.isfinite(dataset.values).all()
    found = effects.measure(p, sight)
    assert np.isfinite(found["noisy"]["rtl"]["attached"]).all()


@pytest.mark.parametrize("name", ["params.yaml", "params.preview.yaml"])
def test_what_is_published_runs(name: str, run: Run, target: Path) -> None:
    target.write_bytes(dump(WHOLE if name == "params.yaml" else preview.merged_params(ROOT)))
    for p in changed(params.load(target)):
        run(p)
