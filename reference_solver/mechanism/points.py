"""Points of moving bodies: where they are, how fast they move, and what a force on them does."""

from dataclasses import dataclass

from reference_solver.mechanism.data import GROUND, Ends, Line, Point
from reference_solver.tape import Array, Scalar, array, cos, sin


@dataclass(frozen=True)
class MovingPoint:
    """A point of a body, in the global frame.

    ``lever`` (2,) leads there from the body's centre of mass, ``place`` (2,) from the origin; ``rate`` (2,)
    is its velocity, ``spin`` the body's angular velocity.
    """

    body: int
    lever: Array
    place: Array
    rate: Array
    spin: Scalar

    @property
    def jacobian(self) -> Array:
        """Return (2, 3): the point's velocity per unit of the rates of its body's (x, y, phi)."""
        return array([[1.0, 0.0, -self.lever[1]], [0.0, 1.0, self.lever[0]]])

    @property
    def centripetal(self) -> Array:
        """Return (2,): the point's acceleration while its body turns without any."""
        return -(self.spin * self.spin) * self.lever


class State:
    """Coordinates q and velocities v of all bodies, (3b,) each, at a time; GROUND rests at the origin."""

    def __init__(self, q: Array, v: Array, t: Scalar = 0.0) -> None:
        self.q, self.v, self.t, self._still = q, v, t, array([0.0, 0.0, 0.0])
        self._turns: dict[int, tuple[Scalar, Scalar]] = {GROUND: (1.0, 0.0)}

    def position(self, body: int) -> Array:
        """Return a body's (x, y, phi)."""
        return self._still if body == GROUND else self.q[3 * body : 3 * body + 3]

    def velocity(self, body: int) -> Array:
        """Return the rates of a body's (x, y, phi)."""
        return self._still if body == GROUND else self.v[3 * body : 3 * body + 3]

    def point(self, body: int, place: Point) -> MovingPoint:
        """Return a point given in the frame of its body."""
        at, rate, lever = self.position(body), self.velocity(body), self._turned(body, place)
        spin = rate[2]
        turning = array([-spin * lever[1], spin * lever[0]])
        return MovingPoint(body, lever, at[:2] + lever, rate[:2] + turning, spin)

    def direction(self, body: int, angle_rad: float) -> Array:
        """Return the unit vector (2,) at an angle from the x axis of a body, in the global frame."""
        return self._turned(body, (cos(angle_rad), sin(angle_rad)))

    def _turned(self, body: int, vector: Point) -> Array:
        """Return a vector (2,) in the frame of its body in the directions of the global one."""
        if body not in self._turns:
            angle = self.position(body)[2]
            self._turns[body] = cos(angle), sin(angle)
        (c, s), (x, y) = self._turns[body], vector
        return array([c * x - s * y, s * x + c * y])


def ends_of(part: Ends, state: State) -> tuple[MovingPoint, MovingPoint]:
    """Return the points of bodies i and j: of a joint with clearance the bearing's centre and the pin's."""
    return state.point(part.body_i, part.point_i), state.point(part.body_j, part.point_j)


def line_at(line: Line, state: State) -> tuple[MovingPoint, MovingPoint, Array, Array, Array]:
    """Return the points i and j of a line, u along it and n across it, and d = p_j - p_i."""
    (i, j), u = ends_of(line, state), state.direction(line.body_i, line.angle_rad)
    return i, j, u, array([-u[1], u[0]]), j.place - i.place
