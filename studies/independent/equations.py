"""The crank-slider in the places of its pins in their bearings, as machine code.

w = (theta, d_O, d_A, d_B): the crank's angle, and pin centre less bearing centre of every joint, zero where
it is ideal. A gap is so a coordinate itself, exact to its own round-off. The rod's angle and the slider
follow: pin B lies on the guide, y = 0. M w'' = Q follows from the bodies' velocities J w'; there is no
multiplier. A pendulum's rod and slider weigh nothing.

The state y (STATE,) is w, its rate, the time, and sums of powers. A pin that follows a rigid wall has psi of
d = c (cos(psi), sin(psi)) in place of d_x, and nothing in place of d_y: such a state is z (STATE,), and the
wall's force is what the equation along the normal leaves over.
"""

import math

import numpy as np
from numba import njit

from studies.independent import drives, loads, mechanism
from studies.independent.drives import CONSTANT, prescribed_acceleration, torque
from studies.independent.loads import load_forces
from studies.independent.mechanism import SIZE, Bodies, FloatArray, Mechanism, Walls

#: Modules whose text the machine code has taken over.
COMPILED_WITH = (drives, loads, mechanism)
#: Places in a state: the time; of every joint the sums in order: its normal force, what that and clipping
#: and friction dissipate; works of the drive and of the load's parts.
TIME, SUMS, OF_JOINT = 2 * SIZE, 2 * SIZE + 1, 4
WORK = SUMS + 3 * OF_JOINT
STATE = WORK + 5
#: Columns of a joint's phase: what its contact is, its a/v0 while it touches, and the piece of its friction.
CONTACT, MEMORY, PIECE = range(3)
#: The row behind the joints': of the gas, whose PIECE is that of its straight lines, if it has such.
GAS = 3
#: Contacts: none, one whose wall pushes by its law, and one whose law would pull: there is no force then, but
#: of Kelvin and Voigt's law no friction only.
FLIGHT, PUSHED, CLIPPED = 0.0, 1.0, 2.0
#: Of a rigid wall: its pin follows it.
FOLLOWS = 3.0
#: Columns of what is told of a joint, and in row TORQUE that on a crank whose speed is prescribed or not.
NORMAL, FRICTION, SLIDING = range(3)
TORQUE = 3


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
def fill_sliding_row(walls: Walls, k: int, y: FloatArray, rod: FloatArray, row: FloatArray) -> float:
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
    walls: Walls,
    k: int,
    phase: FloatArray,
    y: FloatArray,
    rod: FloatArray,
    Q: FloatArray,
    told: FloatArray,
    powers: FloatArray,
) -> None:
    """Add the generalised force of a wall, in its phase (3,), to Q; fill what is told and its powers (4,)."""
    x = 2 * k + 1
    distance = math.hypot(y[x], y[x + 1])
    n_x, n_y = y[x] / distance, y[x + 1] / distance
    rate = n_x * y[SIZE + x] + n_y * y[SIZE + x + 1]
    spring = walls.K[k] * max(distance - walls.c[k], 0.0) ** walls.n[k]
    if phase[CONTACT] == CLIPPED and not walls.pulls[k]:
        powers[2] = -spring * rate
        return
    force = spring * (1.0 + phase[MEMORY] * rate) + walls.b[k] * rate
    Q[x] -= force * n_x
    Q[x + 1] -= force * n_y
    told[NORMAL], powers[0], powers[1] = force, force, (force - spring) * rate
    if walls.mu[k] > 0.0 and phase[CONTACT] == PUSHED:
        row = np.empty(SIZE)
        sliding = fill_sliding_row(walls, k, y, rod, row)
        rub = walls.mu[k] * force * friction_share(walls, k, phase[PIECE], sliding)
        told[FRICTION], told[SLIDING], powers[3] = -rub, sliding, rub * sliding
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
def assemble(
    m: Mechanism,
    y: FloatArray,
    x: float,
    J: FloatArray,
    bias: FloatArray,
    M: FloatArray,
    q: FloatArray,
    load: FloatArray,
) -> None:
    """Fill M and q in M w'' = q of no contact, and the load's forces (4,), with the slider at x.

    q is without the torque of a prescribed speed.
    """
    b, speed = m.bodies, 0.0
    mass = (b.crank_kg, b.crank_kg, b.crank_kg_m2, b.rod_kg, b.rod_kg, b.rod_kg_m2, b.slider_kg)
    for i in range(SIZE):
        speed += J[6, i] * y[SIZE + i]
    load_forces(m.load, y[0], x, speed, load)
    push = load[0] + load[1] + load[2] + load[3]
    for i in range(SIZE):
        q[i] = push * J[6, i]
        for row in range(SIZE):
            weight = b.gravity_m_s2 if row in (1, 4) else 0.0
            q[i] -= mass[row] * J[row, i] * (bias[row] + weight)
        for j in range(i + 1):
            M[i, j] = 0.0
            for row in range(SIZE):
                M[i, j] += mass[row] * J[row, i] * J[row, j]
            M[j, i] = M[i, j]
    q[0] += torque(m.drive, y[SIZE])


