"""The reference solver on the ideal scenes against the independent truth: accuracy, order, drift."""

from dataclasses import replace
from fractions import Fraction
from functools import cache

import numpy as np
import pytest

from engine_models.engine import FloatArray, RunSettings, Trajectory
from engine_models.mechanics.assembly import start_state
from engine_models.mechanics.equations import mechanism_of
from engine_models.reference.engine import ReferenceEngine
from engine_models.scene.library import IDEAL_SCENES, ideal_free
from engine_models.scene.scene import Scene
from reference_solver.equations import Equations
from reference_solver.mechanism.mechanism import Body
from studies.judges.converged_truth import converged
from studies.judges.metrics import (
    constraint_violation_m,
    energy_balance_residual_J,
    errors,
    kinetic_energy_J,
    signals,
    uncertainties,
)
from tests.studies.truth.closed_forms.crank_slider import exact

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


@cache
def run(name: str, variant: str, steps_per_sample: int) -> tuple[Scene, Trajectory]:
    scene = IDEAL_SCENES[name]()
    step = scene.end_time_s / (SAMPLES * steps_per_sample)
    engine = ReferenceEngine(stabilisation=variant)  # type: ignore[arg-type]
    return scene, engine.simulate(scene, RunSettings(step_s=step, samples=SAMPLES))


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


def drift(variant: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return times and the running largest |g| and |g'| of a free run of 3 s at h = 2.5e-4 s."""
    scene = ideal_free().model_copy(update={"end_time_s": 3.0})
    engine = ReferenceEngine(stabilisation=variant)  # type: ignore[arg-type]
    run = engine.simulate(scene, RunSettings(step_s=2.5e-4, samples=400))
    states = list(zip(run.time_s, run.position.reshape(401, 9), run.velocity.reshape(401, 9), strict=True))
    equations = Equations(mechanism_of(scene), states[0][1])
    g = [np.abs(equations.violation(t, q)).max() for t, q, _ in states]
    g_rate = [np.abs(equations.constraint_matrix(q) @ v - equations.C).max() for _, q, v in states]
    return run.time_s, np.maximum.accumulate(g), np.maximum.accumulate(g_rate)


def growth(time: np.ndarray, values: np.ndarray) -> float:
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
    scene, random = ideal_free(), np.random.default_rng(body)
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
