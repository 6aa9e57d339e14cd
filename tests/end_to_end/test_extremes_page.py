"""The gallery of extremes on rows with round numbers: every verdict, cell and sentence worked out here."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from matplotlib.colors import to_hex, to_rgba
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from reports.chapters import extremes
from reports.chapters.answer.trust import breaks
from reports.chapters.headlines import hard
from reports.parts import Section, Table
from reports.plots.series import marked
from reports.results import Results
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
    "no motion": ("failed clearly", "wrong", "refused"),
    "ending": ("failed clearly", "failed clearly", "failed clearly"),
    "absurd": ("right", "failed obscurely", "wrong, noticed"),
    "endless": ("timed out", "crashed", "out of memory"),
}
WANTED = {"easy": "+--", "no motion": "+-+", "ending": "+-+", "absurd": "+-+", "endless": "---"}
LOOKS = {
    "right": ("✓", "#f4f8fb"),
    "refused": ("⊘", "#cfe3f1"),
    "failed clearly": ("F", "#a2c8e4"),
    "wrong, noticed": ("N", "#7fb2d6"),
    "inaccurate": ("≈", "#d98d2b"),
    "failed obscurely": ("f", "#d27328"),
    "timed out": ("T", "#b0502a"),
    "out of memory": ("M", "#8f2f26"),
    "crashed": ("C", "#631a2b"),
    "wrong": ("✗", "#20122e"),
}


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Results:
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
    return results_of(tmp_path_factory.mktemp("results") / "extremes", rows[::-1], {})


@pytest.fixture(scope="module")
def sections(results: Results) -> dict[str, Section]:
    return {section.name: section for section in extremes.sections(results)}


def test_an_arm_breaks_where_it_goes_wrong_without_guards_and_not_where_its_model_refuses(
    results: Results,
) -> None:
    """Pymunk does what theory asks in 3 cases, in 1 without guards; then a run of Exudyn is its model's."""
    studies = {"extremes": results}
    assert breaks(studies, "reference", "reference (default)") == "against theory in 1 of 5 hard cases"
    assert breaks(studies, "pymunk", "pymunk (tuned)") == "against theory in 4 of 5 hard cases"
    assert breaks(studies, "exudyn", "exudyn (DOPRI5)") == "against theory in 5 of 5 hard cases"
    rows = results.rows.assign(spoken_by=None)
    rows.loc[rows["reason"] == "something broke", "spoken_by"] = "adapter"
    altered = replace(results, rows=rows)
    assert breaks({"extremes": altered}, "exudyn", "exudyn (DOPRI5)") == "against theory in 4 of 4 hard cases"
    text = next(section for section in extremes.sections(altered) if section.name == "gallery").text
    assert "exudyn (DOPRI5) does what theory asks in 0 of 4 cases." in text
    assert "Cases that our model of exudyn (DOPRI5) does not express: 1." in text
    assert any("does what theory asks in 0 of 4 hard cases" in told for told in hard(altered))


def table(sections: dict[str, Section], name: str) -> Table:
    found = (one for section in sections.values() for one in section.tables)
    return next(one for one in found if one.name == f"extremes-{name}")


def test_every_run_has_its_verdict_with_the_numbers_it_rests_on(sections: dict[str, Section]) -> None:
    shown = table(sections, "verdicts")
    head = (
        "case",
        "engine",
        "arm",
        "longest step [s]",
        "verdict",
        "error",
        "of what",
        "energy",
        "constraints",
    )
    assert shown.head == (*head, "told by", "reason")
    assert "right is below 0.001." in shown.reading
    assert "right below 0.01;" in shown.reading
    assert "right below 0.002." in shown.reading
    assert "Beyond 10 times one of these" in shown.reading
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