@njit(error_model="numpy")
def rates(m: Mechanism, phases: FloatArray, z: FloatArray, out: FloatArray, told: FloatArray) -> None:
    """Fill z' (STATE,) with every joint in its phase (4, 3), and what is told (4, 3).

    In M w'' - Q + sum F (n + mu f row) = 0 of pins that follow, w'' = psi'' dd/dpsi + bias.
    """
    J, M, y = np.empty((SIZE, SIZE)), np.empty((SIZE, SIZE)), placed(m.walls, phases, z)
    bias, q, row_of, load = np.empty(SIZE), np.empty(SIZE), np.empty(SIZE), np.empty(4)
    walls, free, driven = m.walls, m.bodies.free, m.drive.kind >= CONSTANT
    out[:], told[:] = 0.0, 0.0
    out[:SIZE], out[TIME] = z[SIZE:TIME], 1.0
    x_slider = kinematics(m.bodies, y, J, bias)
    for k in range(3):
        if phases[k, CONTACT] == FOLLOWS:
            x, turn = 2 * k + 1, z[SIZE + 2 * k + 1] ** 2
            for row in range(SIZE):
                bias[row] -= turn * (J[row, x] * y[x] + J[row, x + 1] * y[x + 1])
    assemble(m, y, x_slider, J, bias, M, q, load)
    for k in range(3):
        x, c, at = 2 * k + 1, walls.c[k], SUMS + OF_JOINT * k
        if phases[k, CONTACT] == FOLLOWS:
            for i in range(SIZE):
                M[i, x] = M[i, x + 1] * y[x] - M[i, x] * y[x + 1]
            for i in range(SIZE):
                M[i, x + 1] = y[i] / c if i in (x, x + 1) else 0.0
            if walls.mu[k] > 0.0:
                told[k, SLIDING] = fill_sliding_row(walls, k, y, J[5], row_of)
                share = walls.mu[k] * friction_share(walls, k, phases[k, PIECE], told[k, SLIDING])
                told[k, FRICTION] = -share
                for i in range(SIZE):
                    M[i, x + 1] += share * row_of[i]
        elif phases[k, CONTACT] != FLIGHT:
            add_contact(walls, k, phases[k], y, J[5], q, told[k], out[at : at + OF_JOINT])
    n, answer = len(free), np.zeros(SIZE)
    A, a = np.empty((n, n)), np.empty(n)
    if driven:
        answer[0] = prescribed_acceleration(m.drive, z[TIME])
    for i in range(n):
        a[i] = q[free[i]] - M[free[i], 0] * answer[0]
        for j in range(n):
            A[i, j] = M[free[i], free[j]]
    eliminate(A, a)
    for i in range(n):
        answer[free[i]] = a[i]
    told[TORQUE, 0] = torque(m.drive, y[SIZE])
    if driven:
        for j in range(SIZE):
            told[TORQUE, 0] += M[0, j] * answer[j]
        told[TORQUE, 0] -= q[0]
    for k in range(3):
        if phases[k, CONTACT] == FOLLOWS:
            x, at = 2 * k + 1, SUMS + OF_JOINT * k
            force, answer[x + 1] = answer[x + 1], 0.0
            told[k, NORMAL] = out[at] = force
            told[k, FRICTION] *= force
            out[at + 3] = -told[k, FRICTION] * told[k, SLIDING]
            out[x + 1] = 0.0
    out[SIZE:TIME] = answer
    out[WORK] = told[TORQUE, 0] * y[SIZE]
    speed = 0.0
    for i in range(SIZE):
        speed += J[6, i] * y[SIZE + i]
    for part in range(4):
        out[WORK + 1 + part] = load[part] * speed


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
