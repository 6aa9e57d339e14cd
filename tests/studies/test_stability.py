"""The stability study: its cells, theory's first impact, and verdicts that keep their bounds."""

from dataclasses import replace
from math import sqrt

import numpy as np
import pytest

from engine_models.arms import NATIVE_CONTACT
from engine_models.engine import FloatArray, Trajectory
from engine_models.engines import make_engine
from engine_models.mechanics.contact_law import stiffness_of
from reports.stability import VERDICTS as SHOWN
from studies import stability
from studies.case import Case, Value
from studies.stability import ERROR, GAIN, LOSS, VIOLATION, first_impact


def the_case(engine: str, arm: str, step_s: float, factor: float = 1.0) -> Case:
    """Return the one case of the full set with a part of steel's stiffness and this step."""
    (match,) = [
        case
        for case in stability.cases(full=True)
        if (case.engine, case.arm.name) == (engine, arm)
        and case.scene.name == f"stability-stiffness-{factor:g}"
        and step_s == pytest.approx(case.run.step_s)
    ]
    return match


def test_the_quick_set_has_each_engines_best_method_and_the_report_its_verdicts() -> None:
    quick = stability.cases(full=False)
    best = {("reference", "DOP853"), ("exudyn", "DOPRI5"), ("pymunk", "as the scene")}
    assert best < {(case.engine, case.arm.name) for case in quick}
    assert SHOWN == stability.VERDICTS


def test_a_hertz_bounce_has_the_limit_of_0_702_and_0_496_of_its_duration() -> None:
    # Stiff: far above any gravity or inertia force while in contact: the closed form of the free bounce.
    scene = the_case("reference", "located", 1e-5, 1000.0).plain_scene
    energy, frequency = first_impact(scene)
    clearance, slider = scene.clearance.B, scene.crank_slider()[2]
    assert clearance is not None
    speed = sqrt(2 * energy / slider.mass_kg)
    depth = (5 * slider.mass_kg * speed**2 / (4 * stiffness_of(clearance))) ** 0.4
    duration = 2.94327518 * depth / speed
    assert 2 * sqrt(2) / frequency == pytest.approx(0.702 * duration, rel=1e-3)
    assert 2 / frequency == pytest.approx(0.496 * duration, rel=2e-3)


# Verdicts


GOOD = dict.fromkeys((ERROR, VIOLATION, GAIN, LOSS), 0.0)


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        (ERROR, 0.009, stability.ACCURATE),
        (ERROR, 0.011, stability.INACCURATE),
        (VIOLATION, 0.011, stability.INACCURATE),
        (VIOLATION, 1.1, stability.DIVERGED),
        (LOSS, 0.051, stability.INACCURATE),
        (GAIN, 0.049, stability.ACCURATE),
        (GAIN, 0.051, stability.GROWING),
        (GAIN, 11.0, stability.DIVERGED),
        (LOSS, 11.0, stability.DIVERGED),
        (ERROR, np.nan, stability.DIVERGED),
        (GAIN, np.inf, stability.DIVERGED),
    ],
)
def test_a_bound_exceeded_decides_the_verdict(name: str, value: float, expected: str) -> None:
    assert stability.verdict_of({**GOOD, name: value})[0] == expected


@pytest.fixture(scope="module")
def bounce() -> tuple[Case, Trajectory]:
    case = the_case("reference", "located", 1e-5)
    return case, make_engine("reference").simulate(case.scene, case.run)


def judged(case: Case, run: Trajectory, true: Trajectory) -> dict[str, Value]:
    energy, _ = first_impact(case.plain_scene)
    return stability.judged(case.plain_scene, run, true, len(true.time_s), energy)


def test_a_trajectory_is_judged_by_its_own_numbers(bounce: tuple[Case, Trajectory]) -> None:
    case, run = bounce
    assert judged(case, run, run)["verdict"] == stability.ACCURATE

    grown = replace(run, velocity=run.velocity * np.linspace(1.0, 1.1, len(run.time_s))[:, None, None])
    assert judged(case, grown, run)["verdict"] in (stability.GROWING, stability.DIVERGED)

    def moved(body: int, axis: int, by_m: float) -> FloatArray:
        position = run.position.copy()
        position[:, body, axis] += by_m
        return np.asarray(position)

    off = judged(case, replace(run, position=moved(2, 0, 1e-5)), run)
    assert (off["verdict"], off["verdict_reason"]) == (stability.INACCURATE, "slider off by 0.02 clearances")
    assert judged(case, replace(run, position=moved(2, 1, 1e-3)), run)["verdict"] == stability.DIVERGED
    assert judged(case, replace(run, position=moved(2, 1, 1e-4)), run)["verdict"] == stability.INACCURATE


def test_what_an_engine_refuses_or_fails_at_has_a_verdict() -> None:
    case = the_case("pymunk", "as the scene", 1e-5)
    fields = {"clearance.B.law": "kelvin-voigt", "clearance.B.damping_N_s_m": 10.0}
    row, _ = stability.measure(replace(case, scene=case.plain_scene.replace(fields), arm=NATIVE_CONTACT))
    assert (row["status"], row["verdict"]) == ("unsupported", "refused")

    case = the_case("reference", "plain", 1e-4, 1000.0)
    row, _ = stability.measure(case)
    assert (row["status"], row["verdict"]) == ("failed", "diverged")


def test_positions_are_compared_through_the_first_impacts_only(bounce: tuple[Case, Trajectory]) -> None:
    _, run = bounce
    contact, count = run.contacts["B"], stability.COMPARED_IMPACTS + 2
    times = np.linspace(0.0, run.time_s[-1], count + 1)[1:]

    def touching(times_s: FloatArray) -> Trajectory:
        impacts = replace(contact.impacts, time_s=times_s)
        return replace(run, contacts={"B": replace(contact, impacts=impacts)})

    until = stability.before_chaos(touching(times))
    assert run.time_s[until - 1] < times[-2] <= run.time_s[until]
    assert stability.before_chaos(touching(np.empty(0))) == len(run.time_s)
