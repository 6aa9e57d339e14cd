"""Singular positions: runs that pass one are right, or are refused; and every run is held to its energy."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from reference_solver.energy import Scales, check_energy, ledger_J
from reference_solver.failures import EnergyNotConserved, LimitPosition
from reference_solver.mechanism.constraints import PrescribedMotion
from reference_solver.mechanism.data import GROUND, Body, ConstantSpeed, Pin
from reference_solver.mechanism.mechanism import Mechanism, light
from reference_solver.solver import ErrorControl, StepChoice
from tests.helpers.kernels import CASES, straight_guide
from tests.helpers.mechanism_energy import energy_residual_J
from tests.helpers.singular import PASSING, STABILISED, parallelograms, random_runs
from tests.solver.pins import run

#: Two parallelograms and more take half a minute to compile.
SEVERAL = ("A02 N=2", "A02 N=5")
SOONER = [pytest.param(name, marks=pytest.mark.accuracy if name in SEVERAL else ()) for name in PASSING]


@pytest.mark.parametrize("name", SOONER)
def test_runs_at_random_steps_and_tolerances_are_right_or_refused(name: str) -> None:
    for stabilisation in STABILISED.values():
        tally = random_runs(PASSING[name](), stabilisation, 12, seed=1)
        assert (tally.right, tally.refused, tally.wrong) == (12, [], [])
    tally = random_runs(PASSING[name](), "none", 12, seed=1)
    assert tally.wrong == []
    assert tally.refused, "drift is amplified at most steps"
    if name != "A02 N=5":
        tally = random_runs(PASSING[name](), "projection", 12, seed=1, controlled=True)
        assert tally.wrong == []
        # Below 1e-10 round-off, amplified, may be more than the tolerance.
        assert tally.right >= 6


def test_the_step_that_made_the_parallelograms_energy_grow_six_hundredfold_conserves_it() -> None:
    passing = parallelograms(1)
    found = run(passing.mechanism, passing.q, passing.v, 10.0, 9931, 1)
    # 20.5 J, of which RK4 loses a part of 1e-9; a stage was 1e-6 rad from the singular position.
    assert np.abs(energy_residual_J(found)).max() < 1e-7
    assert 1e4 < found.condition < 1e9


@pytest.mark.parametrize("place", [0.5, 1.0], ids=["middle", "end"])
def test_a_stage_close_to_a_singular_position_is_stepped_around(place: float) -> None:
    passing = parallelograms(1)
    when = brentq(lambda t: float(passing.angle(np.array([t]))[0]), 0.1, 1.0, xtol=1e-13)
    # A stage of step 69 is a ten-thousandth of a step from it: there rounding is amplified by 1e12.
    step = StepChoice(when / (69 + place + 1e-4))
    found = run(passing.mechanism, passing.q, passing.v, step.longest_s * 97, step, 97)
    error = np.abs(found.q[:, 2] - passing.angle(found.time_s)).max()
    assert error < passing.allowed(step, "projection") / 10
    assert found.condition < 1e7


def test_the_ledger_has_all_lines_and_a_run_that_gains_a_thousandth_is_refused() -> None:
    mechanism, q, v, h = CASES["ideal-torque"]()
    found = run(mechanism, q, v, 1000 * h, 1000, 50)
    lines = ledger_J(found).sum(axis=0) - found.sums["removed"]
    np.testing.assert_allclose(lines, energy_residual_J(found), rtol=0, atol=1e-12)
    scales = Scales(0.12, 100.0)
    check_energy(found, scales, h)
    gained = replace(found, v=found.v * np.linspace(1.0, 1.001, 51)[:, None])
    with pytest.raises(EnergyNotConserved, match=r"does not add up by .* where the steps explain"):
        check_energy(gained, scales, h)


@pytest.mark.parametrize("step", [500, ErrorControl(1e-8)], ids=["rk4", "dop853"])
def test_a_drive_that_cannot_go_on_is_told_with_the_time_of_its_limit(step: int | ErrorControl) -> None:
    # A crank of 0.2 m at 2 rad/s, held by a rod of 0.1 m to a line through its centre: sin phi <= 1/2.
    joints = (
        Pin(GROUND, (0.0, 0.0), 0, (0.0, 0.0)),
        Pin(0, (0.2, 0.0), 1, (0.0, 0.0)),
        Pin(1, (0.1, 0.0), 2, (0.0, 0.0)),
        *straight_guide(2, (0.0, 0.0), 0.0),
    )
    driven = Mechanism((Body(1.0, 0.01),) * 3, (*joints, PrescribedMotion(0, ConstantSpeed(2.0))))
    q = np.array([0.0, 0.0, 0.0, 0.2, 0.0, 0.0, 0.3, 0.0, 0.0])
    v = np.array([0.0, 0.0, 2.0, 0.0, 0.4, -4.0, 0.0, 0.0, 0.0])
    with pytest.raises(LimitPosition, match=r"limit position of its mechanism at t = 0\.261799\d* s"):
        run(driven, q, v, 0.5, step, 50)  # pi/12 s is 0.26179939 s


def test_a_body_too_light_for_the_arithmetic_is_named() -> None:
    bodies = Body(3.0, 1.0), Body(1e-12, 1e-12, "coupler")
    assert light(bodies) == (
        "expected bodies of at least 3e-11 kg beside one of 3 kg, got coupler of 1e-12 kg: "
        "what moves it is lost in rounding"
    )
    assert light((bodies[0], Body(1e-9, 1e-9))) is None
