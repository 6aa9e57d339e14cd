"""The massless link's multiplier is the compliant contact's force in the limit of a stiff contact."""

import numpy as np

from reference_solver.mechanism.contact_laws import ContactLaw
from reference_solver.mechanism.mechanism import GROUND, Body, ClearanceJoint, MasslessLink, Mechanism
from reference_solver.solver import StepChoice, solve

MASS, CLEARANCE, GRAVITY, ANGLE = 0.1, 5e-4, 9.81, 0.4


def link_force() -> float:
    """Return the push of the wall on a pin that slides down it from rest at ANGLE off the bottom."""
    link = MasslessLink(GROUND, (0.0, 0.0), 0, (0.0, 0.0), CLEARANCE)
    pin = Mechanism((Body(MASS, 1e-4),), (link,), gravity_m_s2=GRAVITY)
    d = CLEARANCE * np.array([np.sin(ANGLE), -np.cos(ANGLE)])
    start = np.array([*d, 0.0])
    run = solve(pin, start, np.zeros(3), end_time_s=5e-3, samples=1, step=5e-3 / 400)
    # The force on the pin is lambda d, inward while lambda is negative.
    return float(-run.multipliers[-1, 0] * CLEARANCE)


def compliant_force(stiffness: float) -> float:
    """Return the same of a pin on a spring wall, which it touches from the start."""
    damping = 2 * np.sqrt(MASS * stiffness)  # critical: the start is forgotten
    law = ContactLaw(stiffness, 1.0, damping_N_s_m=damping)
    pin = Mechanism(
        (Body(MASS, 1e-4),),
        (),
        gravity_m_s2=GRAVITY,
        contacts=(ClearanceJoint(GROUND, (0.0, 0.0), 0, (0.0, 0.0), CLEARANCE, 0.01, law),),
    )
    d = CLEARANCE * np.array([np.sin(ANGLE), -np.cos(ANGLE)]) * (1 - 1e-12)
    run = solve(
        pin,
        np.array([*d, 0.0]),
        np.zeros(3),
        end_time_s=5e-3,
        samples=1,
        step=StepChoice(5e-6, 100),
    )
    return float(run.normal_force_N[-1, 0])


def test_the_compliant_force_tends_to_the_massless_links_multiplier_as_stiffness_grows() -> None:
    rigid = link_force()
    stiffnesses = [1e6, 1e7, 1e8]
    off = [abs(compliant_force(k) / rigid - 1) for k in stiffnesses]
    # The depth F/k is a part F/(k c) of the radius on which the pin turns: the error falls as 1/k.
    rate = -np.polyfit(np.log(stiffnesses), np.log(off), 1)[0]
    assert off[-1] < 1e-3, f"{off}"
    assert 0.8 < rate < 1.2, f"falls as k^-{rate:.2f}: {off}"
