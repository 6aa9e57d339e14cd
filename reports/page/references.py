"""What the page explains and cites: terms at their first use, with a glossary, and a bibliography."""

import json
import re
from importlib.resources import files
from typing import Any

from markupsafe import Markup, escape

#: How a text cites: [@hairer1993].
_CITED = re.compile(r"\[@(\w+)\]")


class References:
    """The glossary and the bibliography of one page, which remembers which terms it has explained.

    ``works`` are in the order of their first authors, in the form of CSL-JSON.
    """

    def __init__(self) -> None:
        room = files("reports.page")
        self._glossary: dict[str, str] = json.loads((room / "glossary.json").read_text(encoding="utf-8"))
        works = json.loads((room / "bibliography.json").read_text(encoding="utf-8"))
        self.works: list[dict[str, Any]] = sorted(works, key=lambda work: (authors(work), year(work)))
        self._by_id = {work["id"]: work for work in works}
        terms = sorted(map(re.escape, self._glossary), key=len, reverse=True)
        self._term = re.compile(rf"(?<![\w-])({'|'.join(terms)})(s?)(?![\w-])")
        self._new = set(self._glossary)

    @property
    def glossary(self) -> list[tuple[str, str, Markup]]:
        """Every term with its anchor and what it means, in the order of the alphabet."""
        terms = sorted(self._glossary, key=str.lower)
        return [(term, anchor(term), self.cited(self._glossary[term])) for term in terms]

    def explained(self, text: str) -> Markup:
        """Return a text whose works are cited, and whose new terms lead to the glossary."""
        return Markup(self._term.sub(self._first, str(self.cited(text))))

    def cited(self, text: str) -> Markup:
        """Return a text whose citations lead to the bibliography.

        Raises:
            KeyError: it cites a work that is not there.
        """
        return Markup(_CITED.sub(lambda found: self._link(found[1]), str(escape(text))))

    def entry(self, name: str) -> str:
        """Return a work in full, without what its entry lacks."""
        work = self._by_id[name]
        people = "; ".join(
            each.get("literal") or f"{each['family']}, {each['given']}" for each in work["author"]
        )
        place = " ".join(work[key] for key in ("container-title", "publisher", "volume") if key in work)
        parts = (
            f"{people} ({year(work)})",
            work.get("title"),
            ", ".join(filter(None, (place, work.get("page")))),
        )
        return ". ".join(filter(None, parts)) + "."

    def _link(self, name: str) -> str:
        work = self._by_id[name]
        return f'<a class="cite" href="#work-{name}">{escape(authors(work))} {year(work)}</a>'

    def _first(self, found: re.Match[str]) -> str:
        term = found[1]
        if term not in self._new:
            return found[0]
        self._new.remove(term)
        meaning = escape(_CITED.sub("", self._glossary[term]))
        return f'<a class="term" href="#{anchor(term)}" title="{meaning}">{found[0]}</a>'


def anchor(term: str) -> str:
    """Return the anchor of a term in the glossary."""
    return "term-" + re.sub(r"\W+", "-", term)


def authors(work: dict[str, Any]) -> str:
    """Return the authors of a work as it is cited: Hairer and Wanner, Hairer et al."""
    names = [each.get("family") or each["literal"] for each in work["author"]]
    return names[0] if len(names) == 1 else " and ".join(names) if len(names) == 2 else f"{names[0]} et al."


def year(work: dict[str, Any]) -> int:
    """Return the year of a work."""
    return int(work["issued"]["date-parts"][0][0])
