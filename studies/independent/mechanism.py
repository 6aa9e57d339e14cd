"""A scene in numbers for the equations in ``equations``: bodies, walls, drive and load."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine_models.scene.scene import Clearance, Scene
from studies.independent.drives import CONSTANT, Drive, drive_of, prescribed_speed, start_speed
from studies.independent.loads import Load, load_of

FloatArray = NDArray[np.float64]
SIZE, JOINTS = 7, "OAB"
#: Floor of the approach speed in laws that divide by it, where the scene gives none.
SLOWEST_M_S = 1e-6
FRICTION = ("saturated-linear", "ambrosio", "tanh")
#: How many times the crank's length the weightless rod is that a pendulum has.
WEIGHTLESS = 100.0
#: Places at which a prescribed speed is looked at for its largest.
LOOKS = 1000


class Bodies(NamedTuple):
    """Masses in kg, inertias in kg m^2, lengths and centres of mass in m."""

    crank_kg: float
    crank_kg_m2: float
    crank_m: float
    crank_centre_m: float
    rod_kg: float
    rod_kg_m2: float
    rod_m: float
    rod_centre_m: float
    slider_kg: float
    gravity_m_s2: float
    free: NDArray[np.int64]  # the coordinates that move on their own


class Walls(NamedTuple):
    """Of each joint, (3,): clearance c and bearing radius R in m, F = K delta^n (1 + a delta'/v0) + b delta'.

    Friction is mu F f(v) with f = 1 at full speed, 0 below the dead one, or tanh. A law that ``pulls`` is
    left as it is, but for its friction; friction too where it ``drags``. Of rigid walls K is infinite, e the
    restitution, and what comes slower than ``slowest`` does not rebound.
    """

    c: FloatArray
    R: FloatArray
    K: FloatArray
    n: FloatArray
    a: FloatArray
    b: FloatArray
    e: FloatArray
    slowest: FloatArray
    pulls: NDArray[np.bool_]
    drags: NDArray[np.bool_]
    mu: FloatArray
    full: FloatArray
    dead: FloatArray
    kind: NDArray[np.int64]  # of ``FRICTION``


class Mechanism(NamedTuple):
    """All that decides the motion but its start."""

    bodies: Bodies
    walls: Walls
    drive: Drive
    load: Load


def mechanism_of(scene: Scene) -> Mechanism:
    """Return the mechanism of a scene."""
    return Mechanism(_bodies_of(scene), _walls_of(scene), drive_of(scene), load_of(scene))


def _bodies_of(scene: Scene) -> Bodies:
    crank, free = scene.crank, [] if scene.speed_is_prescribed else [0]
    for k, name in enumerate(JOINTS):
        free += [2 * k + 1, 2 * k + 2] * (name in scene.joints_with_clearance)
    first = crank.mass_kg, crank.inertia_kg_m2, crank.length_m, crank.centre_of_mass_m
    others = 0.0, 0.0, WEIGHTLESS * crank.length_m, 0.0, 0.0
    if scene.is_crank_slider:
        _, rod, slider = scene.crank_slider()
        others = rod.mass_kg, rod.inertia_kg_m2, rod.length_m, rod.centre_of_mass_m, slider.mass_kg
    return Bodies(*first, *others, scene.weight_m_s2, np.array(free))


def damping_of(law: str, e: float) -> float:
    """Return a(e) of a law, from its paper; 0 of those without restitution."""
    if law == "hunt-crossley":
        return 1.5 * (1 - e)
    if law == "lankarani-nikravesh":
        return 0.75 * (1 - e * e)
    if law == "gonthier":
        return (1 - e * e) / e
    if law == "zhiying-qishao":
        return 0.75 * (1 - e * e) * math.exp(2 - 2 * e)
    if law == "flores":
        return 1.6 * (1 - e) / e
    if law == "hu-guo":
        return 1.5 * (1 - e) / e
    if law == "carvalho-martins":
        return 1.5 * (1 - e) * (11 - e) / (1 + 9 * e)
    assert law in ("linear", "kelvin-voigt", "hertz", "rigid"), law
    return 0.0


def _stiffness_of(clearance: Clearance) -> float:
    """Return K as given, infinite of a rigid wall, or by Hertz of a pin in a hole of its own material.

    K = 4/(3 (s_i + s_j)) sqrt(R_i R_j/(R_i - R_j)) with s = (1 - nu^2)/E.
    """
    if clearance.law == "rigid":
        return math.inf
    if clearance.stiffness is not None:
        return clearance.stiffness
    E, nu, c = clearance.young_modulus_Pa, clearance.poisson_ratio, clearance.radial_clearance_m
    assert E is not None
    assert nu is not None
    hole = clearance.bearing_radius_m
    return 2 * E / (3 * (1 - nu * nu)) * math.sqrt(hole * (hole - c) / c)


def _walls_of(scene: Scene) -> Walls:
    """Return the walls of a scene's joints; ideal ones have c = 0."""
    joints = (scene.clearance.O, scene.clearance.A, scene.clearance.B)
    rows = [_wall_of(joint) if joint else [0.0] * 3 + [1.0] + [0.0] * 7 + [1.0, 0.0, 0.0] for joint in joints]
    c, R, K, n, a, b, e, slowest, pulls, drags, mu, full, dead, kind = np.array(rows).T.copy()
    signs = pulls.astype(np.bool_), drags.astype(np.bool_)
    return Walls(c, R, K, n, a, b, e, slowest, *signs, mu, full, dead, kind.astype(np.int64))


def _wall_of(clearance: Clearance) -> list[float]:
    law, friction = clearance.law, clearance.friction
    e, rubs = clearance.restitution or 0.0, [0.0, 1.0, 0.0, 0.0]
    if friction is not None:
        speeds = friction.regularisation_speed_m_s, friction.dead_band_speed_m_s or 0.0
        rubs = [friction.coefficient, *speeds, FRICTION.index(friction.law)]
    return [
        clearance.radial_clearance_m,
        clearance.bearing_radius_m,
        _stiffness_of(clearance),
        clearance.exponent or (1.0 if law in ("linear", "kelvin-voigt") else 1.5),
        damping_of(law, e),
        clearance.damping_N_s_m or 0.0,
        e,
        clearance.minimum_impact_speed_m_s or (0.0 if law == "rigid" else SLOWEST_M_S),
        float(clearance.may_pull or law == "kelvin-voigt"),
        float(clearance.may_pull),
        *rubs,
    ]


def start_of(scene: Scene) -> tuple[FloatArray, FloatArray]:
    """Return w and its rate: pins in the middle, at rest there, or where the bodies' states have them."""
    w, rate = np.zeros((2, SIZE))
    w[0], rate[0] = scene.start.crank_angle_rad, start_speed(scene)
    if scene.start.states:
        crank, rod = scene.crank, scene.rod
        arms = [(-crank.centre_of_mass_m, crank.length_m - crank.centre_of_mass_m), (0.0, 0.0), (0.0, 0.0)]
        if rod is not None:
            arms[1] = -rod.centre_of_mass_m, rod.length_m - rod.centre_of_mass_m
        end, end_rate = np.zeros((2, 2))
        for k, (body, (near, far)) in enumerate(zip(scene.start.states, arms, strict=False)):
            angle, turn = body.angle_rad, body.angular_velocity_rad_s
            along = np.array([math.cos(angle), math.sin(angle)])
            across = turn * np.array([-along[1], along[0]])
            centre = np.array([body.x_m, body.y_m])
            speed = np.array([body.velocity_x_m_s, body.velocity_y_m_s])
            if JOINTS[k] in scene.joints_with_clearance:
                w[2 * k + 1 : 2 * k + 3] = centre + near * along - end
                rate[2 * k + 1 : 2 * k + 3] = speed + near * across - end_rate
            end, end_rate = centre + far * along, speed + far * across
        w[0] = scene.start.states[0].angle_rad
        if not scene.speed_is_prescribed:
            rate[0] = scene.start.states[0].angular_velocity_rad_s
    return w, rate


def speed_of(scene: Scene) -> float:
    """Return a speed in m/s typical of the mechanism: that of the crank's pin, or what work may make it.

    It is no less than that of a body at the start, nor than what crosses a clearance within the scene.
    """
    told = (math.hypot(body.velocity_x_m_s, body.velocity_y_m_s) for body in scene.start.states)
    rooms: list[float] = [
        getattr(scene.clearance, joint).radial_clearance_m for joint in scene.joints_with_clearance
    ]
    return max([_driven_speed(scene), *told, *(room / scene.end_time_s for room in rooms)])


def _driven_speed(scene: Scene) -> float:
    drive, r = drive_of(scene), scene.crank.length_m
    if drive.kind >= CONSTANT:
        looks = np.linspace(0.0, scene.end_time_s, LOOKS).tolist()
        return r * max(abs(prescribed_speed(drive, t)) for t in looks)
    load = load_of(scene)
    force = abs(load.force_N) + np.abs(load.pieces[3:]).max(initial=0.0)
    work = 2 * r * force + 2 * math.pi * abs(drive.numbers[0] if scene.drive.kind == "torque" else 0.0)
    mass = sum(body.mass_kg for body in scene.bodies)
    fastest = max(abs(start_speed(scene)), abs(drive.numbers[1])) * r
    return math.sqrt(fastest**2 + 2 * (scene.weight_m_s2 * r + work / mass))
