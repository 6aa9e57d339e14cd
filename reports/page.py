"""Builds the report: figures, tables and the page, all or nothing."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Protocol

import matplotlib as mpl
from jinja2 import Environment, PackageLoader, StrictUndefined

from reports.chapters.agreement import chapter as agreement
from reports.chapters.clearance import chapter as clearance
from reports.chapters.energy import chapter as energy
from reports.chapters.extremes import chapter as extremes
from reports.chapters.predictability import chapter as predictability
from reports.chapters.stability import chapter as stability
from reports.chapters.work_precision import chapter as work_precision
from reports.parts import Contradiction, Section
from reports.results import BrokenResults, NoResults, Results, read_results
from reports.style import RC
from reports.tables import FORMATS, write_table

__all__ = ["BrokenResults", "Contradiction", "NoResults", "write_report"]

#: What marks a folder as a report, so that nothing else is ever replaced.
GENERATOR = '<meta name="generator" content="crankslider">'


class StudyReport(Protocol):
    """What a study's module provides."""

    TITLE: str
    INTRODUCTION: str

    def sections(self, results: Results) -> list[Section]:
        """Return the study's part of the page."""
        ...


#: The studies on the page, by the name of their folder. A new study is a new file and a line here.
STUDIES: dict[str, StudyReport] = {
    "agreement": agreement,
    "clearance": clearance,
    "work-precision": work_precision,
    "energy": energy,
    "predictability": predictability,
    "stability": stability,
    "extremes": extremes,
}


@dataclass(frozen=True)
class Chapter:
    """A study as the page shows it."""

    name: str
    title: str
    introduction: str
    sections: Sequence[Section]
    sidecar: dict[str, Any] | None
    runs: int
    notes: Sequence[str]


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
    return [note for chapter in chapters for note in chapter.notes]


def _chapters(results: Path) -> list[Chapter]:
    """Return the chapters of the studies that have results."""
    chapters, missing = [], []
    with mpl.rc_context(RC):
        for name, study in STUDIES.items():
            try:
                found = read_results(results / name)
            except NoResults as reason:
                missing.append(str(reason))
                continue
            sections = study.sections(found)
            title, text, runs = study.TITLE, study.INTRODUCTION, len(found.runs)
            chapters.append(Chapter(name, title, text, sections, found.sidecar, runs, found.notes))
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
