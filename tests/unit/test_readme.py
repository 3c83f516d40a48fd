"""The README's table of claims says what reports/claims.json says; what people read leads to where it says."""

import json
import re
import tomllib
from pathlib import Path
from typing import Any

import pytest
import yaml

from mimo.science import judgement

ROOT = Path(__file__).parents[2]
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/*.md")])


def test_the_table_of_claims_has_the_published_verdicts() -> None:
    published = json.loads((ROOT / "reports/claims.json").read_text())["claims"]
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (\d\w?) [^|]*\|[^|]*\| \*\*([\w, ]+)\*\* \| \*\*([\w, ]+)\*\* \|$", text, re.M)
    words = [[verdict(claim[group]) for group in judgement.GROUPS] for claim in published]
    assert rows == [(claim["name"].split()[0], *said) for claim, said in zip(published, words, strict=True)]


def verdict(group: dict[str, Any]) -> str:
    return str(group["verdict"]) + (", saturated" if group["saturated"] else "")


def test_the_readme_is_short() -> None:
    assert len((ROOT / "README.md").read_text().splitlines()) < 150


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path) -> None:
    text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.M | re.S)
    headings = {re.sub(r"[^\w -]", "", line.lower()).replace(" ", "-") for line in re.findall(r"^#+ (.*)", text, re.M)}
    for link in re.findall(r"\]\(([^)]+)\)", text):
        if link.startswith("#"):
            assert link[1:] in headings, link
        elif not link.startswith("https://"):
            assert (page.parent / link).exists(), link


def test_the_citation_is_of_this_version_and_licence() -> None:
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert {cited[key] for key in ("title", "version", "license")} == {
        project[key] for key in ("name", "version", "license")
    }
    assert f"## [{project['version']}]" in (ROOT / "CHANGELOG.md").read_text()
