"""Bad input: whatever is done to a file of settings, it is refused in sentences before work begins, or it runs."""

import re
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import Phase, event, given, settings

from mimo.settings import params, studies
from mimo.settings.files import ParamsError
from mimo.settings.params import Params
from mimo.settings.studies import Studies
from stages.base import overlay
from tests.faults import mutants
from tests.faults.mutants import PARAMS, STUDIES, Mutant, Shipped
from tests.faults.running import ROOT, TALLY, P, Run
from tests.faults.running import STUDIES as ASKED


@pytest.fixture(scope="module", autouse=True)
def _told() -> Iterator[None]:
    yield
    names = ("tried", "refused", "accepted", "computed")
    print("\nMutants:", ", ".join(f"{TALLY[name]} {name}" for name in names))
    print(*(f"{kind}: {count}" for kind, count in sorted(TALLY.items()) if kind not in names), sep="; ")


@pytest.fixture(scope="module")
def target(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("mutants") / "params.yaml"


def load(file: Shipped, path: Path) -> tuple[Params, Studies]:
    """Both files' settings, where one of them lies elsewhere."""
    if file is STUDIES:
        return P, studies.load(P, path)
    p = params.load(path)
    return p, studies.load(p, ROOT / studies.PATH)


def changed(p: Params, asked: Studies) -> Iterator[Params]:
    """The settings that a mutant makes others of: its own, and those of the variants and alternatives it touches."""
    yield p
    shipped = sets(ASKED)
    yield from (params.changed(p, values) for values in sets(asked) if values not in shipped)
    for values in asked.effects.alternatives.values():
        if values not in ASKED.effects.alternatives.values():
            yield params.changed(p, values)


def sets(asked: Studies) -> list[dict[str, object]]:
    """What the variants of all studies change."""
    return [variant.set for study in asked.studies.values() for variant in study.variants.values()]


def refusal(file: Shipped, target: Path, data: bytes) -> list[str]:
    """The sentences that refuse one of the files; none if it is accepted."""
    target.write_bytes(data)
    try:
        load(file, target)
    except ParamsError as error:
        sentences = str(error).splitlines()
        for sentence in sentences:
            assert sentence.startswith(str(target))
            assert re.search(r"[^?!.;,:]\.$", sentence)
            assert len(sentence) < 600
        return sentences
    return []


@settings(max_examples=160, phases=[Phase.generate])
@given(mutant=mutants.mutants())
def test_a_mutant_is_refused_in_sentences_or_runs(mutant: Mutant, target: Path, run: Run) -> None:
    began = time.monotonic()
    sentences = refusal(mutant.file, target, mutant.data)
    assert time.monotonic() - began < 5
    assert not Path("made").exists()
    verdict = "refused" if sentences else "accepted"
    for name in ("tried", verdict, f"{mutant.file}, {mutant.kind} {verdict}"):
        TALLY[name] += 1
    event(f"{mutant.file}, {mutant.kind} {verdict}")
    if sentences:
        assert all(word in "\n".join(sentences) for word in mutant.named), sentences
        return
    for p in changed(*load(mutant.file, target)):
        run(p)


@pytest.mark.parametrize("file", [PARAMS, STUDIES], ids=str)
@pytest.mark.parametrize(
    ("data", "says"),
    [
        ("", "the file must be a section"),
        ("- 1\n", "the file must be a section"),
        ("3\n", "the file must be a section"),
        ("{}\n", "(seed|effects) is missing"),
        ("{text}---\n{text}", r"another document"),
        ("# \0\n{text}", "special characters are not allowed"),
        ("[" * 10**5, "too deeply nested"),
    ],
    ids=["empty", "list", "number", "no key", "two documents", "NUL", "brackets"],
)
def test_another_file_is_refused(data: str, says: str, file: Shipped, target: Path) -> None:
    (sentence, *_) = refusal(file, target, data.replace("{text}", file.text).encode())
    assert re.search(says, sentence)


@pytest.mark.parametrize("file", [PARAMS, STUDIES], ids=str)
def test_other_bytes_than_utf_8_are_refused(file: Shipped, target: Path) -> None:
    for data in (file.text.encode("utf-16"), b"\x89HDF\r\n\x1a\n\0\0"):
        (sentence,) = refusal(file, target, data)
        assert "must be text in UTF-8; line 1 " in sentence


@pytest.mark.parametrize("file", [PARAMS, STUDIES], ids=str)
def test_a_folder_and_a_missing_file_are_refused(file: Shipped, tmp_path: Path) -> None:
    with pytest.raises(ParamsError, match=rf"^{re.escape(str(tmp_path))} must be a file that can be read: Is a dir"):
        load(file, tmp_path)
    with pytest.raises(ParamsError, match=r"is missing; run from the project's top folder\.$"):
        load(file, tmp_path / "params.yaml")


def test_aliases_are_read_as_what_they_stand_for(target: Path) -> None:
    text = PARAMS.text.replace("learning_rate: 0.001", "learning_rate: &rate 0.001", 1)
    target.write_text(text.replace("learning_rate: 0.001", "learning_rate: *rate"), encoding="utf-8")
    assert params.load(target) == P


@pytest.mark.parametrize("small", [False, True], ids=["published", "preview"])
def test_what_is_published_runs(small: bool, run: Run, tmp_path: Path) -> None:
    """Both files as they are, with every variant and every alternative."""
    if small:
        overlay.write(ROOT, tmp_path)
    folder = tmp_path if small else ROOT
    p = params.load(folder / PARAMS.path)
    asked = studies.load(p, folder / STUDIES.path)
    for values in ({}, *sets(asked), *asked.effects.alternatives.values()):
        run(params.changed(p, values))
