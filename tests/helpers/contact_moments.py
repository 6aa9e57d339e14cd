"""Moments of runs with contacts: in flight, in contact, and with the force clipped."""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from engine_models.mechanics.assembly import start_state
from engine_models.mechanics.equations import mechanism_of
from engine_models.scene.library import CLEARANCE_SCENES
from reference_solver.contact.force import contact_force
from reference_solver.contact.types import CLIPPED, CONTACT
from reference_solver.mechanism.mechanism import ClearanceJoint, Mechanism
from reference_solver.mechanism.points import State, ends_of
from reference_solver.solver import StepChoice, solve
from tests.helpers.crank_sliders import HORIZON_S

FloatArray = NDArray[np.float64]
#: By how much states are moved off the constraints, in m and m/s, so that a stabilisation has work to do.
OFF_M, OFF_M_S = 1e-9, 1e-4


@dataclass(frozen=True)
class ContactState:
    """One contact at one instant: penetration, its rate, normal force and friction, by the readable face."""

    penetration_m: float
    rate_m_s: float
    normal_force_N: float
    friction_force_N: float


def contact_state(
    joint: ClearanceJoint, phase: float, memory: float, q: FloatArray, v: FloatArray
) -> ContactState:
    state = State(q, v)
    bearing, pin = ends_of(joint, state)
    d = pin.place - bearing.place
    rate = d @ (pin.rate - bearing.rate) / np.hypot(*d)
    _, (normal, *_), friction = contact_force(joint, phase, memory, state)
    return ContactState(float(np.hypot(*d) - joint.radial_clearance_m), float(rate), normal, friction)


@dataclass(frozen=True)
class Moment:
    """A mechanism, its start, and a state of a run at time t with a step h to take from there."""

    mechanism: Mechanism
    q_start: FloatArray
    t: float
    q: FloatArray
    v: FloatArray
    phases: FloatArray
    h: float

    def depth_m(self) -> float:
        return max(c.penetration_m for c in self.contacts())

    def contacts(self) -> list[ContactState]:
        pairs = zip(self.mechanism.contacts, self.phases, strict=True)
        return [contact_state(joint, phase, a, self.q, self.v) for joint, (phase, a) in pairs]

    def condition(self) -> float:
        """Return by how much contact forces magnify the rounding of coordinates and speeds."""
        worst = 1.0
        for joint, state in zip(self.mechanism.contacts, self.contacts(), strict=True):
            if state.penetration_m > 0:
                worst = max(worst, joint.compliance.exponent * np.abs(self.q).max() / state.penetration_m)
            if state.penetration_m > 0 and joint.friction is not None:
                ramp = joint.friction.regularisation_speed_m_s - joint.friction.dead_band_speed_m_s
                worst += np.abs(self.v).max() / ramp
        return float(worst)


@cache
def moments(name: str) -> dict[str, Moment]:
    """Return from a run of a scene a moment in flight, the deepest one in contact, and that one clipped."""
    scene = CLEARANCE_SCENES[name]()
    mechanism, (q, v) = mechanism_of(scene), (part.ravel() for part in start_state(scene))
    run = solve(mechanism, q, v, end_time_s=HORIZON_S[name], samples=2000, step=StepChoice(2e-5, 100))
    clearances = [joint.radial_clearance_m for joint in mechanism.contacts]
    depths = (np.hypot(run.gap_m[..., 0], run.gap_m[..., 1]) - clearances).max(axis=1)
    flying = np.flatnonzero(~run.closed.any(axis=1))[-1]
    noise_q, noise_v = np.random.default_rng(1).uniform(-1, 1, (2, len(q)))

    def moment(k: int, h: float) -> Moment:
        state = run.q[k] + OFF_M * noise_q, run.v[k] + OFF_M_S * noise_v
        return Moment(mechanism, q, float(run.time_s[k]), *state, run.phases[k], h)

    deep = moment(int(depths.argmax()), 5e-7)
    phases = deep.phases.copy()
    phases[phases[:, 0] == CONTACT, 0] = CLIPPED
    return {"flight": moment(int(flying), 1e-5), "contact": deep, "clipped": replace(deep, phases=phases)}
