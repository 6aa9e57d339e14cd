"""What is published is as it was made: sealed file by file, and tables and sentences follow from its rows."""

import json
import lzma
import re
import shutil
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest

from reports.chapters import answer
from reports.page import FINDINGS, Report, claims_of, write_report
from reports.page.contents import CHAPTERS
from reports.parts import Chapter, Table
from reports.publication import FIGURES, broken_seals, certain, publish, tell_answer, write_seals, write_study
from reports.results import Results, published_rows, read_study
from reports.tables import comma_separated
from tests.helpers.row_files import write_rows

PUBLISHED = Path(__file__).parents[2] / "reports/published"
#: The most that may be published: what is in a clone for good.
MOST_BYTES = 5_000_000
#: One file of each kind.
KINDS = {
    "readme": "README.md",
    "table": "tables/agreement-errors.csv",
    "findings": "findings.json",
    "figure": "figures/agreement-steps.svg",
    "rows": "results/agreement/rows.jsonl.xz",
    "times": "results/work-precision/times.csv",
    "sidecar": "results/energy/sidecar.json",
    "truth": "truth/ideal-free.csv.xz",
}


def test_nothing_published_was_altered_lost_or_added() -> None:
    assert broken_seals(PUBLISHED) == [], "make publish"


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with one published file of each kind, sealed."""
    folder = tmp_path_factory.mktemp("published")
    for name in KINDS.values():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(PUBLISHED / name, folder / name)
    write_seals(folder)
    return folder


@pytest.mark.parametrize("kind", KINDS)
def test_one_digit_of_any_file_breaks_its_seal(copy: Path, kind: str) -> None:
    path = copy / KINDS[kind]
    whole = path.read_bytes()
    assert broken_seals(copy) == []
    place = max(whole.rfind(digit) for digit in (b"1", b"2", b"3"))
    path.write_bytes(whole[:place] + b"7" + whole[place + 1 :])
    try:
        assert broken_seals(copy) == [f"{KINDS[kind]} was altered"]
    finally:
        path.write_bytes(whole)


def test_a_file_that_is_lost_or_added_breaks_the_seal(copy: Path) -> None:
    (copy / KINDS["findings"]).rename(copy / "other.json")
    try:
        assert broken_seals(copy) == [f"{KINDS['findings']} was lost", "other.json was added"]
    finally:
        (copy / "other.json").rename(copy / KINDS["findings"])


@pytest.fixture(scope="module")
def studies() -> dict[str, Results]:
    """The published rows of all studies, without curves."""
    return {path.name: read_study(path) for path in sorted((PUBLISHED / "results").iterdir())}


@pytest.fixture(scope="module")
def said() -> set[str]:
    """All sentences that are published."""
    return {claim.text for claim in claims_of(PUBLISHED)}


def require_published(tables: Iterable[Table | None]) -> None:
    for table in tables:
        if table and table.rows:
            path = PUBLISHED / f"tables/{table.name}.csv"
            assert path.read_text(encoding="utf-8") == comma_separated(table), path.name


@pytest.mark.parametrize("chapter", CHAPTERS, ids=lambda chapter: chapter.name)
def test_published_tables_and_findings_follow_from_the_published_rows(
    chapter: Chapter, studies: dict[str, Results], said: set[str]
) -> None:
    require_published(chapter.tables(studies))
    assert {str(finding) for finding in chapter.findings(studies)} <= said


def test_the_published_answer_follows_from_the_published_rows(
    studies: dict[str, Results], said: set[str], tmp_path: Path
) -> None:
    advice, limits = answer.advice(studies), [*answer.limits(studies)]
    findings = (*(each.finding for each in advice), *limits)
    assert {str(finding) for finding in findings} <= said
    require_published([answer.table(advice)])
    copy = shutil.copytree(PUBLISHED, tmp_path / "copy")
    readme = (copy / "README.md").read_text(encoding="utf-8")
    titles = {name: title for title, name in re.findall(r"!\[(.*)\]\(figures/(.*)\.svg\)", readme)}
    tell_answer(copy / "README.md", Report(findings, (), (), titles))
    assert (copy / "README.md").read_bytes() == (PUBLISHED / "README.md").read_bytes()


def test_the_readme_refers_to_files_that_are_there() -> None:
    text = (PUBLISHED / "README.md").read_text(encoding="utf-8")
    files = {target for target in re.findall(r"\]\(([^)#]+)\)", text) if "://" not in target}
    assert {f"figures/{name}.svg" for name in FIGURES} <= files
    assert [name for name in files if not (PUBLISHED / name).exists()] == []


@pytest.mark.accuracy
def test_tables_and_sentences_of_the_full_set_follow_from_its_rows(tmp_path: Path) -> None:
    again = tmp_path / "full"
    shutil.copytree(PUBLISHED / "full/results", again / "results")
    publish(again)
    for path in [*sorted(again.rglob("*.csv")), again / FINDINGS]:
        there = PUBLISHED / "full" / path.relative_to(again)
        assert path.read_bytes() == there.read_bytes(), there


def test_what_is_published_is_small() -> None:
    assert sum(path.stat().st_size for path in PUBLISHED.rglob("*") if path.is_file()) < MOST_BYTES


def one_run(number: int, solve_time_s: float) -> dict[str, Any]:
    """Return a row as a run writes it."""
    head = {"scene": "x", "engine": "e", "arm": "a", "label": "e (a)", "step_s": 1 / 3, "round": number}
    measured = {"error_m": 2 / 3, "solve_time_s": solve_time_s, "compile_time_s": solve_time_s}
    return {
        "case": f"c{number}",
        "fingerprint": "f",
        "study": "s",
        **head,
        "status": "ok",
        "reason": "",
        **measured,
    }


def test_published_twice_no_byte_is_changed_and_new_times_change_only_theirs(tmp_path: Path) -> None:
    study, out = tmp_path / "s", tmp_path / "out"
    study.mkdir()

    def written(rows: list[dict[str, Any]], commit: str) -> dict[str, bytes]:
        write_rows(study / "rows.jsonl", rows)
        (study / "sidecar.json").write_text(json.dumps({"commit": commit, "rows": commit}))
        write_study(study, out)
        return {path.name: path.read_bytes() for path in out.iterdir()}

    rows = [one_run(number, 1e-3) for number in range(3)]
    first = written(rows, "1")
    assert written(rows[::-1], "2") == first, "the order in which runs finished does not count"
    slower = written(
        [one_run(number, 1.0) | {"case": f"b{number}", "fingerprint": "g"} for number in range(3)], "3"
    )
    assert {name for name in first if first[name] != slower[name]} == {"times.csv"}
    other = written([row | {"error_m": 0.5} for row in rows], "4")
    assert {name for name in first if first[name] != other[name]} == {"rows.jsonl.xz", "sidecar.json"}
    last = published_rows(out)[2]
    assert (last["step_s"], last["round"], last["solve_time_s"]) == (1 / 3, 2, 1e-3), "what was run is exact"


@pytest.mark.parametrize(
    ("error", "doubt", "shown"),
    [(0.123456789, 1e-9, 0.123457), (0.123456789, 1e-3, 0.1235), (0.123456789, 0.3, 0.12), (0.0, 1e-3, 0.0)],
)
def test_an_error_has_the_digits_that_its_truth_certifies(error: float, doubt: float, shown: float) -> None:
    row = one_run(0, 1.0) | {"x_error_m": error, "x_uncertainty_m": doubt}
    assert certain(row)["x_error_m"] == shown


def test_published_rows_of_an_older_commit_are_shown_where_their_columns_allow_it(tmp_path: Path) -> None:
    for study in ("agreement", "extremes"):
        shutil.copytree(PUBLISHED / "results" / study, tmp_path / "old" / study)
    path = tmp_path / "old/extremes/rows.jsonl.xz"
    older = lzma.decompress(path.read_bytes()).replace(b'"unaccounted_energy_part_bound"', b'"energy_bound"')
    path.write_bytes(lzma.compress(older))
    (tmp_path / "report").mkdir()
    report = write_report(tmp_path / "old", tmp_path / "report")
    assert "rows of extremes are of an older commit, with other columns: left out" in report.notes
    page = (tmp_path / "report/index.html").read_text(encoding="utf-8")
    assert 'id="accuracy-ideal"' in page
    assert 'id="limits"' not in page
