"""The energy that projection and Baumgarte's feedback remove: against energies, between faces, in order."""

from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from engine_models.engine import RunSettings
from engine_models.reference.engine import ReferenceEngine
from engine_models.scene.library import CLEARANCE_SCENES, IDEAL_SCENES
from reference_solver import methods
from reference_solver.compiled.faces import CompiledFace, ReadableFace
from reference_solver.contact.types import CONTACT
from reference_solver.equations import Equations
from reference_solver.mechanism.mechanism import Mechanism, SpringDamper, Torque
from reference_solver.solver import Stabilisation
from studies.judges.metrics import energy_balance_residual_J, kinetic_energy_J
from tests.helpers.chains import CASES
from tests.helpers.contact_moments import moments
from tests.helpers.kernels import CASES as SMALL
from tests.helpers.kernels import VARIANTS, stepped, topology_of

FloatArray = NDArray[np.float64]
SAMPLES = 200


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


@pytest.mark.parametrize("case", SMALL)
def test_what_projections_remove_is_the_energy_before_less_that_after(case: str) -> None:
    mechanism, q, v, h = SMALL[case]()
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


@pytest.mark.parametrize("label", ["contact", "clipped"])
@pytest.mark.parametrize("name", ["clearance-driven-damped", "clearance-driven-A"])
def test_moving_a_contact_is_counted_with_its_elastic_energy(name: str, label: str) -> None:
    at = moments(name)[label]  # off the constraints by 1e-9 m and 1e-4 m/s
    equations = Equations(at.mechanism, at.q_start)
    assert (at.phases[:, 0] >= CONTACT).any()
    q, v, counted, ok = equations.project(at.t, at.q, at.v, at.phases)
    assert ok
    removed = float(energy(at.mechanism, at.q, at.v) - energy(at.mechanism, q, v))
    stiffness = max(np.abs(equations.stored_force(at.q, at.phases)).max() / at.depth_m(), 1.0)
    neglected = 2 * stiffness * np.sum((q - at.q) ** 2)
    assert abs(counted - removed) <= neglected + 1e-5 * abs(removed), f"{counted} J against {removed} J"


@pytest.mark.parametrize("stabilisation", ["projection", "baumgarte"])
@pytest.mark.parametrize("case", CASES)
def test_all_faces_count_the_same_to_round_off(case: str, stabilisation: str) -> None:
    mechanism, start, v, h = CASES[case]()
    random = np.random.default_rng(3)
    q = start + random.uniform(-1e-4, 1e-4, len(start))  # a violation far above its own round-off
    v = v + random.uniform(-1e-2, 1e-2, len(v))
    first, *others = removed(mechanism, start, q, v, h, VARIANTS[stabilisation], compiled=case in SMALL)
    assert abs(first) > 1e-9
    for other in others:
        assert other == pytest.approx(first, rel=1e-9), "measured: 2e-11 in the chain"


def removed(
    mechanism: Mechanism,
    start: FloatArray,
    q: FloatArray,
    v: FloatArray,
    h: float,
    stabilisation: Stabilisation,
    compiled: bool = True,
) -> list[float]:
    """Return what three steps remove by the readable face, and by the compiled one if there is one."""
    topology = topology_of(mechanism, stabilisation)
    kinds = (ReadableFace, CompiledFace) if compiled else (ReadableFace,)
    return [float(stepped(kind(topology, start), mechanism, q, v, h, 3)[0].sums[-1]) for kind in kinds]


def test_without_stabilisation_nothing_is_removed() -> None:
    mechanism, q, v, h = SMALL["ideal-free"]()
    assert removed(mechanism, q, q, v + 1e-3, h, "none") == [0, 0]
    scene = IDEAL_SCENES["ideal-free"]()
    run = ReferenceEngine(stabilisation="none").simulate(scene, RunSettings(1e-3, 10))
    assert run.stabilisation_loss_J is None


@cache
def run(name: str, variant: str, steps_per_sample: int) -> tuple[FloatArray, FloatArray]:
    """Return the residual of an ideal run's ledger, and in it the line of the stabilisation."""
    scene = IDEAL_SCENES[name]()
    scene = scene.model_copy(update={"end_time_s": min(0.3, scene.end_time_s)})
    step = scene.end_time_s / (SAMPLES * steps_per_sample)
    engine = ReferenceEngine(stabilisation=variant)  # type: ignore[arg-type]
    found = engine.simulate(scene, RunSettings(step_s=step, samples=SAMPLES))
    assert found.stabilisation_loss_J is not None
    return energy_balance_residual_J(scene, found), found.stabilisation_loss_J


@pytest.mark.parametrize(("variant", "order"), [("projection", 4), ("baumgarte", 8)])
@pytest.mark.parametrize("name", IDEAL_SCENES)
def test_the_line_falls_in_order_and_the_residual_with_it_is_no_larger(
    name: str, variant: str, order: int
) -> None:
    # A projection undoes RK4's error, of order 4 over a run. The feedback's power is quadratic in it.
    ladder = {"ideal-free": (6, 8, 12, 16), "ideal-driven": (4, 6, 8, 12), "ideal-torque": (16, 24, 32, 48)}
    ladder |= {"ideal-fluctuating": (8, 12, 16, 24), "ideal-compressor": (2, 3, 4, 6)}
    for what, expected in ((0, 4), (1, order)):
        sizes = [np.abs(run(name, variant, count)[what]).max() for count in ladder[name]]
        found = -np.polyfit(np.log(ladder[name]), np.log(sizes), 1)[0]
        # Steps that end on the gas's knots are shorter than they may be, the more so the longer they may.
        scatter = 0.2 if name == "ideal-compressor" else 0.1
        assert abs(found - expected) < scatter, f"order {found:.2f} of {sizes}"
    for count in ladder[name]:
        residual, line = run(name, variant, count)
        with_line, without = np.abs(residual).max(), np.abs(residual - line).max()
        # The quadratures of a motor's and a load's work have errors of their own, far above the line.
        larger = 1e-6 if name != "ideal-compressor" else 0.01
        assert with_line <= without * (1 + larger), f"{with_line} J with the line, {without} J without"
        # The feedback is a damper of the violation, and a spring that gives back no more than it took.
        assert variant == "projection" or line[-1] > line.min() >= 0


def test_a_third_of_the_driven_scenes_imbalance_is_what_the_projection_removed() -> None:
    residual, line = run("ideal-driven", "projection", 8)
    assert np.abs(residual).max() < 0.7 * np.abs(residual - line).max()


@pytest.mark.parametrize("variant", ["projection", "baumgarte", "none"])
def test_a_contact_runs_residual_with_the_line_falls_at_order_four_and_is_no_larger(variant: str) -> None:
    scene = CLEARANCE_SCENES["clearance-driven-0.5mm"]().model_copy(update={"end_time_s": 0.003})
    residuals, steps = [], (3e-5, 2e-5, 1.5e-5, 1e-5)
    for step in steps:
        engine = ReferenceEngine(stabilisation=variant, steps_per_contact=2000)  # type: ignore[arg-type]
        found = engine.simulate(scene, RunSettings(step, 10))
        residual, line = energy_balance_residual_J(scene, found), found.stabilisation_loss_J
        residuals.append(np.abs(residual).max())
        assert residuals[-1] < 1e-9 * kinetic_energy_J(scene, found).max()
        assert (line is None) == (variant == "none")
        if line is not None:
            assert residuals[-1] <= np.abs(residual - line).max() * (1 + 1e-6)
    order = np.polyfit(np.log(steps), np.log(residuals), 1)[0]
    assert abs(order - 4) < 0.3, f"order {order:.2f} of {residuals}"
