"""The report: what is on it comes from the rows, and it is there whole or not at all."""

import csv
import html
import math
import re
import shutil
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from matplotlib.figure import Figure as Drawing

from engine_models.arms import Arm
from reports.page import compare_claims, read_claims, write_report
from reports.page.figures import as_svg, write_figure
from reports.parts import Contradiction, Figure, Finding, Number, Table, quantity
from reports.plots.series import mark
from reports.results import NoResults, frame
from reports.shared_tables import settings_table
from reports.style import axis_label, line_styles
from reports.tables import comma_separated, error, markdown
from studies import agreement
from studies.case import load_study
from studies.registry import STUDIES
from studies.store import FILE, Store
from tests.helpers.command import crankslider
from tests.helpers.refusals import require_refusal
from tests.helpers.row_files import write_rows
from tests.helpers.running import run_in

pytestmark = pytest.mark.system

PUBLISHED = Path(__file__).parents[2] / "reports/published"
#: Steps per sample interval of the cheap cases: enough for an order, a second or two in all.
CHEAP = (2, 4, 8)


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Real results of all engines at a few coarse steps, with a little of Pymunk's sweep of iterations."""
    folder = tmp_path_factory.mktemp("results")
    cases = [
        case
        for case in agreement.cases(full=True)
        if case.scene.name in ("ideal-free", "ideal-driven")
        and (
            (
                case.arm.name in ("projection", "trapezoidal", "tuned", "out of the box")
                and case.run.steps_per_sample(case.scene.end_time_s) in CHEAP
            )
            or case.arm.name in ("2 iterations", "20 iterations")
        )
    ]
    swept = next(
        case for case in cases if case.arm.name == "2 iterations" and case.scene.name == "ideal-free"
    )
    # Two sweeps are too few for all joints, and no joint can be left out.
    cases.append(replace(swept, arm=Arm("pymunk", "all joints", {"joints": "all", "iterations": 2})))
    run_in(folder, cases)
    return folder


