"""The page: chapters of claims, figures, tables and text, numbered and written as HTML, SVG, CSV and JSON."""

import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from shutil import rmtree
from typing import Any

import pandas as pd
from jinja2 import Environment, PackageLoader, StrictUndefined
from matplotlib.figure import Figure as Drawing

from reports.look import ABSENT, ENGINES, picture_bytes, plain, quantity
from reports.results import NoResults, Results, Studies, read_study
from studies.failures import BadInput, Failed

#: What marks a folder as a report, so that nothing else is ever replaced; the file of its claims.
GENERATOR, FINDINGS = '<meta name="generator" content="crankslider">', "findings.json"
#: Folders of a page's files.
KINDS = ("tables", "data", "figures")
#: Endings of columns that say more of the number in the column without: they are shown in its cell.
MOST, UNCERTAIN, HALF_WIDTH = ENDINGS = (" (most)", " (uncertainty)", " (half width)")
#: A half width below this part of its number is not shown.
NARROW = 0.01


class Contradiction(Failed):
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
    """A drawing, or an SVG file, whose title asks a question.

    ``data`` are its points, ``study`` has the runs it shows.
    """

    name: str
    title: str
    caption: str
    study: str
    drawing: Drawing | Path
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
        names, rows = [name for name in self.rows if not name.endswith(ENDINGS)], self.rows.to_dict("records")
        return pd.DataFrame({name: [self._cell(name, row) for row in rows] for name in names}, dtype=object)

    def _cell(self, name: str, row: Mapping[Any, Any]) -> str:
        value, form = row[name], self.formats.get(name, plain)
        if not isinstance(value, float):
            return ABSENT if pd.isna(value) else str(value)
        most, uncertain, half = (row.get(name + ending, math.nan) for ending in ENDINGS)
        if value < uncertain:
            return f"< {form(uncertain)}"
        if abs(value) <= half:
            return f"< {form(abs(value) + half)}"
        ends = [form(end) for end in (value, most) if not math.isnan(end)]
        interval = f" ± {form(half)}" if half >= NARROW * abs(value) else ""
        return (" to ".join(dict.fromkeys(ends)) or ABSENT) + interval

    def markdown(self, *without: str) -> str:
        """Return the table as Markdown with its caption below, without some columns."""
        cells = self.cells().drop(columns=list(without), errors="ignore")
        rows = [tuple(cells), ("---",) * cells.shape[1], *cells.itertuples(index=False)]
        lines = ["| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |\n" for row in rows]
        return "".join([*lines, f"\n{self.caption}\n".replace("*", "\\*")])


@dataclass(frozen=True)
class Text:
    """Some HTML as it is."""

    html: str


Part = Claim | Figure | Table | Text


@dataclass(frozen=True)
class Chapter:
    """A chapter of the page, made of the rows of the ``studies`` that it names: all have to be there.

    ``parts`` yields what these rows give, in the order of the page; None is left out. ``introduction`` says
    what is compared.
    """

    name: str
    title: str
    studies: tuple[str, ...]
    introduction: str
    parts: Callable[[Studies], Iterator[Part | None]]


@dataclass
class Made:
    """A chapter with what its rows give; ``claims``, ``figures`` and ``tables`` are its parts by kind."""

    chapter: Chapter
    parts: tuple[Part, ...]

    @classmethod
    def of(cls, chapter: Chapter, studies: Studies) -> "Made":
        """Make a chapter.

        Raises:
            Contradiction: a claim does not hold.
        """
        parts = [part for part in chapter.parts(studies) if part is not None]
        for part in parts:
            if isinstance(part, Claim) and not part.holds:
                raise Contradiction(f"the results contradict the report's sentence: {part}")
        return cls(chapter, tuple(part for part in parts if not isinstance(part, Table) or len(part.rows)))

    def __post_init__(self) -> None:
        self.claims = [part for part in self.parts if isinstance(part, Claim)]
        self.figures = [part for part in self.parts if isinstance(part, Figure)]
        self.tables = [part for part in self.parts if isinstance(part, Table)]


@dataclass(frozen=True)
class Report:
    """What came of building: the chapters, the first of which is the answer, and ``notes`` on the results."""

    made: tuple[Made, ...]
    notes: tuple[str, ...]

    @property
    def answer(self) -> Iterator[str]:
        """The shown tables of the answer in lines, and the claims of its chapter."""
        for table in self.made[0].tables if self.made else ():
            for row in table.cells().to_dict("records") if table.shown else ():
                yield "; ".join(f"{name}: {cell}" for name, cell in row.items() if cell != ABSENT)
        yield from map(str, self.made[0].claims if self.made else ())


