"""Builds the report: every chapter's findings, figures and tables, and the page that shows them."""

import os
import signal
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from itertools import count
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import matplotlib as mpl
from jinja2 import Environment, PackageLoader, StrictUndefined

from reports.chapters import answer
from reports.page.claims import Claim, as_json, collect, from_json
from reports.page.contents import CHAPTERS
from reports.page.figures import Drawn, draw
from reports.page.references import References
from reports.page.svg import classes_of
from reports.parts import Figure, Finding, Studies, Table
from reports.results import BrokenResults, NoResults, Results, read_study
from reports.style import ENGINES, RC
from reports.tables import write_table

#: What marks a folder as a report, so that nothing else is ever replaced.
GENERATOR = '<meta name="generator" content="crankslider">'
FINDINGS = "findings.json"
#: The part of the page that it opens with.
ANSWER = "answer"


@dataclass(frozen=True)
class Report:
    """What came of building: the ``answer`` in sentences, ``notes`` on the results, all ``claims``.

    ``titles`` are those of the figures, by their names.
    """

    answer: tuple[Finding, ...]
    notes: tuple[str, ...]
    claims: tuple[Claim, ...]
    titles: Mapping[str, str]


@dataclass(frozen=True)
class Part:
    """A chapter, or the first screen, whose files are written: figures with their drawings, and tables."""

    name: str
    title: str
    introduction: str
    findings: tuple[Finding, ...]
    figures: tuple[tuple[Figure, Drawn], ...]
    tables: tuple[Table, ...]

    @property
    def shown(self) -> list[Table]:
        """The tables on the page."""
        return [table for table in self.tables if table.shown]

    @property
    def more(self) -> list[tuple[Figure, Drawn]]:
        """The figures behind the chapter's link."""
        return [pair for pair in self.figures if pair[0].more]

    @property
    def first(self) -> list[tuple[Figure, Drawn]]:
        """The figures that are seen at once."""
        return [pair for pair in self.figures if not pair[0].more]


def write_report(results: Path, folder: Path, paper: bool = False) -> Report:
    """Make the report of the studies in ``results`` in a folder that is new or empty.

    That is index.html, findings.json, tables/ and data/ with CSV; for a ``paper`` also figures/ with SVG, PNG
    and PDF, and LaTeX in tables/.

    Raises:
        NoResults: no study in ``results`` has rows; then there is no folder.
        BrokenResults: a study's files cannot be read.
        Contradiction: a finding is not true of the results.
    """
    studies, missing = _read(results)
    for kind in ("tables", "data", *(["figures"] if paper else [])):
        (folder / kind).mkdir(parents=True)
    parts, lacking = _build(studies, folder, paper)
    studies = {name: each for name, each in studies.items() if name not in lacking}
    screen = parts.pop(ANSWER)
    notes = [note for each in studies.values() for note in each.notes]
    if lacking:
        notes.append(f"rows of {', '.join(lacking)} are of an older commit, with other columns: left out")
    if bare := [name for name, each in studies.items() if not each.has_curves]:
        notes.append(
            f"no time histories beside the rows of {', '.join(bare)}: figures over time are left out"
        )
    if missing:
        notes.append(f"not run: {', '.join(missing)}; `crankslider run` runs what is missing")
    claims = collect({ANSWER: screen.findings} | {part.name: part.findings for part in parts.values()})
    _write_page(folder, screen, list(parts.values()), studies, notes, paper)
    (folder / FINDINGS).write_text(as_json(claims, studies), encoding="utf-8")
    figures = [pair for part in (screen, *parts.values()) for pair in part.figures]
    titles = {figure.name: figure.title for figure, _ in figures}
    return Report(screen.findings, tuple(notes), tuple(claims), titles)


def claims_of(report: Path) -> list[Claim]:
    """Return the claims of a report that was made before.

    Raises:
        OSError: there is no report.
        ValueError: its findings are none.
    """
    return from_json((report / FINDINGS).read_text(encoding="utf-8"))


def require_replaceable(out: Path) -> None:
    """Raise FileExistsError if something is at a report's place that is no report."""
    if not out.exists() or (out.is_dir() and not any(out.iterdir())):
        return
    page = out / "index.html"
    if not page.is_file() or GENERATOR not in page.read_text(encoding="utf-8", errors="replace"):
        raise FileExistsError(f"out: expected a new folder or a report to replace, got {out}")


def _read(folder: Path) -> tuple[dict[str, Results], list[str]]:
    """Return the results by study, and the studies that have none."""
    studies, missing = {}, {}
    for study in dict.fromkeys(name for chapter in CHAPTERS for name in chapter.studies):
        try:
            found = studies[study] = read_study(folder / study)
            if others := set(found.rows.get("study", ())) - {study}:
                came = ", ".join(map(str, others))
                raise BrokenResults(f"{found.folder}: expected rows of the study {study}, got of {came}")
        except NoResults as reason:
            missing[study] = str(reason)
    if not studies:
        raise NoResults("; ".join(missing.values()))
    return studies, list(missing)


#: Ctrl-C is for the process that waits for the others.
_DEAF = (signal.SIGINT, signal.SIG_IGN)


