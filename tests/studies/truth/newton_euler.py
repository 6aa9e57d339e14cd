"""The ideal crank-slider body by body: Newton's and Euler's laws with every joint's force as an unknown.

Accelerations and reactions solve one linear system; positions, velocities and all works come from DOP853, the
prescribed speeds by integrating their accelerations. Splines are B-splines. No minimal coordinate, no
closed-form motion, nothing of the truth under test.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.interpolate import BSpline, make_interp_spline

from engine_models.scene.scene import Scene
from reference_solver.mechanism.data import Course, DriveData, Fluctuation, Motor, Ramp, Torque

FloatArray = NDArray[np.float64]
#: Parts of the load on the slider.
PARTS = ("force", "viscous", "spring", "gas")


@dataclass(frozen=True)
class Run:
    """What an ``engine.Trajectory`` has, in its shapes and signs, and the works of the load by part."""

    position: FloatArray
    velocity: FloatArray
    joint_force_N: FloatArray
    guide_normal_force_N: FloatArray
    driver_torque_N_m: FloatArray
    driver_work_J: FloatArray
    load_work_J: dict[str, FloatArray]


def integrate(scene: Scene, times: FloatArray, rtol: float, longest_s: float) -> Run:
    """Integrate from the assembly at the scene's start, DOP853 in steps of ``longest_s`` at most."""
    load_at, drive = slider_load(scene), scene.mechanism.drive
    speed_at, acceleration_at = prescribed(drive) if drive.prescribes else (None, None)
    masses = np.array([[part.mass_kg, part.mass_kg, part.inertia_kg_m2] for part in scene.bodies])

    def solved(t: float, q: FloatArray, v: FloatArray) -> tuple[FloatArray, dict[str, float]]:
        """Return accelerations (9,), O, A, B (6,), guide force and moment, torque in a row; and the load."""
        load = load_at(q[0, 2], q[2, 0], v[2, 0])
        A, b = np.zeros((18, 18)), np.zeros(18)
        A[:9, :9] = np.diag(masses.ravel())
        b[[1, 4, 7]] = -masses[:, 0] * scene.gravity_m_s2
        b[6] += sum(load.values())
        for joint, body, arm, sign in _pins(scene):
            x, y = arm * np.cos(q[body, 2]), arm * np.sin(q[body, 2])
            column, place = 9 + 2 * joint, 3 * body
            A[place : place + 3, column : column + 2] -= sign * np.array([[1, 0], [0, 1], [-y, x]])
            # The accelerations of the joint's two sides are equal; the frame's is zero.
            A[column : column + 2, place : place + 3] += sign * np.array([[1, 0, -y], [0, 1, x]])
            b[column : column + 2] += sign * v[body, 2] ** 2 * np.array([x, y])
        A[7, 15], A[8, 16], A[15, 7], A[16, 8] = -1, -1, 1, 1
        A[2, 17] = -1
        if acceleration_at is not None:
            A[17, 2], b[17] = 1, acceleration_at(t)
        else:
            A[17, 17], b[17] = 1, torque(drive, v[0, 2])
        return np.asarray(np.linalg.solve(A, b)), load

    def derivative(t: float, y: FloatArray) -> FloatArray:
        q, v = y[:18].reshape(2, 3, 3)
        found, load = solved(t, q, v)
        powers = [force * v[2, 0] for force in load.values()]
        return np.concatenate([y[9:18], found[:9], [found[17] * v[0, 2]], powers])

    start = np.concatenate(
        [_assembly(scene, speed_at(0.0) if speed_at else scene.start.crank_speed_rad_s).ravel(), np.zeros(5)]
    )
    run = solve_ivp(
        derivative,
        (times[0], times[-1]),
        start,
        "DOP853",
        t_eval=times,
        rtol=rtol,
        atol=1e-14,
        max_step=longest_s,
    )
    q, v = run.y[:18].T.reshape(-1, 2, 3, 3).swapaxes(0, 1)
    found = np.array([solved(*state)[0] for state in zip(times, q, v, strict=True)])
    works = dict(zip(PARTS, run.y[19:], strict=True))
    joints = found[:, 9:15].reshape(-1, 3, 2)
    return Run(q, v, joints, found[:, 15], found[:, 17], run.y[18], works)


