"""The page of a quick set's rows in Debian's Chromium, for all tests of this folder."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, sync_playwright

from reports.contents import CHAPTERS
from reports.page import write_report

ROWS = Path(__file__).parents[3] / "reports/published/results"
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    if CHROMIUM is None:
        pytest.skip("no Chromium on this machine: apt-get install chromium")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def heard() -> list[str]:
    """What the page said on the console, and whatever it asked the network for."""
    return []


@pytest.fixture(scope="module")
def page(browser: Browser, heard: list[str], tmp_path_factory: pytest.TempPathFactory) -> Page:
    folder = tmp_path_factory.mktemp("report")
    write_report(ROWS, folder, CHAPTERS)
    page = browser.new_page(viewport={"width": 1440, "height": 900})
    page.on("console", lambda said: heard.append(f"{said.type}: {said.text}"))
    page.on("pageerror", lambda error: heard.append(f"error: {error}"))
    page.on("request", lambda of: heard.extend([] if of.url.startswith("file:") else [of.url[:80]]))
    page.on("requestfailed", lambda of: heard.append(f"failed: {of.url[:80]}"))
    page.goto((folder / "index.html").as_uri())
    return page