def write_report(results: Path, folder: Path, chapters: Sequence[Chapter]) -> Report:
    """Make the report of the studies in ``results`` in a folder, which is new or replaces a report.

    That is index.html, findings.json, tables/ and data/ with CSV, and figures/ with SVG.

    Raises:
        FileExistsError: something is in the folder that is no report.
        NoResults: no study in ``results`` has rows.
        BadInput: a file cannot be read.
        Contradiction: a claim is not true of the results.
    """
    page = folder / "index.html"
    is_report = page.is_file() and GENERATOR in page.read_text(encoding="utf-8", errors="replace")
    if any(folder.glob("*")) and not is_report:
        raise FileExistsError(f"out: expected a new folder or a report to replace, got {folder}")
    studies, missing = dict[str, Results](), dict[str, NoResults]()
    for study in dict.fromkeys(name for chapter in chapters for name in chapter.studies):
        try:
            studies[study] = read_study(results, study)
        except NoResults as reason:
            missing[study] = reason
    if not studies:
        raise next(iter(missing.values()))
    made = tuple(Made.of(each, studies) for each in chapters if studies.keys() >= {*each.studies})
    notes = []
    for name, each in studies.items():
        if len(each.rows) < (asked := each.facts.get("cases", 0)):
            notes.append(f"{name}: {len(each.rows)} of {asked} cases are there; `crankslider run` goes on")
    if bare := [name for name, each in studies.items() if not each.has_curves]:
        notes.append(f"no time histories beside the rows of {', '.join(bare)}: no figures over time")
    if missing:
        notes.append(f"not run: {', '.join(missing)}; `crankslider run` runs what is missing")
    run = "crankslider run" + " --full" * any(of.facts.get("set") == "full" for of in studies.values())
    recreate = {name: f"{run} {name}; crankslider report" for name in studies}
    recreate[""] = f"{run}; crankslider report"
    for kind in KINDS:
        rmtree(folder / kind, ignore_errors=True)
    write_page(folder, "Crank-slider validation study", _head(studies), made, recreate, notes)
    origins = {
        name: {"set": of.facts.get("set"), "commit": of.facts.get("commit"), "runs": len(of.rows)}
        for name, of in studies.items()
    }
    claims = [
        {"id": f"{each.chapter.name}/{claim.name}", "text": str(claim), "numbers": dict(claim.numbers)}
        for each in made
        for claim in each.claims
    ]
    findings = json.dumps({"studies": origins, "claims": claims}, ensure_ascii=False, indent=1, default=float)
    (folder / FINDINGS).write_text(findings + "\n", encoding="utf-8")
    return Report(made, tuple(notes))


def write_page(
    folder: Path,
    title: str,
    head: Mapping[str, str],
    made: Sequence[Made],
    recreate: Mapping[str, str],
    notes: Sequence[str] = (),
) -> None:
    """Write chapters as index.html, with their figures, the points of these, and tables as files.

    ``head`` is the line below the title, ``recreate`` has the command for the rows of each study.
    """
    for kind in KINDS:
        (folder / kind).mkdir(parents=True, exist_ok=True)
    for table in (table for each in made for table in each.tables):
        table.rows.to_csv(folder / f"tables/{table.name}.csv", index=False, lineterminator="\n")
    for figure in (figure for each in made for figure in each.figures):
        drawing = figure.drawing
        content = drawing.read_bytes() if isinstance(drawing, Path) else picture_bytes(drawing, ".svg")
        (folder / f"figures/{figure.name}.svg").write_bytes(content)
        if figure.data is not None:
            data = folder / f"data/{figure.name}.csv"
            figure.data.to_csv(data, index=False, float_format="%.6g", lineterminator="\n")
    text = template("page.html.jinja").render(
        generator=GENERATOR, title=title, head=head, chapters=made, recreate=recreate, notes=notes
    )
    (folder / "index.html").write_text(text, encoding="utf-8")


def template(name: str) -> Any:
    """Return one of the templates in this package."""
    settings: dict[str, Any] = {"autoescape": True, "undefined": StrictUndefined, "trim_blocks": True}
    page = Environment(loader=PackageLoader("reports", "."), lstrip_blocks=True, **settings)
    page.tests["part"] = lambda part, kind: type(part).__name__ == kind
    return page.get_template(name)


def read_claims(report: Path) -> dict[str, str]:
    """Return the numbers of a report's claims as text, by their names."""
    try:
        claims = json.loads((report / FINDINGS).read_text(encoding="utf-8"))["claims"]
    except (ValueError, LookupError, TypeError):
        raise BadInput(f"against: expected a report's {FINDINGS}, got a damaged one in {report}") from None
    numbers = [(claim["id"], *number) for claim in claims for number in claim["numbers"].items()]
    return {f"{claim} {name}": quantity(*number[:2]) for claim, name, number in numbers}


def versions(studies: Studies) -> dict[str, str]:
    """Return the versions of Python and of packages that the results were made with."""
    facts = [results.facts.get("versions", {}) for results in studies.values()]
    return {name: version for each in facts for name, version in each.items()}


def _head(studies: Studies) -> dict[str, str]:
    """Return what the head says: set, commit, date, processor, engines."""
    facts, known = [results.facts for results in studies.values()], versions(studies)
    told: dict[str, list[Any]] = {
        "set": [of.get("set") for of in facts],
        "commit": [commit[:8] + commit[40:] for commit in (str(of.get("commit")) for of in facts)],
        "date": [of.get("date") for of in facts],
        "processor": [of.get("machine", {}).get("processor") for of in facts],
        "engines": ["reference", *(f"{name} {known[name]}" for name in ENGINES if name in known)],
    }
    return {name: ", ".join(dict.fromkeys(filter(None, of))) or "not on record" for name, of in told.items()}