@pytest.fixture(scope="module")
def report(results: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("page") / "report"
    write_report(results, out)
    return out


@pytest.fixture(scope="module")
def small(results: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Of the results, one scene and one arm: quicker to draw."""
    folder = tmp_path_factory.mktemp("small") / "results"
    rows = [row for row in rows_of(results) if (row["scene"], row["arm"]) == ("ideal-free", "projection")]
    write_rows(folder, "agreement", rows, cases=1, commit="0123abc")
    return folder


@pytest.fixture(scope="module")
def written(small: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A report of rows with a reason in the letters of three languages, whose provenance is theirs."""
    folder = tmp_path_factory.mktemp("written")
    rows = [row | {"scene": "<script>alert(1)</script>"} for row in rows_of(small)]
    rows[0] |= {"status": "failed", "reason": "<script>alert(1)</script> | 5 % of $x_1$"}
    write_rows(folder / "results", "agreement", rows, cases=1000, commit="0123abc")
    write_report(folder / "results", folder / "report")
    return folder / "report"


@pytest.fixture(scope="module")
def replaced(small: Path, report: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Another report in the place of the first."""
    folder = tmp_path_factory.mktemp("replaced")
    results = Path(shutil.copytree(small, folder / "results"))
    out = Path(shutil.copytree(report, folder / "report"))
    (out / "figures/stale.svg").touch()
    done = crankslider("report", "--results", results, "--out", out)
    assert done.code == 0, done.stderr
    return out


def rows_of(results: Path) -> list[dict[str, Any]]:
    with Store(results) as store:
        return store.results("agreement")[0]


class Page(HTMLParser):
    """The files and anchors of a page, and the texts that stand for its pictures."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.files: set[str] = set()
        self.jumps: set[str] = set()
        self.anchors: list[str] = []
        self.alts: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = {name: value or "" for name, value in attrs}
        if "id" in found:
            self.anchors.append(found["id"])
        target = found.get("href") or found.get("src") or ""
        if target.startswith("#"):
            self.jumps.add(target[1:])
        elif target:
            self.files.add(target)
        if tag == "img":
            self.alts.append(found["alt"])


# The page and its files


def test_a_report_is_the_page_its_findings_figures_and_tables_and_nothing_that_was_there(
    replaced: Path,
) -> None:
    names = {path.relative_to(replaced).as_posix() for path in replaced.rglob("*") if path.is_file()}
    assert {"index.html", "findings.json"} <= names
    files = names - {"index.html", "findings.json"}
    assert files
    assert "figures/stale.svg" not in files
    assert all(re.fullmatch(r"(tables|data)/[\w-]+\.csv|figures/[\w-]+\.svg", name) for name in files)


@pytest.mark.parametrize("kind", ["report", "replaced"])
def test_the_page_names_every_file_there_is_and_no_other(kind: str, request: pytest.FixtureRequest) -> None:
    folder: Path = request.getfixturevalue(kind)
    page = Page((folder / "index.html").read_text("utf-8"))
    written = {str(path.relative_to(folder)) for path in folder.rglob("*.*") if path.name != "index.html"}
    assert page.files == written


def test_links_within_the_page_lead_somewhere_and_pictures_have_a_text(report: Path) -> None:
    page = Page((report / "index.html").read_text("utf-8"))
    assert page.jumps <= set(page.anchors)
    assert len(page.anchors) == len(set(page.anchors))
    assert all(len(alt) > 40 for alt in page.alts)


def test_the_order_in_which_runs_finished_does_not_change_a_byte(
    results: Path, report: Path, tmp_path: Path
) -> None:
    shuffled = tmp_path / "results"
    with Store(results) as before, Store(shuffled) as store:
        rows, facts = before.results("agreement")
        store.describe("agreement", facts)
        for row in rows[::-1]:
            key = str(row["case"])
            told = {name: value for name, value in row.items() if name != "case"}
            store.keep(key, facts["engines"][row["engine"]], told, before.curves(key))
    write_report(shuffled, tmp_path / "report")
    for path in sorted(report.rglob("*.*")):
        again = tmp_path / "report" / path.relative_to(report)
        assert path.read_bytes() == again.read_bytes(), f"{path.name} differs from run to run"


def test_a_scene_without_a_driver_has_no_driver_torque(report: Path) -> None:
    with (report / "tables/agreement-orders.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    with_torque = {row["scene"] for row in rows if row["driver torque"] != "–"}
    assert with_torque == {"ideal-driven"}


def test_every_failed_run_is_listed_with_its_reason(results: Path, report: Path) -> None:
    failed = [row for row in rows_of(results) if row["status"] != "ok"]
    assert failed, "two sweeps are too few for all of Pymunk's joints"
    with (report / "tables/agreement-failures.csv").open(encoding="utf-8", newline="") as file:
        listed = sorted(
            (row["scene"], row["configuration"], row["reason"], row["exception"])
            for row in csv.DictReader(file)
        )
    # Pymunk itself goes on with what has come apart.
    assert listed == sorted((row["scene"], row["arm"], row["reason"], "SimulationFailed") for row in failed)


def test_the_error_table_shows_the_numbers_of_the_rows(results: Path, report: Path) -> None:
    with (report / "tables/agreement-errors.csv").open(encoding="utf-8", newline="") as file:
        shown = next(
            row
            for row in csv.DictReader(file)
            if (row["scene"], row["configuration"]) == ("ideal-free", "tuned")
        )
    step = float(shown["step [s]"])
    row = next(
        row
        for row in rows_of(results)
        if (row["scene"], row["arm"]) == ("ideal-free", "tuned") and f"{row['step_s']:.1e}" == f"{step:.1e}"
    )
    assert shown["slider position [m]"] == f"{row['slider_position_error_m']:.1e}"


def test_text_from_results_is_escaped(written: Path) -> None:
    page = (written / "index.html").read_text("utf-8")
    assert "<script>alert" not in page
    assert "&lt;script&gt;alert(1)" in page


def test_the_page_says_what_made_its_rows_and_whether_the_run_came_to_its_end(
    written: Path, replaced: Path
) -> None:
    for report, whole in ((written, False), (replaced, True)):
        page = (report / "index.html").read_text("utf-8")
        assert "0123abc" in page
        assert ("cases are there; `crankslider run` goes on" in page) != whole


# All or nothing


def test_no_results_is_said_in_one_line_and_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(NoResults, match=r"^--results: expected the results of a study, got none in "):
        write_report(tmp_path / "nowhere", tmp_path / "out" / "report")
    assert list(tmp_path.iterdir()) == []


def test_a_damaged_file_is_named_and_the_old_report_stays(small: Path, tmp_path: Path) -> None:
    broken = Path(shutil.copytree(small, tmp_path / "results"))
    (broken / FILE).write_bytes(b"no rows" * 1000)
    out = tmp_path / "reports" / "old"
    out.mkdir(parents=True)
    (out / "index.html").write_text('<meta name="generator" content="crankslider">', encoding="utf-8")
    done = crankslider("report", "--results", broken, "--out", out)
    require_refusal(done.stdout, done.stderr, done.code, "results: expected rows of a run", str(broken))
    assert [path.name for path in out.parent.iterdir()] == ["old"]
    assert [path.name for path in out.iterdir()] == ["index.html"]


def test_a_report_replaces_a_report(replaced: Path) -> None:
    assert not (replaced / "figures/stale.svg").exists()
    assert sorted(path.name for path in replaced.parent.iterdir()) == ["report", "results"]


def test_a_report_replaces_nothing_but_a_report(small: Path, tmp_path: Path) -> None:
    (tmp_path / "home").mkdir()
    (tmp_path / "home/thesis.txt").touch()
    done = crankslider("report", "--results", small, "--out", tmp_path / "home")
    require_refusal(done.stdout, done.stderr, done.code, "expected a new folder or a report to replace")
    assert [path.name for path in tmp_path.rglob("*")] == ["home", "thesis.txt"]


def test_the_table_of_settings_says_what_a_ladder_varies() -> None:
    head: dict[str, object] = {"scene": "s", "engine": "reference", "step_s": 1.0}
    head |= {"status": "ok", "reason": ""}
    ladder = {"arm": "DOP853", "label": "reference (DOP853)", "setting_method": "dop853"}
    plain = {"case": "1", "arm": "default", "label": "reference (default)"}
    rungs = [{**head, **ladder, "case": str(k), "setting_step_tolerance": 10.0**-k} for k in (6, 8)]
    shown = {row[1]: row[2] for row in settings_table(frame([*rungs, {**head, **plain}]), "s").rows}
    assert shown == {"DOP853": "method = dop853, step_tolerance varied", "default": "the defaults"}


def test_a_report_of_runs_that_all_failed_says_so_of_every_study(tmp_path: Path) -> None:
    ended = {"status": "crashed", "reason": "killed by SIGSEGV"}
    for study in STUDIES:
        cases = enumerate(load_study(study).cases(False))
        rows = [{"case": f"{study} {n}", **case.head(), **ended} for n, case in cases]
        write_rows(tmp_path / "results", study, rows)
    write_report(tmp_path / "results", tmp_path / "report")
    told = [path.read_text("utf-8") for path in (tmp_path / "report/tables").glob("*-failures.csv")]
    assert sum("killed by SIGSEGV" in text for text in told) >= len(STUDIES) - 1, "the gallery has verdicts"


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


# Sentences


def test_a_sentence_that_the_rows_contradict_breaks_the_report(results: Path, tmp_path: Path) -> None:
    broken, rows = tmp_path / "results", rows_of(results)
    for row in rows:
        if (row["engine"], row["arm"], row["status"]) == ("pymunk", "tuned", "ok"):
            row["slider_position_error_m"] = float(str(row["step_s"]))
    write_rows(broken, "agreement", rows)
    done = crankslider("report", "--results", broken, "--out", tmp_path / "report")
    assert (done.code, done.stdout, done.stderr.count("\n")) == (1, "", 1)
    assert "pymunk (tuned), with joint errors corrected" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["results"]


def test_a_finding_that_does_not_hold_is_a_contradiction() -> None:
    assert Finding("even", "Two is even.").require(2 % 2 == 0) == "Two is even."
    with pytest.raises(Contradiction, match=r"Three is even\."):
        Finding("odd", "Three is even.").require(3 % 2 == 0)


# Digits and labels


@pytest.mark.parametrize(
    ("value", "uncertainty", "text"),
    [
        (1.2345e-6, 1e-13, "1.2e-06"),
        (9.96e-4, math.nan, "1.0e-03"),
        (4.9e-14, 5.02e-14, "< 5.0e-14"),
        (0.0, 6e-16, "< 6.0e-16"),
        (6e-16, 6e-16, "6.0e-16"),
        (0.0, math.nan, "0.0e+00"),
        (math.nan, 1e-13, "–"),
    ],
)
def test_errors_have_two_digits_and_none_below_the_uncertainty(
    value: float, uncertainty: float, text: str
) -> None:
    assert error(value, uncertainty) == text


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (1.26e-10, "m", "130 pm"),
        (1.26e-7, "m", "130 nm"),
        (1.24e-6, "m", "1.2 µm"),
        (9.96e-4, "s", "1 ms"),
        (25.0, "N", "25 N"),
        (-2.5e4, "N", "-25 kN"),
        (4.4, "%", "4.4 %"),
        (1.26e-10, "", "1.3×10⁻¹⁰"),
        (0.0, "m", "0 m"),
        (160.0, "", "160"),
        (12345.0, "", "12345"),
        (1.26e-20, "m", "1.3×10⁻²⁰ m"),
    ],
)
def test_a_number_in_a_sentence_has_two_digits_and_a_prefix(value: float, unit: str, text: str) -> None:
    assert quantity(value, unit) == text


def test_a_table_is_the_same_in_all_formats() -> None:
    head, cells = ("scene", "slider position [m]"), (("a_b|c", "< 5.0e-14"),)
    table = Table("t", "A title", "Read & see.", "agreement", head, cells)
    assert markdown(table).splitlines()[-1] == r"| a_b\|c | < 5.0e-14 |"
    assert comma_separated(table) == "scene,slider position [m]\na_b|c,< 5.0e-14\n"


@pytest.mark.parametrize(
    ("column", "text"),
    [
        ("slider_position_error_m", "slider position error [m]"),
        ("slider_velocity_error_m_s", "slider velocity error [m/s]"),
        ("joint_O_force_error_N", "joint O force error [N]"),
        ("driver_torque_error_N_m", "driver torque error [N·m]"),
        ("step_s", "step [s]"),
        ("iterations", "iterations"),
        ("peak_force_error_percent", "peak force error [%]"),
        ("impact_force_error_N", "peak force error [N]"),
        ("impact_force_in_phase_error_N", "impact force at equal phase error [N]"),
        ("impact_force_relative_error", "relative peak force error"),
        ("impact_impulse_relative_error", "impact impulse relative error"),
        ("observed_B_x_m", "B x [m]"),
        ("observed_rocker_angle_velocity_rad_s", "rocker angle velocity [rad/s]"),
        ("rocker_angular_acceleration_rad_s2", "rocker angular acceleration [rad/s²]"),
    ],
)
def test_labels_derive_from_column_names(column: str, text: str) -> None:
    assert axis_label(column) == text


def test_an_engine_has_one_colour_and_marker_and_its_arms_differ() -> None:
    arms = [(arm.engine, arm.name, arm.label) for arm in agreement.ARMS]
    rows = pd.DataFrame(arms, columns=["engine", "arm", "label"])
    styles = line_styles(rows)
    for engine, labels in rows.groupby("engine")["label"]:
        of_engine = [styles[label] for label in labels]
        assert len({(style["color"], style["marker"]) for style in of_engine}) == 1, engine
        assert len({(style["linestyle"], style["fillstyle"]) for style in of_engine}) == len(of_engine)
    assert len({style["marker"] for style in styles.values()}) == rows["engine"].nunique()


# The figures as the page has them


def drawn(values: tuple[float, ...]) -> Figure:
    """Return a figure of one series over its own values, log-log, in a panel."""
    drawing = Drawing(figsize=(5.0, 3.0), layout="constrained")
    ax = drawing.add_subplot()
    ax.set(xlabel="step [s]", ylabel="error [m]", title="a scene")
    notes = [f"step {value}" for value in values]
    mark(ax.loglog(values, [10 * value for value in values]), "an arm <b>", notes)
    return Figure("name", "Title", "Reading.", "agreement", drawing)


def test_powers_on_an_axis_are_raised_digit_by_digit() -> None:
    drawing = drawn((1e-23, 1e-21)).drawing
    as_svg(drawing)
    told = {text.get_text() for text in drawing.axes[0].get_xticklabels()}
    assert {"10⁻²³", "10⁻²²", "10⁻²¹"} <= told


def test_a_figure_is_a_picture_with_the_points_of_its_lines_in_words_and_numbers(tmp_path: Path) -> None:
    for kind in ("data", "figures"):
        (tmp_path / kind).mkdir()
    words, has_points = write_figure(drawn((1e-3, 1e-2)), tmp_path)
    assert (words, has_points) == ("Title Panels: a scene. Series: an arm <b>.", True)
    with (tmp_path / "data/name.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    points = [(float(row["x"]), float(row["y"]), row["setting"]) for row in rows]
    assert points == [(1e-3, 1e-2, "step 0.001"), (1e-2, 1e-1, "step 0.01")]
    texts = {(row["panel"], row["series"], row["x is"], row["y is"]) for row in rows}
    assert texts == {("a scene", "an arm <b>", "step [s]", "error [m]")}
    svg = (tmp_path / "figures/name.svg").read_text(encoding="utf-8")
    assert ">error [m]</text>" in svg
    assert "<b>" not in svg, "what a line belongs to is not written into the picture"


# Findings as data


def test_every_sentence_of_the_page_is_a_claim_of_its_own(report: Path) -> None:
    page = html.unescape(re.sub(r"<[^>]*>", "", (report / "index.html").read_text("utf-8")))
    claims = read_claims(report)
    assert len({claim["id"] for claim in claims}) == len(claims) >= 3
    assert [claim["text"] for claim in claims if claim["text"] not in page] == []


def test_the_numbers_of_two_reports_stand_side_by_side() -> None:
    def claims(**numbers: list[Number]) -> list[dict[str, object]]:
        return [{"id": name, "numbers": of} for name, of in numbers.items()]

    before = claims(a=[Number(2e-3, "s"), Number(4.0)], b=[Number(1.0)])
    compared = compare_claims(before, claims(a=[Number(3e-3, "s"), Number(4.0)], c=[Number(0.5, "%")]))
    assert list(compared.columns) == ["before", "after"]
    assert {claim: tuple(numbers) for claim, numbers in compared.T.to_dict("list").items()} == {
        "a 1": ("2 ms", "3 ms"),
        "a 2": ("4", "4"),
        "b 1": ("1", "–"),
        "c 1": ("–", "0.5 %"),
    }


# What a reader has time for

#: At most so many words, figures, tables and bytes are on the page of the quick set.
MOST = {"words": 6000, "figures": 20, "tables": 15, "bytes": 100_000}


def test_the_page_of_the_quick_set_is_short(tmp_path: Path) -> None:
    write_report(PUBLISHED / "results", tmp_path / "report")
    page = (tmp_path / "report/index.html").read_text("utf-8")
    text = re.sub(r"<[^>]+>", " ", re.sub(r"<(script|style).*?</\1>", "", page, flags=re.DOTALL))
    found = {
        "words": len(html.unescape(text).split()),
        "figures": page.count('<figure id="figure-'),
        "tables": page.count('<figure id="table-'),
        "bytes": len(page.encode()),
    }
    assert all(0 < found[name] <= most for name, most in MOST.items()), found


def test_every_figure_and_table_has_a_number_a_command_and_the_file_of_its_data(report: Path) -> None:
    page = (report / "index.html").read_text("utf-8")
    parts = re.findall(r'<figure id="(figure|table)-([\w-]+)".*?</figure>', page, re.DOTALL)
    assert parts
    for kind, name in parts:
        (part,) = re.findall(rf'<figure id="{kind}-{name}".*?</figure>', page, re.DOTALL)
        assert re.search(rf"<strong>{kind.capitalize()} \d+\. ", part)
        assert re.search(r"Recreate: <code>crankslider run( [\w-]+)?; crankslider report</code>", part)
        (file,) = re.findall(r'Data: <a href="([^"]+)">', part)
        assert (report / file).is_file()
    numbers = [int(number) for number in re.findall(r"<strong>Figure (\d+)\. ", page)]
    assert numbers == list(range(1, len(numbers) + 1))
