"""The crank-slider in the places of its pins in their bearings, with walls that give, as machine code.

w = (theta, d_O, d_A, d_B) as in ``rigid_kinematics``: the crank's angle, and pin centre less bearing centre
of every joint, zero where it is ideal. A gap is so a coordinate itself, exact to its own round-off. The
state y (14,) is w and its rate. M w'' = Q follows from the bodies' velocities J w'; there is no multiplier.

A pin that follows a rigid wall has psi of d = c (cos(psi), sin(psi)) in place of d_x, and nothing in
place of d_y: such a state is z (14,), and the wall's force is what the equation along the normal leaves over.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from engine_models.scene.scene import Clearance, Scene

FloatArray = NDArray[np.float64]
SIZE, JOINTS = 7, "OAB"
#: Columns of a joint's phase: what its contact is, its a/v0 while it touches, and the piece of its friction.
CONTACT, MEMORY, PIECE = range(3)
#: Contacts: none, one whose wall pushes by its law, and one whose law would pull: there is no force then, but
#: of Kelvin and Voigt's law no friction only.
FLIGHT, PUSHED, CLIPPED = 0.0, 1.0, 2.0
#: Of a rigid wall: its pin follows it.
FOLLOWS = 3.0
#: Floor of the approach speed in laws that divide by it, where the scene gives none.
SLOWEST_M_S = 1e-6
FRICTION = ("saturated-linear", "ambrosio", "tanh")


class Bodies(NamedTuple):
    """Masses in kg, inertias in kg m^2, lengths and centres of mass in m, the crank's torque in N m."""

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
    torque_N_m: float
    free: NDArray[np.int64]  # the coordinates that move on their own


class Walls(NamedTuple):
    """Of each joint, (3,): clearance c and bearing radius R in m, F = K delta^n (1 + a delta'/v0) + b delta'.

    Friction is mu F f(v) with f = 1 at full speed, 0 below the dead one, or tanh.
    """

    c: FloatArray
    R: FloatArray
    K: FloatArray
    n: FloatArray
    a: FloatArray
    b: FloatArray
    slowest: FloatArray
    pulls: NDArray[np.bool_]
    mu: FloatArray
    full: FloatArray
    dead: FloatArray
    kind: NDArray[np.int64]  # of ``FRICTION``


def bodies_of(scene: Scene) -> Bodies:
    """Return the bodies of a crank-slider without load; its drive is a constant torque or speed, or none."""
    assert scene.drive.kind in ("free", "torque", "constant-speed"), scene.drive.kind
    assert scene.load.slider is None
    crank, rod, slider = scene.crank_slider()
    free = [0] if scene.drive.kind != "constant-speed" else []
    for k, name in enumerate(JOINTS):
        free += [2 * k + 1, 2 * k + 2] * (name in scene.joints_with_clearance)
    return Bodies(
        *(crank.mass_kg, crank.inertia_kg_m2, crank.length_m, crank.centre_of_mass_m),
        *(rod.mass_kg, rod.inertia_kg_m2, rod.length_m, rod.centre_of_mass_m),
        slider.mass_kg,
        scene.gravity_m_s2,
        scene.drive.torque_N_m if scene.drive.kind == "torque" else 0.0,
        np.array(free),
    )


def start_of(scene: Scene) -> FloatArray:
    """Return the state of the ideal joints' motion: every pin in the middle, at rest there."""
    y = np.zeros(2 * SIZE)
    y[0], y[SIZE] = scene.start.crank_angle_rad, scene.start.crank_speed_rad_s
    return y


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


def stiffness_of(clearance: Clearance) -> float:
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


