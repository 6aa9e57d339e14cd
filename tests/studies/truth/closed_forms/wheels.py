"""A wheel dropped in its bearing, a pendulum on a dry one, and a rod shorter than its crank, by hand.

Nothing here is shared with what they test.
"""

import math

import numpy as np
from scipy.integrate import solve_ivp

from engine_models.engine import FloatArray
from engine_models.scene.scene import Clearance, Scene

#: Of ``solve_ivp``'s DOP853, an integrator of another kind and order than the reference's.
TOLERANCE = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-16}
#: A bounce shorter than this has ended: no sample could tell its length.
SHORTEST_FLIGHT_S = 1e-13


def dropped_wheel(scene: Scene, time_s: FloatArray) -> FloatArray:
    """Return the height y (n,) in m, at times from 0 on, of a wheel on the vertical through its bearing.

    In flight y follows gravity. At the walls y = -c and y = c a compliant law gives, in depth,
    m delta'' = m g - K delta^n (1 + a delta'/v0) below, zero where that would pull unless the law may, and a
    rigid one y' -> -e y'. Bounces whose sum converges end at rest.
    """
    clearance, state = _bearing(scene), scene.start.states[0]
    c, rigid = clearance.radial_clearance_m, clearance.law == "rigid"
    t, y, v, out = 0.0, state.y_m, state.velocity_y_m_s, np.empty(len(time_s))
    while t < time_s[-1]:
        outwards = abs(y) == c and y * v > 0
        if rigid and outwards:
            v *= -(clearance.restitution or 0.0)
            if 2 * abs(v) < scene.weight_m_s2 * SHORTEST_FLIGHT_S:
                out[time_s >= t] = y
                break
        elif outwards or abs(y) > c:
            t, y, v = _contact(scene, t, y, v, time_s, out)
        else:
            t, y, v = _flight(scene, t, y, v, time_s, out)
    return out


def _bearing(scene: Scene) -> Clearance:
    assert scene.clearance.O is not None
    return scene.clearance.O


def _flight(
    scene: Scene, t: float, y: float, v: float, time_s: FloatArray, out: FloatArray
) -> tuple[float, float, float]:
    """Fly to the wall that is met first and fill in the samples on the way."""
    c, g = _bearing(scene).radial_clearance_m, scene.weight_m_s2
    walls = [((v + math.sqrt(v * v + 2 * g * (y + c))) / g, -c)]
    if v > 0 and v * v > 2 * g * (c - y):
        walls.append(((v - math.sqrt(v * v - 2 * g * (c - y))) / g, c))
    flight, wall = min(walls)
    during = (time_s >= t) & (time_s <= t + flight)
    elapsed = time_s[during] - t
    out[during] = y + v * elapsed - g * elapsed**2 / 2
    return t + flight, wall, v - g * flight


def _contact(
    scene: Scene, t: float, y: float, v: float, time_s: FloatArray, out: FloatArray
) -> tuple[float, float, float]:
    """Go through a contact, to its end or that of the samples, and fill them in."""
    clearance, m = _bearing(scene), scene.crank.mass_kg
    wall, stiffness = math.copysign(1.0, y), clearance.stiffness
    assert stiffness is not None
    exponent = clearance.exponent or (1.0 if clearance.law == "linear" else 1.5)
    e = clearance.restitution
    factor = 0.0 if e is None or v == 0 else 3 * (1 - e**2) / 4 / abs(v)  # Lankarani-Nikravesh 1990

    def slopes(_: float, state: FloatArray) -> list[float]:
        depth, rate = max(state[0], 0.0), state[1]
        force = stiffness * depth**exponent * (1 + factor * rate)
        return [rate, -wall * scene.weight_m_s2 - (force if clearance.may_pull else max(force, 0.0)) / m]

    def surface(_: float, state: FloatArray) -> float:
        return float(state[0])

    surface.terminal, surface.direction = True, -1.0  # type: ignore[attr-defined]
    c = clearance.radial_clearance_m
    begin = [abs(y) - c, wall * v]
    run = solve_ivp(slopes, (t, time_s[-1]), begin, dense_output=True, events=surface, **TOLERANCE)
    end = float(run.t[-1])
    during = (time_s >= t) & (time_s <= end)
    if during.any():
        out[during] = wall * (c + run.sol(time_s[during])[0])
    left = run.status == 1
    return end, wall * c if left else wall * (c + run.y[0, -1]), wall * float(run.y[1, -1])


