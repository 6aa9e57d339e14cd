"""The published page and tables are what this code makes of the published rows, to the last character.

Curves are not published: a straight line stands for each, which decides nothing but figures and one sentence.
"""

import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from jinja2 import Environment, PackageLoader

from reports.page import GENERATOR, STUDIES, Chapter
from reports.results import FloatArray, Results, read_study
from reports.tables import FORMATS

PUBLISHED = Path(__file__).parents[2] / "reports" / "published"
REPORT = PUBLISHED / "report"
#: The one sentence that is made of curves.
OF_CURVES = re.compile(r"At \d+ of \d+ clearances the pin comes back to its place")


@pytest.fixture(autouse=True)
def _curves(monkeypatch: pytest.MonkeyPatch) -> None:
    def curve(_: Results, _case: str, _column: str) -> FloatArray:
        return np.linspace(1.0, 2.0, 50)

    monkeypatch.setattr(Results, "curve", curve)


@cache
def chapters() -> tuple[Chapter, ...]:
    return tuple(
        Chapter(study, results, study.sections(results))
        for study in STUDIES
        for results in [read_study(PUBLISHED / "results" / study.STUDY)]
    )


def lines(page: str) -> Iterator[str]:
    yield from (line for line in page.splitlines() if not OF_CURVES.search(line))


@pytest.mark.filterwarnings("ignore:Precision loss occurred:RuntimeWarning")
def test_every_table_comes_out_of_the_rows_again_in_every_format() -> None:
    tables = [table for chapter in chapters() for section in chapter.sections for table in section.tables]
    made = {f"{table.name}.{end}": as_text(table) for table in tables for end, as_text in FORMATS.items()}
    assert made.keys() == {path.name for path in (REPORT / "tables").iterdir()}
    for name, text in made.items():
        assert (REPORT / "tables" / name).read_text(encoding="utf-8") == text, name


@pytest.mark.filterwarnings("ignore:Precision loss occurred:RuntimeWarning")
def test_every_line_of_the_page_comes_out_again() -> None:
    environment = Environment(
        loader=PackageLoader("reports", "."), autoescape=True, trim_blocks=True, lstrip_blocks=True
    )
    page = environment.get_template("index.html.jinja").render(
        chapters=chapters(), formats=list(FORMATS), generator=GENERATOR
    )
    published = (REPORT / "index.html").read_text(encoding="utf-8")
    for made, there in zip(lines(page), lines(published), strict=True):
        assert there == made
