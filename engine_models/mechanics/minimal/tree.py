"""The equations of motion in minimal coordinates, of numbers and of a tape's values alike.

With clearance in a joint the mechanism is an open tree: translations w_x and w_y carry a body's centre of
mass, or none, and arms l_k along the axes u_k = (cos w_k, sin w_k) of links at angles w_k. The tree moves by
M w'' + h = Q with

    J = columns (1, 0), (0, 1) and l_k (-sin w_k, cos w_k) of each body
    M = sum of m J^T J, and of inertias on the angles
    h = sum of m J^T a,  a = -sum of l_k u_k w_k'^2
    Q = sum of J^T F, and of torques on the angles

Without clearance the rod closes a loop: sin(phi) = -(r/L) sin(theta), x = r cos(theta) + L cos(phi). With a
dash for d/dtheta,

    phi' = k = -(r cos(theta))/(L cos(phi)),  k' = tan(phi) (k^2 - 1),  x' = r s,  s = (k - 1) sin(theta)

and the directions e = (cos, sin) of both links, of which

    e_phi' = (r/L) (k sin(theta), -cos(theta)),  e_theta'.e_phi' = -(r/L) (1 + s sin(theta))

one equation is left (Eksergian 1930),

    I d^2theta/dt^2 = Q - I'/2 (dtheta/dt)^2,  I = sum of m x'^2, 2 m l_j l_k e_j'.e_k', and inertias w_k'^2.

Coordinates are some of q = (x, y, phi) of crank, rod and slider: crank and rod by their angles, what nothing
carries by the place of its centre of mass, and the slider by its place along the guide. A crank whose motion
is prescribed is one of them, with its acceleration given.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from reference_solver.factorisation import Factors
from reference_solver.mechanism.mechanism import ClearanceJoint, Mechanism, RevoluteJoint
from reference_solver.tape import Array, FloatArray, Scalar, arcsin, array, cos, sin, sqrt

#: Places in q of the angles of crank and rod, and of the slider along its guide.
THETA, PHI, SLIDER_X = 2, 5, 6
ANGLES = (THETA, PHI)
#: A vector in the plane.
Way = tuple[Scalar, Scalar]
#: Joints by their pins' bodies.
O, A, B = range(3)  # noqa: E741  the joints' names


@dataclass(frozen=True)
class Carrier:
    """What carries a body's centre of mass: translations, by their places in q, and arms by those of angles.

    A translation's place tells its axis: it is 3k for x and 3k + 1 for y.
    """

    moved_by: tuple[int, ...]
    arms: dict[int, Scalar]

    @property
    def reach(self) -> dict[int, Scalar]:
        """How far each place moves the centre of mass: a translation by itself, an angle by its arm."""
        return dict.fromkeys(self.moved_by, 1.0) | self.arms

    def past(self, arms: dict[int, Scalar], sign: float = 1.0) -> "Carrier":
        """Return what carries a body so much further along the links, or back."""
        further = {k: self.arms.get(k, 0.0) + sign * arm for k, arm in arms.items()}
        return Carrier(self.moved_by, self.arms | further)


class Tree:
    """A mechanism's coordinates and equations; its numbers are numbers, or a tape's values."""

    def __init__(self, mechanism: Mechanism) -> None:
        joints = [
            part
            for part in (*mechanism.constraints, *mechanism.contacts)
            if isinstance(part, RevoluteJoint | ClearanceJoint)
        ]
        self.bodies = mechanism.bodies
        loose = {joint.body_j for joint in mechanism.contacts}
        self.closed = len(self.bodies) > 1 and not loose
        #: From the centre of mass of a joint's bearing's body to that of its pin's.
        self._ways = {joint.body_j: _way(joint) for joint in joints}
        self.carriers = self._carried(loose)
        angles = ANGLES[: len(self.bodies)]
        moved = [place for carrier in self.carriers for place in carrier.moved_by]
        #: Places in q of all that moves the bodies, and of the coordinates among them.
        self.places = tuple(sorted({*angles, *moved}))
        self.coordinates = (THETA,) if self.closed else self.places

    @property
    def masses(self) -> dict[tuple[int, int], Scalar]:
        """M without the directions in which places move, for all pairs that move a body together."""
        masses = dict[tuple[int, int], Scalar]()
        for body, (carrier, part) in enumerate(zip(self.carriers, self.bodies, strict=True)):
            for (i, a), (j, b) in product(carrier.reach.items(), repeat=2):
                if i == j or not {i, j} <= set(carrier.moved_by):
                    masses[i, j] = masses.get((i, j), 0.0) + part.mass_kg * (a * b)
            angle = 3 * body + 2
            if angle in self.places:
                masses[angle, angle] = masses.get((angle, angle), 0.0) + part.inertia_kg_m2
        return masses

    def start(self, q: FloatArray, v: FloatArray) -> FloatArray:
        """Return z and z' (2n,) of the bodies' q and q', (3b,) each."""
        places = [*self.coordinates]
        return np.concatenate([q[places], v[places]])

    @property
    def radius(self) -> Scalar:
        """The crank's length r."""
        return self._ways[O][THETA] + self._ways[A][THETA]

    @property
    def length(self) -> Scalar:
        """The rod's length L."""
        return self._ways[A][PHI] + self._ways[B][PHI]

    def _carried(self, loose: set[int]) -> list[Carrier]:
        """Return what carries each body: it hangs on its neighbour, or is free."""
        crank = Carrier((0, 1), {}) if O in loose else Carrier((), self._ways[O])
        if len(self.bodies) == 1:
            return [crank]
        slider = Carrier((SLIDER_X,), {})
        if A not in loose and loose != {O}:
            return [crank, crank.past(self._ways[A]), slider]
        rod = Carrier((3, 4), {}) if B in loose else slider.past(self._ways[B], -1.0)
        return [crank if A in loose else rod.past(self._ways[A], -1.0), rod, slider]


