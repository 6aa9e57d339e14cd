"""Samples within the steps of a contact run: the order of the interpolation, and runs that do not notice."""

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from engine_models.engine import RunSettings
from engine_models.reference_engine import ReferenceEngine
from engine_models.reference_model import mechanism_of
from engine_models.reference_runs import compliant_run
from engine_models.scene_library import CLEARANCE_SCENES
from reference_solver.contact_samples import within
from reference_solver.contact_stepper import ContactSolution
from reference_solver.equations import Equations
from reference_solver.solver import StepChoice
from studies.metrics import constraint_violation_m, energy_balance_residual_J, kinetic_energy_J
from tests.independent_clearance import integrate
from tests.test_contact_crank_slider import FINE, HORIZON_S, POSITION_M, short, solved

FloatArray = NDArray[np.float64]


def interpolation_errors(h: float) -> FloatArray:
    """Return the largest errors of q, q' and a sum within a converged step of q'' = -q - q'^3/10."""

    def slopes(*arguments: FloatArray) -> bool:
        _, _, _, q, v, a, rate, multipliers = arguments
        a[:], rate[:], multipliers[:] = -q - v**3 / 10, q[0] * v[0] ** 2, 7.0
        return True

    def flow(until: float) -> FloatArray:
        state, n = np.array([0.8, 0.5, 3.0]), 200
        for _ in range(n):

            def rate_of(y: FloatArray) -> FloatArray:
                return np.array([y[1], -y[0] - y[1] ** 3 / 10, y[0] * y[1] ** 2])

            k = until / n
            k1 = rate_of(state)
            k2 = rate_of(state + k / 2 * k1)
            k3 = rate_of(state + k / 2 * k2)
            state = state + k / 6 * (k1 + 2 * (k2 + k3) + rate_of(state + k * k3))
        return state

    times, samples = np.linspace(0, h, 9)[:-1], np.empty((8, 6))
    (q, v, total), (new_q, new_v, new_total) = flow(0.0), flow(h)
    phases = np.array([1.0, 0.3])
    begin, end = [[np.array([value]) for value in ends] for ends in ((q, v, total), (new_q, new_v))]
    work = np.array([new_total - total])
    taken = within(
        slopes,
        np.empty(0),
        phases,
        0.0,
        h,
        begin[0],
        begin[1],
        begin[2],
        end[0],
        end[1],
        work,
        times,
        0,
        samples,
    )
    assert taken == len(times)
    assert (samples[:, 3:] == [1.0, 0.3, 7.0]).all(), "phases and multipliers"
    return np.asarray(np.abs(samples[:, :3] - [flow(t) for t in times]).max(axis=0))


def test_positions_are_interpolated_at_order_six_velocities_and_sums_at_order_five() -> None:
    steps = [0.4, 0.2, 0.1]
    orders = np.polyfit(np.log(steps), np.log([interpolation_errors(h) for h in steps]), 1)[0]
    assert (orders > [5.5, 4.5, 4.5]).all(), f"{orders}"  # the next terms bend them by up to 0.3


@cache
def pair(name: str) -> tuple[ContactSolution, ContactSolution]:
    """Return a run with 30 samples, and the same run with 100 times as many."""
    scene, choice = short(name), FINE["driven" if "driven" in name else "free"]
    return solved(scene, choice, 30), solved(scene, choice, 3000)


@pytest.mark.parametrize("name", CLEARANCE_SCENES)
def test_a_run_takes_the_same_steps_whatever_its_samples(name: str) -> None:
    few, many = pair(name)
    assert few.steps == many.steps
    assert (few.events == many.events).all()
    assert (few.motion.q[-1] == many.motion.q[-1]).all()
    assert (few.motion.v[-1] == many.motion.v[-1]).all()
    # The same instants, written alike or through the last digit of the time.
    np.testing.assert_allclose(many.motion.q[::100], few.motion.q, rtol=1e-12, atol=1e-14)
    for key, sums in few.sums.items():
        assert sums[-1] == many.sums[key][-1]


