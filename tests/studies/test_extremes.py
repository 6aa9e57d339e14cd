"""The gallery of extremes: its theory, its verdicts, and what the reference makes of it."""

import pickle
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from engine_models.engine import RunSettings
from engine_models.engines import make_engine
from reports.analysis.verdicts import Verdict, answers, verdict_on
from reports.chapters.limits import CHAPTER, EXTREMES
from reports.parts import Finding, Table
from reports.plots.verdict_matrix import LOOKS
from reports.results import frame, read_study
from studies.extremes import checks
from studies.extremes import study as extremes
from studies.extremes.checks import nearly_ideal, settled
from studies.extremes.scenes import TURN_S, driven_loose
from studies.judges.converged_truth import converged
from studies.running.case import Case, Row
from studies.running.outcome import run_case
from studies.running.runner import run_study
from tests.helpers.row_files import read_rows, write_rows

CASES = {
    (case.scene.name, case.engine, case.arm.name, case.columns["guarded"]): case
    for case in extremes.cases(full=True)
}
QUICK = extremes.cases(full=False)
RIGHT: Row = {"relative_error": 1e-4, "unaccounted_energy_part": 1e-4, "constraint_relative": 1e-6}


def row(name: str, engine: str = "reference", arm: str = "default", guarded: bool = True) -> Row:
    return run_case(CASES[name, engine, arm, guarded])[0]


def judged(of: Mapping[str, object]) -> pd.Series:
    """Return a row as the report reads it."""
    return answers(frame([{"case": "0", "place": 0, **of}])).iloc[0]


def synthetic(wanted: str = "answer", **changes: object) -> pd.Series:
    bounds = {f"{name}_bound": bound for name, bound in extremes.RIGHT.items()}
    arm = {"scene": "s", "engine": "pymunk", "arm": "a", "label": "pymunk (a)", "step_s": 1e-3}
    head = {**arm, "status": "ok", "reason": "", "nonsense_factor": extremes.NONSENSE, "stop_s": 3e-3}
    numbers = RIGHT if changes.get("status", "ok") == "ok" else {}
    given = {**head, "wanted": wanted, **bounds, **numbers, **changes}
    return judged({name: value for name, value in given.items() if value is not None})


# The gallery


def test_the_gallery_has_sixty_cases_each_with_a_sentence_of_theory_and_a_check() -> None:
    gallery = extremes.gallery()
    assert len(gallery) >= 60, "a case has gone, or two have one name"
    for extreme in gallery.values():
        assert callable(extreme.check)
        assert extreme.theory.endswith("."), extreme.theory
        assert 20 < len(extreme.theory) < 130, f"{extreme.scene.name}: {len(extreme.theory)} characters"
        assert (extreme.wanted == "stop") == (extreme.stop_s is not None)


def test_every_extreme_case_meets_every_engine_within_limits() -> None:
    cases = extremes.cases(full=True)
    met = {(case.scene.name, case.arm) for case in cases if case.columns["guarded"]}
    assert len(met) == len(extremes.gallery()) * len(extremes.ARMS)
    quick = {case.scene.name for case in QUICK}
    assert len(QUICK) == len(quick) * len(extremes.ARMS) * 2, "with guards and without"
    assert all(case.limits for case in cases if not extremes.gallery()[case.scene.name].first)
    assert all(pickle.loads(pickle.dumps(case)) == case for case in cases)


def test_the_step_at_the_limit_is_the_same_for_all() -> None:
    for name in ("step at the limit", "step beyond the limit"):
        steps = {case.run.step_s for case in QUICK if case.scene.name == name}
        assert steps == {extremes.gallery()[name].step_s}


# Checks


def test_a_pin_that_has_settled_is_judged_by_a_revolution_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(checks, "converged", cache(converged))  # the truth of both is found once
    scene = driven_loose("settled", (40 + 1 / 3) * TURN_S, 2e-5)
    run = make_engine("reference", method="dop853").simulate(scene, RunSettings(scene.end_time_s, 2))
    (error,) = settled(scene, run).values()
    assert error < extremes.RIGHT["relative_error"], f"{error:.1e}"
    contact = replace(run.contacts["B"], gap_m=run.contacts["B"].gap_m * 1.5)
    (error,) = settled(scene, replace(run, contacts={"B": contact})).values()
    assert error == pytest.approx(0.5, rel=0.1), "in parts of the largest distance from the centre"


