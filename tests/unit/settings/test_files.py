"""Files of settings: what is shipped loads and says where each constant comes from; what is no such file is refused."""

import re
import subprocess
import sys
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel, ValidationError

from mimo.settings.files import ParamsError
from tests.unit.settings.shipped import FILES, FLOATS, PARAMS, ROOT, STUDIES, Keys, Shipped, label


@pytest.mark.parametrize("file", FILES, ids=label)
def test_the_shipped_file_loads(file: Shipped) -> None:
    found = file.load(file.path).model_dump(exclude_unset=True)
    for name, study in file.whole.get("studies", {}).items():
        if any("points" in own for own in study["variants"].values()):  # whose points stand in its place when loaded
            assert len(found["studies"][name].pop("variants")) > len(study["variants"])
            found["studies"][name]["variants"] = study["variants"]
    assert found == file.whole


@pytest.mark.parametrize("file", FILES, ids=label)
def test_exponents_have_no_place_in_the_file(file: Shipped) -> None:
    code = "\n".join(line.partition("#")[0] for line in file.path.read_text().splitlines())
    assert not re.search(r"\d[eE]-?\d", code)


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
@pytest.mark.parametrize("file", FILES, ids=label)
def test_a_file_of_another_kind_is_refused(file: Shipped, text: str, words: str, tmp_path):
    path = tmp_path / "params.yaml"
    path.write_text(text)
    with pytest.raises(ParamsError, match=words):
        file.load(path)


@pytest.mark.parametrize("file", FILES, ids=label)
def test_a_missing_file_is_named(file: Shipped, tmp_path):
    path = tmp_path / "params.yaml"
    with pytest.raises(ParamsError, match=re.escape(f"{path} is missing; ")):
        file.load(path)


@pytest.mark.parametrize(("file", "other"), [(PARAMS, STUDIES), (STUDIES, PARAMS)], ids=label)
def test_one_file_does_not_stand_for_the_other(file: Shipped, other: Shipped) -> None:
    with pytest.raises(ParamsError) as caught:
        file.load(other.path)
    sentences = str(caught.value)
    assert all(f"{section} is missing." in sentences for section in file.whole)
    assert all(f"{section} is not a known key; " in sentences for section in other.whole)


@given(st.sampled_from(FLOATS), st.floats(allow_nan=False, allow_infinity=False))
def test_a_float_is_either_taken_as_it_is_or_refused(place: tuple[Shipped, Keys], value: float) -> None:
    file, keys = place
    changed = file.changed({keys: value})
    try:
        loaded = file.model.model_validate(changed)
    except ValidationError:
        return
    assert loaded.model_dump() == changed


@pytest.mark.parametrize("file", FILES, ids=label)
def test_nothing_can_be_changed_after_loading(file: Shipped) -> None:
    def models(model: BaseModel) -> Iterator[BaseModel]:
        yield model
        for name in type(model).model_fields:
            value = getattr(model, name)
            values = value.values() if isinstance(value, dict) else (value,)
            for inner in values:
                if isinstance(inner, BaseModel):
                    yield from models(inner)

    for model in models(file.load(file.path)):
        for name in type(model).model_fields:
            with pytest.raises(ValidationError, match="frozen"):
                setattr(model, name, getattr(model, name))


def test_settings_load_without_torch_and_mujoco() -> None:
    """Which would take seconds, in each command that reads them; the rewards' names and constants are known then."""
    code = """
import sys
from mimo.settings import params, studies
p = params.load()
studies.load(p)
assert p.rewards.cais.pays == "move"
print(*({"torch", "mujoco"} & set(sys.modules)))
"""
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert (done.returncode, done.stdout.strip()) == (0, ""), done.stderr
