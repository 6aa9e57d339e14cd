"""Points, joints, guides and what a scene observes, in any states of a mechanism's bodies.

States are positions and velocities (n, bodies, 3) at n times: (x, y, phi) of centres of mass.
"""

import math
from dataclasses import dataclass

import numpy as np

from engine_models.engine import FloatArray, Trajectory
from engine_models.scene.scene import Scene
from reference_solver.mechanism.data import GROUND as GROUND
from reference_solver.mechanism.data import Ends, MechanismData
from reference_solver.mechanism.data import Line as Line
from reference_solver.mechanism.data import Pin as Pin
from reference_solver.mechanism.data import Point as Point
from reference_solver.mechanism.data import Spring as Spring


@dataclass(frozen=True)
class PointMotion:
    """Place and velocity (n, 2) of a point, and the spin (n,) of its body."""

    place_m: FloatArray
    rate_m_s: FloatArray
    spin_rad_s: FloatArray


@dataclass(frozen=True)
class JointGap:
    """``gap_m`` (n, 2) is from the bearing's centre to the pin's."""

    gap_m: FloatArray
    rate_m_s: FloatArray


def point_motion(body: int, point: Point, position: FloatArray, velocity: FloatArray) -> PointMotion:
    """Return the motion of a point of a body."""
    x, y = point
    if body == GROUND:
        still = np.zeros((len(position), 2))
        return PointMotion(still + point, still, still[:, 0])
    cos, sin, spin = np.cos(position[:, body, 2]), np.sin(position[:, body, 2]), velocity[:, body, 2]
    reach = x * np.stack([cos, sin], axis=-1)
    if y:
        reach += y * np.stack([-sin, cos], axis=-1)
    turned = np.stack([-reach[:, 1], reach[:, 0]], axis=-1)
    return PointMotion(position[:, body, :2] + reach, velocity[:, body, :2] + spin[:, None] * turned, spin)


def ends_of(part: Ends, position: FloatArray, velocity: FloatArray) -> tuple[PointMotion, PointMotion]:
    """Return the motions of the points of bodies i and j."""
    i = point_motion(part.body_i, part.point_i, position, velocity)
    return i, point_motion(part.body_j, part.point_j, position, velocity)


def pin_gap(pin: Pin, position: FloatArray, velocity: FloatArray) -> JointGap:
    """Return the gap of a joint from its bearing to its pin."""
    bearing, own = ends_of(pin, position, velocity)[:: -1 if pin.bearing_on_j else 1]
    gap, rate = own.place_m - bearing.place_m, own.rate_m_s - bearing.rate_m_s
    return JointGap(gap, rate)


