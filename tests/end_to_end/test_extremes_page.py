"""The extreme cases on rows with round numbers: every verdict, count and finding worked out here."""

from typing import Any

import pytest

from reports.chapters.limits import CHAPTER, EXTREMES
from reports.parts import Studies, Table
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
HEAD = {
    "relative_error_bound": 1e-3,
    "unaccounted_energy_part_bound": 0.01,
    "constraint_relative_bound": 2e-3,
    "nonsense_factor": 10.0,
    "end_time_s": 0.1,
}


def numbers(error: float, energy: float, constraint: float, **columns: Any) -> dict[str, Any]:
    """Return what a run says that reports success."""
    judged = {"relative_error": error, "unaccounted_energy_part": energy, "constraint_relative": constraint}
    return {**judged, "judged": "height", **columns}


def ended(status: str, reason: str) -> dict[str, Any]:
    return {"status": status, "reason": reason}


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
#: Verdicts, case by case in the arms' order; how many of each arm's are what theory asks for.
VERDICTS = {
    "easy": ("right", "inaccurate", "inaccurate"),
    "no motion": ("clear error", "wrong, no error", "refused"),
    "ending": ("clear error", "clear error", "clear error"),
    "absurd": ("right", "unclear error", "wrong, found by a check"),
    "endless": ("timed out", "crashed", "out of memory"),
}
AS_ASKED = ("4", "0", "3")
ORDER = (
    *("right", "refused", "clear error", "wrong, found by a check", "inaccurate", "unclear error"),
    *("timed out", "out of memory", "crashed", "wrong, no error"),
)
WORDS = {
    "answer": "the motion",
    "refusal": "a refusal",
    "stop": "an error at the right time, or the smooth branch",
    "answer or word": "the motion, or an error that names step or numbers",
}


@pytest.fixture(scope="module")
def studies(tmp_path_factory: pytest.TempPathFactory) -> Studies:
    """Rows of the three arms, in no order."""
    rows: list[dict[str, Any]] = []
    for place, (case, (group, theory, wanted, stop_s)) in enumerate(CASES.items()):
        head = {"place": place, "group": group, "theory": theory, "wanted": wanted, "stop_s": stop_s, **HEAD}
        for arm, said in zip(ARMS, SAID[case], strict=True):
            rows.append(row(len(rows), case, *arm, 1e-3, **{**head, **said}))
    return {EXTREMES: results_of(tmp_path_factory.mktemp("results") / EXTREMES, rows[::-1], {})}


def table(studies: Studies, name: str) -> Table:
    return next(one for one in CHAPTER.tables(studies) if one and one.name == f"extremes-{name}")


def test_the_finding_tells_who_is_wrong_without_an_error(studies: Studies) -> None:
    """Exudyn returns a motion where there is none; what a check finds is no error that nobody is told of."""
    (wrong,) = CHAPTER.findings(studies)
    assert wrong == (
        "Results wrong by over 10 times a bound, or given where no motion exists, without an error: exudyn "
        "(DOPRI5) in 1 of 5, reference (default) in 0 of 5 and pymunk (tuned) in 0 of 5 extreme cases."
    )


def test_every_run_has_its_verdict_with_the_numbers_it_rests_on(studies: Studies) -> None:
    shown, wrong = table(studies, "verdicts"), table(studies, "wrong")
    assert shown.head == wrong.head
    assert shown.head == (
        *("scene", "engine", "configuration", "longest step [s]", "asked for", "verdict"),
        *("error", "energy", "constraints", "error of", "reason", "theory"),
    )
    assert shown.reading == (
        "Right: error up to 0.001 of the motion, energy 0.01 of that in play, gaps 0.002 of the crank's "
        "length."
    )
    expected = []
    for case, (_, theory, wanted, _) in CASES.items():
        for arm, verdict, said in zip(ARMS, VERDICTS[case], SAID[case], strict=True):
            known = [said.get(f"{name.removesuffix('_bound')}") for name in list(HEAD)[:3]]
            cells = ["–" if number is None else f"{number:.1e}" for number in known]
            why = said.get("reason") or said.get("quality_failure", "–")
            more = (said.get("judged", "–"), why, theory)
            expected.append((case, *arm, "1.0e-03", WORDS[wanted], verdict, *cells, *more))
    assert list(shown.rows) == expected
    assert list(wrong.rows) == [
        cells for cells in expected if cells[5] not in ("right", "refused", "clear error")
    ]
    assert (shown.shown, wrong.shown) == (False, True)


def test_verdicts_are_counted_by_configuration(studies: Studies) -> None:
    shown = table(studies, "counts")
    assert shown.shown
    assert shown.head == ("configuration", "cases", *ORDER, "as theory asks")
    expected = []
    for k, (engine, arm) in enumerate(ARMS):
        own = [verdicts[k] for verdicts in VERDICTS.values()]
        counts = [str(own.count(name)) for name in ORDER]
        expected.append((f"{engine} ({arm})", "5", *counts, AS_ASKED[k]))
    assert list(shown.rows) == expected