def slider_load(scene: Scene) -> Callable[[float, float, float], dict[str, float]]:
    """Return the parts of the load in N as a function of theta, x and x'; those that are absent are zero."""
    load, gas = scene.load.slider, None
    if load is not None and load.gas is not None:
        angle, force = np.array(load.gas.crank_angle_rad), np.array(load.gas.force_N)
        angle[-1], force[-1] = angle[0] + 2 * np.pi, force[0]
        order = 1 if load.gas.interpolation == "linear" else 3
        gas = make_interp_spline(angle, force, k=order, bc_type="periodic")

    def forces(theta: float, x: float, speed: float) -> dict[str, float]:
        if load is None:
            return dict.fromkeys(PARTS, 0.0)
        return {
            "force": load.force_N or 0.0,
            "viscous": -(load.viscous_N_s_m or 0.0) * speed,
            "spring": (load.spring_N_m or 0.0) * ((load.free_position_m or 0.0) - x),
            "gas": 0.0 if gas is None else float(gas(theta, extrapolate="periodic")),
        }

    return forces


def torque(drive: DriveData, speed: float) -> float:
    """Return the torque in N m of a drive that does not prescribe the speed."""
    law = drive.law
    if isinstance(law, Motor):
        return law.stall_torque_N_m * (1 - speed / law.no_load_speed_rad_s)
    if isinstance(law, Torque):
        assert isinstance(law.torque_N_m, float)
        return law.torque_N_m
    return 0.0


def prescribed(drive: DriveData) -> tuple[Callable[[float], float], Callable[[float], float]]:
    """Return a prescribed speed in rad/s and its derivative, as functions of the time since the start."""
    law, clock = drive.law, drive.clock_s
    if isinstance(law, Ramp):
        change, lasts = law.last - law.first, law.duration_s
        smooth = np.polynomial.Polynomial([0, 0, 0, 10, -15, 6])
        return (
            lambda t: law.first + change * float(smooth(min((t + clock) / lasts, 1.0))),
            lambda t: change / lasts * float(smooth.deriv()(min((t + clock) / lasts, 1.0))),
        )
    if isinstance(law, Fluctuation):
        rate, a = 2 * np.pi * law.frequency_Hz, law.amplitude
        return (
            lambda t: law.mean + a * float(np.sin(rate * (t + clock) + law.phase_rad)),
            lambda t: a * rate * float(np.cos(rate * (t + clock) + law.phase_rad)),
        )
    if isinstance(law, Course):
        table = law.table
        assert table.interpolation == "spline"
        assert table.end_slopes is not None
        ends = tuple([(1, slope)] for slope in table.end_slopes)
        spline: BSpline = make_interp_spline(table.x, table.y, k=3, bc_type=ends)
        return (
            lambda t: float(spline.derivative()(t + clock)),
            lambda t: float(spline.derivative(2)(t + clock)),
        )
    assert law is not None
    assert not isinstance(law, Motor | Torque)
    constant = np.polynomial.Polynomial([law.speed])
    return constant, constant.deriv()


def _pins(scene: Scene) -> list[tuple[int, int, float, int]]:
    """Return joint, body, the pin's distance from its centre of mass along it, and the force's sign there."""
    crank, rod, _ = scene.crank_slider()
    s, d = crank.centre_of_mass_m, rod.centre_of_mass_m
    return [
        (0, 0, -s, 1),
        (1, 1, -d, 1),
        (1, 0, crank.length_m - s, -1),
        (2, 2, 0.0, 1),
        (2, 1, rod.length_m - d, -1),
    ]


def _assembly(scene: Scene, omega: float) -> FloatArray:
    """Return positions and velocities (2, 3, 3) by the triangle's angles and the pins' velocities."""
    crank, rod, _ = scene.crank_slider()
    r, length = crank.length_m, rod.length_m
    theta = scene.start.crank_angle_rad
    pin = r * np.array([np.cos(theta), np.sin(theta)])
    slider = np.array([pin[0] + np.sqrt(length**2 - pin[1] ** 2), 0.0])
    along = (slider - pin) / length
    pin_v = omega * np.array([-pin[1], pin[0]])
    # The rod's turning cancels the pin's velocity across the guide.
    turning = -pin_v[1] / (length * along[0])
    across = np.array([-along[1], along[0]])
    s, d = crank.centre_of_mass_m / r, rod.centre_of_mass_m
    place = [[*(s * pin), theta], [*(pin + d * along), np.arctan2(along[1], along[0])], [*slider, 0.0]]
    slider_v = pin_v + length * turning * across
    rate = [[*(s * pin_v), omega], [*(pin_v + d * turning * across), turning], [slider_v[0], 0.0, 0.0]]
    return np.array([place, rate])
