"""Builds the report: figures, tables, findings and the page."""

import os
import signal
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined

from reports.chapters.answer import QUESTION, Answer
from reports.page.claims import Claim, as_json, collected, from_json
from reports.page.questions import QUESTIONS, Question
from reports.page.references import References
from reports.page.shown import ShownChapter, ShownSection, shown_answer, shown_chapter
from reports.page.svg import classes_of
from reports.results import BrokenResults, NoResults, Results, read_study
from reports.tables import formats

#: What marks a folder as a report, so that nothing else is ever replaced.
GENERATOR = '<meta name="generator" content="crankslider">'
FINDINGS = "findings.json"


@dataclass(frozen=True)
class Report:
    """What came of building: the ``answer`` in sentences, ``notes`` on the results, all ``claims``."""

    answer: tuple[str, ...]
    notes: tuple[str, ...]
    claims: tuple[Claim, ...]


def write_report(results: Path, folder: Path, paper: bool = False) -> Report:
    """Make the report of the studies in ``results`` in a folder that is new or empty.

    That is index.html, findings.json and tables/ with CSV; for a ``paper`` also figures/ with SVG, PNG and
    PDF, and LaTeX in tables/.

    Raises:
        NoResults: no study in ``results`` has rows; then there is no folder.
        BrokenResults: a study's files cannot be read.
        Contradiction: a sentence of the report is not true of the results.
    """
    studies, missing = _read(results)
    for kind in ("tables", "figures") if paper else ("tables",):
        (folder / kind).mkdir(parents=True)
    said, screen, chapters = _shown(studies, folder, paper)
    lacking = [name for name in studies if name not in chapters]
    asked = [
        (question, [chapters[study.STUDY] for study in question.studies if study.STUDY in chapters])
        for question in QUESTIONS
    ]
    bare = [name for name, results in studies.items() if not results.has_curves]
    found = collected(said, chapters.values())
    _write_page(folder, said, screen, [each for each in asked if each[1]], missing, lacking, bare, paper)
    (folder / FINDINGS).write_text(as_json(found, studies), encoding="utf-8")
    notes = [note for results in studies.values() for note in results.notes]
    if lacking:
        notes.append(f"rows of {', '.join(lacking)} are of an older commit, with other columns: left out")
    if bare:
        notes.append(f"no curves beside the rows of {', '.join(bare)}: figures over time are left out")
    return Report((*said.text, *said.doubts), tuple(notes), tuple(found))


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
    for study in (study for question in QUESTIONS for study in question.studies):
        try:
            found = studies[study.STUDY] = read_study(folder / study.STUDY)
            if others := set(found.rows.get("study", ())) - {study.STUDY}:
                came = ", ".join(map(str, others))
                raise BrokenResults(
                    f"{found.folder}: expected rows of the study {study.STUDY}, got of {came}"
                )
        except NoResults as reason:
            missing[study.STUDY] = str(reason)
    if not studies:
        raise NoResults("; ".join(missing.values()))
    return studies, list(missing)


def _shown(
    studies: Mapping[str, Results], folder: Path, paper: bool
) -> tuple[Answer, ShownSection, dict[str, ShownChapter]]:
    """Return the answer, as it is and as the page shows it, and the chapters, drawn on all cores.

    Chapters that published rows lack columns for are left out, and the answer is that of the others.
    """
    jobs = min(os.cpu_count() or 1, len(studies))
    if jobs == 1:
        drawn = {name: shown_chapter(name, results, folder, paper) for name, results in studies.items()}
        chapters = {name: chapter for name, chapter in drawn.items() if chapter}
        return *shown_answer({name: studies[name] for name in chapters}, folder, paper), chapters
    with ProcessPoolExecutor(jobs, get_context("spawn"), signal.signal, _DEAF) as pool:
        answer = pool.submit(shown_answer, studies, folder, paper)
        work = {
            name: pool.submit(shown_chapter, name, results, folder, paper)
            for name, results in studies.items()
        }
        try:
            chapters = {name: chapter for name, of in work.items() if (chapter := of.result())}
            if len(chapters) < len(studies):
                others = {name: studies[name] for name in chapters}
                answer = pool.submit(shown_answer, others, folder, paper)
            return *answer.result(), chapters
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


#: Ctrl-C is for the process that waits for the others.
_DEAF = (signal.SIGINT, signal.SIG_IGN)


def _write_page(
    folder: Path,
    said: Answer,
    screen: ShownSection,
    asked: Sequence[tuple[Question, Sequence[ShownChapter]]],
    missing: Sequence[str],
    lacking: Sequence[str],
    bare: Sequence[str],
    paper: bool,
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
    sections = [
        screen,
        *(section for _, chapters in asked for chapter in chapters for section in chapter.sections),
    ]
    figures = [figure for section in sections for figure in section.figures]
    page = environment.get_template("index.html.jinja").render(
        generator=GENERATOR,
        question=QUESTION,
        said=said,
        screen=screen,
        classes=classes_of(figure.picture.svg for figure in figures),
        prefixes={figure.name: f"f{place}-" for place, figure in enumerate(figures)},
        asked=asked,
        missing=missing,
        lacking=lacking,
        bare=bare,
        formats=formats(paper),
        references=references,
        findings=FINDINGS,
    )
    (folder / "index.html").write_text(page, encoding="utf-8")
