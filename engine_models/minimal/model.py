"""A scene as the numbers of ``equations``: its joints, walls, loads and drive, its start, its coordinates."""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
import scipy.linalg
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, PPoly

from engine_models.engine import AdapterCannot, SimulationFailed, UnsupportedScene
from engine_models.mechanics.states import levers_m, turns_of, way
from engine_models.minimal import equations as eq
from engine_models.scene.scene import Scene
from reference_solver.mechanism import data

FloatArray = NDArray[np.float64]
#: No body, no curve.
NONE = -1.0
GROUND = [NONE, 0.0, 0.0]
#: The largest of T, in units of coordinates, from which on other coordinates are to depend; and the least
#: pivot of rows by the largest, below which a position is singular.
STEEP, SINGULAR = 4.0, 1e-7
#: Floor of the approach speed in laws that divide by it, where the scene gives none.
SLOWEST_M_S = 1e-6
#: The factor a of a contact's law, by its name and the restitution.
Damping = Callable[[str, float], float]
#: a(e) of F = K delta^n (1 + a delta'/v0) from each law's paper, of those with restitution.
FACTORS: Mapping[str, Callable[[float], float]] = {
    "hunt-crossley": lambda e: 1.5 * (1 - e),
    "lankarani-nikravesh": lambda e: 0.75 * (1 - e * e),
    "gonthier": lambda e: (1 - e * e) / e,
    "zhiying-qishao": lambda e: 0.75 * (1 - e * e) * math.exp(2 - 2 * e),
    "flores": lambda e: 1.6 * (1 - e) / e,
    "hu-guo": lambda e: 1.5 * (1 - e) / e,
    "carvalho-martins": lambda e: 1.5 * (1 - e) * (11 - e) / (1 + 9 * e),
}
#: Newton's steps to close joints, and the change that ends them.
STEPS, CHANGE = 20, 1e-15


def damping_of(law: str, e: float) -> float:
    """Return a(e).

    Raises:
        UnsupportedScene: the law is not known here.
    """
    if law in FACTORS:
        return FACTORS[law](e)
    if law in ("linear", "kelvin-voigt", "hertz", "rigid"):
        return 0.0
    raise UnsupportedScene(f"the independent solver has no contact law {law!r}")


def wall_of(room: data.ClearanceData, damping: Damping) -> list[float]:
    """Return the columns of a contact behind its ends."""
    law, friction, e, c = room.law, room.friction, room.restitution or 0.0, room.radial_clearance_m
    K = room.stiffness or 0.0
    if law != "rigid" and room.stiffness is None:
        # Hertz, a pin in a hole of its own material: 4/(3 (s_i + s_j)) sqrt(R_i R_j/(R_i - R_j))
        assert room.young_modulus_Pa is not None
        assert room.poisson_ratio is not None
        hole = room.bearing_radius_m
        K = 2 * room.young_modulus_Pa / (3 * (1 - room.poisson_ratio**2)) * math.sqrt(hole * (hole - c) / c)
    rubs = [0.0, 1.0, 0.0, 0.0]
    if friction is not None:
        if friction.law not in ("saturated-linear", "ambrosio", "tanh"):
            raise UnsupportedScene(f"the independent solver has no friction law {friction.law!r}")
        speeds = friction.regularisation_speed_m_s, friction.dead_band_speed_m_s or 0.0
        rubs = [friction.coefficient, *speeds, float(friction.law == "tanh")]
    n = room.exponent or (1.0 if law in ("linear", "kelvin-voigt") else 1.5)
    slowest = room.minimum_impact_speed_m_s or (0.0 if law == "rigid" else SLOWEST_M_S)
    pulls = [float(room.may_pull or law == "kelvin-voigt"), float(room.may_pull)]
    stiff = [K, n, damping(law, e), room.damping_N_s_m or 0.0]
    return [c, room.bearing_radius_m, *stiff, slowest, e, *pulls, *rubs]


