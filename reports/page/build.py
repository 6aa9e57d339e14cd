"""Builds the report: every chapter's findings, figures and tables, and the page that shows them."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any

import matplotlib as mpl
from jinja2 import Environment, PackageLoader, StrictUndefined

from reports.chapters import answer
from reports.page.claims import FINDINGS, write_claims
from reports.page.contents import CHAPTERS
from reports.page.figures import write_figure
from reports.parts import Figure, Finding, Studies, Table
from reports.results import NoResults, Results, read_study
from reports.style import ENGINES, RC
from reports.tables import comma_separated

#: What marks a folder as a report, so that nothing else is ever replaced.
GENERATOR = '<meta name="generator" content="crankslider">'
#: The part of the page that it opens with.
ANSWER = "answer"


@dataclass(frozen=True)
class Report:
    """What came of building: the ``answer`` in sentences, ``notes`` on the results, and all ``figures``."""

    answer: tuple[Finding, ...]
    notes: tuple[str, ...]
    figures: tuple[Figure, ...]


@dataclass(frozen=True)
class Part:
    """A chapter, or the first screen, whose files are written.

    ``figures`` have in words what each shows, and whether the points of its lines are in a file.
    """

    name: str
    title: str
    introduction: str
    findings: tuple[Finding, ...]
    figures: tuple[tuple[Figure, str, bool], ...]
    tables: tuple[Table, ...]

    @property
    def shown(self) -> list[Table]:
        """The tables on the page."""
        return [table for table in self.tables if table.shown]


def write_report(results: Path, folder: Path) -> Report:
    """Make the report of the studies in ``results`` in a folder that is new or empty.

    That is index.html, findings.json, tables/ and data/ with CSV, and figures/ with SVG.

    Raises:
        NoResults: no study in ``results`` has rows; then there is no folder.
        BadInput: a file cannot be read.
        Contradiction: a finding is not true of the results.
    """
    studies, missing = _read(results)
    for kind in ("tables", "data", "figures"):
        (folder / kind).mkdir(parents=True)
    with mpl.rc_context(RC):
        advice = answer.advice(studies)
        figures, tables = [answer.figure(studies)], [answer.table(advice), *answer.compared(studies)]
        said = answer.findings(studies, advice)
        screen = _write_part(folder, (ANSWER, answer.TITLE, ""), said, figures, tables)
        parts = []
        for chapter in CHAPTERS:
            if of := {name: studies[name] for name in chapter.studies if name in studies}:
                texts = chapter.name, chapter.title, chapter.introduction
                made = chapter.findings(of), chapter.figures(of), chapter.tables(of)
                parts.append(_write_part(folder, texts, *made))
    notes = [f"{name}: {each.note}" for name, each in studies.items() if each.note]
    if bare := [name for name, each in studies.items() if not each.has_curves]:
        notes.append(
            f"no time histories beside the rows of {', '.join(bare)}: figures over time are left out"
        )
    if missing:
        notes.append(f"not run: {', '.join(missing)}; `crankslider run` runs what is missing")
    _write_page(folder, screen, parts, studies, notes)
    write_claims({part.name: part.findings for part in (screen, *parts)}, studies, folder)
    shown = (figure for part in (screen, *parts) for figure, *_ in part.figures)
    return Report(screen.findings, tuple(notes), tuple(shown))


def require_replaceable(out: Path) -> None:
    """Raise FileExistsError if something is at a report's place that is no report."""
    if not out.exists() or (out.is_dir() and not any(out.iterdir())):
        return
    page = out / "index.html"
    if not page.is_file() or GENERATOR not in page.read_text(encoding="utf-8", errors="replace"):
        raise FileExistsError(f"out: expected a new folder or a report to replace, got {out}")


def _read(folder: Path) -> tuple[dict[str, Results], list[str]]:
    """Return the results by study, and the studies that have none."""
    studies, missing = dict[str, Results](), list[str]()
    for study in dict.fromkeys(name for chapter in CHAPTERS for name in chapter.studies):
        try:
            studies[study] = read_study(folder, study)
        except NoResults:
            missing.append(study)
    if not studies:
        raise NoResults(
            f"results: expected the results of a study, got none in {folder}: `crankslider run` makes some"
        )
    return studies, missing


def _write_part(
    folder: Path,
    texts: tuple[str, str, str],
    findings: Iterable[Finding],
    figures: Iterable[Figure | None],
    tables: Iterable[Table | None],
) -> Part:
    """Write the files of a chapter, or of the first screen, and return it; its texts come first in it."""
    whole = tuple(table for table in tables if table and table.rows)
    for table in whole:
        (folder / f"tables/{table.name}.csv").write_text(comma_separated(table), encoding="utf-8")
    drawn = tuple((figure, *write_figure(figure, folder)) for figure in figures if figure)
    return Part(*texts, tuple(findings), drawn, whole)


def is_full(studies: Studies) -> bool:
    """Return whether rows of the full set are among the results."""
    return any(results.facts.get("set") == "full" for results in studies.values())


def _write_page(
    folder: Path, screen: Part, parts: Sequence[Part], studies: Studies, notes: Sequence[str]
) -> None:
    environment = Environment(
        loader=PackageLoader("reports", "page"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    page = environment.get_template("index.html.jinja").render(
        generator=GENERATOR,
        screen=screen,
        limits=[finding for finding in screen.findings if finding.name in answer.LIMITS],
        parts=parts,
        numbers=_numbers([screen, *parts]),
        facts=facts(studies),
        studies=studies,
        versions=_versions(studies),
        notes=notes,
        full=is_full(studies),
        findings=FINDINGS,
    )
    (folder / "index.html").write_text(page, encoding="utf-8")


def _numbers(parts: Iterable[Part]) -> dict[tuple[str, str], int]:
    """Return the number of every figure and table that is shown, by its kind and name."""
    found, figures, tables = dict[tuple[str, str], int](), count(1), count(1)
    for part in parts:
        found |= {("figure", figure.name): next(figures) for figure, *_ in part.figures}
        found |= {("table", table.name): next(tables) for table in part.shown}
    return found


def _versions(studies: Studies) -> dict[str, str]:
    """Return the versions of Python and of packages that the results were made with."""
    return {
        name: version
        for results in studies.values()
        for name, version in results.facts.get("versions", {}).items()
    }


def facts(studies: Studies) -> dict[str, str]:
    """Return what the head says: set, commit, date, processor, engines."""
    of_all = [results.facts for results in studies.values()]

    def told(of: Iterable[Any]) -> str:
        return ", ".join(dict.fromkeys(str(each) for each in of if each)) or "not on record"

    versions = _versions(studies)
    engines = [f"{name} {versions[name]}" for name in ENGINES if name in versions]
    return {
        "set": told(each.get("set") for each in of_all),
        "commit": told(str(each.get("commit"))[:8] for each in of_all),
        "date": told(each.get("date") for each in of_all),
        "processor": told(each.get("machine", {}).get("processor") for each in of_all),
        "engines": ", ".join(["reference", *engines]),
    }
