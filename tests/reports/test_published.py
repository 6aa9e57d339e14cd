"""The published report tells the truth about this code: its numbers come out again."""

import json
from pathlib import Path

import pytest

from studies import agreement
from studies.running.case import Case
from studies.running.outcome import load_study, run_case
from studies.running.provenance import code_digest
from studies.running.registry import STUDIES

PUBLISHED = Path(__file__).parents[2] / "reports" / "published"
ROWS = [
    json.loads(line)
    for line in (PUBLISHED / "results/agreement/rows.jsonl").read_text(encoding="utf-8").splitlines()
]
#: Cheap cases are run again, every engine and arm among them. Another machine's sine may differ in the last
#: place, which moves an error by some multiple of the truth's own uncertainty, itself round-off.
STEPS_PER_SAMPLE = 16
AGREEMENT = 1e-3
UNCERTAINTIES = 100


def published_row(case: Case) -> dict[str, object]:
    head = case.head()
    rows = [row for row in ROWS if all(row.get(name) == value for name, value in head.items())]
    assert len(rows) == 1, f"{len(rows)} published rows of {head}"
    row: dict[str, object] = rows[0]
    return row


CASES = [
    case
    for case in agreement.cases(full=False)
    if case.run.steps_per_sample(case.scene.end_time_s) == STEPS_PER_SAMPLE
]


def test_every_case_of_the_quick_study_is_published() -> None:
    assert len(ROWS) == len(agreement.cases(full=False))


@pytest.mark.parametrize("study", STUDIES)
def test_every_study_is_published_whole_and_by_this_code(study: str) -> None:
    folder = PUBLISHED / "results" / study
    sidecar = json.loads((folder / "sidecar.json").read_text(encoding="utf-8"))
    cases = load_study(study).cases(full=False)
    engines = dict.fromkeys(case.engine for case in cases)
    assert sidecar["code"] == code_digest(study, engines), "the code has changed: make publish"
    assert sidecar["fingerprints"].keys() == engines.keys()
    rows = (folder / "rows.jsonl").read_text(encoding="utf-8").splitlines()
    assert len(rows) == len(cases)
    assert not any("process of its own" in row for row in rows), "no engine is refused for another's sake"


@pytest.mark.parametrize("case", CASES, ids=lambda case: f"{case.scene.name}-{case.engine}-{case.arm}")
def test_a_published_row_comes_out_again(case: Case) -> None:
    published, (row, _) = published_row(case), run_case(case)
    assert row["status"] == published["status"]
    for name, value in row.items():
        uncertainty = row.get(name.replace("_error_", "_uncertainty_"))
        if "_error_" in name and isinstance(uncertainty, float):
            slack = UNCERTAINTIES * uncertainty
            assert value == pytest.approx(published[name], rel=AGREEMENT, abs=slack), name
    for name, round_off in (("energy_balance_residual_J", 1e-11), ("constraint_violation_m", 1e-14)):
        if row["status"] == "ok":
            assert row[name] == pytest.approx(published[name], rel=AGREEMENT, abs=round_off), name


def test_the_published_page_is_there_with_all_it_refers_to() -> None:
    page = (PUBLISHED / "report/index.html").read_text(encoding="utf-8")
    for kind in ("figures", "tables"):
        for file in (PUBLISHED / "report" / kind).iterdir():
            assert f"{kind}/{file.name}" in page, f"{file.name} is not on the page"
