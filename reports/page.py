"""Builds the report: figures, tables and the page, all or nothing."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Protocol

import matplotlib as mpl
from jinja2 import Environment, PackageLoader, StrictUndefined

from reports.chapters import agreement, clearance, energy, extremes, predictability, stability, work_precision
from reports.parts import Contradiction, Section
from reports.results import BrokenResults, NoResults, Results, read_study
from reports.style import RC
from reports.tables import FORMATS, write_table

__all__ = ["BrokenResults", "Contradiction", "NoResults", "write_report"]

#: What marks a folder as a report, so that nothing else is ever replaced.
GENERATOR = '<meta name="generator" content="crankslider">'


class StudyReport(Protocol):
    """What a study's module provides; ``STUDY`` is the name of its folder."""

    STUDY: str
    TITLE: str
    INTRODUCTION: str

    def sections(self, results: Results) -> list[Section]:
        """Return the study's part of the page."""
        ...


#: The studies on the page, in its order. A new study is a new module and a word here.
STUDIES: tuple[StudyReport, ...] = (
    agreement,
    clearance,
    work_precision,
    energy,
    predictability,
    stability,
    extremes,
)


@dataclass(frozen=True)
class Chapter:
    """A study as the page shows it."""

    study: StudyReport
    results: Results
    sections: Sequence[Section]


def write_report(results: Path, out: Path) -> list[str]:
    """Make the report in ``out`` from the studies in ``results``: index.html, figures/, tables/.

    It is built beside ``out`` and takes its place when finished; a report that was there is replaced.
    What a user should know of the results is returned.

    Raises:
        NoResults: no study in ``results`` has rows.
        BrokenResults: a study's files cannot be read.
        Contradiction: a sentence of the report is not true of the results.
        FileExistsError: ``out`` is there and is no report.
    """
    chapters = _chapters(results)
    out = out.resolve()
    _require_replaceable(out)
    out.parent.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(prefix=f".{out.name}-", dir=out.parent) as temporary:
        new, old = Path(temporary) / "new", Path(temporary) / "old"
        new.mkdir()
        _build(chapters, new)
        if out.exists():
            out.rename(old)
        try:
            new.rename(out)
        except OSError:
            if old.exists():
                old.rename(out)
            raise
    return [note for chapter in chapters for note in chapter.results.notes]


def _chapters(folder: Path) -> list[Chapter]:
    """Return the chapters of the studies that have results."""
    chapters, missing = [], []
    with mpl.rc_context(RC):
        for study in STUDIES:
            try:
                results = read_study(folder / study.STUDY)
            except NoResults as reason:
                missing.append(str(reason))
            else:
                chapters.append(Chapter(study, results, study.sections(results)))
    if not chapters:
        raise NoResults("; ".join(missing))
    return chapters


def _build(chapters: Sequence[Chapter], folder: Path) -> None:
    figures, tables = folder / "figures", folder / "tables"
    figures.mkdir()
    tables.mkdir()
    for section in (section for chapter in chapters for section in chapter.sections):
        for figure in section.figures:
            with mpl.rc_context(RC):
                figure.drawing.savefig(figures / f"{figure.name}.svg", metadata={"Date": None})
                figure.drawing.savefig(figures / f"{figure.name}.png")
        for table in section.tables:
            write_table(table, tables)
    environment = Environment(
        loader=PackageLoader("reports", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    page = environment.get_template("index.html.jinja").render(
        chapters=chapters, formats=list(FORMATS), generator=GENERATOR
    )
    (folder / "index.html").write_text(page, encoding="utf-8")


def _require_replaceable(out: Path) -> None:
    """Raise FileExistsError if something is in the way that is no report."""
    if not out.exists() or (out.is_dir() and not any(out.iterdir())):
        return
    page = out / "index.html"
    if not page.is_file() or GENERATOR not in page.read_text(encoding="utf-8", errors="replace"):
        raise FileExistsError(f"out: expected a new folder or a report to replace, got {out}")
