"""Singular positions: runs that pass one are right, or are refused; and every run is held to its energy."""

from dataclasses import replace
from functools import partial
from itertools import product

import numpy as np
import pytest
from scipy.optimize import brentq

from engine_models.mechanics.start import start_state
from engine_models.reference.solution import mechanism_of
from engine_models.scene.library import IDEAL_SCENES
from reference_solver import energy as guard
from reference_solver.energy import Guard, ledger_J
from reference_solver.factorisation import Factors
from reference_solver.failures import EnergyNotConserved, LimitPosition, SingularConfiguration
from reference_solver.mechanism.constraints import PrescribedMotion
from reference_solver.mechanism.data import GROUND, Body, ConstantSpeed, Pin
from reference_solver.mechanism.mechanism import Mechanism, light
from reference_solver.mechanism.scales import Scales
from reference_solver.solver import ErrorControl, StepChoice, solve
from tests.helpers.kernels import CASES, VARIANTS, straight_guide
from tests.helpers.mechanism_energy import energy_residual_J
from tests.helpers.singular import PASSING, STABILISED, parallelograms, random_runs

#: Two parallelograms and more take half a minute to compile.
SEVERAL = ("A02 N=2", "A02 N=5")
SOONER = [pytest.param(name, marks=pytest.mark.accuracy if name in SEVERAL else ()) for name in PASSING]


@pytest.mark.parametrize("stabilisation", STABILISED)
@pytest.mark.parametrize("name", SOONER)
def test_stabilised_runs_at_random_steps_are_right_and_none_is_refused(name: str, stabilisation: str) -> None:
    tally = random_runs(PASSING[name](), STABILISED[stabilisation], 12, seed=1)
    assert (tally.right, tally.refused, tally.wrong) == (12, [], [])


@pytest.mark.parametrize("name", SOONER)
def test_plain_runs_at_random_steps_are_right_or_refused(name: str) -> None:
    tally = random_runs(PASSING[name](), "none", 12, seed=1)
    assert tally.wrong == []
    assert tally.refused, "drift is amplified at most steps"


@pytest.mark.parametrize("name", [case for case in SOONER if case.values != ("A02 N=5",)])
def test_error_control_at_random_tolerances_is_right_or_refused(name: str) -> None:
    tally = random_runs(PASSING[name](), "projection", 12, seed=1, controlled=True)
    assert tally.wrong == []
    # Below 1e-10 round-off, amplified, may be more than the tolerance.
    assert tally.right >= 6


def test_the_step_that_made_the_parallelograms_energy_grow_six_hundredfold_conserves_it() -> None:
    passing = parallelograms(1)
    run = solve(passing.mechanism, passing.q, passing.v, end_time_s=10.0, samples=1, step=10 / 9931)
    # 20.5 J, of which RK4 loses a part of 1e-9; a stage was 1e-6 rad from the singular position.
    assert np.abs(energy_residual_J(run)).max() < 1e-7
    assert 1e4 < run.condition < 1e9


@pytest.mark.parametrize("place", [0.5, 1.0], ids=["middle", "end"])
def test_a_stage_close_to_a_singular_position_is_stepped_around(place: float) -> None:
    passing, end = parallelograms(1), 1.0
    when = brentq(lambda t: float(passing.angle(np.array([t]))[0]), 0.1, end, xtol=1e-13)
    # A stage of step 69 is a ten-thousandth of a step from it: there rounding is amplified by 1e12.
    step = when / (69 + place + 1e-4)
    q, v, close = passing.q, passing.v, step * 97
    run = solve(passing.mechanism, q, v, end_time_s=close, samples=97, step=step)
    error = np.abs(run.q[:, 2] - passing.angle(run.time_s)).max()
    assert error < passing.allowed(StepChoice(step), "projection") / 10
    assert run.condition < 1e7