@pytest.mark.parametrize("name", ["clearance-driven-0.5mm", "clearance-free-0.5mm"])
def test_dense_samples_agree_with_an_independent_integration(name: str) -> None:
    scene, (_, many) = short(name), pair(name)
    truth = integrate(scene, many.motion.time_s, 1e-12)
    off = np.abs(many.motion.q[:, -3] - truth.slider_position_m).max()
    assert off < POSITION_M, f"slider off by {off:.1e} m"


@pytest.mark.parametrize("name", CLEARANCE_SCENES)
def test_multipliers_and_contact_forces_of_samples_are_those_of_their_states(name: str) -> None:
    scene, (_, many) = short(name), pair(name)
    equations = Equations(mechanism_of(scene), many.motion.q[0])
    for k in range(7, 3000, 171):
        equations.phases = many.phases[k]
        expected = equations.accelerations(many.motion.time_s[k], many.motion.q[k], many.motion.v[k])[1]
        # Forces in contact magnify the round-off of coordinates (see test_contact_agreement).
        scale = 1 + np.abs(expected).max(initial=0.0)
        assert np.abs(many.motion.multipliers[k] - expected).max(initial=0.0) < 1e-9 * scale


def dense(name: str, step: float, per_contact: float, samples: int) -> FloatArray:
    """Return the residual of the ledger of a run at these rates, relative to the energy in play."""
    scene = short(name)
    rates = StepChoice(step, per_contact)
    run = compliant_run(scene, RunSettings(step, samples), rates, "projection")
    assert run.step_s == step
    assert constraint_violation_m(scene, run).max() < 1e-14
    return np.asarray(energy_balance_residual_J(scene, run) / kinetic_energy_J(scene, run).max())


@pytest.mark.parametrize("name", CLEARANCE_SCENES)
def test_the_ledger_closes_at_dense_samples(name: str) -> None:
    assert HORIZON_S[name] / 20_000 < 5e-6, "samples are denser than steps"
    residual = dense(name, 5e-6 if "driven" in name else 1e-5, 800, 20_000)
    assert np.abs(residual).max() < 1e-11, f"residual {np.abs(residual).max():.1e}"


def test_the_interpolation_adds_nothing_to_the_ledgers_residual_as_it_falls_at_order_four() -> None:
    rates, name, sizes = [(2e-5, 200), (1e-5, 400), (5e-6, 800)], "clearance-driven-0.5mm", []
    for step, per_contact in rates:
        few, many = (np.abs(dense(name, step, per_contact, count)).max() for count in (150, 9000))
        assert many < 1.5 * few, f"{many:.1e} at dense samples, {few:.1e} at few"
        sizes.append(many)
    order = np.polyfit(np.log([step for step, _ in rates]), np.log(sizes), 1)[0]
    assert abs(order - 4) < 0.5, f"order {order:.2f} of {sizes}"


def test_samples_denser_than_steps_no_longer_shorten_them() -> None:
    scene = short("clearance-driven-0.5mm")
    few, many = (ReferenceEngine().simulate(scene, RunSettings(1e-5, samples)) for samples in (300, 30_000))
    assert many.step_s == few.step_s == 1e-5
    assert many.steps == few.steps
    assert len(many.time_s) == 30_001


def test_the_plain_algorithm_takes_steps_of_exactly_the_length_asked_for() -> None:
    # 0.003 s in 30 samples of 1e-4 s: 1000 steps of 1e-7 s each, and not one more for rounding.
    scene, plain = short("clearance-driven-0.5mm"), ReferenceEngine(locate_events=False)
    run = plain.simulate(scene, RunSettings(1e-7, 30))
    assert run.steps == 30_000
    assert run.step_s == pytest.approx(1e-7, rel=1e-12)
