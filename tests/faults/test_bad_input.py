"""Bad input: whatever is done to params.yaml, it is refused in sentences before work begins, or it really runs.

Training that comes to NaN stops its own run, by name and step, and no other.
"""

import copy
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
import torch
import yaml
from hypothesis import Phase, assume, event, given, settings
from hypothesis import strategies as st

from mimo import calibrate, collect, effects, encoder, params, scene
from mimo.encoder import Trained
from mimo.experiment import Experiment, Record, RunError
from mimo.params import Params, ParamsError
from mimo.rewards import REWARDS
from stages import preview

Keys = tuple[str | int, ...]
Run = Callable[[Params], None]
Mutant = tuple[str, bytes, tuple[str, ...]]  # kind, the file, words that a refusal must have

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "params.yaml").read_text()
WHOLE: dict[str, Any] = yaml.safe_load(TEXT)
P = params.load(ROOT / "params.yaml")
TALLY: Counter[str] = Counter()


def walk(value: Any, above: Keys = ()) -> Iterator[Keys]:
    inner = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, held in inner:
        yield (*above, key)
        yield from walk(held, (*above, key))


def at(tree: Any, place: Keys) -> Any:
    return functools.reduce(lambda part, key: part[key], place, tree)


PLACES = list(walk(WHOLE))
NUMBERS = [place for place in PLACES if isinstance(at(WHOLE, place), int | float)]
LISTS = [place for place in PLACES if isinstance(at(WHOLE, place), list)]
WORDS = [place for place in PLACES if isinstance(at(WHOLE, place), str) and place[-1] != "asks"]
FREE = ("variants", "alternatives")  # sections of free names
KNOWN = [place for place in PLACES if isinstance(place[-1], str) and place[-2:-1] not in [(name,) for name in FREE]]
LINES = [i for i, line in enumerate(TEXT.splitlines()) if re.match(r" *\w+:", line)]
SCALARS = [match.span(1) for match in re.finditer(r"^ *\w+: ([\w.-]+)(?: #|$)", TEXT, re.MULTILINE)]
EXTREMES = (0, -1, 1, 1e-300, 1e300, float("nan"), float("inf"), -float("inf"), 10**12, -(10**12), 10**400, 1e-9, 1e9)
WRONG: tuple[Any, ...] = (None, True, "text", "1e-3", "0.3", [], {}, [[1]], {"a": 1}, 3, 1.5, [1, 2], "")


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


def dump(tree: Any) -> bytes:
    return yaml.safe_dump(tree, sort_keys=False).encode()


def words(place: Keys) -> tuple[str, ...]:
    """What names a place: its section, and its last key."""
    return str(place[0]), [key for key in place if isinstance(key, str)][-1].split(".")[-1]


def put(place: Keys, value: Any) -> dict[str, Any]:
    tree = copy.deepcopy(WHOLE)
    at(tree, place[:-1])[place[-1]] = copy.deepcopy(value)
    return tree


@st.composite
def typos(draw: st.DrawFn, word: str) -> str:
    index = draw(st.integers(0, len(word) - 1))
    dropped, doubled = word[:index] + word[index + 1 :], word[:index] + word[index] + word[index:]
    swapped = word[:index] + word[index : index + 2][::-1] + word[index + 2 :]
    typo = draw(st.sampled_from([dropped, doubled, swapped, word.upper()]))
    assume(typo not in {word, ""})
    return typo


@st.composite
def misspelt_key(draw: st.DrawFn) -> tuple[bytes, tuple[str, ...]]:
    place = draw(st.sampled_from(KNOWN))
    name = str(place[-1])
    *before, last = name.split(".")
    typo = ".".join([*before, draw(typos(last))])
    tree = copy.deepcopy(WHOLE)
    section = at(tree, place[:-1])
    items = [(typo if key == name else key, value) for key, value in section.items()]
    section.clear()
    section.update(items)
    return dump(tree), (typo.split(".")[-1], last if name in params.VARIED else f"'{last}'")