def test_next_to_no_clearance_is_judged_as_an_ideal_joint() -> None:
    scene = driven_loose("tight", 5e-4, 1e-9)
    run = make_engine("reference").simulate(scene, RunSettings(1e-6, 20))
    (error,) = nearly_ideal(scene, run).values()
    assert error < extremes.RIGHT["relative_error"], f"{error:.1e}"


# Verdicts


@pytest.mark.parametrize(
    ("changes", "verdict"),
    [
        ({}, Verdict.RIGHT),
        ({"relative_error": 2e-3}, Verdict.INACCURATE),
        ({"relative_error": 5e-3}, Verdict.INACCURATE),
        ({"relative_error": 5e-2}, Verdict.WRONG),
        ({"unaccounted_energy_part": 2e-2}, Verdict.INACCURATE),
        ({"unaccounted_energy_part": 0.2}, Verdict.WRONG),
        ({"constraint_relative": 0.02}, Verdict.WRONG),
        ({"relative_error": None}, Verdict.WRONG),
        ({"unaccounted_energy_part": None}, Verdict.WRONG),
        ({"wanted": "refusal"}, Verdict.WRONG),
        ({"unaccounted_energy_part": 0.2, "quality_failure": "energy off at t = 0.1 s"}, Verdict.NOTICED),
        ({"relative_error": None, "quality_failure": "energy off at t = 0.1 s"}, Verdict.NOTICED),
        ({"quality_failure": ""}, Verdict.RIGHT),
        ({"status": "unsupported", "reason": "no"}, Verdict.REFUSED),
        ({"status": "failed", "reason": "overflow at t = 1.2e-05 s"}, Verdict.FAILED),
        ({"status": "failed", "reason": "initial positions: expected g = 0"}, Verdict.FAILED),
        ({"status": "failed", "reason": "something went wrong"}, Verdict.FAILED_OBSCURELY),
        ({"status": "timed out", "reason": "not finished"}, Verdict.TIMED_OUT),
        ({"status": "out of memory", "reason": "no memory"}, Verdict.OUT_OF_MEMORY),
        ({"status": "crashed", "reason": "killed by SIGABRT"}, Verdict.CRASHED),
    ],
)
def test_the_verdict_follows_from_status_numbers_and_bounds(
    changes: dict[str, object], verdict: Verdict
) -> None:
    answer = synthetic(**changes)  # type: ignore[arg-type]
    assert answer["verdict"] is verdict
    assert verdict_on(answer) is verdict


@pytest.mark.parametrize(
    ("wanted", "changes", "asked"),
    [
        ("answer", {}, True),
        ("answer", {"status": "failed", "reason": "at t = 0.003 s"}, False),
        ("answer or word", {"status": "failed", "reason": "at t = 0.003 s"}, True),
        ("answer or word", {"relative_error": 0.1}, False),
        ("answer or word", {"quality_failure": "energy off at t = 0.1 s"}, True),
        ("answer", {"quality_failure": "energy off at t = 0.1 s"}, False),
        ("refusal", {"quality_failure": "energy off at t = 0.1 s"}, True),
        ("stop", {"quality_failure": "energy off at t = 0.003 s"}, True),
        ("refusal", {"status": "unsupported"}, True),
        ("answer or word", {"status": "unsupported"}, True),
        ("answer", {"status": "unsupported"}, False),
        ("stop", {"status": "failed", "reason": "rank 8 at t = 0.003 s"}, True),
        ("stop", {"status": "failed", "reason": "rank 8 at t = 0.009 s"}, False),
        ("stop", {}, True),
    ],
)
def test_what_theory_asks_for_depends_on_the_case(
    wanted: str, changes: dict[str, object], asked: bool
) -> None:
    assert synthetic(wanted, **changes)["as_wanted"] == asked


def lightness(colour: str) -> float:
    """Return how light a colour is to the eye, CIE L* from 0 to 100."""
    linear = [((int(colour[k : k + 2], 16) / 255 + 0.055) / 1.055) ** 2.4 for k in (1, 3, 5)]
    luminance = 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
    return float(116 * luminance ** (1 / 3) - 16)


def test_the_worse_the_verdict_the_darker_its_colour() -> None:
    shades = [lightness(LOOKS[verdict][1]) for verdict in Verdict]
    steps = -np.diff(shades)
    assert len({symbol for symbol, _ in LOOKS.values()}) == len(LOOKS)
    assert steps.min() > 5, f"lightness {np.round(shades, 1)} in the order of the verdicts"


