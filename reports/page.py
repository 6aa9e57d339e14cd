"""The page: chapters of claims, figures and tables, numbered and written as HTML, SVG, CSV and JSON."""

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from typing import Any

import pandas as pd
from jinja2 import Environment, PackageLoader, StrictUndefined
from matplotlib.figure import Figure as Drawing

from reports.lines import as_svg
from reports.look import ABSENT, ENGINES, plain, quantity
from reports.results import NoResults, Results, Studies, read_study

#: What marks a folder as a report, so that nothing else is ever replaced; the file of its claims.
GENERATOR, FINDINGS = '<meta name="generator" content="crankslider">', "findings.json"
#: Endings of columns that say more of the number in the column without: they are shown in its cell.
MOST, UNCERTAIN, HALF_WIDTH = " (most)", " (uncertainty)", " (half width)"
#: A half width below this part of its number is not shown.
NARROW = 0.01


class Contradiction(Exception):
    """A sentence of the report is not true of the results; the message is the sentence."""


@dataclass(frozen=True)
class Claim:
    """A sentence with its ``numbers`` by name: (value, unit), or (value, unit, low, high) with an interval.

    ``holds`` is whether the rows bear it out, of one that theory makes; the page is not written if they do
    not. The name stays from results to results.
    """

    name: str
    text: str
    numbers: Mapping[str, tuple[Any, ...]] = field(default_factory=dict)
    holds: bool = True

    def __str__(self) -> str:
        """Return the sentence with its numbers in it."""
        return self.text.format(**{name: quantity(*of[:2]) for name, of in self.numbers.items()})


@dataclass(frozen=True)
class Figure:
    """A drawing whose title asks a question; ``data`` are its points, ``study`` has the runs it shows."""

    name: str
    title: str
    caption: str
    study: str
    drawing: Drawing
    data: pd.DataFrame | None = None


@dataclass(frozen=True)
class Table:
    """A data frame with a caption: its CSV has the numbers, ``formats`` are how columns are shown.

    Columns whose names end in ``MOST``, ``UNCERTAIN`` or ``HALF_WIDTH`` are shown in the cell of the number
    that they belong to. One that is not ``shown`` is a file to be downloaded.
    """

    name: str
    title: str
    caption: str
    study: str
    rows: pd.DataFrame
    formats: Mapping[str, Callable[[float], str]] = field(default_factory=dict)
    shown: bool = True

    def cells(self) -> pd.DataFrame:
        """Return the table as it is shown, as text: numbers have two significant digits by default."""
        columns = {}
        for name, column in self.rows.items():
            if not str(name).endswith((MOST, UNCERTAIN, HALF_WIDTH)):
                columns[str(name)] = [self._cell(str(name), place) for place in range(len(column))]
        return pd.DataFrame(columns)

    def _cell(self, name: str, place: int) -> str:
        value = self.rows[name].iloc[place]
        if not isinstance(value, int | float) or isinstance(value, bool):
            return ABSENT if pd.isna(value) else str(value)
        form = self.formats.get(name, plain)
        more = {end: self.rows.get(f"{name}{end}") for end in (MOST, UNCERTAIN, HALF_WIDTH)}
        most, unsure, half = (None if of is None else of.iloc[place] for of in more.values())
        if unsure is not None and value < unsure:
            return f"< {form(unsure)}"
        if half is not None and abs(value) <= half:
            return f"< {form(abs(value) + half)}"
        text = ABSENT if pd.isna(value) else form(value)
        if most is not None and not pd.isna(most):
            text = " to ".join(dict.fromkeys((text, form(most))))
        if half is not None and half >= NARROW * abs(value):
            text += f" ± {form(half)}"
        return text

    def markdown(self, *without: str) -> str:
        """Return the table as Markdown, without its caption and some columns."""
        cells = self.cells().drop(columns=list(without), errors="ignore")
        rows = [tuple(cells), ("---",) * cells.shape[1], *cells.itertuples(index=False)]
        return "".join("| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |\n" for row in rows)


