"""The published report tells the truth about this code: its numbers come out again."""

import json
from collections.abc import Iterator
from functools import cache
from itertools import groupby
from pathlib import Path

import pytest

from reports.results import FACTS, published_rows
from studies import accuracy
from studies.case import LIMIT_S, Case, load_study, project_code, run_case
from studies.registry import STUDIES
from studies.workers import Pool

PUBLISHED = Path(__file__).parents[2] / "reports" / "published"
#: The coarsest run of every configuration on ideal joints is made again. Another machine's sine may differ in
#: the last place, which moves an error by some multiple of the truth's own uncertainty, itself round-off.
AGREEMENT = 1e-3
UNCERTAINTIES = 100


@cache
def rows_of(study: str) -> list[dict[str, object]]:
    return published_rows(PUBLISHED / "results", study)


def published_row(case: Case) -> dict[str, object]:
    head = {name: value for name, value in case.head().items() if value is not None}
    rows = [row for row in rows_of(case.study) if head.items() <= row.items()]
    assert len(rows) == 1, f"{len(rows)} published rows of {head}"
    return rows[0]


CASES = [
    next(cases)
    for _, cases in groupby(
        (case for case in accuracy.cases(full=False) if not case.scene.joints_with_clearance),
        key=lambda case: (case.scene.name, case.arm.label),
    )
]


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
