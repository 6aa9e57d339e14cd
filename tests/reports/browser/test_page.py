"""The page as a browser shows it: quiet, alone, no wider than the screen, and at work."""

import json
import re

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Page

pytestmark = pytest.mark.system

#: A phone's width, and that of a desk's screen.
WIDTHS = (390, 1440)
#: The table and figures in which what is tested of all is tried; the second figure has pickers.
TABLE, FIGURE, PICKED = "#table-clearance-impact-errors", "#figure-answer", "#figure-cost-error"
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
    assert page.locator("figure.drawing svg").count() > 10
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
    heights = page.evaluate(
        """[...document.querySelectorAll(".drawing:not(.dense) .view:not([hidden]) svg")].map(svg => Math.min(
            ...[...svg.querySelectorAll("text")].map(text => parseFloat(getComputedStyle(text).fontSize)
                * svg.getBoundingClientRect().width / svg.viewBox.baseVal.width)))"""
    )
    assert min(heights) >= 8, "pixels; raised exponents are the smallest"


def test_every_picture_is_there(page: Page) -> None:
    unfold(page)
    broken = page.evaluate(
        """[...document.querySelectorAll("svg [href], img")].filter(each => each.tagName === "IMG"
            ? !each.naturalWidth : each.tagName === "image" ? !each.href.baseVal.startsWith("data:image/")
            : !document.getElementById(each.getAttribute("href").slice(1))).length"""
    )
    assert broken == 0


def test_a_series_is_switched_off_and_on(page: Page) -> None:
    figure = page.locator(FIGURE)
    button = figure.get_by_role("button", name="reference")
    for pressed, hidden in (("false", True), ("true", False)):
        button.click()
        assert button.get_attribute("aria-pressed") == pressed
        assert bool(figure.locator("svg .off").count()) == hidden


def test_the_value_under_the_pointer_is_told_with_its_setting(page: Page) -> None:
    figure = page.locator(FIGURE)
    figure.scroll_into_view_if_needed()
    at = page.evaluate(
        """id => { const figure = document.querySelector(id), svg = figure.querySelector("svg");
            const [x, y] = JSON.parse(figure.querySelector("script").textContent).lines[0][4][0];
            const place = new DOMPoint(x, y).matrixTransform(svg.getScreenCTM());
            return [place.x, place.y]; }""",
        FIGURE,
    )
    page.mouse.move(at[0], at[1])
    told = figure.locator(".value").inner_text()
    assert re.search(r"slider position error \[m\]: \d", told), told
    assert re.search(r"(step|tolerance) \d", told), told


def test_a_figure_zooms_in_and_back(page: Page) -> None:
    figure = page.locator(FIGURE)
    whole = figure.locator("svg").get_attribute("viewBox")
    figure.get_by_role("button", name="Zoom in").click()
    assert figure.locator("svg").get_attribute("viewBox") != whole
    figure.get_by_role("button", name="Zoom out").click()
    assert (
        page.evaluate("id => document.querySelector(id).querySelector('svg').classList.length", FIGURE) == 0
    )


def seen(page: Page) -> list[list[str]]:
    """Return the choices of the views of the figure with pickers that are seen."""
    views = page.locator(f"{PICKED} .view:not([hidden])").all()
    return [json.loads(view.get_attribute("data-choice") or "") for view in views]


def test_a_picker_shows_another_view_and_moves_the_others_where_it_must(page: Page) -> None:
    pickers = page.locator(PICKED).get_by_role("combobox")
    joints, signal, cost = (pickers.nth(place) for place in range(3))
    assert seen(page) == [["ideal joints", "slider position", "run time"]]
    cost.select_option("steps")
    assert seen(page) == [["ideal joints", "slider position", "steps"]]
    signal.select_option("peak force")  # which ideal joints have none of, and which is over run time alone
    assert seen(page) == [["clearance", "peak force", "run time"]]
    assert [picker.input_value() for picker in (joints, signal, cost)] == seen(page)[0]


def column(page: Page, number: int) -> list[str]:
    cells = page.locator(f"{TABLE} tbody td:nth-child({number})")
    return [text.strip() for text in cells.all_text_contents()]


def test_a_table_is_sorted_by_number_and_back(page: Page) -> None:
    head = page.locator(f"{TABLE} thead th").nth(3)
    assert "time" in head.inner_text()
    for order in ("ascending", "descending"):
        head.get_by_role("button").click()
        assert head.get_attribute("aria-sort") == order
        times = [float(text) for text in column(page, 4)]
        assert times == sorted(times, reverse=order == "descending")


def test_dark_is_dark_and_a_button_makes_it_light(page: Page) -> None:
    page.emulate_media(color_scheme="dark")
    colour = "getComputedStyle(document.body).backgroundColor"
    dark = page.evaluate(colour)
    page.get_by_role("button", name="Light").click()
    assert (dark, page.evaluate(colour)) == ("rgb(21, 24, 27)", "rgb(255, 255, 255)")


def test_letters_and_black_lines_of_figures_are_light_in_the_dark(page: Page) -> None:
    page.emulate_media(color_scheme="dark")
    fills = page.evaluate(
        """id => [...document.querySelectorAll(id + " svg text")].map(text => getComputedStyle(text).fill)""",
        FIGURE,
    )
    assert set(fills) == {"rgb(232, 232, 232)"}


def test_print_shows_the_first_view_of_each_figure_and_what_is_folded(page: Page) -> None:
    page.emulate_media(media="print")
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert page.locator("details:not([open])").count() == 0
    figures = page.locator("figure.drawing").all()
    assert [figure.locator("svg").filter(visible=True).count() for figure in figures] == [1] * len(figures)
    assert not page.locator("nav").is_visible()


def test_the_first_screen_has_the_table_and_the_figure(page: Page) -> None:
    bottom = page.evaluate("document.querySelector('#answer table').getBoundingClientRect().bottom")
    assert bottom < 700
    top = page.evaluate("document.querySelector('#figure-answer svg').getBoundingClientRect().top")
    assert top < 800


def test_the_page_is_as_long_as_a_reader_has_time_for(page: Page) -> None:
    high = page.evaluate("document.documentElement.scrollHeight")
    assert high < MOST_SCREENS * 900


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_nothing_that_keeps_people_out(page: Page, scheme: str) -> None:
    page.emulate_media(color_scheme="dark" if scheme == "dark" else "light")
    only = (
        {"type": "tag", "values": RULES}
        if scheme == "light"
        else {"type": "rule", "values": ["color-contrast"]}
    )
    options = {"runOnly": only, "resultTypes": ["violations"]}
    # Of a drawing the whole is checked; its thousands of strokes would take minutes.
    found = Axe().run(page, {"exclude": [["svg > g"]]}, options).response["violations"]
    assert [(each["id"], each["nodes"][0]["html"][:120], len(each["nodes"])) for each in found] == []
