"""Publishes results in few bytes.

``python -m reports.publication FOLDER RESULTS`` writes into FOLDER

* ``results/STUDY.csv.xz``: a row a line, in the order of what was run, with the digits that are certain, and
  ``results/facts.json``: set, code, commit, day, versions and machine of each study;
* ``tables/NAME.csv`` and ``findings.json``: those of the page that these rows make;
* in its ``README.md`` the answer with its ``figures``; and in that of the project what each engine costs.
"""

import json
import lzma
import math
import shutil
import sys
import textwrap
from collections.abc import Iterable, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pandas as pd

from reports.chapters.contents import CHAPTERS
from reports.page import FINDINGS, Report, write_report
from reports.results import ENDING, FACTS, head_of
from studies.case import STUDIES
from studies.running.store import Store

#: Columns of times, and those that say no more than the file and the row itself.
TIMES = ("solve_time_s", "engine_time_s")
LEFT_OUT = ("case", "study")
#: Significant digits of a measured number, of a time and of an uncertainty; and of an error so many as are
#: above a tenth of its uncertainty, but some.
DIGITS, TIME_DIGITS, DOUBT_DIGITS, FEWEST = 6, 4, 3, 2
#: The column of the tables of the first screen that is left out, and the figures that are shown.
COMMAND = "command"
FIGURES = (
    "answer",
    "accuracy-steps",
    "clearance-steps",
    "energy-steps",
    "stability-map",
    "mechanism",
)
#: The project's README, the claim that it tells, the width of its lines, and what encloses the text.
README, COSTS, README_WIDTH = Path(__file__).parents[1] / "README.md", "within", 120
BEGIN, END = "<!-- The answer, as `make publish` writes it. -->", "<!-- End of the answer. -->"


def publish(folder: Path, results: Path) -> None:
    """Write the rows of all studies in ``results`` into a folder, and what the page says of those in it.

    Raises:
        NoResults, BadInput, Contradiction: as ``write_report`` does.
    """
    made = folder / "results"
    _renew(made, [])
    with Store(results) as store:
        facts = {study: write_study(store, study, made) for study in STUDIES}
    (made / FACTS).write_text(json.dumps(facts, indent=2) + "\n", encoding="utf-8")
    with TemporaryDirectory() as name:
        page = Path(name)
        report = write_report(made, page, CHAPTERS)
        shutil.copy(page / FINDINGS, folder)
        _renew(folder / "tables", sorted((page / "tables").glob("*.csv")))
        _renew(folder / "figures", [page / f"figures/{name}.svg" for name in FIGURES])
    tell(folder / "README.md", answer_of(report))
    tell(README, costs_of(report))


def write_study(store: Store, study: str, folder: Path) -> dict[str, Any]:
    """Write a study's rows and return where they come from."""
    rows, facts = store.results(study)
    told = [certain(row) for row in sorted(rows, key=lambda row: json.dumps(head_of(row), sort_keys=True))]
    content = pd.DataFrame(told).to_csv(index=False, lineterminator="\n").encode()
    (folder / f"{study}{ENDING}").write_bytes(lzma.compress(content, preset=9 | lzma.PRESET_EXTREME))
    return facts


def certain(row: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a row says of its run, with the digits that are certain."""
    head, kept = head_of(row), dict[str, Any]()
    for name, value in row.items():
        digits = TIME_DIGITS if name in TIMES else DIGITS
        if "_uncertainty_" in name:
            digits = DOUBT_DIGITS
        elif "_error_" in name:
            doubt = row.get(name.replace("_error_", "_uncertainty_"))
            if isinstance(doubt, float) and doubt > 0 and value and math.isfinite(value / doubt):
                above = math.floor(math.log10(abs(value) / doubt))
                digits = min(max(above + 2, FEWEST), DIGITS)
        measured = name not in head and isinstance(value, float)
        kept[name] = float(f"{value:.{digits}g}") if measured else value
    return {name: value for name, value in kept.items() if name not in LEFT_OUT}


def _renew(folder: Path, files: Iterable[Path]) -> None:
    """Have these files in a folder and no others."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for file in files:
        shutil.copy(file, folder)


def answer_of(report: Report) -> str:
    """Return the answer in Markdown: its tables without commands, the limits of what it says, and figures."""
    answer, titles = report.made[0], {of.name: of.title for part in report.made for of in part.figures}
    tables = [table.markdown(COMMAND) for table in answer.tables if table.shown]
    limits = "\n".join(f"* {claim}" for claim in answer.claims if claim.name != COSTS)
    figures = "\n".join(f"{titles[name]}\n\n![{titles[name]}](figures/{name}.svg)\n" for name in FIGURES)
    return "\n".join([*tables, limits, "", figures])


def costs_of(report: Report) -> str:
    """Return the sentence of README that says what each engine costs."""
    (sentence,) = (str(claim) for claim in report.made[0].claims if claim.name == COSTS)
    return textwrap.fill(sentence, README_WIDTH, break_long_words=False, break_on_hyphens=False) + "\n"


def tell(readme: Path, text: str) -> None:
    """Write a text into its place in a README."""
    before, _, rest = readme.read_text(encoding="utf-8").partition(BEGIN)
    after = rest.partition(END)[2]
    readme.write_text(f"{before}{BEGIN}\n\n{text}\n{END}{after}", encoding="utf-8")


if __name__ == "__main__":
    publish(*map(Path, sys.argv[1:]))