def way(line: Line, position: FloatArray, velocity: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the way of a line's point along it and its rate, (n,) each."""
    return _along(line, False, position, velocity)


def off_line(line: Line, position: FloatArray, velocity: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return how far a line's point is off it, to the left, and the rate of that, (n,) each."""
    return _along(line, True, position, velocity)


def line_angle_rad(line: Line, position: FloatArray) -> FloatArray:
    """Return the angle of a line, (n,)."""
    turned = 0.0 if line.body_i == GROUND else position[:, line.body_i, 2]
    return np.asarray(line.angle_rad + turned + np.zeros(len(position)))


def direction(line: Line, position: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the unit vectors along a line and to its left, (n, 2) each."""
    angle = line_angle_rad(line, position)
    u = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    return u, np.stack([-u[:, 1], u[:, 0]], axis=-1)


# s = u.d, d = p_j - p_i, u' = phi_i' n with n 90 degrees counter-clockwise of u: s' = u.d' + phi_i' n.d
def _along(
    line: Line, across: bool, position: FloatArray, velocity: FloatArray
) -> tuple[FloatArray, FloatArray]:
    i, j = ends_of(line, position, velocity)
    u, n = direction(line, position)
    if across:
        u, n = n, -u
    d, rate = j.place_m - i.place_m, j.rate_m_s - i.rate_m_s
    return np.sum(u * d, axis=1), np.sum(u * rate, axis=1) + i.spin_rad_s * np.sum(n * d, axis=1)


def turned_apart(line: Line, position: FloatArray) -> FloatArray:
    """Return the angle of a line's body j against body i, (n,)."""
    angles = (0.0 if body == GROUND else position[:, body, 2] for body in (line.body_j, line.body_i))
    return np.asarray(next(angles) - next(angles))


def turns_of(of: MechanismData, angle: FloatArray) -> FloatArray:
    """Return the whole turns by twos in angles (n,), 0 in those of up to two.

    They would cost digits; a sine's own reduction is exact, and gas is the same after two turns. A torsion
    spring is not: with one there are none.
    """
    within = np.arctan2(np.sin(angle), np.cos(angle))
    count = np.round((angle - within) / math.tau)
    kept = within + math.tau * np.mod(count, 2)
    return np.where((np.abs(angle) <= 4 * math.pi) | bool(of.torsions), 0.0, angle - kept)


def levers_m(of: MechanismData) -> list[float]:
    """Return the distances in m between points of each body at joints and guides, and its centre of mass."""
    points: dict[int, list[Point]] = {number: [(0.0, 0.0)] for number in range(len(of.bodies))}
    for part in (*of.pins, *of.guides):
        points.get(part.body_i, []).append(part.point_i)
        points.get(part.body_j, []).append(part.point_j)
    return [math.dist(a, b) for places in points.values() for a in places for b in places]


def lever_m(scene: Scene) -> float:
    """Return the longest distance between two points of a body at joints, or from its centre of mass, in m.

    Of a crank-slider or a pendulum it is the crank's length.
    """
    if scene.is_short:
        return scene.short.crank.length_m
    return max(levers_m(scene.mechanism), default=0.0) or 1.0


def shortest_m(scene: Scene) -> float:
    """Return the shortest distance between two joints of a body in m, or the longest lever without one."""
    if scene.is_short:
        return min(link.length_m for link in (scene.short.crank, scene.short.rod) if link)
    return min((lever for lever in levers_m(scene.mechanism) if lever > 0), default=lever_m(scene))


def observed(scene: Scene, run: Trajectory) -> tuple[FloatArray, FloatArray]:
    """Return what a scene observes, in m or rad, and its rate, (n,) each.

    A crank-slider's is the slider's way along its guide, a pendulum's the place of its pin A along x.
    """
    of = scene.observed
    if of.what == "angle":
        return run.position[:, of.body, 2], run.velocity[:, of.body, 2]
    if of.guide is not None:
        return way(of.guide, run.position, run.velocity)
    point, axis = point_motion(of.body, of.point, run.position, run.velocity), "xy".index(of.what)
    return point.place_m[:, axis], point.rate_m_s[:, axis]


def observed_m(scene: Scene, run: Trajectory) -> FloatArray:
    """Return what a scene observes in m, (n,): an angle times the longest lever."""
    value, _ = observed(scene, run)
    return lever_m(scene) * value if scene.observed.what == "angle" else value


def observed_columns(scene: Scene, run: Trajectory) -> dict[str, FloatArray]:
    """Return what a scene observes, and its rate, (n,) each, by their columns: ``observed_B_x_m``."""
    if scene.is_short and "rod" in scene.body:
        names = "slider_position_m", "slider_velocity_m_s"
    else:
        of = scene.observed
        name = f"observed_{of.name.replace('.', '_')}"
        unit = "rad" if of.what == "angle" else "m"
        names = f"{name}_{unit}", f"{name}_velocity_{unit}_s"
    return dict(zip(names, observed(scene, run), strict=True))


def guide_column(scene: Scene, guide: str) -> str:
    """Return the column of a guide's normal force; that of a crank-slider goes without its name."""
    return "guide_normal_force_N" if scene.is_short else f"guide_{guide}_normal_force_N"


def observed_in_words(scene: Scene) -> str:
    """Return what a tolerance is of, in words."""
    if scene.is_short and "rod" in scene.body:
        return "slider position"
    of = scene.observed
    scaled = f" times the longest lever, {lever_m(scene):.3g} m" if of.what == "angle" else ""
    return f"{of.name}{scaled}"