@dataclass(frozen=True)
class Chapter:
    """A chapter of the page, made of the rows of the ``studies`` that it names: all have to be there.

    ``parts`` yields what these rows give; None is left out. ``introduction`` says what is compared.
    """

    name: str
    title: str
    studies: tuple[str, ...]
    introduction: str
    parts: Callable[[Studies], Iterator[Claim | Figure | Table | None]]


@dataclass(frozen=True)
class Made:
    """A chapter with what its rows give."""

    chapter: Chapter
    claims: tuple[Claim, ...]
    figures: tuple[Figure, ...]
    tables: tuple[Table, ...]

    @classmethod
    def of(cls, chapter: Chapter, studies: Studies) -> "Made":
        """Make a chapter.

        Raises:
            Contradiction: a claim does not hold.
        """
        parts = [*filter(None, chapter.parts(studies))]
        claims = tuple(part for part in parts if isinstance(part, Claim))
        if broken := [claim for claim in claims if not claim.holds]:
            raise Contradiction(f"the results contradict the report's sentence: {broken[0]}")
        tables = tuple(part for part in parts if isinstance(part, Table) and len(part.rows))
        return cls(chapter, claims, tuple(part for part in parts if isinstance(part, Figure)), tables)

    @property
    def shown(self) -> list[Table]:
        """The tables on the page."""
        return [table for table in self.tables if table.shown]

    @property
    def files(self) -> list[Table]:
        """The tables that are only to be downloaded."""
        return [table for table in self.tables if not table.shown]


@dataclass(frozen=True)
class Report:
    """What came of building: the chapters, the first of which is the answer, and ``notes`` on the results."""

    made: tuple[Made, ...]
    notes: tuple[str, ...]

    @property
    def answer(self) -> Iterator[str]:
        """The first table in lines, and the claims of its chapter."""
        if not self.made:
            return
        for table in self.made[0].tables[:1]:
            for row in table.cells().to_dict("records"):
                yield "; ".join(f"{name}: {cell}" for name, cell in row.items() if cell != ABSENT)
        yield from map(str, self.made[0].claims)


def write_report(results: Path, folder: Path, chapters: Sequence[Chapter]) -> Report:
    """Make the report of the studies in ``results`` in a folder that is new or empty.

    That is index.html, findings.json, tables/ and data/ with CSV, and figures/ with SVG.

    Raises:
        NoResults: no study in ``results`` has rows; then there is no folder.
        BadInput: a file cannot be read.
        Contradiction: a claim is not true of the results.
    """
    studies, missing = _read(results, chapters)
    made = tuple(Made.of(each, studies) for each in chapters if studies.keys() >= {*each.studies})
    notes = [f"{name}: {each.note}" for name, each in studies.items() if each.note]
    if bare := [name for name, each in studies.items() if not each.has_curves]:
        notes.append(f"no time histories beside the rows of {', '.join(bare)}: no figures over time")
    if missing:
        notes.append(f"not run: {', '.join(missing)}; `crankslider run` runs what is missing")
    for kind in ("tables", "data", "figures"):
        (folder / kind).mkdir(parents=True)
    for part in made:
        _write_files(part, folder)
    (folder / "index.html").write_text(_page(made, studies, notes), encoding="utf-8")
    (folder / FINDINGS).write_text(_findings(made, studies), encoding="utf-8")
    return Report(made, tuple(notes))


def require_replaceable(out: Path) -> None:
    """Raise FileExistsError if something is at a report's place that is no report."""
    if not out.exists() or (out.is_dir() and not any(out.iterdir())):
        return
    page = out / "index.html"
    if not page.is_file() or GENERATOR not in page.read_text(encoding="utf-8", errors="replace"):
        raise FileExistsError(f"out: expected a new folder or a report to replace, got {out}")


def read_claims(report: Path) -> list[dict[str, Any]]:
    """Return the claims of a report.

    Raises:
        OSError: there is no report.
        ValueError: its findings are none.
    """
    try:
        claims: list[dict[str, Any]] = json.loads((report / FINDINGS).read_text(encoding="utf-8"))["claims"]
        return [{"id": claim["id"], "text": claim["text"], "numbers": claim["numbers"]} for claim in claims]
    except (KeyError, TypeError) as error:
        raise ValueError(f"no findings of a report: {error!r}") from None