def test_verdicts_are_counted_by_engine(sections: dict[str, Section]) -> None:
    shown = table(sections, "counts")
    asked = ("by our model", "as theory asks", "by guards", "as theory asks without them")
    assert shown.head == ("engine", "arm", "cases", *LOOKS, *asked)
    # Without guards Pymunk goes on past the end, and returns half of its energy unnoticed.
    by_guards = {"reference": ("4", "0", "4"), "exudyn": ("0", "0", "0"), "pymunk": ("3", "2", "1")}
    expected = []
    for k, (engine, arm) in enumerate(ARMS):
        own = [verdicts[k] for verdicts in VERDICTS.values()]
        counts = [str(own.count(name)) for name in LOOKS]
        expected.append((engine, arm, "5", *counts, "0", *by_guards[engine]))
    assert list(shown.rows) == expected


def test_the_sentences_tell_who_does_what_theory_asks(sections: dict[str, Section]) -> None:
    assert sections["gallery"].text == (
        "15 runs of 5 cases all ended in a verdict. None that counts as right or inaccurate leaves more than "
        "5.0×10⁻² of the energy in play unaccounted for, or opens a joint by more than 3.0×10⁻³ of the "
        "crank's length.",
        "Contained: reference (default) timed out on endless; exudyn (DOPRI5) crashed on endless; pymunk "
        "(tuned) out "
        "of memory on endless.",
        "reference (default) does what theory asks in 4 of 5 cases.",
        "exudyn (DOPRI5) does what theory asks in 0 of 5 cases.",
        "exudyn (DOPRI5) returns a wrong result as a success in: no motion.",
        "pymunk (tuned) does what theory asks in 3 of 5 cases.",
        "Without our guards pymunk (tuned) would in 1.",
        "pymunk (tuned) returns a wrong result that the check notices in: absurd.",
        "The reference stops with a reason in: no motion; ending.",
    )


def test_guards_stand_beside_what_comes_without_them(sections: dict[str, Section]) -> None:
    shown = table(sections, "guards")
    assert shown.head == ("case", "engine", "arm", "the guard", "verdict", "what came")
    apart, off = "a joint or the guide 12 mm apart", "energy off by 5.0×10⁻¹ of that in play"
    assert shown.rows == (
        ("ending", "pymunk", "tuned", "joint apart at t = 0.0105 s", "wrong", f"success, with {apart}"),
        ("absurd", "pymunk", "tuned", "energy is off by half", "wrong", f"success, with {off}"),
    )
    assert sections["guards"].text == (
        "Of the runs of pymunk (tuned) guards end or fail 2. Without them it reports success in 2.",
    )


def test_what_theory_expects_is_told_of_every_case(sections: dict[str, Section]) -> None:
    shown = table(sections, "expectations")
    assert shown.head == ("group", "case", "asked for", "theory")
    words = {"answer": "the motion", "refusal": "a refusal", "stop": "a stop in time, or the smooth branch"}
    words["answer or word"] = "the motion, or word that step or numbers are none to run with"
    assert list(shown.rows) == [
        (group, case, words[wanted], theory) for case, (group, theory, wanted, _) in CASES.items()
    ]


def test_the_matrix_has_every_verdict_in_its_cell_and_a_frame_where_theory_asks_for_it(
    sections: dict[str, Section],
) -> None:
    (figure,) = sections["gallery"].figures
    assert figure.name == "extremes-matrix"
    (panel,) = figure.drawing.axes
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
            bare = {("ending", 2): "wrong", ("absurd", 2): "wrong"}.get((case, column))
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
    sections: dict[str, Section],
) -> None:
    (figure,) = sections["gallery"].figures
    boxes = [patch for patch in figure.drawing.axes[0].patches if isinstance(patch, Rectangle)]
    lines = dict(zip(VERDICTS, marked(figure.drawing), strict=True))
    assert lines["easy"].notes[1] == "easy, exudyn (DOPRI5): inaccurate"
    assert lines["ending"].notes[2].endswith("failed clearly (guard: joint apart at t = 0.0105 s)")
    assert lines["endless"].notes[0] == "endless, reference (default): timed out (after 120 s)"
    for place, cell in enumerate(boxes[:3]):
        line = lines["easy"].artist
        assert isinstance(line, Line2D)
        assert tuple(np.asarray(line.get_data())[:, place]) == pytest.approx(
            (cell.get_center()[0], cell.get_center()[1])
        )
