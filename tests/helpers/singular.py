"""Mechanisms that pass through singular positions, and their motion in one coordinate, derived by hand.

In a parallelogram all of whose links lie in a line, and in a crank-slider with a rod as long as its crank at
the dead centre, a second branch of motion crosses: the slider's pin may stay on the crank's.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from reference_solver.energy import MOVED
from reference_solver.equations import Baumgarte
from reference_solver.failures import SolverError
from reference_solver.mechanism.constraints import PrescribedMotion
from reference_solver.mechanism.data import GROUND, Body, ConstantSpeed, Pin
from reference_solver.mechanism.mechanism import Mechanism
from reference_solver.solver import ErrorControl, Solver, Stabilisation, StepChoice
from tests.helpers.kernels import straight_guide

FloatArray = NDArray[np.float64]
GRAVITY = 9.81
#: Samples of a run at most, and what is asked of it: the error of its first angle in rad. It is round-off,
#: amplified, beside some times the method's error, as measured away from singular positions.
SAMPLES, ROUND_OFF, ORDER, TOLERANCES = 60, 1e-7, 30.0, 5e3


@dataclass(frozen=True)
class Passing:
    """A mechanism, its start, its end, and its first angle (s,) at times; ``rate_s`` is its fastest turn."""

    mechanism: Mechanism
    q: FloatArray
    v: FloatArray
    end_time_s: float
    rate_s: float
    angle: Callable[[FloatArray], FloatArray]

    def allowed(self, choice: StepChoice | ErrorControl, stabilisation: Stabilisation) -> float:
        """Return the error in rad that order and step, or the tolerance, allow."""
        if isinstance(choice, ErrorControl):
            return ROUND_OFF + TOLERANCES * choice.tolerance
        gain = stabilisation.alpha_s if isinstance(stabilisation, Baumgarte) else 0.0
        drift = MOVED if stabilisation == "none" else 0.0
        return drift + ROUND_OFF + ORDER * (max(self.rate_s, gain) * choice.longest_s) ** 4


def turning(
    acceleration: Callable[[float, float], float], angle: float, rate: float, end_time_s: float
) -> Callable[[FloatArray], FloatArray]:
    """Return the angle at times of angle'' = f(angle, angle'), by DOP853 of SciPy near round-off."""

    def derivative(_: float, y: FloatArray) -> list[float]:
        return [y[1], acceleration(y[0], y[1])]

    span, start = (0.0, end_time_s), [angle, rate]
    run = solve_ivp(derivative, span, start, "DOP853", rtol=3e-14, atol=1e-14, dense_output=True)
    return lambda times: np.asarray(run.sol(times)[0])


def parallelograms(loops: int, end_time_s: float = 10.0) -> Passing:
    """Return benchmark A02 of the IFToMM library: N parallelograms of rods of 1 m and 1 kg, at 1 m/s.

    The N + 1 cranks are pendulums, J phi'' = -M g cos phi, to whose ends the N couplers add their mass.
    """
    rod, cranks = Body(1.0, 1 / 12), range(loops + 1)
    joints = [Pin(GROUND, (float(k), 0.0), k, (-0.5, 0.0)) for k in cranks]
    for k in range(loops):
        coupler = loops + 1 + k
        joints.append(Pin(k, (0.5, 0.0), coupler, (-0.5, 0.0)))
        joints.append(Pin(coupler, (0.5, 0.0), k + 1, (0.5, 0.0)))
    centres = [(float(k), 0.5, np.pi / 2) for k in cranks] + [(k + 0.5, 1.0, 0.0) for k in range(loops)]
    rates = [(0.5, 0.0, -1.0) for _ in cranks] + [(1.0, 0.0, 0.0)] * loops
    inertia, moment = len(cranks) / 3 + loops, len(cranks) / 2 + loops
    pull = GRAVITY * moment / inertia
    angle = turning(lambda phi, _: -pull * np.cos(phi), np.pi / 2, -1.0, end_time_s)
    mechanism = Mechanism((rod,) * (2 * loops + 1), tuple(joints), gravity_m_s2=GRAVITY)
    start, rate_s = (np.ravel(centres), np.ravel(rates)), np.sqrt(1 + 4 * pull)
    return Passing(mechanism, *start, end_time_s, rate_s, angle)


def equal_links(driven: bool) -> Passing:
    """Return a crank-slider whose rod is as long as its crank l, turning freely or at constant speed.

    The crank at phi has the rod at -phi, its centre at (3/2 l cos phi, 1/2 l sin phi), the slider at
    2 l cos phi. Free, it follows J phi'' = -J' phi'^2/2 - 1/2 (m1 + m2) g l cos phi.
    """
    l, (m1, m2, m3), start, speed = 0.1, (0.3, 0.21, 0.14), 0.3, 10.0  # noqa: E741
    c, s = np.cos(start), np.sin(start)
    joints = (
        Pin(GROUND, (0.0, 0.0), 0, (-l / 2, 0.0)),
        Pin(0, (l / 2, 0.0), 1, (-l / 2, 0.0)),
        Pin(1, (l / 2, 0.0), 2, (0.0, 0.0)),
        *straight_guide(2, (0.0, 0.0), 0.0),
    )
    bodies = tuple(Body(m, m * l * l / 12) for m in (m1, m2, m3))
    drivers = (PrescribedMotion(0, ConstantSpeed(speed)),) if driven else ()
    q = [l / 2 * c, l / 2 * s, start, 1.5 * l * c, l / 2 * s, -start, 2 * l * c, 0, 0]
    v = [-l / 2 * s, l / 2 * c, 1, -1.5 * l * s, l / 2 * c, -1, -2 * l * s, 0, 0]

    def free(phi: float, rate: float) -> float:
        c, s = np.cos(phi), np.sin(phi)
        J = l * l * (m1 / 3 + m2 / 12 + m2 * (2.25 * s * s + 0.25 * c * c) + 4 * m3 * s * s)
        J_1 = l * l * (4 * m2 + 8 * m3) * s * c
        return float(-(J_1 / 2 * rate * rate + (m1 + m2) / 2 * GRAVITY * l * c) / J)

    angle = (lambda t: start + speed * t) if driven else turning(free, start, speed, 3.0)
    mechanism = Mechanism(bodies, (*joints, *drivers), gravity_m_s2=GRAVITY)
    return Passing(mechanism, np.array(q, dtype=float), speed * np.array(v), 3.0, 25.0, angle)


#: By name.
PASSING: dict[str, Callable[[], Passing]] = {
    **{f"A02 N={loops}": partial(parallelograms, loops) for loops in (1, 2, 5)},
    "free equal links": partial(equal_links, driven=False),
    "driven equal links": partial(equal_links, driven=True),
}
STABILISED: dict[str, Stabilisation] = {"projection": "projection", "baumgarte": Baumgarte(50.0, 50.0)}


@dataclass
class Tally:
    """What random runs came to: how many were right, why some were refused, and which were wrong unsaid."""

    right: int
    refused: list[SolverError]
    wrong: list[str]


def random_runs(
    passing: Passing, stabilisation: Stabilisation, count: int, seed: int, controlled: bool = False
) -> Tally:
    """Return what so many random runs came to.

    Steps are between a 2000th and a 20,000th of the end time, or DOP853's tolerance between 1e-12 and 1e-3.
    """
    random, tally = np.random.default_rng(seed), Tally(0, [], [])
    for _ in range(count):
        samples, step = int(random.integers(1, SAMPLES)), passing.end_time_s / 2000 * 10 ** -random.random()
        choice = ErrorControl(10 ** random.uniform(-12, -3)) if controlled else StepChoice(step)
        solver = Solver(passing.mechanism, passing.q, choice, stabilisation)
        try:
            run = solver.run(passing.q, passing.v, passing.end_time_s, samples)
        except SolverError as error:
            tally.refused.append(error)
            continue
        error_rad = float(np.abs(run.q[:, 2] - passing.angle(run.time_s)).max())
        if error_rad <= passing.allowed(choice, stabilisation):
            tally.right += 1
        else:
            tally.wrong.append(f"{choice} with {samples} samples: {error_rad:.1e} rad")
    return tally