def curve_of(table: data.Table) -> PPoly:
    """Return the curve through a table."""
    x, y = np.array(table.x), np.array(table.y)
    if table.period:
        x[-1], y[-1] = x[0] + table.period, y[0]
    if table.interpolation == "linear":
        return PPoly(np.array([np.diff(y) / np.diff(x), y[:-1]]), x)
    if table.period:
        return CubicSpline(x, y, bc_type="periodic")
    level = 0.0 if y[1] == y[0] else None, 0.0 if y[-1] == y[-2] else None
    ends = table.end_slopes or level
    return CubicSpline(x, y, bc_type=tuple("not-a-knot" if slope is None else (1, slope) for slope in ends))


@dataclass(frozen=True)
class Kinks:
    """Where the pieces of a curve over a coordinate of y begin, (n,), and its period or 0.

    Without a period there is one more on either side.
    """

    coordinate: int
    begins: FloatArray
    period: float

    def piece(self, y: FloatArray) -> int:
        """Return the piece that a state is in, counted on from period to period."""
        x = float(y[self.coordinate])
        turns = math.floor((x - self.begins[0]) / self.period) if self.period else 0
        place = int(np.searchsorted(self.begins, x - turns * self.period, "right")) - 1
        return turns * len(self.begins) + place

    def begin(self, piece: int) -> float:
        """Return where a piece begins."""
        turns, place = divmod(piece, len(self.begins))
        return float(self.begins[place] + turns * self.period)


class LimitPosition(SimulationFailed):
    """A prescribed motion has come to where its mechanism cannot follow."""


