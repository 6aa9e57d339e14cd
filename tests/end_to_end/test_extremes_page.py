"""The extreme cases on rows with round numbers: every verdict, cell and finding worked out here."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from matplotlib.colors import to_hex, to_rgba
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from reports.analysis.verdicts import answers, wrong_results
from reports.chapters.limits import CHAPTER, EXTREMES
from reports.parts import Figure, Studies, Table
from reports.plots.series import marked
from tests.end_to_end.written_rows import results_of, row

#: Cases in their places: group, what theory says and asks for, and when the motion ends in s.
CASES: dict[str, tuple[str, str, str, float | None]] = {
    "easy": ("everyday", "Ordinary numbers.", "answer", None),
    "no motion": ("impossible", "There is none.", "refusal", None),
    "ending": ("singular", "It ends after 10 ms.", "stop", 0.01),
    "absurd": ("numbers", "The step is none.", "answer or word", None),
    "endless": ("numbers", "It takes for ever.", "answer", None),
}
ARMS = (("reference", "default"), ("exudyn", "DOPRI5"), ("pymunk", "tuned"))
BOUNDS = {
    "relative_error_bound": 1e-3,
    "unaccounted_energy_part_bound": 0.01,
    "constraint_relative_bound": 2e-3,
}


def numbers(error: float, energy: float, constraint: float, **columns: Any) -> dict[str, Any]:
    """Return what a run says that reports success."""
    judged = {"relative_error": error, "unaccounted_energy_part": energy, "constraint_relative": constraint}
    return {
        **judged,
        "judged": "height",
        "finite": True,
        "penetration_part": 0.0,
        "ideal_gap_part": 0.0,
        **columns,
    }


def ended(status: str, reason: str, **columns: Any) -> dict[str, Any]:
    return {"status": status, "reason": reason, **columns}


#: What each arm says of each case.
SAID: dict[str, tuple[dict[str, Any], ...]] = {
    "easy": (numbers(1e-4, 2e-3, 1e-4), numbers(5e-3, 5e-3, 1e-5), numbers(5e-4, 0.05, 3e-3)),
    "no motion": (
        ended("failed", "initial positions: expected closed joints, got 3 m"),
        numbers(0.0, 0.0, 0.0, judged="a crank of no length turns"),
        ended("unsupported", "no such scene: expected a rod"),
    ),
    "ending": (
        ended("failed", "singular at t = 0.0100001 s, q = 3: no more"),
        ended("failed", "step too short at t = 0.02 s"),
        ended("failed", "joint apart at t = 0.0105 s"),
    ),
    "absurd": (
        numbers(2e-4, 1e-3, 1e-3),
        ended("failed", "something broke"),
        numbers(1e-4, 0.5, 0.0, quality_failure="energy is off by half"),
    ),
    "endless": (
        ended("timed out", "after 120 s"),
        ended("crashed", "signal 11"),
        ended("out of memory", "more than 4 GB"),
    ),
}
#: The same of Pymunk without our guards, where one had spoken.
BARE = {
    "ending": numbers(0.3, 2e-3, 1e-3, ideal_gap_part=0.2, ideal_gap_m=0.0123),
    "absurd": numbers(1e-4, 0.5, 0.0),
}
#: Verdicts, case by case in the arms' order, and whether that is what theory asks for.
VERDICTS = {
    "easy": ("right", "inaccurate", "inaccurate"),
    "no motion": ("clear error", "wrong, no error", "refused"),
    "ending": ("clear error", "clear error", "clear error"),
    "absurd": ("right", "unclear error", "wrong, found by a check"),
    "endless": ("timed out", "crashed", "out of memory"),
}
WANTED = {"easy": "+--", "no motion": "+-+", "ending": "+-+", "absurd": "+-+", "endless": "---"}
LOOKS = {
    "right": ("✓", "#f4f8fb"),
    "refused": ("⊘", "#cfe3f1"),
    "clear error": ("F", "#a2c8e4"),
    "wrong, found by a check": ("N", "#7fb2d6"),
    "inaccurate": ("≈", "#d98d2b"),
    "unclear error": ("f", "#d27328"),
    "timed out": ("T", "#b0502a"),
    "out of memory": ("M", "#8f2f26"),
    "crashed": ("C", "#631a2b"),
    "wrong, no error": ("✗", "#20122e"),
}


@pytest.fixture(scope="module")
def studies(tmp_path_factory: pytest.TempPathFactory) -> Studies:
    rows: list[dict[str, Any]] = []
    for place, (case, (group, theory, wanted, stop_s)) in enumerate(CASES.items()):
        head = {"place": place, "group": group, "theory": theory, "wanted": wanted, "stop_s": stop_s}
        head |= {**BOUNDS, "nonsense_factor": 10.0, "end_time_s": 0.1}
        for (engine, arm), said in zip(ARMS, SAID[case], strict=True):
            rows.append(row(len(rows), case, engine, arm, 1e-3, guarded=True, **{**head, **said}))
        if case in BARE:
            rows.append(
                row(len(rows), case, "pymunk", "tuned", 1e-3, guarded=False, **{**head, **BARE[case]})
            )
    return {EXTREMES: results_of(tmp_path_factory.mktemp("results") / EXTREMES, rows[::-1], {})}


def table(studies: Studies, name: str) -> Table:
    return next(one for one in CHAPTER.tables(studies) if one and one.name == f"extremes-{name}")


@pytest.fixture(scope="module")
def matrix(studies: Studies) -> Figure:
    (figure,) = CHAPTER.figures(studies)
    assert figure
    return figure


def test_what_our_model_does_not_express_is_no_case_of_the_engine(studies: Studies) -> None:
    """Exudyn returns a motion where there is none; Pymunk goes on past the end and loses half its energy."""
    rows = studies[EXTREMES].rows
    counts = wrong_results(answers(rows))
    assert list(counts.index) == ["pymunk (tuned)", "exudyn (DOPRI5)", "reference (default)"]
    assert counts.to_numpy().tolist() == [[2, 5], [1, 5], [0, 5]]
    rows = rows.assign(spoken_by=None)
    rows.loc[rows["reason"] == "something broke", "spoken_by"] = "adapter"
    altered = {EXTREMES: replace(studies[EXTREMES], rows=rows)}
    assert wrong_results(answers(rows)).loc["exudyn (DOPRI5)"].tolist() == [1, 4]
    (exudyn,) = (cells for cells in table(altered, "counts").rows if cells[0] == "exudyn (DOPRI5)")
    assert exudyn[table(altered, "counts").head.index("not modelled")] == "1"


def test_the_findings_tell_who_is_wrong_without_an_error_and_what_checks_change(studies: Studies) -> None:
    wrong, checks = CHAPTER.findings(studies)
    assert wrong == (
        "Results wrong by over 10 times a bound, or given where no motion exists, without an error (our "
        "checks off): pymunk (tuned) in 2 of 5, exudyn (DOPRI5) in 1 of 5 and reference (default) in 0 of 5 "
        "extreme cases."
    )
    assert checks == (
        "Our checks end 1 runs with which the engine would go on, and reject 1 that it finished. With checks "
        "off 2 of these report success. With checks on 1 wrong results have no error: exudyn (DOPRI5) 1."
    )


def test_every_run_has_its_verdict_with_the_numbers_it_rests_on(studies: Studies) -> None:
    shown = table(studies, "verdicts")
    head = (
        "case",
        "engine",
        "configuration",
        "longest step [s]",
        "verdict",
        "error",
        "of what",
        "energy",
        "constraints",
    )
    assert shown.head == (*head, "told by", "reason")
    assert shown.reading == (
        "Right: error up to 0.001 of the motion, energy 0.01 of that in play, gaps 0.002 of the crank's "
        "length. Wrong: beyond 10 times one of these."
    )
    none = ("–", "–", "–", "–")
    cells = {
        "easy": (
            ("1.0e-04", "height", "2.0e-03", "1.0e-04", "–", "–"),
            ("5.0e-03", "height", "5.0e-03", "1.0e-05", "–", "–"),
            ("5.0e-04", "height", "5.0e-02", "3.0e-03", "–", "–"),
        ),
        "no motion": (
            (*none, "engine", "initial positions: expected closed joints, got 3 m"),
            ("0.0e+00", "a crank of no length turns", "0.0e+00", "0.0e+00", "–", "–"),
            (*none, "scene", "no such scene: expected a rod"),
        ),
        "ending": (
            (*none, "engine", "singular at t = 0.0100001 s, q = 3: no more"),
            (*none, "engine", "step too short at t = 0.02 s"),
            (*none, "guard", "joint apart at t = 0.0105 s"),
        ),
        "absurd": (
            ("2.0e-04", "height", "1.0e-03", "1.0e-03", "–", "–"),
            (*none, "engine", "something broke"),
            ("1.0e-04", "height", "5.0e-01", "0.0e+00", "guard", "energy is off by half"),
        ),
        "endless": (
            (*none, "–", "after 120 s"),
            (*none, "–", "signal 11"),
            (*none, "–", "more than 4 GB"),
        ),
    }
    assert list(shown.rows) == [
        (case, *arm, "1.0e-03", verdict, *rest)
        for case, verdicts in VERDICTS.items()
        for arm, verdict, rest in zip(ARMS, verdicts, cells[case], strict=True)
    ]


def test_verdicts_are_counted_by_engine(studies: Studies) -> None:
    shown = table(studies, "counts")
    asked = ("not modelled", "as theory asks", "by our checks", "as theory asks without our checks")
    assert shown.shown
    assert shown.head == ("configuration", "cases", *LOOKS, *asked)
    # Without our checks Pymunk goes on past the end, and returns half of its energy without an error.
    by_checks = {"reference": ("4", "0", "4"), "exudyn": ("0", "0", "0"), "pymunk": ("3", "2", "1")}
    expected = []
    for k, (engine, arm) in enumerate(ARMS):
        own = [verdicts[k] for verdicts in VERDICTS.values()]
        counts = [str(own.count(name)) for name in LOOKS]
        expected.append((f"{engine} ({arm})", "5", *counts, "0", *by_checks[engine]))
    assert list(shown.rows) == expected


def test_guards_stand_beside_what_comes_without_them(studies: Studies) -> None:
    shown = table(studies, "guards")
    assert shown.head == ("case", "engine", "configuration", "the check", "verdict without it", "what came")
    apart, off = "a joint or the guide 12 mm apart", "energy off by 0.5 of that in play"
    assert shown.rows == (
        (
            "ending",
            "pymunk",
            "tuned",
            "joint apart at t = 0.0105 s",
            "wrong, no error",
            f"success, with {apart}",
        ),
        ("absurd", "pymunk", "tuned", "energy is off by half", "wrong, no error", f"success, with {off}"),
    )


def test_what_theory_expects_is_told_of_every_case(studies: Studies) -> None:
    shown = table(studies, "expectations")
    assert shown.head == ("group", "case", "asked for", "theory")
    words = {"answer": "the motion", "refusal": "a refusal"}
    words["stop"] = "an error at the right time, or the smooth branch"
    words["answer or word"] = "the motion, or an error that names step or numbers"
    assert list(shown.rows) == [
        (group, case, words[wanted], theory) for case, (group, theory, wanted, _) in CASES.items()
    ]


def test_the_matrix_has_every_verdict_in_its_cell_and_a_frame_where_theory_asks_for_it(
    matrix: Figure,
) -> None:
    assert matrix.name == "extremes-matrix"
    (panel,) = matrix.drawing.axes
    boxes = [patch for patch in panel.patches if isinstance(patch, Rectangle)]
    cells = iter(boxes)
    columns: dict[int, set[float]] = {0: set(), 1: set(), 2: set()}
    for place, (case, verdicts) in enumerate(VERDICTS.items()):
        for column, (verdict, asked) in enumerate(zip(verdicts, WANTED[case], strict=True)):
            cell = next(cells)
            assert to_hex(cell.get_facecolor()) == LOOKS[verdict][1], (case, column)
            assert (to_rgba(cell.get_edgecolor())[3] > 0) == (asked == "+"), (case, column)
            columns[column].add(cell.get_x())
            middle = cell.get_y() + cell.get_height() / 2
            assert middle == pytest.approx(boxes[0].get_y() + boxes[0].get_height() / 2 + 0.2 * place)
            inside = [
                text.get_text()
                for text in panel.texts
                if abs(text.get_position()[1] - middle) < 0.01
                and cell.get_x() < text.get_position()[0] < cell.get_x() + cell.get_width()
            ]
            of_what = {("easy", 1): ["5e-03"], ("easy", 2): ["E 5e-02"]}.get((case, column), [])
            bare = {("ending", 2): "wrong, no error", ("absurd", 2): "wrong, no error"}.get((case, column))
            if bare:
                assert to_hex(next(cells).get_facecolor()) == LOOKS[bare][1]
            assert inside == [LOOKS[verdict][0], *of_what, *([LOOKS[bare][0]] if bare else [])], (
                case,
                column,
            )
    lefts = [min(found) for found in columns.values()]
    assert all(len(found) == 1 for found in columns.values())
    assert lefts == sorted(lefts)
    heads = [text.get_text() for text in panel.texts[:3]]
    assert heads == ["reference\ndefault", "exudyn\nDOPRI5", "pymunk\ntuned"]
    legend = [text.get_text() for text in panel.texts[-2 * len(LOOKS) :]]
    assert legend == [word for name, (symbol, _) in LOOKS.items() for word in (symbol, name)]


def test_a_cell_of_the_matrix_tells_whose_run_it_is_and_why_its_verdict_fell(
    matrix: Figure,
) -> None:
    drawing = matrix.drawing
    boxes = [patch for patch in drawing.axes[0].patches if isinstance(patch, Rectangle)]
    lines = dict(zip(VERDICTS, marked(drawing), strict=True))
    assert lines["easy"].notes[1] == "easy, exudyn (DOPRI5): inaccurate. Theory: Ordinary numbers."
    assert "clear error (guard: joint apart at t = 0.0105 s). Theory: " in lines["ending"].notes[2]
    assert lines["endless"].notes[0].startswith("endless, reference (default): timed out (after 120 s).")
    for place, cell in enumerate(boxes[:3]):
        line = lines["easy"].artist
        assert isinstance(line, Line2D)
        assert tuple(np.asarray(line.get_data())[:, place]) == pytest.approx(
            (cell.get_center()[0], cell.get_center()[1])
        )