def walls_of(scene: Scene) -> Walls:
    """Return the walls of a scene's joints; ideal ones have c = 0."""
    columns = list[list[float]]()
    for name in JOINTS:
        clearance: Clearance | None = getattr(scene.clearance, name)
        if clearance is None:
            columns.append([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0])
            continue
        law, friction = clearance.law, clearance.friction
        assert not clearance.may_pull
        rubs = [0.0, 1.0, 0.0, 0.0]
        if friction is not None:
            speeds = friction.regularisation_speed_m_s, friction.dead_band_speed_m_s or 0.0
            rubs = [friction.coefficient, *speeds, FRICTION.index(friction.law)]
        columns.append(
            [
                clearance.radial_clearance_m,
                clearance.bearing_radius_m,
                stiffness_of(clearance),
                clearance.exponent or (1.0 if law in ("linear", "kelvin-voigt") else 1.5),
                damping_of(law, clearance.restitution or 0.0),
                clearance.damping_N_s_m or 0.0,
                clearance.minimum_impact_speed_m_s or SLOWEST_M_S,
                float(law == "kelvin-voigt"),
                *rubs,
            ]
        )
    c, R, K, n, a, b, slowest, pulls, mu, full, dead, kind = np.array(columns).T.copy()
    return Walls(
        *(c, R, K, n, a, b, slowest, pulls.astype(np.bool_)), *(mu, full, dead, kind.astype(np.int64))
    )


@njit(error_model="numpy")
def friction_share(walls: Walls, k: int, piece: float, sliding: float) -> float:
    """Return the part of mu F that rubs at a sliding speed, with its sign, by one piece of the law.

    Pieces are 0 about rest, +-1 on the ramps beside a dead band, +-2 beyond full speed; that of tanh is
    smooth. Each goes on beyond its ends: who changes pieces knows where.
    """
    if walls.kind[k] == 2:
        return math.tanh(sliding / walls.full[k])
    if piece == 0.0 and walls.dead[k] > 0.0:
        return 0.0
    if abs(piece) == 2.0:
        return 0.5 * piece
    return float(sliding - piece * walls.dead[k]) / float(walls.full[k] - walls.dead[k])


@njit(error_model="numpy")
def sliding_row(walls: Walls, k: int, y: FloatArray, rod: FloatArray, row: FloatArray) -> float:
    """Return the sliding speed, that of the pin's surface against the bearing's, counter-clockwise.

    It is ``row`` . w', both surfaces where the contact's force acts: in the middle of the penetration.
    ``rod`` is the row of the rod's angular velocity.
    """
    x = 2 * k + 1
    distance = math.hypot(y[x], y[x + 1])
    depth = max(distance - walls.c[k], 0.0)
    bearing_arm = walls.R[k] + depth / 2
    pin_arm = walls.R[k] - walls.c[k] - depth / 2
    for i in range(SIZE):
        row[i] = 0.0 if k == 0 else (pin_arm * rod[i] if k == 1 else -bearing_arm * rod[i])
    if k == 0:
        row[0] = pin_arm
    elif k == 1:
        row[0] -= bearing_arm
    row[x] -= y[x + 1] / distance
    row[x + 1] += y[x] / distance
    sliding = 0.0
    for i in range(SIZE):
        sliding += row[i] * y[SIZE + i]
    return sliding


@njit(error_model="numpy")
def add_contact(
    walls: Walls, k: int, phase: FloatArray, y: FloatArray, rod: FloatArray, Q: FloatArray
) -> None:
    """Add the generalised force of a wall, in its phase (3,), to Q."""
    if phase[CONTACT] == CLIPPED and not walls.pulls[k]:
        return
    x = 2 * k + 1
    distance = math.hypot(y[x], y[x + 1])
    n_x, n_y = y[x] / distance, y[x + 1] / distance
    rate = n_x * y[SIZE + x] + n_y * y[SIZE + x + 1]
    spring = walls.K[k] * max(distance - walls.c[k], 0.0) ** walls.n[k]
    force = spring * (1.0 + phase[MEMORY] * rate) + walls.b[k] * rate
    Q[x] -= force * n_x
    Q[x + 1] -= force * n_y
    if walls.mu[k] == 0.0 or phase[CONTACT] == CLIPPED:
        return
    row = np.empty(SIZE)
    sliding = sliding_row(walls, k, y, rod, row)
    rub = walls.mu[k] * force * friction_share(walls, k, phase[PIECE], sliding)
    for i in range(SIZE):
        Q[i] -= rub * row[i]