def _way(joint: RevoluteJoint | ClearanceJoint) -> dict[int, Scalar]:
    """Return the arms through a joint: forward to it in its bearing's body, and from it in its pin's."""
    angles = {0: THETA, 1: PHI}
    arms = {joint.body_i: joint.point_i[0], joint.body_j: -joint.point_j[0]}
    return {angles[body]: arm for body, arm in arms.items() if body in angles}


class Posture:
    """Where a tree's bodies are at coordinates z with rates u, (n,) each, and how they move.

    ``q`` and ``v`` have the (x, y, phi) of every body, 3b each. Of many states at once, the elements of z and
    u are arrays, and so are these.
    """

    def __init__(self, tree: Tree, z: Array, u: Array) -> None:
        self._tree = tree
        self._w = dict(zip(tree.coordinates, z, strict=True))
        self._rate = dict(zip(tree.coordinates, u, strict=True))
        self._turns = {k: (cos(self._w[k]), sin(self._w[k])) for k in ANGLES if k in self._w}
        #: The direction in which each place moves a centre of mass.
        self._across = {k: (1.0, 0.0) if k % 3 == 0 else (0.0, 1.0) for k in tree.places if k not in ANGLES}
        #: Of a loop, by the crank's angle: both derivatives of all places.
        self._slopes = dict[int, tuple[Scalar, Scalar]]()
        if tree.closed:
            self._close()
        self._across |= {k: (-s, c) for k, (c, s) in self._turns.items()}
        self.q, self.v = self._of_bodies()

    def _close(self) -> None:
        """Add the rod's angle and the slider's place, which follow from the crank's angle."""
        r, length = self._tree.radius, self._tree.length
        cos_theta, sin_theta = self._turns[THETA]
        part = r / length
        sin_phi = -part * sin_theta
        cos_phi = sqrt((1.0 - part * part) + (part * part) * (cos_theta * cos_theta))
        k = -part * cos_theta / cos_phi
        dk = sin_phi / cos_phi * (k * k - 1.0)
        along, lag = k * cos_theta, k * sin_theta
        s, ds, rate = lag - sin_theta, along + dk * sin_theta - cos_theta, self._rate[THETA]
        self._turns[PHI] = cos_phi, sin_phi
        self._w |= {PHI: arcsin(sin_phi), SLIDER_X: r * cos_theta + length * cos_phi}
        self._rate |= {PHI: k * rate, SLIDER_X: r * (s * rate)}
        self._slopes = {THETA: (1.0, 0.0), PHI: (k, dk), SLIDER_X: (r * s, r * ds)}
        self._e_phi = part * lag, -part * cos_theta
        #: The product of both directions' derivatives, and what its own is.
        self._coupling = -part * (1.0 + sin_theta * s), -part * (sin_theta * (along - cos_theta + ds))

    def _columns(self, body: int) -> dict[int, tuple[Scalar, Scalar]]:
        """Return the columns of a body's J: the velocity of its centre by each rate."""
        reach = self._tree.carriers[body].reach
        return {k: (far * self._across[k][0], far * self._across[k][1]) for k, far in reach.items()}

    def _of_bodies(self) -> tuple[list[Scalar], list[Scalar]]:
        q, v = list[Scalar](), list[Scalar]()
        for body, carrier in enumerate(self._tree.carriers):
            columns, angle = self._columns(body), 3 * body + 2
            for axis in range(2):
                place = sum((self._w[k] for k in carrier.moved_by if k % 3 == axis), start=0.0)
                place = sum((arm * self._turns[k][axis] for k, arm in carrier.arms.items()), start=place)
                q.append(place)
                v.append(sum((column[axis] * self._rate[k] for k, column in columns.items()), start=0.0))
            q.append(self._w.get(angle, 0.0))
            v.append(self._rate.get(angle, 0.0))
        return q, v

    def accelerations(
        self, F: Array, driven: Scalar | None, more: Mapping[int, Scalar] | None = None
    ) -> tuple[list[Scalar], Scalar]:
        """Return z'' (n,) under forces F (3b,) on the bodies, and the torque in N m of a driver of the crank.

        ``driven`` is the crank's angular acceleration where that is prescribed; else it is None, and the
        torque 0. Of an open tree ``more`` are generalised forces beside F, by places.
        """
        if self._tree.closed:
            return [self._eksergian(F)], 0.0
        M, Q = self._masses(), self._forces(F, self._across, dict.fromkeys(ANGLES, 1.0))
        h = self._inertial(self._rate)
        right = {i: Q[i] + (more or {}).get(i, 0.0) - h[i] for i in Q}
        given = {} if driven is None else {THETA: driven}
        free = [k for k in self._tree.places if k not in given]
        matrix = array([[M[i, j] for j in free] for i in free])
        rest = array([right[i] - sum((M[i, k] * given[k] for k in given), start=0.0) for i in free])
        unconstrained = np.zeros((0, len(free)))
        accelerations, _ = Factors(matrix, unconstrained).solve(rest, np.zeros(0))
        solved = given | dict(zip(free, accelerations, strict=True))
        torque = sum((M[THETA, k] * solved[k] for k in solved), start=0.0) - right[THETA] if given else 0.0
        return [solved[k] for k in self._tree.places], torque

    def _eksergian(self, F: Array) -> Scalar:
        """Return the crank's acceleration in a loop under forces F (3b,) on the bodies."""
        across = self._across | {PHI: self._e_phi}
        slopes = {k: first for k, (first, _) in self._slopes.items()}
        Q = self._forces(F, across, slopes)
        force = Q[THETA] + Q[PHI] + slopes[SLIDER_X] * Q[SLIDER_X]
        inertia: Scalar = 0.0
        bent: Scalar = 0.0
        for (i, j), mass in self._tree.masses.items():
            if i == j:
                first, second = self._slopes[i]
                inertia, bent = inertia + mass * (first * first), bent + mass * (first * second)
            elif i < j:
                value, change = self._coupling
                inertia, bent = inertia + 2.0 * mass * value, bent + mass * change
        rate = self._rate[THETA]
        return (force - bent * (rate * rate)) / inertia

    def _masses(self) -> dict[tuple[int, int], Scalar]:
        """Return M by places."""
        across, places = self._across, self._tree.places
        M: dict[tuple[int, int], Scalar] = {(i, j): 0.0 for i in places for j in places}
        for (i, j), mass in self._tree.masses.items():
            if i <= j:
                M[i, j] = M[j, i] = mass if i == j else mass * _dot(across[i], across[j])
        return M

    def _inertial(self, rates: Mapping[int, Scalar]) -> dict[int, Scalar]:
        """Return h by places, at rates of the angles."""
        across, h = self._across, dict[int, Scalar](dict.fromkeys(self._tree.places, 0.0))
        for (i, k), mass in self._tree.masses.items():
            if i != k and k in self._turns:
                # Of two angles it is an odd function of their difference, which is written once.
                swapped = i in self._turns and i > k
                first, second = (k, i) if swapped else (i, k)
                pull = mass * _dot(across[first], self._turns[second])
                h[i] = h[i] + (pull if swapped else -pull) * (rates[k] * rates[k])
        return h

    def _forces(
        self, F: Array, across: Mapping[int, Way], turning: Mapping[int, Scalar]
    ) -> dict[int, Scalar]:
        """Return Q of forces F (3b,) on the bodies by places, which move them across, or turn them."""
        Q = dict[int, Scalar]()
        for i in self._tree.places:
            reach = {3 * body: carrier.reach.get(i, 0.0) for body, carrier in enumerate(self._tree.carriers)}
            sums = [sum((far * F[x + axis] for x, far in reach.items()), start=0.0) for axis in range(2)]
            Q[i] = _dot(across[i], sums) + (turning[i] * F[i] if i in self._turns else 0.0)
        return Q


def _dot(one: Sequence[Scalar], other: Sequence[Scalar]) -> Scalar:
    return one[0] * other[0] + one[1] * other[1]
