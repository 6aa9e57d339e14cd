"""What is published is as it was made: sealed file by file, and tables and sentences follow from its rows."""

import html
import re
import shutil
from pathlib import Path
from typing import Any

import matplotlib as mpl
import pytest

from reports.chapters.answer import answer
from reports.chapters.headlines import HEADLINES
from reports.page.questions import QUESTIONS, StudyReport
from reports.parts import Section
from reports.results import Results, read_study
from reports.style import RC
from reports.tables import FORMATS
from studies.conformance.seal import broken_seals, write_seals

PUBLISHED = Path(__file__).parents[2] / "reports/published"
STUDIES = [study for question in QUESTIONS for study in question.studies]
#: Its intervals are resampled ten thousand times, half a minute in all.
SLOW = "work-precision"
#: One file of each kind.
KINDS = {
    "page": "report/index.html",
    "table": "report/tables/agreement-errors.csv",
    "table in LaTeX": "report/tables/clearance-impacts.tex",
    "table in Markdown": "report/tables/energy-drift.md",
    "figure": "report/figures/agreement-slider-position.svg",
    "picture": "report/figures/agreement-slider-position.png",
    "rows": "results/agreement/rows.jsonl",
    "sidecar": "results/energy/sidecar.json",
}


def test_nothing_published_was_altered_lost_or_added() -> None:
    assert broken_seals(PUBLISHED) == [], "make publish"


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with one published file of each kind, sealed."""
    folder = tmp_path_factory.mktemp("published")
    for name in KINDS.values():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(PUBLISHED / name, folder / name)
    write_seals(folder)
    return folder


@pytest.mark.parametrize("kind", KINDS)
def test_one_digit_of_any_file_breaks_its_seal(copy: Path, kind: str) -> None:
    path = copy / KINDS[kind]
    whole = path.read_bytes()
    assert broken_seals(copy) == []
    place = max(whole.rfind(digit) for digit in (b"1", b"2", b"3"))
    path.write_bytes(whole[:place] + b"7" + whole[place + 1 :])
    try:
        assert broken_seals(copy) == [f"{KINDS[kind]} was altered"]
    finally:
        path.write_bytes(whole)


def test_a_file_that_is_lost_or_added_breaks_the_seal(copy: Path) -> None:
    (copy / KINDS["page"]).rename(copy / "report/other.html")
    try:
        assert broken_seals(copy) == [f"{KINDS['page']} was lost", "report/other.html was added"]
    finally:
        (copy / "report/other.html").rename(copy / KINDS["page"])


def published(study: StudyReport) -> Results:
    """Return the published rows of a study, without curves."""
    return read_study(PUBLISHED / "results" / study.STUDY)


def sections(study: StudyReport) -> list[Section]:
    """Return a chapter made anew from the published rows, without what curves are for."""
    with mpl.rc_context(RC):
        return study.sections(published(study))


def marked(study: StudyReport) -> Any:
    marks = [pytest.mark.accuracy] if study.STUDY == SLOW else []
    return pytest.param(study, id=study.STUDY, marks=marks)


def shown_tables(page: str) -> dict[str, list[tuple[str, ...]]]:
    """Return head and rows of the tables on a page, by their names."""
    out = {}
    for name, body in re.findall(r'<figure id="table-([^"]+)".*?<table>(.*?)</table>', page, re.DOTALL):
        lines = re.findall(r"<tr.*?</tr>", body, re.DOTALL)
        cells = (re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", line) for line in lines)
        out[name] = [tuple(map(html.unescape, line)) for line in cells]
    return out


@pytest.fixture(scope="module")
def page() -> str:
    return (PUBLISHED / "report/index.html").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def words(page: str) -> str:
    """What is to be read on the page, in one line without markup."""
    return " ".join(html.unescape(re.sub(r"<[^>]*>", "", page)).split())


@pytest.mark.parametrize("study", [marked(study) for study in STUDIES])
def test_published_tables_and_sentences_follow_from_the_published_rows(
    study: StudyReport, page: str, words: str
) -> None:
    on_page = shown_tables(page)
    for section in sections(study):
        for table in section.tables:
            assert on_page[table.name] == [table.head, *table.rows], f"{table.name} on the page"
            assert table.title in words
            assert table.reading in words
            for ending, written in FORMATS.items():
                path = PUBLISHED / f"report/tables/{table.name}.{ending}"
                assert path.read_text(encoding="utf-8") == written(table), path.name
        for figure in section.figures:
            assert f'<figure id="figure-{figure.name}"' in page
            for text in (figure.title, figure.reading, figure.alt):
                assert text in words, f"{figure.name} with what is said of it"
        for sentence in section.text:
            assert sentence in words


@pytest.mark.parametrize("study", [marked(study) for study in STUDIES if study.STUDY in HEADLINES])
def test_what_a_published_chapter_opens_with_follows_from_its_rows(study: StudyReport, words: str) -> None:
    for sentence in HEADLINES[study.STUDY](published(study)):
        assert sentence in words


@pytest.mark.accuracy
def test_the_published_answer_follows_from_the_published_rows(page: str, words: str) -> None:
    with mpl.rc_context(RC):
        said = answer({study.STUDY: published(study) for study in STUDIES})
    assert said.text
    assert said.doubts
    for sentence in (*said.text, *said.doubts):
        assert sentence in words
    for table in said.tables:
        assert shown_tables(page)[table.name] == [table.head, *table.rows], f"{table.name} on the page"