def turning_rod(scene: Scene, time_s: FloatArray) -> FloatArray:
    """Return the slider's position (n,) where the rod is the shorter link, and so the one that turns.

    With its angle phi as the coordinate sin(theta) = -(L/r) sin(phi) never comes to the end of its range, and
    phi' = sqrt(2 (E - V(phi))/J(phi)) follows from energy for as long as the rod does not turn back.
    """
    crank, rod, _ = scene.crank_slider()
    r, length, s, d = crank.length_m, rod.length_m, crank.centre_of_mass_m, rod.centre_of_mass_m
    m = np.array([[body.mass_kg, body.mass_kg, body.inertia_kg_m2] for body in scene.bodies])

    def at(phi: float) -> tuple[FloatArray, FloatArray]:
        """Return X and dX/dphi, each (3, 3)."""
        sin, sin_1 = -length / r * math.sin(phi), -length / r * math.cos(phi)
        cos = math.sqrt(1 - sin * sin)
        theta_1 = sin_1 / cos
        cos_1 = -sin * theta_1
        along, along_1 = np.array([math.cos(phi), math.sin(phi)]), np.array([-math.sin(phi), math.cos(phi)])
        pin, pin_1 = np.array([cos, sin]), np.array([cos_1, sin_1])
        slider = r * cos + length * math.cos(phi), r * cos_1 - length * math.sin(phi)
        X = [[*(s * pin), math.asin(sin)], [*(r * pin + d * along), phi], [slider[0], 0, 0]]
        X_1 = [[*(s * pin_1), theta_1], [*(r * pin_1 + d * along_1), 1], [slider[1], 0, 0]]
        return np.array(X), np.array(X_1)

    def energies(phi: float) -> tuple[float, float]:
        X, X_1 = at(phi)
        return float(np.sum(m * X_1**2)), scene.weight_m_s2 * float(m[:, 0] @ X[:, 1])

    phi_0 = math.asin(-r / length * math.sin(scene.start.crank_angle_rad))
    rate_0 = scene.start.crank_speed_rad_s / at(phi_0)[1][0, 2]
    inertia, height = energies(phi_0)
    energy = inertia * rate_0**2 / 2 + height

    def rate(_: float, phi: FloatArray) -> list[float]:
        inertia, height = energies(float(phi[0]))
        return [math.copysign(math.sqrt(2 * (energy - height) / inertia), rate_0)]

    run = solve_ivp(rate, (0.0, time_s[-1]), [phi_0], t_eval=time_s, **TOLERANCE)
    return np.array([at(float(phi))[0][2, 0] for phi in run.y[0]])


def swinging_pendulum(scene: Scene, time_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return angle (n,) in rad and pin's place (n, 2) in m of a pendulum that stays on its bearing's wall.

    Its law is Kelvin and Voigt's, its friction saturates linearly. With e the unit vector from the bearing's
    centre to the pin's, at the distance c + delta, and t = (-e_y, e_x) the forces on the pin are -N e and
    -mu N f t, f the sliding speed in parts of the regularisation speed, no more than 1.
    """
    clearance, link, g = _bearing(scene), scene.crank, scene.weight_m_s2
    friction, K, d = clearance.friction, clearance.stiffness, clearance.damping_N_s_m
    assert friction is not None
    assert K is not None
    assert d is not None
    c, s, m = clearance.radial_clearance_m, link.centre_of_mass_m, link.mass_kg

    def pin(state: FloatArray) -> tuple[float, float, float, float]:
        x, y, angle, u, v, spin = state
        cos, sin = math.cos(angle), math.sin(angle)
        return x - s * cos, y - s * sin, u + s * spin * sin, v - s * spin * cos

    def slopes(_: float, state: FloatArray) -> list[float]:
        x, y, u, v = pin(state)
        away = math.hypot(x, y)
        e_x, e_y, depth = x / away, y / away, away - c
        normal = K * depth + d * (u * e_x + v * e_y)
        lever = clearance.bearing_radius_m - c - depth / 2
        sliding = v * e_x - u * e_y + state[5] * lever
        share = max(-1.0, min(1.0, sliding / friction.regularisation_speed_m_s))
        drag = friction.coefficient * normal * share
        force_x, force_y = -normal * e_x + drag * e_y, -normal * e_y - drag * e_x
        at_x, at_y = x - state[0] + lever * e_x, y - state[1] + lever * e_y
        torque = at_x * force_y - at_y * force_x
        return [*state[3:], force_x / m, force_y / m - g, torque / link.inertia_kg_m2]

    (begin,) = scene.start.states
    y_0 = [
        *(begin.x_m, begin.y_m, begin.angle_rad),
        *(begin.velocity_x_m_s, begin.velocity_y_m_s, begin.angular_velocity_rad_s),
    ]
    run = solve_ivp(slopes, (0.0, time_s[-1]), y_0, method="LSODA", t_eval=time_s, rtol=1e-10, atol=1e-13)
    place = np.array([pin(state)[:2] for state in run.y.T])
    return run.y[2], place
