"""The report's pages in a real browser, from their files: the published ones, and those of a small project."""

import re
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml
from selenium.webdriver import ActionChains, Chrome, ChromeOptions, ChromeService, Keys
from selenium.webdriver.common.by import By
from selenium.webdriver.remote.webelement import WebElement
from selenium.webdriver.support.select import Select
from selenium.webdriver.support.wait import WebDriverWait

from mimo.settings import studies as settings
from stages.base import paths
from stages.page import page
from tests.unit.page import fabricated
from tests.unit.page.kinds import ASKED, EFFECTS, computed, effect

ROOT = Path(__file__).resolve().parents[3]
QUIET = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
PHONE, DESK, PAPER = 390, 1440, 673  # pixels; paper is A4 less its margins
PICTURES = "return [...document.images].map(image => image.complete && image.naturalWidth)"
OVERFLOW = "return document.documentElement.scrollWidth - document.documentElement.clientWidth"
CURVES = "return [...document.querySelectorAll('#panels .mean')].map(path => path.getAttribute('d'))"
DRAWN = "const done = arguments[0]; requestAnimationFrame(() => requestAnimationFrame(() => done()))"
PROGRAMS = shutil.which("chromium"), shutil.which("chromedriver")

FILMS = sorted((ROOT / paths.FILMS).glob("*.mp4"))

pytestmark = pytest.mark.skipif(None in PROGRAMS, reason="Debian's chromium and chromium-driver are not installed")


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Chrome]:
    options = ChromeOptions()
    options.binary_location = str(PROGRAMS[0])
    for flag in (*QUIET, f"--user-data-dir={tmp_path_factory.mktemp('chromium')}"):
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = Chrome(options, ChromeService(PROGRAMS[1]))
    yield driver
    driver.quit()


@pytest.fixture
def published(browser: Chrome) -> Chrome:
    """The browser with the published page open, as wide as a desk's."""
    return opened(browser, ROOT)


@pytest.fixture
def made(browser: Chrome, reported: Path) -> Chrome:
    """The browser with the small project's page open, whose numbers are known."""
    return opened(browser, reported)


def opened(browser: Chrome, project: Path, page: Path = paths.REPORT) -> Chrome:
    widen(browser, DESK)
    browser.get((project / page).as_uri())
    return browser


def widen(browser: Chrome, width: int, media: str = "") -> None:
    """Give the page this width in pixels, and wait until what follows its width is drawn again."""
    metrics = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width == PHONE}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": media})
    browser.execute_async_script(DRAWN)


def reading(browser: Chrome) -> str:
    return browser.find_element(By.ID, "reading").text


def curves(browser: Chrome) -> list[str]:
    """The lines that the explorer draws, as they are at one moment."""
    return list(browser.execute_script(CURVES))


def choose(browser: Chrome, name: str, text: str) -> None:
    Select(browser.find_element(By.NAME, name)).select_by_visible_text(text)


def assert_fits(browser: Chrome) -> None:
    """Nothing overflows, on any screen or on paper, and the console is silent."""
    for width, media in ((DESK, ""), (PHONE, ""), (PAPER, "print")):
        widen(browser, width, media)
        assert browser.execute_script("return innerWidth") == width
        assert browser.execute_script(OVERFLOW) == 0, width
    assert browser.get_log("browser") == []


def test_every_picture_loads_nothing_overflows_and_the_console_is_silent(published: Chrome) -> None:
    pictures = published.execute_script(PICTURES)
    assert len(pictures) >= 6
    assert min(pictures) > 0
    assert_fits(published)


def test_the_published_studies_page_has_what_is_computed_fits_and_its_console_is_silent(browser: Chrome) -> None:
    page = opened(browser, ROOT, paths.STUDIES)
    asked = yaml.safe_load((ROOT / settings.PATH).read_text(encoding="utf-8"))["studies"]
    shown = [section.get_attribute("id") for section in page.find_elements(By.CSS_SELECTOR, "section[id^=study-]")]
    computed = {name: (ROOT / paths.STUDIES_NUMBERS / f"{name}.json").exists() for name in asked}
    assert shown == [f"study-{name}" for name, there in computed.items() if there]
    short = page.find_element(By.ID, "short").text
    assert all(f"{asked[name]['title']}" in short for name in asked)
    assert ("Not computed yet" in short) == (not all(computed.values()))
    assert_fits(page)


