"""Crank-sliders without clearance: order, accuracy and drift, the ledger of energy, and the last digits."""

from dataclasses import replace
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from engine_models.engine import RunSettings, Trajectory
from engine_models.mechanics.assembly import start_state
from engine_models.mechanics.equations import mechanism_of
from engine_models.reference.engine import ReferenceEngine
from engine_models.scene.library import IDEAL_SCENES
from engine_models.scene.scene import Scene
from reference_solver import methods
from reference_solver.contact.types import CLIPPED, CONTACT
from reference_solver.equations import Equations
from reference_solver.mechanism.contact_laws import ContactLaw
from reference_solver.mechanism.mechanism import (
    GROUND,
    Body,
    ClearanceJoint,
    Mechanism,
    RevoluteJoint,
    SpringDamper,
    Torque,
)
from studies.judges.converged_truth import converged
from studies.judges.metrics import (
    constraint_violation_m,
    energy_balance_residual_J,
    errors,
    kinetic_energy_J,
    signals,
    uncertainties,
)
from tests.helpers.kernels import CASES
from tests.studies.truth.closed_forms.crank_slider import exact

FloatArray = NDArray[np.float64]
SAMPLES = 200
EPS = float(np.finfo(float).eps)
VARIANTS = ("none", "baumgarte", "projection")
#: Steps per sample, each with its half: the finest are 400 times as far from the truth as round-off.
LADDERS = {"ideal-free": (32, 48, 64), "ideal-driven": (2, 3, 4), "ideal-torque": (12, 16, 24)}
#: The error of RK4 is a h^4 + b h^5 + O(h^6), so 32 times that of half a step less that of the step itself is
#: a h^4 + O(h^6): its slope is 4 up to a term in h^2, measured as 0.004. Round-off on these steps adds to the
#: slope 1/400 over the octave, 0.004, and twice that on another processor's would not show.
ORDER_TOLERANCE = 0.02
#: Projected, a driven crank-slider is a function of time alone and has nothing to err in but round-off.
WITHOUT_ERROR = ("ideal-driven", "projection")
CONVERGING = [(name, variant) for name in LADDERS for variant in VARIANTS if (name, variant) != WITHOUT_ERROR]
#: Its errors in units of the truth's own uncertainty, which is 4 units in the last place; 7 are measured.
ROUND_OFF = 40


def engine(variant: str, **settings: Any) -> ReferenceEngine:
    return ReferenceEngine(stabilisation=variant, **settings)  # type: ignore[arg-type]


@cache
def run(
    name: str, variant: str, steps_per_sample: int, end_time_s: float | None = None
) -> tuple[Scene, Trajectory]:
    scene = IDEAL_SCENES[name]()
    scene = scene.model_copy(update={"end_time_s": end_time_s or scene.end_time_s})
    step = scene.end_time_s / (SAMPLES * steps_per_sample)
    return scene, engine(variant).simulate(scene, RunSettings(step_s=step, samples=SAMPLES))


def leading_errors(name: str, variant: str, steps_per_sample: int) -> dict[str, float]:
    """Return the largest 32 e(h/2) - e(h) of every signal."""
    scene, coarse = run(name, variant, steps_per_sample)
    _, fine = run(name, variant, 2 * steps_per_sample)
    found = {}
    for (signal, of_h), (_, of_half), (_, true) in zip(
        signals(scene, coarse), signals(scene, fine), signals(scene, exact(scene, SAMPLES)), strict=True
    ):
        error = 32 * (of_half - true) - (of_h - true)
        found[signal] = float(np.linalg.norm(error.reshape(len(error), -1), axis=1).max())
    return found


@pytest.mark.parametrize(("name", "variant"), CONVERGING)
def test_every_signal_converges_at_order_four(name: str, variant: str) -> None:
    ladder = LADDERS[name]
    found = [leading_errors(name, variant, count) for count in ladder]
    for signal in found[0]:
        leading = [errors[signal] for errors in found]
        order = -np.polyfit(np.log(ladder), np.log(leading), 1)[0]
        assert abs(order - 4) < ORDER_TOLERANCE, f"{signal}: order {order:.4f} of {leading}"


@pytest.mark.parametrize("steps_per_sample", LADDERS["ideal-driven"])
def test_the_projection_leaves_a_driven_mechanism_round_off_at_any_step(steps_per_sample: int) -> None:
    scene, trajectory = run(*WITHOUT_ERROR, steps_per_sample)
    truth, repeats = converged(scene, SAMPLES)
    floor = uncertainties(scene, truth, list(repeats)).values()
    for (signal, error), unit in zip(errors(scene, trajectory, truth).items(), floor, strict=True):
        assert error.max() < ROUND_OFF * unit, f"{signal}: {error.max():.1e} of {unit:.1e}"


def test_the_projected_free_run_at_1e_5_meets_the_stated_accuracy() -> None:
    scene, trajectory = run("ideal-free", "projection", 500)
    assert trajectory.step_s == pytest.approx(1e-5, rel=1e-12)
    truth = exact(scene, SAMPLES)
    found = errors(scene, trajectory, truth)
    at_end = found["slider_position_error_m"][-1]
    assert at_end < 1e-11, f"slider off by {at_end:.2e} m at 1 s"
    for (signal, value), error in zip(signals(scene, truth), found.values(), strict=True):
        if signal.endswith("_N"):
            relative = error.max() / np.abs(value).max()
            assert relative < 1e-7, f"{signal}: {relative:.2e}"


