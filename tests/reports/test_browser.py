"""The page of a quick set's rows in Debian's Chromium: quiet, alone, and no wider than the screen."""

import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlparse

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Page, sync_playwright

from reports.chapters.contents import CHAPTERS
from reports.page import write_report

pytestmark = pytest.mark.system

ROWS = Path(__file__).parents[2] / "reports/published/results"
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
#: A phone's width, and that of a desk's screen; the most screens of 900 pixels.
PHONE, DESK, MOST_SCREENS = 390, 1440, 25
#: Which of axe's checks are of what people can use, and not of taste.
RULES = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa"]
#: What is on the screen that scrolls nowhere and ends beyond its right edge.
TOO_WIDE = """width => [...document.querySelectorAll("body *")]
    .filter(each => !each.closest(".wide") && each.getBoundingClientRect().right > width + 0.5)
    .map(each => each.outerHTML.slice(0, 80))"""


@pytest.fixture(scope="module")
def heard() -> list[str]:
    """What the page said on the console, and whatever it asked the network for."""
    return []


@pytest.fixture(scope="module")
def opened(heard: list[str], tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    if CHROMIUM is None:
        pytest.skip("no Chromium on this machine: apt-get install chromium")
    folder = tmp_path_factory.mktemp("report")
    write_report(ROWS, folder, CHAPTERS)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        page = browser.new_page()
        page.on("console", lambda said: heard.append(f"{said.type}: {said.text}"))
        page.on("pageerror", lambda error: heard.append(f"error: {error}"))
        page.on("request", lambda of: heard.extend([] if of.url.startswith("file:") else [of.url[:80]]))
        page.on("requestfailed", lambda of: heard.append(f"failed: {of.url[:80]}"))
        page.goto((folder / "index.html").as_uri())
        yield page
        browser.close()


@pytest.fixture
def page(opened: Page) -> Page:
    """Return the page as a reader finds it, at a desk, in the light."""
    opened.set_viewport_size({"width": DESK, "height": 900})
    opened.emulate_media(color_scheme="light", media="screen")
    opened.reload()
    return opened


@pytest.mark.parametrize("width", [PHONE, DESK])
def test_nothing_is_wider_than_the_screen_or_asks_the_network(
    page: Page, width: int, heard: list[str]
) -> None:
    page.set_viewport_size({"width": width, "height": 800})
    page.evaluate("document.querySelectorAll('details').forEach(part => { part.open = true; })")
    assert page.evaluate(TOO_WIDE, width) == []
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert page.locator("figure.drawing img").count() >= 8
    assert heard == []


def test_letters_on_a_figure_are_legible_on_a_phone(page: Page) -> None:
    """But for the map of stability, whose cells have a letter each."""
    page.set_viewport_size({"width": PHONE, "height": 800})
    for image in page.locator(".drawing img").all():
        svg = Path(unquote(urlparse(image.evaluate("image => image.src")).path))
        box, text = image.bounding_box(), svg.read_text(encoding="utf-8")
        assert box is not None
        if svg.name != "stability-map.svg":
            (wide,) = re.findall(r'viewBox="0 0 ([\d.]+)', text)
            smallest = min(float(size) for size in re.findall(r"font-size: ([\d.]+)px", text))
            assert smallest * box["width"] / float(wide) >= 8, f"pixels, {svg.name}"


def test_dark_is_dark_and_figures_stay_on_paper_which_print_shows(page: Page) -> None:
    page.emulate_media(color_scheme="dark")
    colour = "getComputedStyle(document.querySelector('{}')).backgroundColor"
    assert page.evaluate(colour.format("body")) == "rgb(21, 24, 27)"
    assert page.evaluate(colour.format(".drawing img")) == "rgb(255, 255, 255)"
    page.emulate_media(media="print")
    assert all(figure.locator("img").is_visible() for figure in page.locator("figure.drawing").all())
    assert not page.locator("nav").is_visible()


def test_the_first_screen_has_the_recommendations_and_the_second_the_comparison(page: Page) -> None:
    for table, most in (("answer", 700), ("compared-ideal-joints", 1100), ("compared-clearance", 1500)):
        what = f"document.querySelector('#table-{table}').getBoundingClientRect().bottom"
        assert page.evaluate(what) < most, table
    assert page.evaluate("document.documentElement.scrollHeight") < MOST_SCREENS * 900


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_nothing_that_keeps_people_out(page: Page, scheme: Any) -> None:
    page.emulate_media(color_scheme=scheme)
    only: dict[str, Any] = {"type": "rule", "values": ["color-contrast"]}
    if scheme == "light":
        only = {"type": "tag", "values": RULES}
    options = {"runOnly": only, "resultTypes": ["violations"]}
    found = Axe().run(page, options=options).response["violations"]
    assert [(each["id"], each["nodes"][0]["html"][:120], len(each["nodes"])) for each in found] == []