@st.composite
def removed_key(draw: st.DrawFn) -> tuple[bytes, tuple[str, ...]]:
    place = draw(st.sampled_from(PLACES))
    tree = copy.deepcopy(WHOLE)
    del at(tree, place[:-1])[place[-1]]
    return dump(tree), (str(place[0]),)


@st.composite
def wrong_value(draw: st.DrawFn) -> tuple[bytes, tuple[str, ...]]:
    place = draw(st.sampled_from(PLACES))
    return dump(put(place, draw(st.sampled_from(WRONG)))), words(place)


@st.composite
def extreme_number(draw: st.DrawFn) -> tuple[bytes, tuple[str, ...]]:
    place = draw(st.sampled_from(NUMBERS))
    return dump(put(place, draw(st.sampled_from(EXTREMES)))), words(place)


@st.composite
def other_number(draw: st.DrawFn) -> tuple[bytes, tuple[str, ...]]:
    """Up to three numbers, by up to 30 times more or less."""
    tree = copy.deepcopy(WHOLE)
    for place in draw(st.lists(st.sampled_from(NUMBERS), min_size=1, max_size=3, unique=True)):
        value = at(WHOLE, place)
        changed = value * 10 ** draw(st.floats(-1.5, 1.5))
        at(tree, place[:-1])[place[-1]] = type(value)(changed)
    return dump(tree), ()


@st.composite
def misspelt_name(draw: st.DrawFn) -> tuple[bytes, tuple[str, ...]]:
    place = draw(st.sampled_from(WORDS))
    typo = draw(typos(str(at(WHOLE, place))))
    return dump(put(place, typo)), (str(place[0]), repr(typo))


@st.composite
def other_list(draw: st.DrawFn) -> tuple[bytes, tuple[str, ...]]:
    place = draw(st.sampled_from(LISTS))
    value = at(WHOLE, place)
    return dump(put(place, draw(st.sampled_from([[], [*value, value[0]], value[:1], [value], [None], value[0]])))), ()


@st.composite
def repeated_line(draw: st.DrawFn) -> tuple[bytes, tuple[str, ...]]:
    lines = TEXT.splitlines()
    at_line = draw(st.sampled_from([i for i in LINES if not re.search(r":( #.*)?$", lines[i])]))
    lines.insert(at_line, lines[at_line])
    return "\n".join(lines).encode(), (lines[at_line].split(":")[0].strip(), "once")


@st.composite
def other_character(draw: st.DrawFn) -> tuple[bytes, tuple[str, ...]]:
    """One character in, out or changed, or a line indented, in front of a comment or in it."""
    index = draw(st.integers(0, len(TEXT) - 1))
    inserted = draw(
        st.sampled_from([*":[]{}&*!|>-\t'\"#\0,?%@`~=\n 0é\x85\u2028", "<<", "- ", ": ", "---\n", "\ufeff"])
    )
    return (TEXT[:index] + inserted + TEXT[index + draw(st.integers(0, 1)) :]).encode(), ()


@st.composite
def other_byte(draw: st.DrawFn) -> tuple[bytes, tuple[str, ...]]:
    data = TEXT.encode()
    index = draw(st.integers(0, len(data)))
    return data[:index] + draw(st.sampled_from([b"\xff", b"\xfe\xff", b"\xc3\x28", b"\x80"])) + data[index:], ("UTF-8",)


