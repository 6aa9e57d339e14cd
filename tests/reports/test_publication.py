"""What is published: tables and sentences follow from its rows, and rows are written with certain digits."""

import re
import shutil
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest
from matplotlib.figure import Figure as Drawing
from reports.chapters import answer
from reports.page.contents import CHAPTERS
from reports.parts import Chapter, Figure, Finding, Table
from reports.tables import comma_separated

from reports.page import Report, read_claims
from reports.publication import FIGURES, README, answer_of, certain, costs_of, tell, write_study
from reports.results import Results, published_rows, read_study
from studies.registry import STUDIES
from studies.store import Store
from tests.helpers.row_files import write_rows

PUBLISHED = Path(__file__).parents[2] / "reports/published"
#: The most that may be published: what is in a clone for good.
MOST_BYTES = 5_000_000


@pytest.fixture(scope="module")
def studies() -> dict[str, Results]:
    """The published rows of all studies, without curves."""
    return {study: read_study(PUBLISHED / "results", study) for study in STUDIES}


def require_claims(part: str, findings: Iterable[Finding]) -> None:
    published = {claim["id"]: (claim["text"], claim["numbers"]) for claim in read_claims(PUBLISHED)}
    for finding in findings:
        text, numbers = published[f"{part}/{finding.name}"]
        assert text == finding
        assert [of.value for of in numbers] == pytest.approx([of.value for of in finding.numbers], rel=1e-9)


def require_published(tables: Iterable[Table | None]) -> None:
    for table in tables:
        if table and table.rows:
            path = PUBLISHED / f"tables/{table.name}.csv"
            assert path.read_text(encoding="utf-8") == comma_separated(table), path.name


@pytest.mark.parametrize("chapter", CHAPTERS, ids=lambda chapter: chapter.name)
def test_published_tables_and_findings_follow_from_the_published_rows(
    chapter: Chapter, studies: dict[str, Results]
) -> None:
    require_published(chapter.tables(studies))
    require_claims(chapter.name, chapter.findings(studies))


def test_the_published_answers_follow_from_the_published_rows(
    studies: dict[str, Results], tmp_path: Path
) -> None:
    advice = answer.advice(studies)
    findings = tuple(answer.findings(studies, advice))
    require_claims("answer", findings)
    require_published([answer.table(advice), *answer.compared(studies)])
    published = PUBLISHED / "README.md"
    titles = re.findall(r"!\[(.*)\]\(figures/(.*)\.svg\)", published.read_text(encoding="utf-8"))
    report = Report(findings, (), tuple(Figure(name, title, "", "", Drawing()) for title, name in titles))
    for readme, text in ((published, answer_of(report, PUBLISHED / "tables")), (README, costs_of(report))):
        copy = shutil.copy(readme, tmp_path)
        tell(Path(copy), text)
        assert Path(copy).read_bytes() == readme.read_bytes(), readme


def test_the_readme_refers_to_files_that_are_there() -> None:
    text = (PUBLISHED / "README.md").read_text(encoding="utf-8")
    files = {target for target in re.findall(r"\]\(([^)#]+)\)", text) if "://" not in target}
    assert {f"figures/{name}.svg" for name in FIGURES} <= files
    assert [name for name in files if not (PUBLISHED / name).exists()] == []


def test_what_is_published_is_small() -> None:
    assert sum(path.stat().st_size for path in PUBLISHED.rglob("*") if path.is_file()) < MOST_BYTES


def one_run(number: int, solve_time_s: float) -> dict[str, Any]:
    """Return a row as a run writes it."""
    head = {"scene": "x", "engine": "e", "arm": "a", "label": "e (a)", "step_s": 1 / 3, "round": number}
    measured = {"error_m": 2 / 3, "solve_time_s": solve_time_s, "compile_time_s": solve_time_s}
    return {"case": f"c{number}", "study": "s", **head, "status": "ok", "reason": "", **measured}


def test_published_rows_come_back_in_whatever_order_runs_finished(tmp_path: Path) -> None:
    def written(rows: list[dict[str, Any]]) -> bytes:
        results = tmp_path / str(len(list(tmp_path.iterdir())))
        write_rows(results, "s", rows)
        with Store(results) as store:
            write_study(store, "s", tmp_path)
        return (tmp_path / "s.csv.xz").read_bytes()

    rows = [one_run(number, 1e-3) for number in range(3)]
    first = written(rows)
    renamed = [row | {"case": f"b{9 - number}"} for number, row in enumerate(rows)]
    assert written(renamed) == first
    last = published_rows(tmp_path, "s")[2]
    assert (last["step_s"], last["round"], last["solve_time_s"]) == (1 / 3, 2, 1e-3), "what was run is exact"
    assert last["error_m"] == 0.666667


@pytest.mark.parametrize(
    ("error", "doubt", "shown"),
    [(0.123456789, 1e-9, 0.123457), (0.123456789, 1e-3, 0.1235), (0.123456789, 0.3, 0.12), (0.0, 1e-3, 0.0)],
)
def test_an_error_has_the_digits_that_its_truth_certifies(error: float, doubt: float, shown: float) -> None:
    row = one_run(0, 1.0) | {"x_error_m": error, "x_uncertainty_m": doubt}
    assert certain(row)["x_error_m"] == shown
