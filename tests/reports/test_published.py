"""What is published tells the truth about this code: rows come out again, and tables follow from them."""

import json
import re
import shutil
from collections.abc import Iterator
from functools import cache
from itertools import groupby
from pathlib import Path
from typing import Any

import pytest

from reports import publication
from reports.page import FINDINGS
from reports.publication import FIGURES, README, certain, publish, write_study
from reports.results import FACTS, published_rows
from studies import accuracy
from studies.case import LIMIT_S, STUDIES, Case, load_study, project_code, run_case
from studies.running.store import Store
from studies.running.workers import Pool
from tests.helpers.row_files import write_rows

PUBLISHED = Path(__file__).parents[2] / "reports/published"
#: The most that may be published: what is in a clone for good.
MOST_BYTES = 5_000_000
#: The coarsest run of every configuration on ideal joints is made again. Another machine's sine may differ in
#: the last place, which moves an error by some multiple of the truth's own uncertainty, itself round-off.
AGREEMENT, UNCERTAINTIES = 1e-3, 100
SCENES = groupby(
    (case for case in accuracy.cases(full=False) if not case.scene.clearances),
    key=lambda case: (case.scene.name, case.arm.label),
)
CASES = [next(cases) for _, cases in SCENES]
NUMBER = r"\b\d+\.\d+(e[-+]?\d+)?\b"


def ten_digits(number: re.Match[str]) -> str:
    return f"{float(number[0]):.9e}"


def test_published_tables_claims_and_answers_follow_from_the_published_rows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They do where the same rows are published again."""
    again, readme = tmp_path / "published", tmp_path / "README.md"
    again.mkdir()
    shutil.copy(PUBLISHED / "README.md", again)
    shutil.copy(README, readme)
    monkeypatch.setattr(publication, "README", readme)
    for study, facts in json.loads((PUBLISHED / "results" / FACTS).read_text("utf-8")).items():
        rows = [{"case": f"{study} {n}", **row} for n, row in enumerate(rows_of(study))]
        del facts["engines"]  # the code that ran them
        write_rows(tmp_path / "results", study, rows, **facts)
    publish(again, tmp_path / "results")
    # The last digits of means and fits are those of pandas and of the processor's linear algebra.
    of_rows, published = (
        {it.name: re.sub(NUMBER, ten_digits, it.read_text("utf-8")) for it in (of / "tables").glob("*.csv")}
        for of in (again, PUBLISHED)
    )
    assert published == of_rows
    findings = [
        json.loads((of / FINDINGS).read_text("utf-8"), parse_float=lambda number: f"{float(number):.9e}")
        for of in (again, PUBLISHED)
    ]
    assert findings[0] == findings[1]
    assert (again / "README.md").read_bytes() == (PUBLISHED / "README.md").read_bytes()
    assert readme.read_bytes() == README.read_bytes()


def test_the_readme_refers_to_files_that_are_there_and_few_bytes() -> None:
    text = (PUBLISHED / "README.md").read_text(encoding="utf-8")
    files = {target for target in re.findall(r"\]\(([^)#]+)\)", text) if "://" not in target}
    assert {f"figures/{name}.svg" for name in FIGURES} <= files
    assert [name for name in files if not (PUBLISHED / name).exists()] == []
    assert sum(path.stat().st_size for path in PUBLISHED.rglob("*") if path.is_file()) < MOST_BYTES


def one_run(number: int, solve_time_s: float = 1e-3, **columns: Any) -> dict[str, Any]:
    """Return a row as a run writes it."""
    head = {"scene": "x", "engine": "e", "arm": "a", "label": "e (a)", "step_s": 1 / 3, "round": number}
    measured = {"error_m": 2 / 3, "solve_time_s": solve_time_s, **columns}
    return {"case": f"c{number}", "study": "s", **head, "status": "ok", "reason": "", **measured}


def test_published_rows_come_back_in_whatever_order_runs_finished(tmp_path: Path) -> None:
    def written(rows: list[dict[str, Any]], results: Path) -> bytes:
        write_rows(results, "s", rows)
        with Store(results) as store:
            write_study(store, "s", tmp_path)
        return (tmp_path / "s.csv.xz").read_bytes()

    rows = [one_run(number) for number in range(3)]
    first = written(rows, tmp_path / "first")
    assert written([row | {"case": f"b{9 - k}"} for k, row in enumerate(rows)], tmp_path / "again") == first
    last = published_rows(tmp_path, "s")[2]
    assert (last["step_s"], last["round"], last["solve_time_s"]) == (1 / 3, 2, 1e-3), "what was run is exact"
    assert last["error_m"] == 0.666667


@pytest.mark.parametrize(
    ("error", "doubt", "shown"),
    [(0.123456789, 1e-9, 0.123457), (0.123456789, 1e-3, 0.1235), (0.123456789, 0.3, 0.12), (0.0, 1e-3, 0.0)],
)
def test_an_error_has_the_digits_that_its_truth_certifies(error: float, doubt: float, shown: float) -> None:
    assert certain(one_run(0, x_error_m=error, x_uncertainty_m=doubt))["x_error_m"] == shown


@cache
def rows_of(study: str) -> list[dict[str, object]]:
    return published_rows(PUBLISHED / "results", study)


def published_row(case: Case) -> dict[str, object]:
    head = {name: value for name, value in case.head().items() if value is not None}
    rows = [row for row in rows_of(case.study) if head.items() <= row.items()]
    assert len(rows) == 1, f"{len(rows)} published rows of {head}"
    return rows[0]


@pytest.fixture(scope="module")
def pool() -> Iterator[Pool]:
    """Return a process of its own, since one has room for one of Exudyn's builds."""
    with Pool(1) as pool:
        yield pool


@pytest.mark.parametrize("study", STUDIES)
def test_every_study_is_published_whole_and_by_this_code(study: str) -> None:
    facts = json.loads((PUBLISHED / "results" / FACTS).read_text(encoding="utf-8"))[study]
    cases = load_study(study).cases(full=False)
    assert facts["code"] == project_code(), "the code has changed: make publish"
    assert facts["engines"].keys() == {case.engine for case in cases}
    assert len(rows_of(study)) == len(cases)
    reasons = [str(published_row(case).get("reason", "")) for case in cases]
    assert not any("process of its own" in reason for reason in reasons), "an engine is refused for another"


@pytest.mark.parametrize("case", CASES, ids=lambda case: f"{case.scene.name}-{case.engine}-{case.arm.name}")
def test_a_published_row_comes_out_again(case: Case, pool: Pool) -> None:
    published, (row, _) = published_row(case), pool.run(run_case, case, limit_s=LIMIT_S)
    assert row["status"] == published["status"]
    for name, value in row.items():
        uncertainty = row.get(name.replace("_error_", "_uncertainty_"))
        if "_error_" in name and isinstance(uncertainty, float):
            slack = UNCERTAINTIES * uncertainty
            assert value == pytest.approx(published[name], rel=AGREEMENT, abs=slack), name
    for name, round_off in (("energy_balance_residual_J", 1e-11), ("constraint_violation_m", 1e-14)):
        if row["status"] == "ok":
            assert row[name] == pytest.approx(published[name], rel=AGREEMENT, abs=round_off), name
