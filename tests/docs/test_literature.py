"""Whoever the code names as a source is among the literature, and the project says how to cite it."""

import re
from collections.abc import Iterator

import yaml

import crankslider
from tests.docs.pages import DOCS, ROOT, table

PACKAGES = ("reference_solver", "engine_models", "studies", "reports", "tests")
#: "Pfeiffer and Glocker 1996", "Kane (1984)", "Virtanen et al. 2020".
SOURCE = re.compile(
    r"\b([A-Z][a-z]+)(?:(?:, [A-Z][a-z]+)*,? and ([A-Z][a-z]+)| et al\.)?,? \(?(1[89]\d\d|20[012]\d)\b"
)
LITERATURE = [
    " ".join(entry.split()) for entry in (DOCS / "literature.md").read_text(encoding="utf-8").split("\n- ")
]


def sources() -> Iterator[tuple[str, str]]:
    """Yield name and year of every source that code and pages name."""
    texts = [path.read_text(encoding="utf-8") for p in PACKAGES for path in (ROOT / p).rglob("*.py")]
    texts += [
        row["source"]
        for first in ("law", "friction")
        for row in table("docs/laws.md", first)
        if "source" in row
    ]
    for text in texts:
        for first, last, year in SOURCE.findall(" ".join(text.split())):
            yield from ((name, year) for name in (first, last) if name)


def test_every_source_is_among_the_literature() -> None:
    for name, year in set(sources()):
        assert any(name in entry.split(":")[0] and f"({year})" in entry for entry in LITERATURE), (name, year)


def test_the_citation_is_of_this_version_and_names_the_paper() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert {"cff-version", "message", "title", "authors"} <= citation.keys()
    assert citation["version"] == crankslider.__version__
    authors = {author["family-names"] for author in citation["references"][0]["authors"]}
    assert authors == {"Grigore", "Stanescu", "Pandrea"}
