"""The gallery of extremes: its theory, its verdicts, and what the reference makes of it."""

import math
import pickle
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.special import lambertw

from reports.chapters.extremes.matrix import LOOKS
from reports.chapters.extremes.verdict import Verdict, answers, verdict_on
from reports.page import write_report
from reports.results import frame, read_results
from studies.extremes import study as extremes
from studies.extremes.scenes import CLEARANCE_M, GRAVITY_M_S2, WHEEL, wheel
from studies.extremes.truth import dropped_wheel
from studies.running.case import Case, Row
from studies.running.outcome import run_case
from studies.running.runner import run_study
from tests.helpers.row_files import read_rows, write_rows

CASES = {(case.scene.name, case.engine, case.arm.name): case for case in extremes.cases(full=False)}
RIGHT: Row = {"relative_error": 1e-4, "energy_relative": 1e-4, "constraint_relative": 1e-6}


def row(name: str, engine: str = "reference", arm: str = "default") -> Row:
    return run_case(CASES[name, engine, arm])[0]


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


def test_the_gallery_has_fifty_cases_each_with_a_sentence_of_theory_and_a_check() -> None:
    gallery = extremes.gallery()
    assert len(gallery) >= 50, "a case has gone, or two have one name"
    for extreme in gallery.values():
        assert callable(extreme.check)
        assert extreme.theory.endswith("."), extreme.theory
        assert 20 < len(extreme.theory) < 130, f"{extreme.scene.name}: {len(extreme.theory)} characters"
        assert (extreme.wanted == "stop") == (extreme.stop_s is not None)


def test_every_extreme_case_meets_every_engine_within_limits() -> None:
    cases = extremes.cases(full=True)
    assert len(cases) == len(extremes.gallery()) * len(extremes.ARMS)
    assert all(case.limits for case in cases if not extremes.gallery()[case.scene.name].first)
    assert all(pickle.loads(pickle.dumps(case)) == case for case in cases)


# Theory against theory


@pytest.mark.parametrize("e", [0.0, 0.5, 0.9])
def test_the_dropped_wheel_rebounds_as_lamberts_function_says(e: float) -> None:
    # Weight during the contact is no part of that formula: at this stiffness it is 1e-4 of the force.
    scene = wheel("w", 0.02, law="lankarani-nikravesh", restitution=e, stiffness=1e13)
    touch, a = math.sqrt(2 * CLEARANCE_M / GRAVITY_M_S2), 3 * (1 - e**2) / 4
    time = np.array([0.0, touch + 1e-3, touch + 2e-3])
    _, low, high = dropped_wheel(scene, time)
    speed = (high - low) / 1e-3 + GRAVITY_M_S2 * (time[1:].mean() - touch)
    expected = (1 + lambertw(-(1 + a) * math.exp(-(1 + a))).real) / a
    measured = speed / (GRAVITY_M_S2 * touch)
    assert measured == pytest.approx(expected, rel=5e-3), f"e_out = {measured:.5f}"


def test_a_rigid_ball_comes_to_rest_when_the_sum_of_its_bounces_says() -> None:
    touch = math.sqrt(2 * CLEARANCE_M / GRAVITY_M_S2)
    scene = wheel("w", 0.04, law="rigid", stiffness=None, restitution=0.5)
    before, after = dropped_wheel(scene, np.array([0.0, 2.9 * touch, 3.001 * touch, 0.04]))[1:3]
    assert before > -CLEARANCE_M * (1 - 1e-6)
    assert after == -CLEARANCE_M


def test_hertzs_contact_lasts_as_long_as_its_closed_form() -> None:
    stiffness, touch = 1e10, math.sqrt(2 * CLEARANCE_M / GRAVITY_M_S2)
    speed = GRAVITY_M_S2 * touch
    deepest = (5 * WHEEL.mass_kg * speed**2 / (4 * stiffness)) ** 0.4
    ends = touch + 2.94327518 * deepest / speed
    time = np.array([0.0, touch + 0.5 * (ends - touch), ends + 1e-4])
    _, bottom, above = dropped_wheel(wheel("w", 0.02, stiffness=stiffness), np.append(time, 0.02))[:3]
    assert -CLEARANCE_M - bottom == pytest.approx(deepest, rel=0.01)
    assert above + CLEARANCE_M == pytest.approx(speed * 1e-4, rel=0.03)


# Verdicts


@pytest.mark.parametrize(
    ("changes", "verdict"),
    [
        ({}, Verdict.RIGHT),
        ({"relative_error": 2e-3}, Verdict.INACCURATE),
        ({"relative_error": 5.0}, Verdict.INACCURATE),
        ({"energy_relative": 2e-2}, Verdict.INACCURATE),
        ({"energy_relative": 0.2}, Verdict.NONSENSE),
        ({"constraint_relative": 0.02}, Verdict.NONSENSE),
        ({"relative_error": None}, Verdict.NONSENSE),
        ({"energy_relative": None}, Verdict.NONSENSE),
        ({"wanted": "refusal"}, Verdict.NONSENSE),
        ({"energy_relative": 0.2, "quality_failure": "energy off at t = 0.1 s"}, Verdict.NOTICED),
        ({"relative_error": None, "quality_failure": "energy off at t = 0.1 s"}, Verdict.NOTICED),
        ({"quality_failure": ""}, Verdict.RIGHT),
        ({"status": "unsupported", "reason": "no"}, Verdict.REFUSED),
        ({"status": "failed", "reason": "overflow at t = 1.2e-05 s"}, Verdict.FAILED),
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


# The reference


@pytest.mark.parametrize("name", [name for name, extreme in extremes.gallery().items() if not extreme.long])
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


def test_the_reference_tells_rank_time_and_configuration_of_a_singularity() -> None:
    reason = str(row("L = r through the fold")["reason"])
    assert "rank 8 of 9 rows at t = 0.003 s, q = [" in reason
    assert reason.count("1.5708") == 2, "crank and rod stand upright, folded on each other"


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
    case = CASES["everyday driven (c = 0)", "reference", "default"]
    measured, _ = run_case(case)
    for name in extremes.RIGHT:
        assert judged({k: v for k, v in measured.items() if k != name})["verdict"] is Verdict.NONSENSE


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
    cases: list[Case] = [replace(case, limits=None) for case in CASES.values() if case.scene.name in TINY]
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
        }
        lines.append(head | ended)
    write_rows(rows, lines)
    return folder


def test_the_chapter_shows_every_case_with_its_verdict(results: Path, tmp_path: Path) -> None:
    write_report(results, tmp_path / "report")
    assert (tmp_path / "report/figures/extremes-matrix.svg").exists()
    rows = answers(read_results(results / "extremes"))
    listed = (tmp_path / "report/tables/extremes-verdicts.csv").read_text("utf-8").splitlines()[1:]
    assert len(listed) == len(rows) == len(TINY) * len(extremes.ARMS) + 3
    for _, row in rows.iterrows():
        begin = f"{row['scene']},{row['engine']},{row['arm']},"
        assert any(begin in line.replace('"', "") and row["verdict"].value in line for line in listed)
    page = (tmp_path / "report/index.html").read_text("utf-8")
    assert "Contained: " in page
    assert "pymunk (tuned) does what theory asks in" in page