class Numbers:
    """A mechanism as one array of numbers ``p`` (see ``equations``), begun at positions q (3b,).

    ``size`` is 3b and ``rows`` how many rows of joints there are; ``sums`` names the sums of powers, and
    ``parts`` the parts of loads, the torque of a drive that prescribes no motion among them, ``working``
    those that store nothing. ``kinks`` are those of tables over an angle or a speed, ``stops_s`` the
    times of those over time, and of ramps.

    Raises:
        UnsupportedScene: a contact has a law that is not known here.
    """

    def __init__(self, of: data.MechanismData, q: FloatArray, damping: Damping) -> None:
        self.of, self.size, self.kinks, self._stops = of, len(q), list[Kinks](), list[float]()
        self._curves, self._pieces = list[list[float]](), [np.zeros((0, 5))]
        parts, joints, motion = [*self._parts()], [*self._joints(q)], self._motion()
        self.parts = [name for name, _ in parts]
        undamped = {name for name, row in parts if ":" in name and not row[eq.DAMPER]}
        self.working = [name for name in self.parts if name not in {"driver", *undamped}]
        self.rows = sum(2 if row[0] == eq.PIN else 1 for row in joints)
        contacts = [[*_ends(pin), *wall_of(pin.clearance, damping)] for pin in of.loose if pin.clearance]
        driver = ["driver"] if of.drive.prescribes else []
        sums = ("normal_impulse_N_s", "normal_loss_J", "clipped_loss_J", "friction_loss_J")
        self.sums = [*((pin.name, each) for pin in of.loose for each in sums), *self.parts, *driver]
        self.stops_s = np.unique(np.array(self._stops) - of.drive.clock_s)
        self.lever_m = max(levers_m(of)) or 1.0
        self.unit = np.tile([self.lever_m, self.lever_m, 1.0], len(of.bodies))
        self.first = 2 * self.size + self.rows  # of what is told of contacts
        told = self.first + eq.OF_CONTACT * len(contacts) + len(parts) + 2
        self.p = _packed(
            [
                [[body.mass_kg, body.mass_kg, body.inertia_kg_m2] for body in of.bodies],
                joints,
                contacts,
                [row for _, row in parts],
                self._curves,
                np.concatenate(self._pieces),
                [[*of.gravity_m_s2, of.drive.clock_s, *motion, self.rows]],
                [np.arange(self.size), self.unit],
                np.zeros((len(contacts), 3)),
                np.zeros((1, told)),
            ]
        )
        self.contacts, self.phases = self.block(eq.CONTACTS), self.block(eq.PHASES)
        self.order, self.told = self.block(eq.ORDER)[0], self.block(eq.TOLD)[0]
        self.masses = self.block(eq.BODIES)  # mass, mass and inertia of every body, (bodies, 3)

    def block(self, number: int) -> FloatArray:
        """Return a block of ``p``, of which a change changes it."""
        first, rows, columns = self.p[3 * number : 3 * number + 3].astype(int).tolist()
        return self.p[first : first + rows * columns].reshape(rows, columns)

    def look(self, t: float, q: FloatArray, v: FloatArray | None = None) -> tuple[FloatArray, ...]:
        """Return B (..., m, 3b) of all rows, g, c and gamma (..., m) at a time, in states q, v (..., 3b)."""
        states, m = np.ascontiguousarray(q).reshape(-1, self.size), self.rows
        rates = np.zeros_like(states) if v is None else np.ascontiguousarray(v).reshape(-1, self.size)
        B, (g, c, gamma) = np.empty((len(states), m, self.size)), np.empty((3, len(states), m))
        eq.look(self.p, t, states, rates, B, g, c, gamma)
        shape = (*q.shape[:-1], m)
        return B.reshape(*shape, self.size), *(each.reshape(shape) for each in (g, c, gamma))

    def _joints(self, q: FloatArray) -> Iterator[list[float]]:
        of = self.of
        for pin in of.ideal:
            yield [eq.PIN, pin.body_i, *pin.point_i, pin.body_j, *pin.point_j, 0.0, 0.0]
        for guide in of.guides:
            ends = _line(guide)
            yield [eq.ACROSS, *ends, 0.0]
            if not guide.turns:
                turned = q[3 * guide.body_j + 2] - (q[3 * guide.body_i + 2] if guide.body_i >= 0 else 0.0)
                yield [eq.PARALLEL, *ends[:-1], turned, 0.0]
        if of.drive.prescribes and of.drive.guide is not None:
            line = of.guides[of.drive.guide]
            begin, _ = way(line, q.reshape(1, -1, 3), np.zeros((1, len(of.bodies), 3)))
            yield [eq.DRIVEN_WAY, *_line(line), float(begin[0])]
        elif of.drive.prescribes:
            body = of.drive.body
            yield [eq.DRIVEN_ANGLE, *GROUND, body, 0.0, 0.0, q[3 * body + 2], 0.0]

    def _motion(self) -> list[float]:
        match self.of.drive.law:
            case data.ConstantSpeed(speed):
                return [eq.STEADY, speed, 0.0, 0.0, 0.0, NONE]
            case data.Ramp(first, last, duration):
                self._stops.append(duration)
                return [eq.RAMP, first, last - first, duration, 0.0, NONE]
            case data.Fluctuation(mean, amplitude, frequency, phase):
                return [eq.SINE, mean, amplitude, math.tau * frequency, phase, NONE]
            case data.Course(table):
                return [eq.TABLE, 0.0, 0.0, 0.0, 0.0, self._over_time(table)]
        return [NONE, 0.0, 0.0, 0.0, 0.0, NONE]

    def _parts(self) -> Iterator[tuple[str, list[float]]]:
        """Yield the parts of loads by name."""
        for load in self.of.loads:
            along = [eq.LINE, *_line(load.line)] if load.line else []
            turn = [eq.TURN, *GROUND, load.body, 0.0, 0.0, 0.0]
            gas, angle = load.gas, -1 if load.gas is None else 3 * load.gas.body + 2
            by_angle = {eq.BY_ANGLE: self._over(angle, gas.table), eq.OF_BODY: gas.body} if gas else {}
            spring = {eq.SPRING: load.spring_N_m, eq.FREE: load.free_position_m}
            force, turning = load.force_by_time, load.torque_by_time
            parts = {
                "force": (load.force_N, along, {eq.CONSTANT: load.force_N}),
                "viscous": (load.viscous_N_s_m, along, {eq.DAMPER: load.viscous_N_s_m}),
                "spring": (load.spring_N_m, along, spring),
                "gas": (gas, along, by_angle),
                "by_time": (force, along, {eq.BY_TIME: self._over_time(force)}),
                "torque": (load.torque_N_m, turn, {eq.CONSTANT: load.torque_N_m}),
                "turning_viscous": (load.viscous_N_m_s, turn, {eq.DAMPER: load.viscous_N_m_s}),
                "torque_by_time": (turning, turn, {eq.BY_TIME: self._over_time(turning)}),
            }
            for part, (acts, ends, numbers) in parts.items():
                if acts:
                    yield f"{self.of.bodies[load.body].name}.{part}", _part(ends, numbers)
        for s in self.of.springs:
            ends = [eq.PULL, s.body_i, *s.point_i, s.body_j, *s.point_j, 0.0]
            pull = {eq.DAMPER: s.damping_N_s_m, eq.SPRING: s.stiffness_N_m, eq.FREE: s.free_length_m}
            yield f"spring:{s.name}", _part(ends, pull)
        for it in self.of.torsions:
            ends = [eq.TURN, it.body_i, 0.0, 0.0, it.body_j, 0.0, 0.0, 0.0]
            twist = {eq.DAMPER: it.damping_N_m_s, eq.SPRING: it.stiffness_N_m_rad, eq.FREE: it.free_angle_rad}
            yield f"torsion:{it.name}", _part(ends, twist)
        body, rate = self.of.drive.body, self.size + 3 * self.of.drive.body + 2
        turn = [eq.TURN, *GROUND, body, 0.0, 0.0, 0.0]
        match self.of.drive.law:
            case data.Torque(data.Table() as table):
                yield "driver", _part(turn, {eq.BY_TIME: self._over_time(table)})
            case data.Torque(float() | int() as torque):
                yield "driver", _part(turn, {eq.CONSTANT: torque})
            case data.Motor(table=data.Table() as table):
                yield "driver", _part(turn, {eq.BY_RATE: self._over(rate, table, held=True)})
            case data.Motor(stall, speed):
                yield "driver", _part(turn, {eq.CONSTANT: stall, eq.DAMPER: stall / speed})

    def _over(self, coordinate: int, table: data.Table, held: bool = False) -> float:
        """Return the number of the curve of a table over a coordinate of y, with its kinks there."""
        begins = np.array(table.x[:-1] if table.period else [-np.inf, *table.x, np.inf])
        self.kinks.append(Kinks(coordinate, begins, table.period))
        return self._curve(table, held)

    def _over_time(self, table: data.Table | None) -> float:
        """Return the number of the curve of a table over time, with its kinks there."""
        if table is None:
            return NONE
        self._stops += table.x
        return self._curve(table)

    def _curve(self, table: data.Table, held: bool = False) -> float:
        """Return the number of a table's curve, which holds its ends' values or goes on beyond them."""
        curve, first = curve_of(table), sum(map(len, self._pieces))
        rows = np.zeros((len(curve.x) - 1, 5))
        rows[:, 0], rows[:, 5 - len(curve.c) :] = curve.x[:-1], curve.c.T
        self._pieces.append(rows)
        self._curves.append([first, len(rows), table.period, table.x[-1], float(held)])
        return float(len(self._curves) - 1)