@njit(error_model="numpy")
def kinematics(b: Bodies, y: FloatArray, J: FloatArray, bias: FloatArray) -> float:
    """Fill J (7, 7) and bias (7,) and return the slider's place.

    The rows are the velocities J w' of crank x, y, angle, rod x, y, angle and slider x; their derivatives are
    J w'' + bias.
    """
    w, rate = y[:SIZE], y[SIZE:]
    cos, sin, turn = math.cos(w[0]), math.sin(w[0]), rate[0] * rate[0]
    J[:] = 0.0
    J[0, 0], J[0, 1] = -b.crank_centre_m * sin, 1.0
    J[1, 0], J[1, 2] = b.crank_centre_m * cos, 1.0
    J[2, 0] = 1.0
    bias[0], bias[1], bias[2] = -b.crank_centre_m * cos * turn, -b.crank_centre_m * sin * turn, 0.0
    # Pin A, then the rod's angle of sin(phi) = -(A_y + d_By)/L, differentiated twice.
    height = w[2] + b.crank_m * sin + w[4]
    sin_phi = -(height + w[6]) / b.rod_m
    cos_phi = math.sqrt((1.0 - sin_phi) * (1.0 + sin_phi))
    scale = -1.0 / (b.rod_m * cos_phi)
    J[5, 0], J[5, 2], J[5, 4], J[5, 6] = scale * b.crank_m * cos, scale, scale, scale
    phi_rate = J[5, 0] * rate[0] + scale * (rate[2] + rate[4] + rate[6])
    bias_x, bias_y = -b.crank_m * cos * turn, -b.crank_m * sin * turn
    bias[5] = sin_phi / cos_phi * phi_rate * phi_rate + scale * bias_y
    for row, reach in ((3, b.rod_centre_m), (6, b.rod_m)):
        for i in range(SIZE):
            J[row, i] = -reach * sin_phi * J[5, i]
        J[row, 0] -= b.crank_m * sin
        J[row, 1] += 1.0
        J[row, 3] += 1.0
        bias[row] = bias_x - reach * (sin_phi * bias[5] + cos_phi * phi_rate * phi_rate)
    J[6, 5] += 1.0
    reach = b.rod_centre_m
    for i in range(SIZE):
        J[4, i] = reach * cos_phi * J[5, i]
    J[4, 0] += b.crank_m * cos
    J[4, 2] += 1.0
    J[4, 4] += 1.0
    bias[4] = bias_y + reach * (cos_phi * bias[5] - sin_phi * phi_rate * phi_rate)
    return float(w[1] + b.crank_m * cos + w[3] + b.rod_m * cos_phi + w[5])


@njit(error_model="numpy")
def placed(walls: Walls, phases: FloatArray, z: FloatArray) -> FloatArray:
    """Return y of z."""
    y: FloatArray = z.copy()
    for k in range(3):
        if phases[k, CONTACT] == FOLLOWS:
            x, c = 2 * k + 1, walls.c[k]
            cos, sin, rate = math.cos(z[x]), math.sin(z[x]), z[SIZE + x]
            y[x], y[x + 1] = c * cos, c * sin
            y[SIZE + x], y[SIZE + x + 1] = -c * rate * sin, c * rate * cos
    return y


@njit(error_model="numpy")
def slider_place(b: Bodies, walls: Walls, phases: FloatArray, z: FloatArray) -> float:
    """Return the slider's position in m."""
    return kinematics(b, placed(walls, phases, z), np.empty((SIZE, SIZE)), np.empty(SIZE))


@njit(error_model="numpy")
def accelerations(b: Bodies, walls: Walls, phases: FloatArray, z: FloatArray, out: FloatArray) -> None:
    """Fill z'' (7,), with every joint in its phase (3, 3)."""
    motion(b, walls, phases, z, out)
    for k in range(3):
        if phases[k, CONTACT] == FOLLOWS:
            out[2 * k + 2] = 0.0


