"""The generated contact step agrees with the readable one: every scene, variant, phase and law, and runs."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from engine_models.mechanics.assembly import start_state
from engine_models.mechanics.equations import mechanism_of
from engine_models.scene.library import CLEARANCE_SCENES, RIGID_SCENES
from reference_solver.compiled.faces import ReadableFace
from reference_solver.compiled.kernel import source_of
from reference_solver.compiled.store import load_kernel
from reference_solver.contact.force import contact_force
from reference_solver.contact.loop import ROWS
from reference_solver.contact.types import CONTACT_RECORD, FLIGHT, START, new_run
from reference_solver.equations import Equations
from reference_solver.mechanism.contact_laws import DAMPING_FACTORS, ContactLaw, FrictionLaw
from reference_solver.mechanism.mechanism import GROUND
from reference_solver.mechanism.points import State
from reference_solver.solver import Stabilisation, StepChoice, contact_record, solve
from tests.helpers.contact_moments import Moment, contact_state, moments
from tests.helpers.kernels import VARIANTS, topology_of

FloatArray = NDArray[np.float64]
#: How far the two faces may part in a step, in units in the last place of what enters the sums. Measured: 25.
#: The faces do some hundred operations in another order, each of which may round the other way.
ROUND_OFF = 200 * float(np.finfo(float).eps)


def check(at: Moment, stabilisation: Stabilisation) -> None:
    """Compare a step, its sums, and forces and losses at its start, between the two faces."""
    topology = topology_of(at.mechanism, stabilisation)
    kernel, readable = load_kernel(source_of(topology.marked())), ReadableFace(topology, at.q_start)
    equations = readable.equations
    names = [*equations.power_names, "removed"]
    parameters = topology.parameters(kernel, at.q_start)
    contacts = np.array([contact_record(joint) for joint in at.mechanism.contacts], CONTACT_RECORD)
    contacts["phase"], contacts["memory"] = at.phases.T
    sizes = len(at.q), len(names), len(equations.C)
    run, of_readable = (new_run(contacts, sizes, np.zeros(1), ROWS, 0) for _ in range(2))
    old, new, again, true = run.old, run.new, run.at, of_readable.new
    old.q[:], old.v[:] = at.q, at.v
    assert kernel.step(parameters, contacts, at.t, at.h, old, new) < np.inf
    q, v, sums = new.q, new.v, new.sums
    again.q[:], again.v[:] = q, v
    assert kernel.gaps(parameters, contacts, at.t + at.h, again)
    for field, scale in (("depth", np.abs(q).max()), ("rate", np.abs(v).max())):
        assert np.abs(new.gaps[field] - again.gaps[field]).max() <= ROUND_OFF * scale
    assert kernel.slopes(parameters, contacts, at.t, START, 1.0, old.y, run.slopes) < np.inf
    rate, a, powers, _ = np.split(run.slopes[START], np.cumsum([old.n, *sizes[:2]]))
    assert kernel.forces(parameters, contacts, at.t, old.y, 0, run.records.samples) < np.inf
    _, lambda_, forces = np.split(run.records.samples[0], np.cumsum([len(old.y), sizes[2]]))
    assert (rate == old.v).all()

    assert readable.step(None, contacts, at.t, at.h, old, true)
    true_a, true_lambda = equations.accelerations(at.t, at.q, at.v, at.phases)
    work, removed = true.sums[0], true.sums[-1]
    magnified = ROUND_OFF * at.condition()
    speeds = np.abs(at.v).max() + at.condition() * at.h * np.abs(true_a).max()
    torques = np.abs(true_lambda).max(initial=0.0)
    energy = at.h * torques * np.abs(at.v).max()
    compared = {
        "q": (q, true.q, ROUND_OFF * (np.abs(at.q).max() + at.h * speeds)),
        "v": (v, true.v, ROUND_OFF * speeds),
        "accelerations": (a, true_a, magnified * np.abs(true_a).max()),
        "multipliers": (lambda_, true_lambda, magnified * torques),
        "work": (sums[0], work, magnified * energy),
    }
    if stabilisation == "none":
        assert sums[-1] == removed == 0
    else:
        # A drift of one unit in the last place would do as much, and a projection counts what rounding the
        # velocities adds (see Equations): a unit of every one of them is 2 eps of kinetic energy.
        kinetic = float(np.sum(at.v**2 / equations.inverse_mass)) / 2
        tolerance = magnified * (abs(removed) + energy) + 2 * float(np.finfo(float).eps) * kinetic
        compared["removed"] = (sums[-1], removed, tolerance)
    for name, (one, other, tolerance) in compared.items():
        difference = np.abs(one - other).max(initial=0.0)
        assert difference <= tolerance, f"{name}: {difference:.1e}, {tolerance:.1e} expected"
    check_losses(at, dict(zip(names[1:-1], powers[1:-1], strict=True)), forces)


def check_losses(at: Moment, rates: dict[str, float], forces: FloatArray) -> None:
    """Compare contact forces, and losses with the power of all contact forces that no spring stores."""
    F, stored, scale = np.zeros(len(at.q)), 0.0, 0.0
    for k, (joint, (phase, damping)) in enumerate(zip(at.mechanism.contacts, at.phases, strict=True)):
        state = contact_state(joint, phase, damping, at.q, at.v)
        for body, force in contact_force(joint, phase, damping, State(at.q, at.v))[0].items():
            if body != GROUND:
                F[3 * body : 3 * body + 3] += force
        law = joint.compliance
        spring = law.stiffness * max(state.penetration_m, 0.0) ** law.exponent
        stored += spring * state.rate_m_s if phase != FLIGHT else 0.0
        scale = max(scale, spring, abs(state.normal_force_N))
        normal, friction = forces[2 * k : 2 * k + 2]
        assert abs(normal - rates[f"normal{k}"]) <= ROUND_OFF * at.condition() * scale
        assert abs(normal - state.normal_force_N) <= ROUND_OFF * at.condition() * scale
        assert abs(friction - state.friction_force_N) <= ROUND_OFF * at.condition() * scale
    lost = sum(rate for name, rate in rates.items() if not name.startswith(("normal", "load")))
    tolerance = ROUND_OFF * at.condition() * scale * np.abs(at.v).max()
    assert abs(lost + F @ at.v + stored) <= tolerance, f"lost {lost} W of {-F @ at.v} W, stored {stored} W"


#: A variant adds to the equations of any scene: it is held to those of all joints, of a drive, and of a load.
EVERY_VARIANT = ("clearance-free-OAB", "clearance-driven-A", "clearance-compressor")
STEPS = [(name, "projection") for name in CLEARANCE_SCENES if name not in EVERY_VARIANT]
STEPS += [(name, variant) for name in EVERY_VARIANT for variant in VARIANTS]


@pytest.mark.parametrize(("name", "variant"), STEPS)
def test_a_generated_step_agrees_with_the_readable_one_in_flight_contact_and_clipped(
    name: str, variant: str
) -> None:
    found = moments(name)
    contact = found["contact"]
    assert contact.depth_m() > 1e-6, "the contact is deep"
    assert contact.phases[:, 1].any(), "a/v0 is set"
    for at in found.values():
        check(at, VARIANTS[variant])


def with_law(law: ContactLaw | None = None, friction: FrictionLaw | None = None) -> Moment:
    """Return the pendulum's deepest contact with another law, or with friction."""
    at = moments("clearance-pendulum")["contact"]
    (joint,) = at.mechanism.contacts
    phases = at.phases.copy()
    if law is not None:
        phases[:, 1] *= law.damping_factor / joint.compliance.damping_factor
    joint = replace(joint, law=law or joint.law, friction=friction)
    return replace(at, mechanism=replace(at.mechanism, contacts=(joint,)), phases=phases)