def compare_claims(before: Iterable[Mapping[str, Any]], after: Iterable[Mapping[str, Any]]) -> pd.DataFrame:
    """Return the numbers of two reports' claims in columns ``before`` and ``after``, a row a number."""
    columns = {
        name: {
            f"{claim['id']} {number}": quantity(*of[:2])
            for claim in claims
            for number, of in claim["numbers"].items()
        }
        for name, claims in (("before", before), ("after", after))
    }
    return pd.DataFrame(columns).fillna(ABSENT)


def _read(folder: Path, chapters: Iterable[Chapter]) -> tuple[dict[str, Results], list[str]]:
    """Return the results by study, and the studies that have none."""
    studies, missing = dict[str, Results](), list[str]()
    for study in dict.fromkeys(name for chapter in chapters for name in chapter.studies):
        try:
            studies[study] = read_study(folder, study)
        except NoResults:
            missing.append(study)
    if not studies:
        raise NoResults(
            f"results: expected the results of a study, got none in {folder}: `crankslider run` makes some"
        )
    return studies, missing


def _write_files(part: Made, folder: Path) -> None:
    for table in part.tables:
        table.rows.to_csv(folder / f"tables/{table.name}.csv", index=False, lineterminator="\n")
    for figure in part.figures:
        (folder / f"figures/{figure.name}.svg").write_text(as_svg(figure.drawing), encoding="utf-8")
        if figure.data is not None:
            data = folder / f"data/{figure.name}.csv"
            figure.data.to_csv(data, index=False, float_format="%.6g", lineterminator="\n")


def _page(made: Sequence[Made], studies: Studies, notes: Sequence[str]) -> str:
    loader = PackageLoader("reports", ".")
    settings: dict[str, Any] = {"trim_blocks": True, "lstrip_blocks": True}
    environment = Environment(loader=loader, autoescape=True, undefined=StrictUndefined, **settings)
    numbers, figures, tables = dict[str, int](), count(1), count(1)
    for part in made:
        numbers |= {figure.name: next(figures) for figure in part.figures}
        numbers |= {f"table-{table.name}": next(tables) for table in part.shown}
    return environment.get_template("page.html.jinja").render(
        generator=GENERATOR,
        parts=made,
        numbers=numbers,
        facts=facts(studies),
        studies=studies,
        versions=_versions(studies),
        notes=notes,
        full=any(results.facts.get("set") == "full" for results in studies.values()),
        findings=FINDINGS,
    )


def _findings(made: Iterable[Made], studies: Studies) -> str:
    """Return the claims of every chapter, and of which set and commit each study's rows are."""
    origins = {
        name: {key: results.facts.get(key) for key in ("set", "commit")} | {"runs": len(results.rows)}
        for name, results in studies.items()
    }
    claims = [
        {"id": f"{part.chapter.name}/{claim.name}", "text": str(claim), "numbers": dict(claim.numbers)}
        for part in made
        for claim in part.claims
    ]
    content = {"studies": origins, "claims": claims}
    return json.dumps(content, ensure_ascii=False, indent=1, default=float) + "\n"


def _versions(studies: Studies) -> dict[str, str]:
    """Return the versions of Python and of packages that the results were made with."""
    facts = [results.facts.get("versions", {}) for results in studies.values()]
    return {name: version for each in facts for name, version in each.items()}


def facts(studies: Studies) -> dict[str, str]:
    """Return what the head says: set, commit, date, processor, engines."""
    of_all = [results.facts for results in studies.values()]

    def told(of: Iterable[Any]) -> str:
        return ", ".join(dict.fromkeys(str(each) for each in of if each)) or "not on record"

    versions = _versions(studies)
    return {
        "set": told(each.get("set") for each in of_all),
        "commit": told(str(each.get("commit"))[:8] for each in of_all),
        "date": told(each.get("date") for each in of_all),
        "processor": told(each.get("machine", {}).get("processor") for each in of_all),
        "engines": told(["reference", *(f"{of} {versions[of]}" for of in ENGINES if of in versions)]),
    }
