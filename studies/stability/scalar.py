"""The scalar test problem: a mass on a contact's spring and damper, in every engine by its own ``simulate``.

A pendulum hangs straight down and its weight presses the pin into the bearing. Moved up or down a little it
oscillates there, always in contact: with the law F = K delta + c delta' exactly as a mass on a spring, with
zeta = c/(2 m omega), omega^2 = K/m. What a step multiplies its amplitude by follows from consecutive samples:
k states a step make their deviations z obey z_n = p_1 z_(n-1) + ... + p_k z_(n-k).
"""

import math

import numpy as np

from engine_models.engine import Engine, FloatArray, RunSettings, SimulationFailed, Trajectory
from engine_models.scene.drives import FreeDrive
from engine_models.scene.scene import BodyState, Clearance, Clearances, Link, Scene, Start

#: Mass, frequency of the contact, and penetration at rest, which sets gravity. The pin can roll sideways too,
#: a tenth as fast where the clearance is a hundred times the penetration: never the first motion to grow.
MASS_KG, FREQUENCY_RAD_S, DEPTH_M = 0.2, 1000.0, 1e-4
CLEARANCE_M, CENTRE_M = 1e-2, 1e-2
#: Deviation at the start, and the largest fitted, as parts of the penetration at rest. A Runge-Kutta stage
#: goes further than its step, and must not leave the contact either.
DEVIATION, LARGEST_DEVIATION = 1e-3, 0.1
#: A damping ratio without effect: a law without a damper would be one more kernel to compile.
NO_DAMPING = 1e-18
#: A step that multiplies the deviation by more is one of growth: well above
#: round-off, some 1e-8, and too little to move a limit by 1e-4 of itself.
GROWING_STEP = 1 + 1e-4
#: Round-off of a deviation at the start is some 2e-8 of it: what a fit has no more of than this is let be.
#: A deviation below the other number is gone, or no more than what a method's own tolerance allows.
ROUND_OFF, QUIET = 1e-6, 1e-8
#: Samples before this are no part of the fit: methods begin differently.
FIRST = 1


def oscillator(damping_ratio: float, step_s: float, steps: int, flight_first: bool = False) -> Scene:
    """Return the scene of so many steps; with ``flight_first`` one of free fall leads to the start."""
    gravity = DEPTH_M * FREQUENCY_RAD_S**2
    depth, rate = DEPTH_M * (1 + DEVIATION), 0.0
    if flight_first:
        depth, rate = depth + gravity * step_s**2 / 2, -gravity * step_s
    place = {"y_m": -(CENTRE_M + CLEARANCE_M + depth), "angle_rad": -math.pi / 2}
    zeros = dict.fromkeys(BodyState.model_fields, 0.0)
    hanging = BodyState(**zeros | place | {"velocity_y_m_s": -rate})
    bearing = Clearance(
        radial_clearance_m=CLEARANCE_M,
        bearing_radius_m=2 * CLEARANCE_M,
        law="kelvin-voigt",
        stiffness=MASS_KG * FREQUENCY_RAD_S**2,
        damping_N_s_m=2 * max(damping_ratio, NO_DAMPING) * MASS_KG * FREQUENCY_RAD_S,
    )
    return Scene(
        name=f"oscillator-{damping_ratio:g}",
        end_time_s=step_s * steps,
        gravity_m_s2=gravity,
        crank=Link(length_m=0.12, mass_kg=MASS_KG, inertia_kg_m2=2.5e-4, centre_of_mass_m=CENTRE_M),
        start=Start(crank_angle_rad=-math.pi / 2, crank_speed_rad_s=0.0, crank=hanging),
        drive=FreeDrive(kind="free"),
        clearance=Clearances(O=bearing),
    )


def measured_growth(
    engine: Engine, frequency_step: float, damping_ratio: float, steps: int, order: int
) -> float:
    """Return the factor by which a step multiplies the deviation, infinite if it left the contact or failed.

    ``frequency_step`` is omega h, ``order`` the number k of states a step. An engine that is still in flight
    at a start in contact, since it looks for contacts at the ends of steps only, is started a step earlier.
    """
    step = frequency_step / FREQUENCY_RAD_S
    settings = RunSettings(step, steps)
    try:
        run = engine.simulate(oscillator(damping_ratio, step, steps), settings)
        if _fell(run, step):
            run = engine.simulate(oscillator(damping_ratio, step, steps, flight_first=True), settings)
    except (SimulationFailed, OverflowError):
        return math.inf
    return growth_of(run.contacts["O"].penetration_m[FIRST:], order)


def _fell(run: Trajectory, step_s: float) -> bool:
    """Return whether the first step was one of free fall, as if there were no contact."""
    fall = DEPTH_M * FREQUENCY_RAD_S**2 * step_s**2 / 2
    depth = run.contacts["O"].penetration_m
    return bool(abs(depth[1] - depth[0] - fall) < 1e-6 * fall)


def growth_of(depth_m: FloatArray, order: int) -> float:
    """Return the largest magnitude of the roots of the recurrence that penetrations (n,) obey around rest."""
    z = depth_m / DEPTH_M - 1
    inside = int(np.argmin(np.append(np.abs(z) <= LARGEST_DEVIATION, False)))
    if inside < 2 * order:
        return math.inf
    rows = np.array([z[k : k + order + 1] for k in range(inside - order)])
    rows = rows[np.abs(rows).max(axis=1) > QUIET]
    if len(rows) < order:
        return 0.0
    least = max(ROUND_OFF, QUIET / max(float(np.linalg.norm(rows[:, :-1])), QUIET))
    coefficients = np.linalg.lstsq(rows[:, :-1], rows[:, -1], rcond=least)[0]
    return float(np.abs(np.roots([1.0, *-coefficients[::-1]])).max())