# Guards


GUARDED = {"status": "failed", "reason": "constraints lost at t = 0.1 s", "guarded": True}
BARE = {"guarded": False, "finite": True, "penetration_part": 3.0, "penetration_m": 0.03}


def pair(guarded: Mapping[str, object], bare: Mapping[str, object]) -> pd.Series:
    """Return what the report makes of a run and of the same one without guards."""
    bounds = {f"{name}_bound": bound for name, bound in extremes.RIGHT.items()}
    arm = {"scene": "s", "engine": "pymunk", "arm": "a", "label": "l", "step_s": 1e-3, "place": 0}
    head = {**arm, "nonsense_factor": extremes.NONSENSE, "wanted": "answer", **bounds, **RIGHT}
    rows = [{**head, "case": k, **row} for k, row in (("0", guarded), ("1", bare))]
    (answer,) = [row for _, row in answers(frame(rows)).iterrows()]
    return answer


def test_a_guard_is_what_spoke_where_the_same_run_without_guards_comes_out_otherwise() -> None:
    success = {"status": "ok", "reason": "", "unaccounted_energy_part": 0.5, "judged": "height", **BARE}
    answer = pair(GUARDED, success)
    assert (answer["told_by"], answer["unguarded"]) == ("guard", Verdict.WRONG)
    assert answer["came"] == "success, with a pin 30 mm beyond the wall of its bearing"

    own = pair(GUARDED, {**GUARDED, "guarded": False})
    assert (own["told_by"], own["unguarded"], own["came"]) == ("engine", None, "")


@pytest.mark.parametrize(
    ("bare", "words"),
    [
        ({"finite": False}, "numbers that are not finite"),
        ({"penetration_part": 0.5, "ideal_gap_part": 0.2, "ideal_gap_m": 0.01}, "a joint or the guide 10 mm"),
        (
            {"penetration_part": 0.5, "relative_error": 0.0, "unaccounted_energy_part": 0.5},
            "energy off by 0.5 of that in play",
        ),
        ({"penetration_part": 0.5}, "height off by 4"),
    ],
)
def test_what_came_without_guards_is_told_by_its_worst(bare: dict[str, object], words: str) -> None:
    success = {"status": "ok", "reason": "", "relative_error": 4.0, "judged": "height", **BARE}
    assert words in pair(GUARDED, {**success, **bare})["came"]


def test_guards_change_no_run_that_they_do_not_end() -> None:
    for engine, arm in (("reference", "default"), ("pymunk", "tuned"), ("exudyn", "default")):
        with_guards, without = (row("everyday linear law", engine, arm, on) for on in (True, False))
        assert {**with_guards, "guarded": False} == without


def test_pymunk_without_guards_reports_a_pin_outside_its_bearing_as_a_success() -> None:
    name = "step at the limit"
    assert "pin through the wall" in str(row(name, "pymunk", "tuned")["reason"])
    bare = row(name, "pymunk", "tuned", guarded=False)
    assert bare["status"] == "ok"
    assert isinstance(part := bare["penetration_part"], float)
    assert part > 1, f"outside by {part:.3g} radii"


def test_an_engine_takes_a_joint_that_is_open_where_no_guard_looks_at_the_start() -> None:
    name = "joint A open by 1 mm"
    assert "start: ideal joints" in str(row(name, "exudyn")["reason"])
    assert row(name, "exudyn", guarded=False)["status"] == "ok"


# The reference


@pytest.mark.parametrize("name", ["step at the limit", "step beyond the limit"])
def test_at_the_step_of_all_the_reference_is_off_by_less_than_two_bounds(name: str) -> None:
    measured = row(name)
    assert judged(measured)["verdict"] is Verdict.INACCURATE
    assert isinstance(error := measured["relative_error"], float)
    assert error < 2 * extremes.RIGHT["relative_error"], f"{error:.2e}; 1.5e-3 and 1.8e-3 were measured"


@pytest.mark.parametrize(
    "name",
    [name for name, extreme in extremes.gallery().items() if not (extreme.long or extreme.group == "step")],
)
def test_the_reference_does_what_theory_asks(name: str) -> None:
    measured = row(name)
    answer = judged(measured)
    assert answer["as_wanted"], f"{answer['verdict'].value}: {measured}"


