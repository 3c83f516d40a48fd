"""The studies' page: the shipped studies, as they are and as a user changes them."""

import re
from copy import deepcopy
from pathlib import Path
from typing import Any

import pytest
import yaml

from mimo.settings.params import REWARDS
from mimo.settings.studies import PATH as SETTINGS
from stages.page import studied
from tests.unit.page import fabricated
from tests.unit.page.kinds import ASKED, effect, written
from tests.unit.page.reading import plain, section

ROOT = Path(__file__).resolve().parents[3]
SHIPPED = yaml.safe_load((ROOT / SETTINGS).read_text(encoding="utf-8"))["studies"]

pytestmark = pytest.mark.usefixtures("few_resamples")


@pytest.mark.parametrize("name", SHIPPED)
def test_every_shipped_study_is_answered_by_a_template_of_its_own(name: str) -> None:
    """Whatever its numbers, with one seed as with more."""
    asked = deepcopy(SHIPPED[name])
    for cells in (asked["cells"], *(own.get("cells", {}) for own in asked["variants"].values())):
        for condition, rewards in cells.items():
            cells[condition] = [reward for reward in rewards if reward in REWARDS] or ["cais"]
    for seeds in (1, 3):
        study = fabricated.studies(**{name: asked | {"seeds": seeds}})
        made = {name: fabricated.made(study.studies[name], effect)}
        own = studied.studied(study.studies, made, fabricated.judged(effect))[0]
        assert own.answer == f"answers/{name}.html.j2"
        words = plain(section(written(study, made), f"study-{name}"))
        assert f"n = {seeds}" in words
        assert "nan" not in words.split()


@pytest.mark.parametrize("name", SHIPPED)
@pytest.mark.parametrize("change", [{"measures": ["path"]}, {"seeds": 25}], ids=["measures", "seeds"])
def test_a_shipped_study_that_a_user_changes_has_a_page_too(change: dict[str, Any], name: str) -> None:
    """Its own words where they are still true, else its kind's; nothing of a change from runs that there are not."""
    asked = SHIPPED[name]
    study = fabricated.studies(**{name: asked | change})
    words = plain(section(written(study, {name: fabricated.made(study.studies[name], effect)}), f"study-{name}"))
    assert f"n = {change.get('seeds', asked['seeds'])}" in words
    if "seeds" in change:
        assert not re.search(
            "certainly another than|turns a verdict|turn some|against CAIS|rises by, same seeds", words
        )


def test_a_study_of_other_variants_than_its_words_are_about_has_a_page_too() -> None:
    limbs = SHIPPED["limbs"] | {"variants": {"right_foot": SHIPPED["limbs"]["variants"]["right_foot"]}}
    own = {"map": {"variants": {"one": {}}}, "against": {}, "limbs": limbs}
    study = fabricated.studies(**own)
    html = written(study, {name: fabricated.made(it, effect) for name, it in study.studies.items()})
    assert [name for name in own if "n = 5" in plain(section(html, f"study-{name}"))] == list(own)


def test_a_force_from_which_the_lead_is_certain_is_told_though_none_below_is() -> None:
    """By noise's own words."""
    study = fabricated.studies(noise=ASKED["dose"])

    def lead(variant: str, cell: str, measure: str) -> float:
        return 0.0 if variant == "n0" and measure == "lead" else 0.2

    words = plain(section(written(study, {"noise": fabricated.made(study.studies["noise"], lead)}), "study-noise"))
    assert re.search(r"with MTL at 1, 80 N, but not below \(at 1 N 0\.\d\d \[", words)