@cache
def drift(variant: str) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return times and the running largest |g| and |g'| of a free run of 3 s at h = 2.5e-4 s."""
    scene, found = run("ideal-free", variant, 60, 3.0)
    states = zip(found.time_s, found.position.reshape(-1, 9), found.velocity.reshape(-1, 9), strict=True)
    equations, g, g_rate = Equations(mechanism_of(scene), found.position[0].ravel()), [], []
    for t, q, v in states:
        g.append(np.abs(equations.violation(t, q)).max())
        g_rate.append(np.abs(equations.constraint_matrix(q) @ v - equations.C).max())
    return found.time_s, np.maximum.accumulate(g), np.maximum.accumulate(g_rate)


def growth(time: FloatArray, values: FloatArray) -> float:
    """Return the power of t at which values grow over the last nine tenths."""
    late = slice(len(time) // 10, None)
    return float(np.polyfit(np.log(time[late]), np.log(values[late]), 1)[0])


def test_the_papers_own_algorithm_drifts_linearly_in_speed_and_quadratically_in_position() -> None:
    time, g, g_rate = drift("none")
    # The oscillation within a revolution (1/30 of the span) moves the fitted powers by less than 0.1.
    assert abs(growth(time, g_rate) - 1) < 0.1, f"|g'| grows as t^{growth(time, g_rate):.3f}"
    assert abs(growth(time, g) - 2) < 0.1, f"|g| grows as t^{growth(time, g):.3f}"


def test_baumgarte_bounds_the_drift_and_projection_removes_it() -> None:
    _, g_none, _ = drift("none")
    time, g, g_rate = drift("baumgarte")
    assert growth(time, g) < 0.1, f"|g| grows as t^{growth(time, g):.3f}"
    assert g[-1] < 1e-3 * g_none[-1], f"{g[-1]:.2e} against {g_none[-1]:.2e} m"
    _, g, g_rate = drift("projection")
    assert g[-1] < 1e-14, f"|g| = {g[-1]:.2e} m"  # one Newton step squares a violation near 1e-10
    assert g_rate[-1] < 1e-13, f"|g'| = {g_rate[-1]:.2e} m/s"  # round-off of a few m/s


@pytest.mark.parametrize("name", LADDERS)
def test_energy_and_joints_hold_to_round_off_at_a_fine_step(name: str) -> None:
    scene, trajectory = run(name, "projection", 1024)
    residual = np.abs(energy_balance_residual_J(scene, trajectory)).max()
    # The sums of the steps are compensated: the energy keeps some units in the last place. The driver's work
    # is a plain sum, which walks at random by up to one with every step. Truncation is below both.
    expected = 50 * EPS * kinetic_energy_J(scene, trajectory).max()
    if trajectory.driver_work_J is not None:
        expected += 2 * np.sqrt(trajectory.steps) * EPS * np.abs(trajectory.driver_work_J).max()
    assert residual < expected, f"{residual:.2e} J, {expected:.2e} J expected"
    assert constraint_violation_m(scene, trajectory).max() < 1e-15


def exactly_solved(matrix: FloatArray, right: FloatArray) -> FloatArray:
    """Return x with matrix times x equal to the right-hand side, found without rounding."""
    rows = [[Fraction(x) for x in row] for row in np.column_stack([matrix, right]).tolist()]
    for k in range(len(rows)):
        at = next(i for i in range(k, len(rows)) if rows[i][k])
        rows[k], rows[at] = rows[at], rows[k]
        rows[k] = [x / rows[k][k] for x in rows[k]]
        for i, row in enumerate(rows):
            if i != k and row[k]:
                rows[i] = [x - row[k] * y for x, y in zip(row, rows[k], strict=True)]
    return np.array([float(row[-1]) for row in rows])


@pytest.mark.parametrize("lighter", [1.0, 1e-6, 1e-12])
@pytest.mark.parametrize("body", range(3))
def test_accelerations_and_multipliers_solve_their_equations_to_the_last_digits(
    body: int, lighter: float
) -> None:
    """Of light links too; states that violate the constraints are as good. Measured: 3e-13 at most."""
    scene, random = IDEAL_SCENES["ideal-free"](), np.random.default_rng(body)
    bodies, q_start = [*mechanism_of(scene).bodies], start_state(scene)[0].ravel()
    bodies[body] = Body(lighter * bodies[body].mass_kg, lighter * bodies[body].inertia_kg_m2)
    equations = Equations(replace(mechanism_of(scene), bodies=tuple(bodies)), q_start)
    for _ in range(10):
        q = q_start + random.normal(size=9) * np.tile([1e-3, 1e-3, 0.3], 3)
        v = random.normal(size=9) * np.tile([5.0, 5.0, 50.0], 3)
        B, F = equations.constraint_matrix(q), np.asarray(equations.applied_force(0.0, q, v), dtype=float)
        matrix = np.block([[np.diag(equations.mass.astype(float)), -B.T], [B, np.zeros((8, 8))]])
        true = exactly_solved(matrix, np.concatenate([F, -equations.centripetal(q, v)]))
        for found, part in zip(equations.accelerations(0.0, q, v), (true[:9], true[9:]), strict=True):
            assert np.abs(found - part).max() <= 1e-12 * np.abs(part).max()


# The energy that a stabilisation removes


def energy(mechanism: Mechanism, q: FloatArray, v: FloatArray) -> Any:
    """Return kinetic, gravitational and elastic energy less the torques' work, a ``np.longdouble``."""
    q, v, total = q.astype(np.longdouble), v.astype(np.longdouble), np.longdouble(0)

    def place(body: int, point: tuple[float, float]) -> NDArray[np.longdouble]:
        if body < 0:
            return np.array(point, dtype=np.longdouble)
        x, y, phi = q[3 * body : 3 * body + 3]
        (a, b), cos, sin = point, np.cos(phi), np.sin(phi)
        return np.array([x + cos * a - sin * b, y + sin * a + cos * b])

    for k, body in enumerate(mechanism.bodies):
        x_rate, y_rate, turning = v[3 * k : 3 * k + 3]
        total += (body.mass_kg * (x_rate**2 + y_rate**2) + body.inertia_kg_m2 * turning**2) / 2
        total += body.mass_kg * mechanism.gravity_m_s2 * q[3 * k + 1]
    for load in mechanism.loads:
        if isinstance(load, Torque):
            total -= load.torque_N_m * q[3 * load.body + 2]
        if isinstance(load, SpringDamper):
            reach = place(load.body_j, load.point_j) - place(load.body_i, load.point_i)
            total += load.stiffness_N_m * (np.sqrt(reach @ reach) - load.free_length_m) ** 2 / 2
    for joint in mechanism.contacts:
        law, reach = joint.compliance, place(joint.body_j, joint.point_j) - place(joint.body_i, joint.point_i)
        depth = max(np.sqrt(reach @ reach) - joint.radial_clearance_m, np.longdouble(0))
        total += law.stiffness * depth ** (law.exponent + 1) / (law.exponent + 1)
    return total


@pytest.mark.parametrize("case", CASES)
def test_what_projections_remove_is_the_energy_before_less_that_after(case: str) -> None:
    mechanism, q, v, h = CASES[case]()
    equations, counted, removed = Equations(mechanism, q), 0.0, np.longdouble(0)
    h = 1e-3 if case != "ideal-driven" else h  # coarse, so that there is something to remove
    for number in range(30):
        found = methods.step(methods.RK4, equations.answer, None, number * h, q, v, h)
        before = energy(mechanism, found.q, found.v)
        moved_q, moved_v, added, ok = equations.project((number + 1) * h, found.q, found.v)
        assert ok
        removed, counted = removed + before - energy(mechanism, moved_q, moved_v), counted + added
        q, v = moved_q, moved_v
    # Neglected: the stiffness of springs times the square of the moves.
    assert counted == pytest.approx(float(removed), rel=1e-4), f"{counted} J against {removed} J"


@pytest.mark.parametrize("phase", [CONTACT, CLIPPED])
def test_moving_springs_and_contacts_is_counted_with_their_elastic_energy(phase: float) -> None:
    """A loaded double pendulum, its pin deep in a wall, is moved onto its joints from 1e-6 m beside."""
    joints = (RevoluteJoint(GROUND, (0.0, 0.0), 0, (-0.5, 0.0)), RevoluteJoint(0, (0.5, 0.0), 1, (-0.4, 0.1)))
    pin = ClearanceJoint(GROUND, (1.5, 0.2), 1, (0.3, -0.1), 0.1, 0.5, ContactLaw(1e3, 1.5, 0.5))
    loads = Torque(1, 3.0), SpringDamper(GROUND, (0.5, 0.7), 1, (0.1, 0.2), 300.0, 2.0, 0.3)
    mechanism = Mechanism((Body(1.0, 0.1), Body(2.0, 0.3)), joints, loads, 9.81, (pin,))
    q, v = np.array([0.5, 0.0, 0.0, 1.4, -0.1, 0.0]), np.zeros(6)
    equations, random = Equations(mechanism, q), np.random.default_rng(5)
    q, v = q + random.uniform(-1e-6, 1e-6, 6), v + random.uniform(-1e-3, 1e-3, 6)
    moved_q, moved_v, counted, ok = equations.project(0.0, q, v, np.array([[phase, 2.0]]))
    assert ok
    assert np.abs(moved_q - q).max() > 1e-7
    assert counted == pytest.approx(
        float(energy(mechanism, q, v) - energy(mechanism, moved_q, moved_v)), rel=1e-4
    )
    without = equations.project(0.0, q, v)[2]
    assert abs(without - counted) > 0.01 * abs(counted), "the wall's energy is part of it"


def test_without_stabilisation_nothing_is_removed() -> None:
    assert run("ideal-free", "none", 32)[1].stabilisation_loss_J is None