@pytest.mark.parametrize("name", ["slider × 1e6, long step", "step beyond the limit"])
def test_nonsense_of_the_reference_is_a_row_in_which_it_says_so(name: str) -> None:
    """RK4 at a step too long for the scene gains half of its energy and more, and holds itself to it."""
    measured = row(name, arm="plain RK4")
    assert measured["status"] == "failed"
    assert "the energy at t = " in str(measured["reason"])
    assert judged(measured)["verdict"] is Verdict.FAILED


def test_the_reference_tells_rank_time_and_joints_of_a_singularity() -> None:
    reason = str(row("L = r through the fold")["reason"])
    assert "rank 8 of 9 at t = 0.003 s, those of O, A, B, guide depend on each other" in reason


def test_plain_rk4_says_when_a_step_was_too_long_for_a_wall() -> None:
    reason = str(row("stiffness 1e14", arm="plain RK4")["reason"])
    assert reason.startswith("non-finite state at t = 0.01")
    assert reason.endswith("shorten the step")


@pytest.mark.parametrize("name", ["rod inertia 0", "L = r, start in the fold", "L = 0.8 r, driven"])
def test_what_is_no_scene_no_engine_gets_to_see(name: str) -> None:
    reasons = {str(row(name, engine)["reason"]) for engine, arm in (("reference", ""), ("exudyn", ""))}
    assert len(reasons) == 1
    assert reasons.pop().startswith("no such scene: rod.")


def test_a_number_that_is_not_finite_never_gets_a_good_verdict() -> None:
    case = CASES["everyday driven (c = 0)", "reference", "default", True]
    measured, _ = run_case(case)
    for name in extremes.RIGHT:
        assert judged({k: v for k, v in measured.items() if k != name})["verdict"] is Verdict.WRONG


# The chapter

TINY = (
    "everyday driven (c = 0)",
    "rod inertia 0",
    "L = r through the fold",
    "joint A open by 1 mm",
    "stiffness 1e14",
)


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Real results of a few cases, and a row of each way to be ended."""
    folder = tmp_path_factory.mktemp("results")
    cases: list[Case] = [replace(case, limits=None) for case in QUICK if case.scene.name in TINY]
    run_study("extremes", cases, folder / "extremes", lambda: ThreadPoolExecutor(1))
    rows = folder / "extremes/rows.jsonl"
    lines = read_rows(rows)
    for line, status in zip(lines, ("crashed", "timed out", "out of memory"), strict=False):
        head = {name: value for name, value in line.items() if name not in extremes.RIGHT}
        ended = {
            "case": status,
            "scene": f"the engine {status}",
            "status": status,
            "reason": "ended",
            "place": 99,
            "guarded": True,
        }
        lines.append(head | ended)
    write_rows(rows, lines)
    return folder


def findings(results: Path) -> dict[str, Finding]:
    return {each.name: each for each in CHAPTER.findings({EXTREMES: read_study(results / "extremes")})}


def test_the_chapter_shows_every_case_with_its_verdict(results: Path) -> None:
    study = read_study(results / "extremes")
    tables: dict[str, Table] = {table.name: table for table in CHAPTER.tables({EXTREMES: study}) if table}
    rows = answers(study.rows)
    listed = tables["extremes-verdicts"].rows
    assert len(listed) == len(rows) == len(TINY) * len(extremes.ARMS) + 3
    assert len(tables["extremes-guards"].rows) == (rows["told_by"] == "guard").sum() > 0
    for (_, row), cells in zip(rows.iterrows(), listed, strict=True):
        assert cells[:3] == (row["scene"], row["engine"], row["arm"])
        assert cells[4] == row["verdict"].value
    (figure,) = CHAPTER.figures({EXTREMES: study})
    assert figure
    assert figure.name == "extremes-matrix"


def test_what_is_said_of_checks_follows_the_rows(results: Path, tmp_path: Path) -> None:
    ended, failed, success, left = (number.value for number in findings(results)["checks"].numbers)
    rows = read_rows(results / "extremes/rows.jsonl")
    for row in rows:
        if row["engine"] == "exudyn" and row["guarded"] is False and row["status"] == "ok":
            row |= {"status": "failed", "reason": "Exudyn failed at t = 0 s"}
    (tmp_path / "extremes").mkdir()
    write_rows(tmp_path / "extremes/rows.jsonl", rows)
    changed = findings(tmp_path)
    assert [number.value for number in changed["checks"].numbers] == [ended, failed, success - 1, left]
    assert "exudyn (default) in 0 of" in changed["wrong-results"]
    assert "exudyn (default) in 1 of" in findings(results)["wrong-results"]
