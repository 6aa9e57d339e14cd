"""The work-precision chapter: who is cheaper is counted by the rivals' rungs, and told whoever it is."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from matplotlib.lines import Line2D

from reports.chapters.work_precision import POSITION, TORQUE, sections
from reports.chapters.work_precision.findings import found, races_table
from reports.chapters.work_precision.tables import building, cheapest, compiling
from reports.equal_error import ALONE, Judged
from reports.parts import Section, Table
from reports.plots.series import marked
from reports.results import Results, frame

#: Rungs of an arm: error in m and run time in s of each.
Rungs = list[tuple[float, float]]
#: What a round takes in times of the median: they differ, but by less than any two engines here.
ROUNDS = (0.98, 1.0, 1.02)
REFERENCE = "reference (DOP853)"
CHEAPER = "is cheaper at 1 of the best rungs; the reference takes up to"
OWN: Rungs = [(1e-4, 1.0), (1e-6, 2.0), (1e-8, 4.0)]


def rows_of(ladders: dict[str, Rungs], column: str = POSITION, **columns: Any) -> list[dict[str, Any]]:
    """Return the recorded run and the rounds of every rung of some arms, by their labels."""
    rows = []
    for label, rungs in ladders.items():
        engine, arm = label.removesuffix(")").split(" (")
        for place, (error, time_s) in enumerate(rungs):
            head: dict[str, Any] = {
                "scene": "free",
                "engine": engine,
                "arm": arm,
                "label": label,
                "fingerprint": "0",
            }
            head |= {"step_s": 0.1 / 2**place, "status": "ok", "reason": "", "end_time_s": 1.0, **columns}
            case = f"{label} {place} {columns.get('scene')}"
            rows.append({**head, "case": case, column: error, "steps": 2**place, "compared_until_s": 1.0})
            for k, part in enumerate(ROUNDS):
                timed = {"round": k, "solve_time_s": part * time_s, "build_time_s": 1.0}
                rows.append({**head, "case": f"{case} {k}", **timed})
    return rows


def judged(rows: list[dict[str, Any]]) -> Judged:
    return Judged("t", frame(rows), POSITION)


def told(rivals: dict[str, Rungs]) -> list[str]:
    return list(found(judged(rows_of({REFERENCE: OWN, **rivals}))))


def cells(table: Table | None) -> list[dict[str, str]]:
    assert table is not None
    return [dict(zip(table.head, row, strict=True)) for row in table.rows]


def test_a_rival_that_is_dearer_everywhere_is_told_with_the_share_of_its_time() -> None:
    (sentence,) = told({"exudyn (DOPRI5)": [(1e-4, 4.0), (1e-6, 20.0)]})
    assert "is cheaper at the errors of all its rivals' best rungs on 1 of 1 scenes" in sentence
    assert "on 1 of 1 scenes. There it takes 0.1 to 0.25 of their time" in sentence


def test_a_rival_that_is_cheaper_is_told_in_a_sentence_of_its_own() -> None:
    first, second, third = told(
        {"heyoka (default)": [(1e-4, 4.0), (1e-8, 1.6)], "exudyn (DOPRI5)": [(1e-2, 0.5)]}
    )
    assert "on 0 of 1 scenes" in first
    where = "free by slider position error, in the native solve"
    assert second == f"{where}: exudyn (DOPRI5) {CHEAPER} 2 times as long."
    assert third == f"{where}: heyoka (default) {CHEAPER} 2.5 times as long."


def test_a_rung_that_only_a_rival_gets_to_counts() -> None:
    _, alone = told({"scipy (DOP853)": [(1e-4, 4.0), (1e-10, 9.0)]})
    assert alone == (
        "free by slider position error, in the native solve: scipy (DOP853) alone is there at 1 of the best "
        "rungs; the reference comes no nearer than 1.0×10⁻⁸ m."
    )


def test_a_rung_that_takes_as_long_decides_nothing() -> None:
    _, undecided = told({"scipy (DOP853)": [(1e-4, 1.9), (1e-6, 2.0)]})
    assert undecided.endswith("the timing does not resolve who is cheaper at 1 of 2 best rungs.")


def test_a_rivals_rungs_count_once_however_many_errors_they_cover() -> None:
    """One rung at round-off is one rung, though it is cheaper at every error."""
    rows = rows_of({REFERENCE: OWN, "exudyn (DOPRI5)": [(1e-4, 40.0), (1e-5, 41.0), (1e-12, 30.0)]})
    (line,) = cells(races_table(judged(rows)))
    assert (line["rivals' best rungs"], line["reference cheaper"], line["rival alone"]) == ("1", "0", "1")


def test_the_reference_alone_is_counted_by_its_own_best_rungs() -> None:
    rows = rows_of({REFERENCE: OWN, "pymunk (tuned)": [(1e-4, 40.0), (1e-5, 41.0)]})
    (line,) = cells(races_table(judged(rows)))
    assert (line["rivals' best rungs"], line["reference cheaper"], line["reference alone"]) == ("2", "2", "2")
    assert line["in parts of the rival's time"] == "0.025 to 0.034"


def test_the_table_names_arm_and_setting_of_each_engine_and_its_ratio_to_the_cheapest() -> None:
    rows = rows_of({REFERENCE: OWN, "pymunk (tuned)": [(1e-4, 40.0), (1e-6, 80.0)]})
    table = cells(cheapest(judged(rows)))
    at = {(line["error [m]"], line["engine and arm"]): line for line in table}
    assert at["1.0e-05", REFERENCE]["setting"] == "step 0.1 to 0.05 s"
    assert at["1.0e-06", "pymunk (tuned)"]["setting"] == "step 0.05 s"
    assert at["1.0e-06", "pymunk (tuned)"]["ratio to the cheapest"] == "40 (40 to 40)"


def test_a_scene_whose_slider_follows_from_a_prescribed_crank_is_judged_by_torque_and_forces() -> None:
    rivals = {REFERENCE: OWN, "exudyn (trapezoidal)": [(1e-3, 4.0), (1e-15, 4.0)]}
    rows = rows_of(rivals, TORQUE, scene="driven", **{POSITION: 1e-15, "joint_A_force_error_N": 1e-3})
    page = sections(Results(Path(), frame([*rows, *rows_of(rivals)]), None))
    names = {table.name: {row[0] for row in table.rows} for section in page for table in section.tables}
    assert names["work-precision-ideal-slider-position-races"] == {"free"}
    assert names["work-precision-ideal-driver-torque-races"] == {"driven"}
    assert names["work-precision-ideal-largest-joint-force-races"] == {"driven"}
    sentences = [text for section in page for text in section.text]
    assert not any("driven by slider position" in text for text in sentences)


def test_compiling_is_paid_for_by_the_lead_on_the_cheapest_rival_or_never() -> None:
    rows = rows_of({REFERENCE: OWN, "scipy (DOP853)": [(1e-4, 11.0), (1e-6, 12.0), (1e-8, 14.0)]})
    compiled = [
        {**row, "case": f"compiled {row['label']}", "compiled_anew": 1, "compile_time_s": 55.0}
        for row in (rows[0], rows[-1])
    ]
    lines = cells(compiling(frame([*rows, *compiled]), [judged(rows)]))
    assert [(line["engine"], line["against"], line["paid for after"]) for line in lines] == [
        ("reference", "scipy (DOP853)", "6 runs"),  # 55 s at 10 s a run
        ("scipy", REFERENCE, "never"),
    ]


def test_building_and_read_out_are_shown_as_a_part_of_the_run() -> None:
    (line,) = cells(building(frame(rows_of({REFERENCE: [(1e-4, 3.0)]}))))
    assert (line["median [ms]"], line["median [%]"]) == ("1000", "25")


@pytest.mark.parametrize(
    ("until", "words"), [(1.0, "until 1 s on free."), (0.5, "until 0.5 s of 1 s on free.")]
)
def test_captions_say_until_when_a_scene_is_compared(until: float, words: str) -> None:
    rows = rows_of({REFERENCE: OWN, "exudyn (DOPRI5)": OWN})
    followed = pd.DataFrame(rows).assign(compared_until_s=until).to_dict("records")
    page = sections(Results(Path(), frame([{str(k): v for k, v in row.items()} for row in followed]), None))
    captions = [figure.reading for section in page for figure in section.figures]
    assert captions
    assert all(caption.endswith(words) for caption in captions)


LOOSE: dict[str, Any] = {"scene": "loose", "clearance_B_error_m": 1e-9, "smallest_clearance_m": 5e-4}
EARLY = "slider_position_error_until_6ms_m"


#: The reference's rungs with clearance, of which the first one's error has grown to that, and Pymunk's.
NEAR: Rungs = [(1e-4, 1.0), (1e-5, 1.5), (1e-7, 2.0), (1e-9, 4.0)]
FAR: Rungs = [(1e-3, 10.0), (9e-5, 20.0)]


def loose_rows() -> list[dict[str, Any]]:
    """Return rows of a scene with clearance; before its end, errors are a thousandth of those there."""
    rows = rows_of({REFERENCE: NEAR, "pymunk (tuned)": FAR}, **LOOSE)
    return [
        {**row, EARLY: 1e-3 * row[POSITION], "reached_1um_s": row["step_s"], "reached_clearance_s": 1.0}
        if POSITION in row
        else row
        for row in rows
    ]


def chapter(rows: list[dict[str, Any]]) -> Section:
    page = sections(Results(Path(), frame(rows), None))
    return next(section for section in page if section.name == "work-precision-clearance")


def test_errors_that_have_grown_to_the_clearance_are_ranked_before_that_alone() -> None:
    section = chapter(loose_rows())
    tables = {table.name: cells(table) for table in section.tables}
    at_end = {line["engine and arm"] for line in tables["work-precision-clearance-slider-position"]}
    assert at_end == {REFERENCE}
    early = tables["work-precision-clearance-early"]
    there = {
        (line["until"], line["error [m]"]) for line in early if line["engine and arm"] == "pymunk (tuned)"
    }
    # Its errors by then are 1e-6 and 9e-8 m, the second largest of all is 1e-7 m.
    assert there == {("6 ms", "1.0e-07")}
    assert (
        "On loose the slider's error grows to a tenth of the clearance or more in 3 of 6 runs, among them "
        "all of pymunk. These are ranked at fixed earlier times alone."
    ) in section.text


def test_where_no_error_has_grown_to_the_clearance_nothing_is_said_of_it() -> None:
    rows = [row if row.get(POSITION, 0.0) < 5e-5 else {**row, POSITION: 4e-5} for row in loose_rows()]
    section = chapter(rows)
    assert not any("clearance or more" in text for text in section.text)
    assert "work-precision-clearance-early" not in {table.name for table in section.tables}


def test_horizons_are_drawn_over_run_time_with_a_line_for_each_arm() -> None:
    figures = {figure.name: figure for figure in chapter(loose_rows()).figures}
    (ax,) = figures["work-precision-clearance-reached-1um"].drawing.axes
    lines = {}
    for series in marked(figures["work-precision-clearance-reached-1um"].drawing):
        if series.notes and isinstance(series.artist, Line2D):
            lines[series.label] = np.asarray(series.artist.get_xydata()).tolist()
    assert lines[REFERENCE] == [[1.0, 0.1], [1.5, 0.05], [2.0, 0.025], [4.0, 0.0125]]
    assert lines["pymunk (tuned)"] == [[10.0, 0.1], [20.0, 0.05]]
    assert (ax.get_xscale(), ax.get_title()) == ("log", "loose")
    assert any(np.allclose(line.get_ydata(), 1.0) for line in ax.lines), "the end of the comparison"


def test_a_time_that_leaves_out_forces_says_so_where_forces_are_judged_and_nowhere_else() -> None:
    rows = rows_of({REFERENCE: OWN})
    rows += rows_of({"heyoka (Taylor)": [(1e-4, 0.5), (1e-8, 1.0)]}, motion_alone=True)
    force = "joint_A_force_error_N"
    rows = [{**row, force: 1e4 * row[POSITION]} if POSITION in row else row for row in rows]
    page = sections(Results(Path(), frame(rows), None))
    tables = {table.name: table for section in page for table in section.tables}
    by_motion = cells(tables["work-precision-ideal-slider-position"])
    assert not any("forces" in line["time [ms]"] for line in by_motion)
    by_force = tables["work-precision-ideal-largest-joint-force"]
    told = {line["engine and arm"]: "without forces" in line["time [ms]"] for line in cells(by_force)}
    assert told == {REFERENCE: False, "heyoka (Taylor)": True}
    assert ALONE in by_force.reading
    sentences = [text for section in page for text in section.text]
    assert any(
        "by largest joint force error" in text and "heyoka (Taylor), without its forces, is cheaper" in text
        for text in sentences
    )
    assert not any("by slider position error" in text and "without its forces" in text for text in sentences)
    figures = {figure.name: figure.reading for section in page for figure in section.figures}
    assert (
        "Forces are left out of the run times of heyoka (Taylor)."
        in figures["work-precision-ideal-largest-joint-force-time"]
    )
    assert "Forces are left out" not in figures["work-precision-ideal-slider-position-time"]