def test_a_start_in_a_singular_position_is_refused_by_its_rank() -> None:
    passing = parallelograms(1)
    q = np.array([0.5, 0, 0, 1.5, 0, 0, 1.5, 0, 0.0])
    with pytest.raises(SingularConfiguration, match="rank 7 of 8"):
        solve(passing.mechanism, q, np.zeros(9), end_time_s=1.0, samples=1, step=1e-2)


def test_a_light_link_is_badly_conditioned_all_the_time_and_steps_as_others_do() -> None:
    mechanism, q, v, h = CASES["ideal-free"]()
    light = replace(mechanism, bodies=(mechanism.bodies[0], Body(1e-7, 1e-11), mechanism.bodies[2]))
    run = solve(light, q, v, end_time_s=1000 * h, samples=1, step=h)
    assert run.steps == 1000
    assert run.condition > 1e4


def test_the_condition_is_that_of_the_pivots() -> None:
    random = np.random.default_rng(0)
    mass, B = np.diag(random.uniform(0.5, 2.0, 9)), random.normal(size=(6, 9))
    matrix = B @ np.linalg.inv(mass) @ B.T  # dense: rows are eliminated in their order, as by Cholesky
    pivots = np.diag(np.linalg.cholesky(matrix)) ** 2
    assert Factors(mass, B).condition == pytest.approx(1 + np.sum(np.diag(matrix) / pivots), rel=1e-9)


def test_orthogonal_constraints_are_as_well_conditioned_however_they_are_eliminated() -> None:
    for size in (1.0, 3.0):  # with a coordinate each, or after all of them
        assert Factors(np.eye(3), size * np.eye(3)).condition == pytest.approx(4, rel=1e-15)


@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("name", IDEAL_SCENES)
def test_the_energy_guard_has_a_margin_of_ten_on_coarse_and_fine_steps(
    name: str, variant: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for bound in ("MARGIN", "ROUND_OFF", "MOVED"):
        monkeypatch.setattr(guard, bound, getattr(guard, bound) / 10)
    scene = IDEAL_SCENES[name]()
    (q, v), mechanism, end = start_state(scene), mechanism_of(scene), scene.end_time_s
    solver = partial(solve, mechanism, q.ravel(), v.ravel(), stabilisation=VARIANTS[variant])
    for steps, samples in product((100, 300, 1000, 10_000), (1, 20)):
        solver(end_time_s=end, samples=samples, step=end / steps)


def test_the_ledger_has_all_lines_and_a_run_that_gains_a_thousandth_is_refused() -> None:
    mechanism, q, v, h = CASES["ideal-torque"]()
    run = solve(mechanism, q, v, end_time_s=1000 * h, samples=50, step=h)
    lines = ledger_J(run).sum(axis=0) - run.stabilisation_loss_J
    np.testing.assert_allclose(lines, energy_residual_J(run), rtol=0, atol=1e-12)
    scales = Scales(0.12, 100.0)
    Guard(run, scales, h).check_energy()
    gained = replace(run, v=run.v * np.linspace(1.0, 1.001, 51)[:, None])
    with pytest.raises(EnergyNotConserved, match=r"does not add up by .* where the steps explain"):
        Guard(gained, scales, h).check_energy()


@pytest.mark.parametrize("step", [1e-3, ErrorControl(1e-8)], ids=["rk4", "dop853"])
def test_a_drive_that_cannot_go_on_is_told_with_the_time_of_its_limit(step: float | ErrorControl) -> None:
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
        solve(driven, q, v, end_time_s=0.5, samples=50, step=step)  # pi/12 s is 0.26179939 s


def test_a_body_too_light_for_the_arithmetic_is_named() -> None:
    bodies = Body(3.0, 1.0), Body(1e-12, 1e-12, "coupler")
    assert light(bodies) == (
        "expected bodies of at least 3e-11 kg beside one of 3 kg, got coupler of 1e-12 kg: "
        "what moves it is lost in rounding"
    )
    assert light((bodies[0], Body(1e-9, 1e-9))) is None
