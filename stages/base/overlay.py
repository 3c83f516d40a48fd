"""The preview's settings: params.yaml and studies/params.yaml, each with the overrides of a file beside it."""

from pathlib import Path
from typing import Any

import yaml

from mimo.settings import params, studies
from mimo.settings.errors import Fault

FILES = {  # and the overrides, both relative to the project's top folder
    Path("params.yaml"): Path("params.preview.yaml"),
    studies.PATH: Path("studies/params.preview.yaml"),
}
REPLACED = {("effects", "alternatives")}  # sections of names that the overrides choose
EACH = "*"  # in a section of names: each that is there, but for what is given by name


class OverlayError(Fault, ValueError):
    """Overrides do not fit; the message is one sentence."""


def merged(source: Path, file: Path) -> dict[str, Any]:
    """A file of FILES with its overrides laid over it.

    Args:
        source: the project's top folder.
        file: one of FILES; it is checked first, so that each fault names its own file.

    Raises:
        OverlayError: the overrides do not fit the file.
        mimo.settings.files.ParamsError: the file itself does not hold.
    """
    p = params.load(source / "params.yaml")
    if file == studies.PATH:
        studies.load(p, source / file)
    whole: dict[str, Any] = yaml.safe_load((source / file).read_text(encoding="utf-8"))
    try:
        overrides = yaml.safe_load((source / FILES[file]).read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise OverlayError(f"{FILES[file]} is missing; restore it from the repository.") from None
    except yaml.YAMLError as error:
        raise OverlayError(f"{FILES[file]} is not valid YAML: {error}") from None
    return _merge(whole, overrides, file, ())


def write(source: Path, folder: Path) -> None:
    """Write all of FILES, merged, to `folder`; each is checked before it replaces what lies there.

    Raises:
        OverlayError: overrides do not fit.
        mimo.settings.files.ParamsError: a file does not hold, with the overrides or without.
    """
    small = {file: merged(source, file) for file in FILES}
    drafts = {file: folder / file.with_name(f"{file.name}+{FILES[file].name}") for file in FILES}
    try:
        for file, draft in drafts.items():
            draft.parent.mkdir(parents=True, exist_ok=True)
            text = yaml.safe_dump(small[file], sort_keys=False)
            draft.write_text(
                f"# By `python -m stages.commands.preview` from {file} and {FILES[file]}.\n{text}", encoding="utf-8"
            )
        own, beyond = drafts.values()
        studies.load(params.load(own), beyond)
        for file, draft in drafts.items():
            draft.replace(folder / file)
    finally:
        for draft in drafts.values():
            draft.unlink(missing_ok=True)


def _merge(whole: dict[str, Any], overrides: Any, file: Path, above: tuple[str, ...]) -> dict[str, Any]:
    """Lay `overrides` over `whole`, section by section but for REPLACED; a key that `whole` has not is refused."""
    here = ".".join(above) or "the file"
    if not isinstance(overrides, dict):
        raise OverlayError(f"{FILES[file]}: {here} must be a section of keys and values, as in {file}.")
    merged = dict(whole)
    if EACH in overrides:
        overrides = dict.fromkeys(whole, overrides[EACH]) | {k: v for k, v in overrides.items() if k != EACH}
    for key, value in overrides.items():
        path = (*above, str(key))
        if key not in whole:
            raise OverlayError(f"{FILES[file]}: {'.'.join(path)} is not in {file}; rename or remove it.")
        deeper = isinstance(whole[key], dict) and path not in REPLACED
        merged[key] = _merge(whole[key], value, file, path) if deeper else value
    return merged