STIFFNESS = 6.61e10
LAWS = {name: ContactLaw(STIFFNESS, 1.5, factor(0.7)) for name, factor in DAMPING_FACTORS.items()} | {
    "hertz": ContactLaw(STIFFNESS),
    "linear": ContactLaw(1e8, 1.0),
    "kelvin-voigt": ContactLaw(1e8, 1.0, damping_N_s_m=300.0),
    "any exponent": ContactLaw(1e13, 2.2, 0.4),
    "may pull": ContactLaw(STIFFNESS, 1.5, 0.4, may_pull=True),
}


@pytest.mark.parametrize("name", LAWS)
def test_every_law_agrees(name: str) -> None:
    check(with_law(LAWS[name]), "none")


FRICTIONS = [
    FrictionLaw("saturated-linear", 0.2, 50.0),  # on the ramp
    FrictionLaw("saturated-linear", 0.2, 1e-3),  # saturated
    FrictionLaw("ambrosio", 0.2, 50.0, 1e-4),
    FrictionLaw("ambrosio", 0.2, 50.0, 40.0),  # in the dead band
    FrictionLaw("tanh", 0.2, 0.5),
]


@pytest.mark.parametrize("friction", FRICTIONS, ids=str)
def test_every_friction_law_agrees(friction: FrictionLaw) -> None:
    at = with_law(friction=friction)
    check(at, "none")
    (state,) = at.contacts()
    assert (state.friction_force_N == 0) == (friction.dead_band_speed_m_s > 1), "it rubs"