def _build(studies: Studies, folder: Path, paper: bool) -> tuple[dict[str, Part], list[str]]:
    """Return the parts of the page by name, made on all cores, and the studies that they leave out.

    A chapter that published rows lack columns for is left out, and the first screen is that of the others.
    """
    wanted = {
        chapter.name: {name: studies[name] for name in chapter.studies if name in studies}
        for chapter in CHAPTERS
    }
    wanted = {name: of for name, of in wanted.items() if of}
    with ProcessPoolExecutor(os.cpu_count(), get_context("spawn"), signal.signal, _DEAF) as pool:
        try:
            work = {name: pool.submit(build_part, name, of, folder, paper) for name, of in wanted.items()}
            screen = pool.submit(build_part, ANSWER, studies, folder, paper)
            parts = {name: part for name, of in work.items() if (part := of.result())}
            lacking = {name for chapter in wanted.keys() - parts.keys() for name in wanted[chapter]}
            if lacking or not screen.result():
                others = {name: each for name, each in studies.items() if name not in lacking}
                screen = pool.submit(build_part, ANSWER, others, folder, paper)
            made = screen.result()
            assert made is not None, "what the first screen needs the chapters have"
            return {ANSWER: made, **parts}, sorted(lacking)
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


def build_part(name: str, studies: Studies, folder: Path, paper: bool) -> Part | None:
    """Write the files of a chapter and return it; None if published rows of an older commit lack columns."""
    try:
        with mpl.rc_context(RC):
            if name == ANSWER:
                title, introduction = answer.TITLE, ""
                advice = answer.advice(studies)
                findings = (*(each.finding for each in advice), *answer.limits(studies))
                tables, figures = [answer.table(advice)], [answer.figure(studies)]
            else:
                chapter = next(each for each in CHAPTERS if each.name == name)
                title, introduction = chapter.title, chapter.introduction
                findings, tables = tuple(chapter.findings(studies)), [*chapter.tables(studies)]
                figures = [*chapter.figures(studies)]
    except KeyError:
        if any(results.is_published for results in studies.values()):
            return None
        raise
    whole = [table for table in tables if table and table.rows]
    for table in whole:
        write_table(table, folder / "tables", paper)
    shown = [figure for figure in figures if figure and (not figure.more or is_full(studies))]
    drawn = tuple((_bare(figure), draw(figure, folder, paper)) for figure in shown)
    return Part(name, title, introduction, findings, drawn, tuple(whole))


def _bare(figure: Figure) -> Figure:
    """Return a figure without what drew it, which is of no use in another process."""
    return Figure(**{**vars(figure), "views": ()})


def is_full(studies: Studies) -> bool:
    """Return whether rows of the full set are among the results."""
    return any((results.sidecar or {}).get("set") == "full" for results in studies.values())


def _write_page(
    folder: Path, screen: Part, parts: Sequence[Part], studies: Studies, notes: Sequence[str], paper: bool
) -> None:
    references = References()
    environment = Environment(
        loader=PackageLoader("reports", "page"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters.update(explained=references.explained, entry=references.entry)
    everything = [screen, *parts]
    figures = [pair for part in everything for pair in (*part.first, *part.more)]
    pictures = [view.svg for _, drawn in figures for view in drawn.views]
    page = environment.get_template("index.html.jinja").render(
        generator=GENERATOR,
        screen=screen,
        limits=[finding for finding in screen.findings if finding.name in answer.LIMITS],
        parts=parts,
        numbers=_numbers(everything),
        classes=classes_of(pictures),
        facts=facts(studies),
        studies=studies,
        versions=_versions(studies),
        notes=notes,
        full=is_full(studies),
        paper=paper,
        references=references,
        findings=FINDINGS,
    )
    (folder / "index.html").write_text(page, encoding="utf-8")


def _numbers(parts: Iterable[Part]) -> dict[tuple[str, str], int]:
    """Return the number of every figure and table that is shown, by its kind and name."""
    found, figures, tables = dict[tuple[str, str], int](), count(1), count(1)
    for part in parts:
        found |= {("figure", figure.name): next(figures) for figure, _ in (*part.first, *part.more)}
        found |= {("table", table.name): next(tables) for table in part.shown}
    return found


def _versions(studies: Studies) -> dict[str, str]:
    """Return the versions of Python and of packages that the results were made with."""
    sidecars = [results.sidecar or {} for results in studies.values()]
    return {name: version for each in sidecars for name, version in each.get("versions", {}).items()}


def facts(studies: Studies) -> dict[str, str]:
    """Return what the head says: set, commit, date, processor, engines."""
    sidecars = [results.sidecar for results in studies.values() if results.sidecar]

    def told(of: Iterable[Any]) -> str:
        return ", ".join(dict.fromkeys(str(each) for each in of if each)) or "not on record"

    versions = _versions(studies)
    engines = [f"{name} {versions[name]}" for name in ENGINES if name in versions]
    return {
        "set": told(each.get("set") for each in sidecars),
        "commit": told(str(each.get("commit"))[:8] for each in sidecars),
        "date": told(each.get("date") for each in sidecars),
        "processor": told(each.get("machine", {}).get("processor") for each in sidecars),
        "engines": ", ".join(["reference", *engines]),
    }