@pytest.fixture(scope="module")
def fabricated_page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A project's folder with the studies' page alone, of one study of each kind."""
    asked = fabricated.studies(**ASKED)
    found = page.Beyond(computed(asked), {name: fabricated.explored(study) for name, study in asked.studies.items()})
    folder = tmp_path_factory.mktemp("studies")
    (folder / paths.STUDIES).parent.mkdir(parents=True)
    html = page.studies(asked, found, fabricated.judged(effect), EFFECTS, [])
    (folder / paths.STUDIES).write_text(html, encoding="utf-8")
    return folder


def test_a_studies_page_fits_and_its_explorer_draws_the_study_that_is_chosen(
    browser: Chrome, fabricated_page: Path
) -> None:
    assert_fits(opened(browser, fabricated_page, paths.STUDIES))
    widen(browser, DESK)
    assert len(curves(browser)) == 2 * 3
    choose(browser, "study", "Study dose")
    choose(browser, "variant", "n80")
    choose(browser, "reward", "MTL")
    assert re.search(r"P\(MOVE\) 0\.62[45] ± 0\.09[89]", reading(browser).splitlines()[1])  # mean of .5 to .75
    before = curves(browser)
    choose(browser, "study", "Study drawn")
    assert Select(browser.find_element(By.NAME, "variant")).first_selected_option.text == "draw1"
    assert Select(browser.find_element(By.NAME, "condition")).first_selected_option.text == "free"
    browser.find_element(By.CSS_SELECTOR, "[name=seed][value='0']").click()
    assert curves(browser) != before
    assert reading(browser).splitlines()[0].endswith("n = 4")
    assert browser.get_log("browser") == []


def test_a_small_projects_pages_fit_and_lead_to_each_other(made: Chrome) -> None:
    assert_fits(made)
    widen(made, DESK)
    made.find_element(By.CSS_SELECTOR, f"header a[href='{paths.STUDIES.name}']").click()
    assert made.title.endswith("studies")
    assert_fits(made)
    made.find_element(By.CSS_SELECTOR, f"header a[href='{paths.REPORT.name}']").click()
    assert made.title.endswith("results")


def test_films_play(published: Chrome) -> None:
    films = published.find_elements(By.TAG_NAME, "video")
    assert len(films) == len(FILMS) == 2
    for film in films:
        assert state(film, "currentTime") == 0
        published.execute_script("arguments[0].muted = true; arguments[0].play()", film)
        WebDriverWait(film, 20).until(lambda film: state(film, "currentTime") > 0.1)
        assert state(film, "videoWidth") > 0
        published.execute_script("arguments[0].pause()", film)
    assert published.get_log("browser") == []


def state(film: WebElement, name: str) -> float:
    return float(str(film.get_property(name)))


def test_the_explorer_draws_what_is_chosen(made: Chrome) -> None:
    assert len(curves(made)) == 2 * 3  # attached limb and others, in three panels
    choose(made, "condition", "free")
    attached, others = reading(made).splitlines()[1:]
    assert "P(MOVE) 0.812 ± 0.088" in attached or "P(MOVE) 0.813 ± 0.088" in attached
    assert others.endswith("P(MOVE) 0.250 ± 0.000")
    before = curves(made)
    choose(made, "condition", "noisy")
    assert curves(made) != before
    assert "P(MOVE) 0.563 ± 0.088" in reading(made) or "P(MOVE) 0.562 ± 0.088" in reading(made)
    choose(made, "joint", "right elbow")
    assert len(curves(made)) == 3
    assert reading(made).endswith("P(MOVE) 0.875 ± 0.000")
    choose(made, "joint", "left knee, attached")
    made.find_element(By.CSS_SELECTOR, "[name=seed][value='0']").click()
    assert reading(made).splitlines()[0].endswith("n = 1")
    assert reading(made).endswith("P(MOVE) 0.625")
    made.find_element(By.NAME, "none").click()
    assert reading(made) == "No seed is chosen."
    made.find_element(By.NAME, "all").click()
    made.find_element(By.NAME, "each").click()
    assert len(made.find_elements(By.CSS_SELECTOR, "#panels .seed")) == 2 * 3
    assert made.get_log("browser") == []


def test_the_explorer_is_read_by_keyboard_and_by_pointer(made: Chrome) -> None:
    slider = made.find_element(By.NAME, "step")
    assert "step 60 (attached)" in reading(made)
    slider.send_keys(Keys.ARROW_RIGHT)
    assert "step 61 (extinction)" in reading(made)
    assert slider.get_attribute("aria-valuetext") == "step 61, extinction"
    panels = made.find_element(By.ID, "panels")
    ActionChains(made).move_to_element_with_offset(panels, -panels.size["width"] // 2 + 60, -100).perform()
    assert "(baseline)" in reading(made)
    choose(made, "reward", "MTL + Surprise")
    assert "(baseline)" in reading(made)
    widen(made, PHONE)
    assert made.execute_script("return document.querySelector('#panels svg').clientWidth") < PHONE
    assert made.execute_script(OVERFLOW) == 0


def test_without_scripts_a_sentence_says_what_is_missing(made: Chrome) -> None:
    made.execute_cdp_cmd("Emulation.setScriptExecutionDisabled", {"value": True})
    try:
        made.refresh()
        section = made.find_element(By.ID, "explore")
        assert "This part needs JavaScript" in section.text
        assert not made.find_element(By.ID, "explorer").is_displayed()
    finally:
        made.execute_cdp_cmd("Emulation.setScriptExecutionDisabled", {"value": False})
