"""What is published: tables and sentences follow from its rows, and rows are written with certain digits."""

import json
import re
import shutil
from pathlib import Path
from typing import Any

import pytest

from reports.contents import CHAPTERS
from reports.page import FINDINGS, Report, write_report
from reports.publication import FIGURES, README, answer_of, certain, costs_of, tell, write_study
from reports.results import published_rows
from studies.store import Store
from tests.helpers.row_files import write_rows

PUBLISHED = Path(__file__).parents[2] / "reports/published"
#: The most that may be published: what is in a clone for good.
MOST_BYTES = 5_000_000


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Report]:
    """The page of the published rows."""
    folder = tmp_path_factory.mktemp("page") / "report"
    return folder, write_report(PUBLISHED / "results", folder, CHAPTERS)


def test_published_tables_and_claims_follow_from_the_published_rows(page: tuple[Path, Report]) -> None:
    folder, _ = page
    tables = {path.name: path.read_text("utf-8") for path in (folder / "tables").glob("*.csv")}
    assert {path.name: path.read_text("utf-8") for path in (PUBLISHED / "tables").glob("*.csv")} == tables
    assert json.loads((PUBLISHED / FINDINGS).read_text("utf-8")) == json.loads(
        (folder / FINDINGS).read_text("utf-8")
    )


def test_the_published_answers_follow_from_the_published_rows(
    page: tuple[Path, Report], tmp_path: Path
) -> None:
    _, report = page
    for readme, text in ((PUBLISHED / "README.md", answer_of(report)), (README, costs_of(report))):
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
    measured = {"error_m": 2 / 3, "solve_time_s": solve_time_s}
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