class Model(Numbers):
    """y' = f(t, y), y = (q, v, sums), of a scene's mechanism, in the present phases of its contacts.

    ``start`` (state,) is the state at t = 0. Raises SimulationFailed where that is singular.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        q, v = np.array(scene.placed.q), np.array(scene.placed.v)
        self.turns_rad = turns_of(scene.mechanism, q[2::3])
        q[2::3] -= self.turns_rad
        super().__init__(scene.mechanism, q, damping_of)
        of_contacts = self.told[self.first : self.first + eq.OF_CONTACT * len(self.contacts)]
        self.contacts_told: FloatArray = of_contacts.reshape(-1, eq.OF_CONTACT)
        self._rates = cast(Any, eq.rates).compiled()
        self.start = self.closed(0.0, np.concatenate([q, v, np.zeros(len(self.sums))]))

    def __call__(self, t: float, y: FloatArray) -> FloatArray:
        """Return y'; ``told`` is of that state then."""
        out = np.empty(len(y))
        self._rates(self.p, t, np.ascontiguousarray(y), out)
        return out

    def closed(self, t: float, y: FloatArray, choose: bool = True) -> FloatArray:
        """Return a state near y that closes all rows, by default after a new choice of coordinates."""
        y, m, size = y.copy(), self.rows, self.size
        q, v = y[:size], y[size : 2 * size]
        dependent = self.choose(t, self.look(t, q, v)[0]) if choose else self.order[:m].astype(int)
        for _ in range(STEPS if m else 0):
            B, g, *_ = self.look(t, q, v)
            change = np.linalg.solve(B[:, dependent], g)
            q[dependent] -= change
            if not np.abs(change / self.unit[dependent]).max() > CHANGE:
                break
        B, _, c, _ = self.look(t, q, v)
        rest = self.order[m:].astype(int)
        v[dependent] = np.linalg.solve(B[:, dependent], c - B[:, rest] @ v[rest]) if m else v[dependent]
        return y

    def choose(self, t: float, B: FloatArray) -> NDArray[np.int64]:
        """Choose the coordinates that depend by a pivoted factorisation of rows, and return them."""
        m, dependent = len(B), np.zeros(0, np.int64)
        if m:
            scaled = B * self.unit
            scaled /= np.linalg.norm(scaled, axis=1)[:, None]
            R, pivots = scipy.linalg.qr(scaled, mode="r", pivoting=True)
            diagonal = np.abs(np.diag(R))
            if m > self.size or not diagonal[-1] > SINGULAR * diagonal[0]:
                raise self.singular(t)
            dependent = np.sort(pivots[:m]).astype(np.int64)
        self.order[:] = [*dependent, *np.setdiff1d(np.arange(self.size), dependent)]
        return dependent

    def singular(self, t: float) -> SimulationFailed:
        """Return the failure at a singular position."""
        begin = f"the mechanism cannot go on at t = {t:.8g} s"
        if self.of.drive.prescribes:
            return LimitPosition(f"{begin}: the drive has come to a limit position")
        return AdapterCannot(f"{begin}: its loops are singular")

    def condition(self, t: float, y: FloatArray) -> float:
        """Return the least singular value of rows by the largest."""
        B, *_ = self.look(t, y[: self.size], y[self.size : 2 * self.size])
        scaled = B * self.unit
        values = np.linalg.svd(scaled / np.linalg.norm(scaled, axis=1)[:, None], compute_uv=False)
        return float(values[-1] / values[0]) if len(B) else 1.0