@njit(error_model="numpy")
def motion(b: Bodies, walls: Walls, phases: FloatArray, z: FloatArray, out: FloatArray) -> None:
    """Fill z'' (7,), and in place of what a following pin lacks the force in N that presses it inwards.

    In M w'' - Q + sum F (n + mu f row) = 0 of pins that follow, w'' = psi'' dd/dpsi + bias.
    """
    J, bias, Q, y = np.empty((SIZE, SIZE)), np.empty(SIZE), np.zeros(SIZE), placed(walls, phases, z)
    kinematics(b, y, J, bias)
    mass = (b.crank_kg, b.crank_kg, b.crank_kg_m2, b.rod_kg, b.rod_kg, b.rod_kg_m2, b.slider_kg)
    bias[1] += b.gravity_m_s2
    bias[4] += b.gravity_m_s2
    Q[0] = b.torque_N_m
    for k in range(3):
        x, c = 2 * k + 1, walls.c[k]
        if phases[k, CONTACT] == FOLLOWS:
            turn = z[SIZE + x] ** 2
            for row in range(SIZE):
                bias[row] -= turn * (J[row, x] * y[x] + J[row, x + 1] * y[x + 1])
        elif phases[k, CONTACT] != FLIGHT:
            add_contact(walls, k, phases[k], y, J[5], Q)
    M, q, n = np.zeros((SIZE, SIZE)), np.zeros(SIZE), len(b.free)
    for i in range(SIZE):
        for row in range(SIZE):
            q[i] -= mass[row] * J[row, i] * bias[row]
        q[i] += Q[i]
        for j in range(i + 1):
            for row in range(SIZE):
                M[i, j] += mass[row] * J[row, i] * J[row, j]
            M[j, i] = M[i, j]
    row_of = np.empty(SIZE)
    for k in range(3):
        if phases[k, CONTACT] == FOLLOWS:
            x, c = 2 * k + 1, walls.c[k]
            for i in range(SIZE):
                M[i, x] = M[i, x + 1] * y[x] - M[i, x] * y[x + 1]
            for i in range(SIZE):
                M[i, x + 1] = y[i] / c if i in (x, x + 1) else 0.0
            if walls.mu[k] > 0.0:
                sliding = sliding_row(walls, k, y, J[5], row_of)
                share = walls.mu[k] * friction_share(walls, k, phases[k, PIECE], sliding)
                for i in range(SIZE):
                    M[i, x + 1] += share * row_of[i]
    A, a = np.empty((n, n)), np.empty(n)
    for i in range(n):
        a[i] = q[b.free[i]]
        for j in range(n):
            A[i, j] = M[b.free[i], b.free[j]]
    eliminate(A, a)
    out[:] = 0.0
    for i in range(n):
        out[b.free[i]] = a[i]


@njit(error_model="numpy")
def eliminate(A: FloatArray, a: FloatArray) -> None:
    """Replace a by the solution of A x = a, by Gauss's elimination with row pivots."""
    n = len(a)
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(A[i, k]) > abs(A[best, k]):
                best = i
        if best != k:
            for j in range(k, n):
                A[k, j], A[best, j] = A[best, j], A[k, j]
            a[k], a[best] = a[best], a[k]
        for i in range(k + 1, n):
            part = A[i, k] / A[k, k]
            for j in range(k + 1, n):
                A[i, j] -= part * A[k, j]
            a[i] -= part * a[k]
    for i in range(n - 1, -1, -1):
        for j in range(i + 1, n):
            a[i] -= A[i, j] * a[j]
        a[i] /= A[i, i]


@njit(error_model="numpy")
def energy(b: Bodies, walls: Walls, y: FloatArray) -> float:
    """Return kinetic energy and those of gravity and of the walls' springs, in J, less the torque's work."""
    J, bias = np.empty((SIZE, SIZE)), np.empty(SIZE)
    kinematics(b, y, J, bias)
    mass = (b.crank_kg, b.crank_kg, b.crank_kg_m2, b.rod_kg, b.rod_kg, b.rod_kg_m2, b.slider_kg)
    total = 0.0
    for row in range(SIZE):
        speed = 0.0
        for i in range(SIZE):
            speed += J[row, i] * y[SIZE + i]
        total += 0.5 * mass[row] * speed * speed
    crank_y = y[2] + b.crank_centre_m * math.sin(y[0])
    rod_y = (y[2] + b.crank_m * math.sin(y[0]) + y[4]) * (1 - b.rod_centre_m / b.rod_m)
    rod_y -= y[6] * b.rod_centre_m / b.rod_m
    total += b.gravity_m_s2 * (b.crank_kg * crank_y + b.rod_kg * rod_y)
    for k in range(3):
        depth = max(math.hypot(y[2 * k + 1], y[2 * k + 2]) - walls.c[k], 0.0)
        total += walls.K[k] * depth ** (walls.n[k] + 1) / (walls.n[k] + 1)
    return float(total - b.torque_N_m * y[0])
