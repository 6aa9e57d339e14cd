"""Samples within the steps of a contact run: the order of the interpolation, and runs that do not notice."""

from functools import cache

import numpy as np
import pytest
from numba import njit
from numpy.typing import NDArray

from engine_models.engine import RunSettings
from engine_models.mechanics.equations import mechanism_of
from engine_models.reference.engine import ReferenceEngine
from engine_models.reference.run import reference_run
from engine_models.scene.library import CLEARANCE_SCENES
from reference_solver.compiled.store import callee, compiled
from reference_solver.contact import loop as contact_loop
from reference_solver.contact.types import CONTACT_RECORD, DONE, new_run
from reference_solver.equations import Equations
from reference_solver.methods import RK4, tableau
from reference_solver.solution import Solution
from reference_solver.solver import StepChoice
from studies.judges.metrics import constraint_violation_m, energy_balance_residual_J, kinetic_energy_J
from tests.helpers.crank_sliders import FINE, HORIZON_S, POSITION_M, in_minimal_coordinates, short, solved

FloatArray = NDArray[np.float64]


@njit
def rate_of(y):  # type: ignore[no-untyped-def]
    """q'' = -q - q'^3/10, and the sum of q q'^2."""
    return np.array([y[1], -y[0] - y[1] ** 3 / 10, y[0] * y[1] ** 2])


@njit
def flow(y, until):  # type: ignore[no-untyped-def]
    """Return the state after a time, by 200 steps of RK4."""
    k = until / 200
    for _ in range(200):
        k1 = rate_of(y)
        k2 = rate_of(y + k / 2 * k1)
        k3 = rate_of(y + k / 2 * k2)
        y = y + k / 6 * (k1 + 2 * (k2 + k3) + rate_of(y + k * k3))
    return y


@njit
def step(p, contacts, t, h, old, new):  # type: ignore[no-untyped-def]  # noqa: ARG001
    """A step of the loop that has converged; its sum is that of the step alone."""
    y = flow(np.array([old.y[0], old.y[1], 0.0]), h)
    new.y[0], new.y[1], new.y[2] = y[0], y[1], y[2]
    return 1.0


@njit
def slopes(p, contacts, t, row, rate, y, slopes):  # type: ignore[no-untyped-def]  # noqa: ARG001
    """The rates at a state."""
    rates = rate_of(y)
    slopes[row, 0], slopes[row, 1], slopes[row, 2] = rates[0], rates[1], rates[2]
    return 1.0


@njit
def forces(p, contacts, t, y, row, samples):  # type: ignore[no-untyped-def]  # noqa: ARG001
    """A multiplier."""
    samples[row, 3] = 7.0
    return 1.0


@njit
def gaps(p, contacts, t, motion):  # type: ignore[no-untyped-def]  # noqa: ARG001
    """There is no contact."""
    return True


@njit
def mobilities(p, y, row, out):  # type: ignore[no-untyped-def]  # noqa: ARG001
    """There is no contact."""
    return True


def interpolation_errors(h: float) -> FloatArray:
    """Return the largest errors of q, q' and a sum within a converged step of the loop."""
    start, times = np.array([0.8, 0.5, 3.0]), np.linspace(0, h, 9)[1:-1]
    run = new_run(np.zeros(0, CONTACT_RECORD), (1, 1, 1), times, contact_loop.ROWS, 1)
    run.old.y[:], (now,) = start, run.clock
    now["longest"] = now["end"] = h
    now["located"] = now["budget"] = 1
    functions = zip((step, slopes, forces, gaps, mobilities), contact_loop.KERNEL, strict=True)
    kernel = contact_loop.Kernel(*(callee(function, kind) for function, kind in functions))
    loop = compiled(contact_loop.advance, contact_loop.ADVANCE)
    assert loop(run._replace(kernel=kernel, p=np.zeros(0), method=tableau(RK4))) == DONE
    assert now["steps"] == 1
    assert (run.records.samples[:, 3] == 7.0).all()
    found = run.records.samples[:, :3]
    return np.asarray(np.abs(found - [flow(start, t) for t in times]).max(axis=0))


def test_positions_are_interpolated_at_order_six_velocities_and_sums_at_order_five() -> None:
    steps = [0.4, 0.2, 0.1]
    orders = np.polyfit(np.log(steps), np.log([interpolation_errors(h) for h in steps]), 1)[0]
    assert (orders > [5.5, 4.5, 4.5]).all(), f"{orders}"  # the next terms bend them by up to 0.3


@cache
def pair(name: str) -> tuple[Solution, Solution]:
    """Return a run with 30 samples, and the same run with 100 times as many."""
    scene, choice = short(name), FINE["driven" if "driven" in name else "free"]
    return solved(scene, choice, 30), solved(scene, choice, 3000)


@pytest.mark.parametrize("name", CLEARANCE_SCENES)
def test_a_run_takes_the_same_steps_whatever_its_samples(name: str) -> None:
    few, many = pair(name)
    assert few.steps == many.steps
    assert (few.events == many.events).all()
    assert (few.q[-1] == many.q[-1]).all()
    assert (few.v[-1] == many.v[-1]).all()
    # The same instants, written alike or through the last digit of the time.
    np.testing.assert_allclose(many.q[::100], few.q, rtol=1e-12, atol=1e-14)
    for key, sums in few.sums.items():
        assert sums[-1] == many.sums[key][-1]


@pytest.mark.parametrize("name", ["clearance-driven-0.5mm", "clearance-free-0.5mm"])
def test_dense_samples_agree_with_an_independent_integration(name: str) -> None:
    scene, (_, many) = short(name), pair(name)
    truth = in_minimal_coordinates(scene, len(many.time_s) - 1)
    off = np.abs(many.q[:, -3] - truth.position[:, -1, 0]).max()
    assert off < POSITION_M, f"slider off by {off:.1e} m"


@pytest.mark.parametrize("name", CLEARANCE_SCENES)
def test_multipliers_and_contact_forces_of_samples_are_those_of_their_states(name: str) -> None:
    scene, (_, many) = short(name), pair(name)
    equations = Equations(mechanism_of(scene), many.q[0])
    for k in range(7, 3000, 171):
        answer = equations.required(many.time_s[k], many.q[k], many.v[k], many.phases[k])
        expected, contacts = answer.multipliers, range(len(mechanism_of(scene).contacts))
        # Forces in contact magnify the round-off of coordinates (see test_contact_agreement).
        scale = 1 + np.abs(expected).max(initial=0.0)
        assert np.abs(many.multipliers[k] - expected).max(initial=0.0) < 1e-9 * scale
        normal = [answer.powers[f"normal{c}"] for c in contacts]
        np.testing.assert_allclose(many.normal_force_N[k], normal, rtol=1e-9, atol=1e-9 * scale)
        np.testing.assert_allclose(many.friction_force_N[k], answer.friction_N, rtol=1e-9, atol=1e-9 * scale)


def dense(name: str, step: float, per_contact: float, samples: int) -> FloatArray:
    """Return the residual of the ledger of a run at these rates, relative to the energy in play."""
    scene = short(name)
    rates = StepChoice(step, per_contact)
    run = reference_run(scene, RunSettings(step, samples), rates, "projection", compiled=True)
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
