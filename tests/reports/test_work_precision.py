"""The work-precision chapter: who is cheaper is counted by the rivals' rungs, and told whoever it is."""

from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from reports.chapters.work_precision import POSITION, TORQUE, sections
from reports.chapters.work_precision.findings import found, races_table
from reports.chapters.work_precision.tables import building, cheapest, compiling
from reports.equal_error import Judged
from reports.parts import Table
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
