"""The published page and tables are what this code makes of the published rows, to the last character.

Curves are not published: a straight line stands for each, which decides nothing but figures and one sentence.
"""

import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from jinja2 import Environment, PackageLoader
from matplotlib.figure import Figure

from reports.chapters import agreement, clearance, work_precision
from reports.page import GENERATOR, STUDIES, Chapter
from reports.results import FloatArray, Results, read_study
from reports.tables import FORMATS

PUBLISHED = Path(__file__).parents[2] / "reports" / "published"
REPORT = PUBLISHED / "report"
PAGE = REPORT / "index.html"
#: The one sentence that is made of curves.
OF_CURVES = re.compile(r"At \d+ of \d+ clearances the pin comes back to its place")


@pytest.fixture(autouse=True)
def _neither_curves_nor_slow_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    def curve(_: Results, _case: str, _column: str) -> FloatArray:
        return np.linspace(1.0, 2.0, 50)

    monkeypatch.setattr(Results, "curve", curve)
    for module, drawing in (
        (work_precision.figures, "drawing"),
        (clearance, "against_step"),
        *((agreement.figures, name) for name in ("against_step", "against_setting", "over_time")),
    ):
        monkeypatch.setattr(module, drawing, lambda *_: Figure())


@cache
def chapter(study: str) -> Chapter:
    (of_study,) = (each for each in STUDIES if study == each.STUDY)
    results = read_study(PUBLISHED / "results" / study)
    return Chapter(of_study, results, of_study.sections(results))


def lines(page: str, study: Chapter) -> list[str]:
    """Return a chapter's lines on a page, and those on where its rows come from."""
    chapter = rf'<section id="{study.study.STUDY}">\n.*?(?=<section id="[\w-]+">\n<h2>|</main>)'
    provenance = rf"<h3>{study.study.TITLE}</h3>\n.*?(?=<h3>|</footer>)"
    found = [re.findall(part, page, re.DOTALL) for part in (chapter, provenance)]
    return [line for (text,) in found for line in text.splitlines() if not OF_CURVES.search(line)]


def test_every_study_is_on_the_page_and_no_other_table() -> None:
    names = {path.name.rpartition(".")[0] for path in (REPORT / "tables").iterdir()}
    assert all(any(name.startswith(f"{study.STUDY}-") for study in STUDIES) for name in names)
    page = PAGE.read_text(encoding="utf-8")
    assert re.findall(r'<section id="([a-z-]+)">\n<h2>', page)[: len(STUDIES)] == [s.STUDY for s in STUDIES]


@pytest.mark.filterwarnings("ignore:Precision loss occurred:RuntimeWarning")
@pytest.mark.parametrize("study", [study.STUDY for study in STUDIES])
def test_every_table_comes_out_of_the_rows_again_in_every_format(study: str) -> None:
    tables = [table for section in chapter(study).sections for table in section.tables]
    made = {f"{table.name}.{end}": as_text(table) for table in tables for end, as_text in FORMATS.items()}
    assert made.keys() == {path.name for path in (REPORT / "tables").glob(f"{study}-*")}
    for name, text in made.items():
        published = (REPORT / "tables" / name).read_text(encoding="utf-8")
        for there, line in zip(published.splitlines(), text.splitlines(), strict=True):
            assert there == line, name


@pytest.mark.filterwarnings("ignore:Precision loss occurred:RuntimeWarning")
@pytest.mark.parametrize("study", [study.STUDY for study in STUDIES])
def test_every_line_of_a_chapter_comes_out_again(study: str) -> None:
    environment = Environment(
        loader=PackageLoader("reports", "."), autoescape=True, trim_blocks=True, lstrip_blocks=True
    )
    made = environment.get_template("index.html.jinja").render(
        chapters=[chapter(study)], formats=list(FORMATS), generator=GENERATOR
    )
    published = lines(PAGE.read_text(encoding="utf-8"), chapter(study))
    assert len(published) > len(chapter(study).sections)
    for there, line in zip(published, lines(made, chapter(study)), strict=True):
        assert there == line
