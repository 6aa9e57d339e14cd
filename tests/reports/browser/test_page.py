"""The page as a browser shows it: quiet, alone, and no wider than the screen."""

import re
from pathlib import Path
from urllib.parse import unquote, urlparse

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Page

pytestmark = pytest.mark.system

#: A phone's width, and that of a desk's screen.
WIDTHS = (390, 1440)
#: Figures with letters in small cells, which a phone shows larger.
DENSE = ("stability-map", "extremes-matrix")
#: Which of axe's checks are of what people can use, and not of taste.
#: Screens of 900 pixels.
MOST_SCREENS = 25
RULES = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa"]


@pytest.fixture(autouse=True)
def _as_opened(page: Page) -> None:
    """Leave to every test the page as a reader finds it, at a desk, in the light."""
    page.set_viewport_size({"width": WIDTHS[-1], "height": 900})
    page.emulate_media(color_scheme="light", media="screen")
    page.reload()


def unfold(page: Page) -> None:
    page.evaluate("document.querySelectorAll('details').forEach(part => { part.open = true; })")


def test_the_page_needs_no_network_and_says_nothing_on_the_console(page: Page, heard: list[str]) -> None:
    unfold(page)
    assert page.locator("figure.drawing img").count() >= 8
    assert heard == []


@pytest.mark.parametrize("width", WIDTHS)
def test_nothing_is_wider_than_the_screen(page: Page, width: int) -> None:
    page.set_viewport_size({"width": width, "height": 800})
    unfold(page)
    wide = page.evaluate(
        """width => [...document.querySelectorAll("body *")]
            .filter(each => !each.closest(".wide") && each.getBoundingClientRect().right > width + 0.5)
            .map(each => each.outerHTML.slice(0, 80))""",
        width,
    )
    assert wide == []
    assert page.evaluate("document.documentElement.scrollWidth") <= width


def test_letters_on_a_figure_are_legible_on_a_phone(page: Page) -> None:
    page.set_viewport_size({"width": WIDTHS[0], "height": 800})
    unfold(page)
    for image in page.locator(".drawing img").all():
        svg = Path(unquote(urlparse(image.evaluate("image => image.src")).path))
        box = image.bounding_box()
        if box and not svg.name.startswith(DENSE):
            text = svg.read_text(encoding="utf-8")
            (wide,) = re.findall(r'viewBox="0 0 ([\d.]+)', text)
            sizes = [float(size) for size in re.findall(r"font-size: ([\d.]+)px", text)]
            assert min(sizes) * box["width"] / float(wide) >= 8, f"pixels, {svg.name}"


def test_dark_is_dark_and_figures_stay_on_paper(page: Page) -> None:
    page.emulate_media(color_scheme="dark")
    colour = "getComputedStyle(document.querySelector('{}')).backgroundColor"
    assert page.evaluate(colour.format("body")) == "rgb(21, 24, 27)"
    assert page.evaluate(colour.format(".drawing img")) == "rgb(255, 255, 255)"


def test_print_shows_each_figure_and_not_the_contents(page: Page) -> None:
    page.emulate_media(media="print")
    figures = page.locator("figure.drawing").all()
    assert [figure.locator("img").filter(visible=True).count() for figure in figures] == [1] * len(figures)
    assert not page.locator("nav").is_visible()


def test_the_first_screen_has_the_recommendations_and_the_second_the_comparison(page: Page) -> None:
    for table, most in (("answer", 700), ("compared-ideal-joints", 1100), ("compared-clearance", 1500)):
        what = f"document.querySelector('#table-{table}').getBoundingClientRect().bottom"
        assert page.evaluate(what) < most, table
    assert page.evaluate("document.documentElement.scrollHeight") < MOST_SCREENS * 900


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_nothing_that_keeps_people_out(page: Page, scheme: str) -> None:
    page.emulate_media(color_scheme="dark" if scheme == "dark" else "light")
    only = (
        {"type": "tag", "values": RULES}
        if scheme == "light"
        else {"type": "rule", "values": ["color-contrast"]}
    )
    options = {"runOnly": only, "resultTypes": ["violations"]}
    found = Axe().run(page, options=options).response["violations"]
    assert [(each["id"], each["nodes"][0]["html"][:120], len(each["nodes"])) for each in found] == []