@st.composite
def odd_scalar(draw: st.DrawFn) -> tuple[bytes, tuple[str, ...]]:
    """A value that YAML reads in ways of its own."""
    first, last = draw(st.sampled_from(SCALARS))
    odd = draw(
        st.sampled_from(
            ["!!python/object/apply:pathlib.Path.touch [made]", "!!python/name:os.system x", "!!python/none", "!mine 1",
             "!!binary aGk=", "!!set {a, b}", "!!int abc", "!!float abc", "!!bool abc", "!!timestamp abc", "!!int [1]",
             "2024-01-01", "2024-99-99", "9" * 5000, "0x" + "f" * 5000, "0b_", "1" * 5000 + "x", "1:30", "1_000", "010",
             "=", "<<", "*none", "&a [*a]", "&a {? *a : *a}", "{<<: {a: 1}}", "{? [a] : 1}", "[" * 3000,
             "'" + "x" * 5000, "[" * 50 + "]" * 50, "&a [1, *a]",
             "yes", ".inf", "-.INF", ".NaN", "0o17", "1e-3", "1e3", "1.e+3", "", "~",
             "'a\\nb'", '"a\\nb"', '"\\ud800"', '"\\0"', "x" * 5000, "|\n  text", "1 2", "[a, b", "{a: 1", "a: b"]
        )
    )  # fmt: skip
    return (TEXT[:first] + odd + TEXT[last:]).encode(), ()


BOMB = ", ".join(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]" for i in range(1, 12))


@st.composite
def bomb(draw: st.DrawFn) -> tuple[bytes, tuple[str, ...]]:
    first, last = draw(st.sampled_from(SCALARS))
    return (TEXT[:first] + f"{{a0: &a0 [x, x, x, x], {BOMB}}}" + TEXT[last:]).encode(), ("too much",)


KINDS: tuple[Callable[[], st.SearchStrategy[tuple[bytes, tuple[str, ...]]]], ...] = (
    misspelt_key, removed_key, wrong_value, extreme_number, other_number, misspelt_name, other_list, repeated_line,
    other_character, other_byte, odd_scalar, bomb
)  # fmt: skip
MUTANTS = st.one_of([kind().map(functools.partial(lambda name, made: (name, *made), kind.__name__)) for kind in KINDS])


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


# NaN in training.


def test_a_nan_in_one_seed_stops_its_run_and_touches_no_other(
    tiny: Params, trained: Trained, scales: dict[str, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A weight of seed 1 becomes NaN before the third step, in company and alone."""
    step = Experiment.step

    def poison(self: Experiment, number: int) -> None:
        if number == 2 and 1 in self.seeds:
            self.agents.network.inlet.weight[self.seeds.index(1), 0, 0] = torch.nan
        step(self, number)

    def computed(*seeds: int) -> list[Record]:
        return Experiment(tiny, "noisy", "cais_surprise", seeds, trained, scales).run()

    before = computed(0, 1)
    monkeypatch.setattr(Experiment, "step", poison)
    for seeds, name in (((0, 1), "seeds 0, 1"), ((1,), "seed 1")):
        with pytest.raises(RunError) as caught:
            computed(*seeds)
        assert str(caught.value) == (
            f"noisy, cais_surprise, {name} stopped at step 3: the TD error of seed 1 is not finite"
        )
    (alone,) = computed(0)
    assert all((dataset.values == before[0][name].values).all() for name, dataset in alone.items())


def test_a_poisoned_encoder_stops_the_first_step(tiny: Params, trained: Trained, scales: dict[str, float]) -> None:
    name = next(iter(trained.weights))
    bad = replace(trained, weights=trained.weights | {name: np.full_like(trained.weights[name], np.nan)})
    with pytest.raises(RunError, match=r"^free, mtl, seed 7 stopped at step 1: the TD error of seed 7 is not finite$"):
        Experiment(tiny, "free", "mtl", [7], bad, scales).run()


def test_a_poisoned_frame_stops_the_encoder_when_it_is_drawn(tiny: Params, pairs: np.ndarray) -> None:
    frames = pairs[::5].astype(np.float32)
    frames[3, 1, 64, 64, 0] = np.nan
    brief = tiny.encoder.model_copy(update={"pairs": 2, "iterations": 50})
    told: list[int] = []
    draws = np.random.default_rng(4)
    draws.integers(2**31)
    drawn = next(i for i in itertools.count() if 3 in draws.choice(8, size=2, replace=False))
    assert drawn > 0
    with pytest.raises(FloatingPointError, match=f"^encoder training: the loss is not finite at iteration {drawn}$"):
        train(brief, frames, np.random.default_rng(4), told.append)
    assert told == list(range(1, drawn + 1))