def _line(line: data.Line) -> list[float]:
    """Return a line: body and point of i and of j, and its angle."""
    return [line.body_i, *line.point_i, line.body_j, *line.point_j, line.angle_rad]


def _part(ends: list[float], numbers: Mapping[int, float]) -> list[float]:
    """Return a part of a load, with numbers by their columns."""
    row = [*ends, 0.0, 0.0, 0.0, 0.0, *[NONE] * 4]
    for column, number in numbers.items():
        row[column] = number
    return row


def _ends(pin: data.Pin) -> list[float]:
    """Return a joint's bearing and its pin: body and point of each."""
    i, j = [pin.body_i, *pin.point_i], [pin.body_j, *pin.point_j]
    return [*j, *i] if pin.bearing_on_j else [*i, *j]


def _packed(blocks: list[object]) -> FloatArray:
    """Return all numbers in one array, which begins with where each block is, and its rows and columns."""
    arrays = [np.array(each, float) for each in blocks]
    arrays = [array.reshape(len(array), -1) if array.size else np.zeros((0, 1)) for array in arrays]
    head, at = list[float](), 3 * len(arrays)
    for array in arrays:
        head += [at, *array.shape]
        at += array.size
    return np.concatenate([np.array(head, float), *(array.ravel() for array in arrays)])
