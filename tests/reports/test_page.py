"""The page: what is on it comes from the rows, numbered, with data, and it is there whole or not at all."""

import html
import json
import math
import re
import shutil
from pathlib import Path

import pandas as pd
import pytest

from reports.chapters.contents import CHAPTERS
from reports.look import quantity
from reports.page import (
    FINDINGS,
    HALF_WIDTH,
    MOST,
    UNCERTAIN,
    Chapter,
    Claim,
    Contradiction,
    Table,
    write_report,
)
from reports.results import NoResults, frame, read_study
from studies.case import STUDIES, load_study
from studies.running.store import FILE
from tests.helpers.command import crankslider
from tests.helpers.refusals import require_refusal
from tests.helpers.row_files import write_rows

pytestmark = pytest.mark.system

#: Rows of a quick set, as they are published.
ROWS = Path(__file__).parents[2] / "reports/published/results"
#: At most so many words, figures, tables, claims and bytes are on the page of the quick set.
MOST_OF = {"words": 4800, "figures": 13, "tables": 15, "claims": 20, "bytes": 100_000}


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("page") / "report"
    write_report(ROWS, out, CHAPTERS)
    return out


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results of one engine without curves, with text that has to be escaped."""
    folder, name = tmp_path_factory.mktemp("small") / "results", "<script>alert(1)</script>"
    rows = read_study(ROWS, "stability").rows.query("engine == 'pymunk'").assign(arm=name, label=name)
    told = [row.dropna().to_dict() for _, row in rows.astype(object).iterrows()]
    write_rows(folder, "stability", told, cases=1000, commit="0123abc")
    return folder


def test_the_page_names_every_file_there_is_and_no_other(report: Path) -> None:
    page = (report / "index.html").read_text("utf-8")
    targets = {*re.findall(r'(?:href|src)="([^"]+)"', page)}
    anchors, alts = re.findall(r'\bid="([^"]+)"', page), re.findall(r'\balt="([^"]+)"', page)
    written = {str(path.relative_to(report)) for path in report.rglob("*.*") if path.name != "index.html"}
    assert {of for of in targets if not of.startswith("#")} == written
    assert {of[1:] for of in targets if of.startswith("#")} <= {*anchors}
    assert len(anchors) == len(set(anchors))
    assert all(len(alt) > 40 for alt in alts)


def test_every_figure_and_table_has_a_number_a_command_and_the_file_of_its_data(report: Path) -> None:
    page = (report / "index.html").read_text("utf-8")
    parts = re.findall(r'(<figure id="(figure|table)-([\w-]+)".*?</figure>)', page, re.DOTALL)
    assert parts
    for part, kind, name in parts:
        assert re.search(rf"<strong>{kind.capitalize()} \d+\. ", part)
        assert re.search(r"Recreate: <code>crankslider run( [\w-]+)?; crankslider report</code>", part)
        assert name == "mechanism" or 'Data: <a href="' in part
    numbers = [int(number) for number in re.findall(r"<strong>Figure (\d+)\. ", page)]
    assert numbers == list(range(1, len(numbers) + 1))
    for name in ("energy-dissipation", "accuracy-errors"):
        columns = pd.read_csv(report / f"tables/{name}.csv").dtypes[1:]
        assert {*columns.astype(str)} == {"float64"}, name


def test_the_page_of_the_quick_set_is_short(report: Path) -> None:
    page = (report / "index.html").read_text("utf-8")
    text = re.sub(r"<[^>]+>", " ", re.sub(r"<(script|style).*?</\1>", "", page, flags=re.DOTALL))
    found = {
        "words": len(html.unescape(text).split()),
        "figures": page.count('<figure id="figure-'),
        "tables": page.count('<figure id="table-'),
        "claims": len(json.loads((report / FINDINGS).read_text("utf-8"))["claims"]),
        "bytes": len(page.encode()),
    }
    assert all(0 < found[name] <= most for name, most in MOST_OF.items()), found


def test_the_order_of_rows_does_not_change_a_byte(tmp_path: Path) -> None:
    for name, order in {"published": 1, "reversed": -1}.items():
        (tmp_path / name).mkdir()
        shutil.copy(ROWS / "facts.json", tmp_path / name)
        for file in (ROWS / "energy.csv.xz", ROWS / "stability.csv.xz"):
            rows = pd.read_csv(file, dtype=str, keep_default_na=False)
            rows[::order].to_csv(tmp_path / name / file.name, index=False, lineterminator="\n")
        write_report(tmp_path / name, tmp_path / f"{name}-page", CHAPTERS)
    for path in sorted((tmp_path / "published-page").rglob("*.*")):
        again = tmp_path / "reversed-page" / path.relative_to(tmp_path / "published-page")
        assert path.read_bytes() == again.read_bytes(), f"{path.name} differs from run to run"


def test_text_is_escaped_and_the_numbers_of_two_reports_stand_side_by_side(
    small: Path, tmp_path: Path
) -> None:
    before, after = tmp_path / "before", tmp_path / "after"
    made = write_report(small, before, CHAPTERS)
    page = (before / "index.html").read_text("utf-8")
    assert "<script>alert" not in page
    told = ("&lt;script&gt;alert(1)", "0123abc", "of 1000 cases are there; `crankslider run` goes on")
    assert [text for text in told if text not in page] == []
    assert any("not run: " in note for note in made.notes)
    text = (before / FINDINGS).read_text("utf-8")
    (before / FINDINGS).write_text(text.replace('"id": "stability/accurate"', '"id": "stability/other"'))
    done = crankslider("report", "--results", small, "--out", after, "--against", before)
    lines = {tuple(line.split()[:2]): line.split()[2:] for line in done.stdout.splitlines()[1:]}
    dash, called = lines["stability/accurate", "called"]
    assert dash == "–"
    assert lines["stability/other", "called"] == [called, "–"]
    assert lines["stability/energy-growth", "runs"] == ["15", "15"]
    (before / FINDINGS).write_text("{")
    done = crankslider("report", "--results", small, "--out", after, "--against", before)
    assert done.stderr == f"error: against: expected a report's {FINDINGS}, got a damaged one in {before}\n"


# All or nothing


def test_a_damaged_file_is_named_and_the_old_report_stays(small: Path, tmp_path: Path) -> None:
    with pytest.raises(NoResults, match=r"^results: expected the results of \w+, got none in "):
        write_report(tmp_path / "nowhere", tmp_path / "out" / "report", CHAPTERS)
    assert list(tmp_path.iterdir()) == []
    broken = Path(shutil.copytree(small, tmp_path / "results"))
    (broken / FILE).write_bytes(b"no rows" * 1000)
    out = tmp_path / "reports" / "old"
    out.mkdir(parents=True)
    (out / "index.html").write_text('<meta name="generator" content="crankslider">', encoding="utf-8")
    done = crankslider("report", "--results", broken, "--out", out)
    require_refusal(done.stdout, done.stderr, done.code, "results: expected rows of a run", str(broken))
    assert [path.name for path in out.parent.rglob("*")] == ["old", "index.html"]


def test_a_report_replaces_a_report_and_nothing_else(small: Path, tmp_path: Path) -> None:
    (tmp_path / "home").mkdir()
    (tmp_path / "home/thesis.txt").touch()
    done = crankslider("report", "--results", small, "--out", tmp_path / "home")
    require_refusal(done.stdout, done.stderr, done.code, "expected a new folder or a report to replace")
    assert [path.name for path in tmp_path.rglob("*")] == ["home", "thesis.txt"]
    for _ in range(2):
        done = crankslider("report", "--results", small, "--out", tmp_path / "report")
        assert done.code == 0, done.stderr
        assert not (tmp_path / "report/figures/stale.svg").exists()
        (tmp_path / "report/figures/stale.svg").touch()


def test_a_report_of_runs_that_all_failed_says_so_of_every_study(tmp_path: Path) -> None:
    for study in STUDIES:
        ended = {"status": "crashed", "reason": "killed by SIGSEGV"}
        cases = enumerate(load_study(study).cases(False))
        write_rows(
            tmp_path / "results",
            study,
            [{"case": f"{study} {n}", **case.head(), **ended} for n, case in cases],
        )
    write_report(tmp_path / "results", tmp_path / "report", CHAPTERS)
    failures = pd.read_csv(tmp_path / "report/tables/failures.csv")
    assert ({*failures["study"]}, {*failures["reason"]}) == ({*STUDIES}, {"killed by SIGSEGV"})


def test_a_claim_that_the_rows_contradict_breaks_the_report(tmp_path: Path) -> None:
    claim = Claim("odd", "Three is {number}.", {"number": (4, "")}, holds=False)
    chapter = Chapter("name", "Title", ("energy",), "", lambda _: iter([claim]))
    with pytest.raises(Contradiction, match=r"contradict the report's sentence: Three is 4\."):
        write_report(ROWS, tmp_path / "report", [chapter])
    assert list(tmp_path.iterdir()) == []


# Cells, numbers and looks


def test_a_cell_shows_a_number_with_what_belongs_to_it() -> None:
    """A range, an error below what is known, an interval that contains zero, and one that is narrow."""
    columns = {
        "name": ["a|b", None, "c"],
        "time": [1.0, 2.04, math.nan],
        f"time{MOST}": [1.04, 310.0, math.nan],
        "error": [4.9e-14, 1.24e-6, math.nan],
        f"error{UNCERTAIN}": [5e-14, 1e-13, math.nan],
        "power": [1e-9, -2.0, 3.0],
        f"power{HALF_WIDTH}": [3e-9, 0.5, 0.001],
    }
    table = Table("t", "", "", "", pd.DataFrame(columns), {"error": "{:.1e}".format})
    assert table.cells().to_dict("list") == {
        "name": ["a|b", "–", "c"],
        "time": ["1", "2 to 310", "–"],
        "error": ["< 5.0e-14", "1.2e-06", "–"],
        "power": ["< 4e-09", "-2 ± 0.5", "3"],
    }
    assert table.markdown("time", "power").splitlines()[2] == r"| a\|b | < 5.0e-14 |"


NUMBERS = [
    (1.24e-6, "m", "1.2 µm"),
    (9.96e-4, "s", "1 ms"),
    (-2.5e4, "N", "-25 kN"),
    (1.26e-10, "", "1.3×10⁻¹⁰"),
    (12345.0, "", "12345"),
    (1.26e-20, "m", "1.3×10⁻²⁰ m"),
]


@pytest.mark.parametrize(("value", "unit", "text"), NUMBERS)
def test_a_number_in_a_sentence_has_two_digits_and_a_prefix(value: float, unit: str, text: str) -> None:
    assert quantity(value, unit) == text
    assert str(Claim("x", "It is {number}.", {"number": (value, unit)})) == f"It is {text}."


def test_a_frame_has_numbers_or_nan_and_settings_as_they_were_written() -> None:
    case = {"case": "0", "scene": "s", "engine": "pymunk", "arm": "tuned", "label": "pymunk (tuned)"}
    first = {**case, "step_s": 2, "setting_iterations": 50, "error_m": math.inf, "method": None}
    second = {**case, "case": "1", "step_s": 1, "mean_step_s": 0.5, "error_m": 1, "method": "a word"}
    other = {**case, "engine": "reference", "arm": "none", "label": "reference (none)", "step_s": 3}
    rows = frame([second, first, other])
    pd.testing.assert_frame_equal(rows, frame([other, first, second]))
    assert list(rows["label"]) == ["reference (none)", "pymunk (tuned)", "pymunk (tuned)"]
    assert list(rows["mean_step_s"]) == [3.0, 2.0, 0.5]
    assert [str(setting) for setting in rows["setting_iterations"]] == ["nan", "50", "nan"]
    assert list(rows["error_m"].isna()) == [True, True, False]
    assert rows["method"].iloc[2] == "a word"