#: Until every scene has touched; until a pin has come to follow its rigid wall, in two scenes.
TOUCHED_S = {"driven": 4e-4, "free": 3.2e-3, "pendulum": 0.0105, "start-up": 2.5e-3, "compressor": 1e-3}
FOLLOWING_S = {"rigid-driven-0.02mm": 8e-4, "rigid-driven-damped": 4e-4}
#: How far the faces' runs may part, relative to the largest of each kind: contacts and impacts enlarge
#: round-off. Measured: 5e-11; after 72 impacts on the smallest circle 2e-9 to 1.2e-8 on five processors'
#: BLAS, and as much between two compiled runs whose steps differ by a part of 1e-7.
PARTED = {"rigid-driven-0.02mm": 1e-6}
PARTED_ELSE = 1e-8


@pytest.mark.parametrize("name", [*CLEARANCE_SCENES, *RIGID_SCENES])
def test_both_faces_run_alike_through_contacts_and_along_rigid_walls(name: str) -> None:
    scene = (CLEARANCE_SCENES | RIGID_SCENES)[name]()
    mechanism, (q, v) = mechanism_of(scene), (part.ravel() for part in start_state(scene))
    end = FOLLOWING_S.get(name) or next(end for kind, end in TOUCHED_S.items() if kind in name)
    choice = StepChoice(4e-6 if name == "rigid-driven-damped" else 5e-5, 25)  # its friction is stiff
    one, other = (
        solve(mechanism, q, v, end_time_s=end, samples=20, step=choice, compiled=compiled)
        for compiled in (True, False)
    )
    assert one.impacts, "it has touched"
    assert len(one.mode_changes) == (name in FOLLOWING_S), "its pin follows its wall"
    assert one.steps == other.steps
    assert (one.events["what"] == other.events["what"]).all()
    assert [i[1:3] for i in one.impacts] == [i[1:3] for i in other.impacts], "contacts and kinds"
    assert [c.following for c in one.mode_changes] == [c.following for c in other.mode_changes]
    energy = np.max(other.v**2 / Equations(mechanism, q).inverse_mass) / 2
    compared = {
        field: (getattr(one, field), getattr(other, field), np.abs(getattr(other, field)).max(initial=0))
        for field in ("q", "v", "multipliers", "phases", "normal_force_N", "friction_force_N")
    }
    for sum_, values in other.sums.items():
        compared[sum_] = one.sums[sum_], values, np.abs(values).max() if "normal" in sum_ else energy
    times = [(i.time_s, i.time_s + i.duration_s) for i in other.impacts]
    compared["times"] = np.array([(i.time_s, i.time_s + i.duration_s) for i in one.impacts]), times, end
    for what, (a, b, scale) in compared.items():
        apart = np.abs(a - b).max(initial=0)
        assert apart <= PARTED.get(name, PARTED_ELSE) * scale, f"{what}: {apart:.1e} of {scale:.1e}"
