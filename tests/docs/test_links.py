"""Links of the pages lead to files and headings that are there."""

import re

from tests.docs.pages import PAGES, ROOT


def anchors(text: str) -> set[str]:
    """Return the anchors of a page's headings, as code hosts make them."""
    headings = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    return {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_every_link_of_a_page_leads_somewhere() -> None:
    for page in PAGES:
        for link in re.findall(r"\]\(([^)\s]+)\)", (ROOT / page).read_text(encoding="utf-8")):
            file, _, anchor = link.partition("#")
            if not file.startswith("http"):
                place = (ROOT / page).parent / file if file else ROOT / page
                assert place.exists(), f"{page}: {link}"
                assert not anchor or anchor in anchors(place.read_text(encoding="utf-8")), f"{page}: {link}"
