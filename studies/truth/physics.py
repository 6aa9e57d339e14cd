"""Walls, drives and loads of a mechanism in numbers, and their formulas, from papers and the format."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from reference_solver.mechanism.data import (
    GROUND,
    ClearanceData,
    ConstantSpeed,
    Course,
    DriveData,
    Fluctuation,
    Line,
    Load,
    MechanismData,
    Motor,
    Ramp,
    Table,
    Torque,
)
from studies.truth.machine import bare
from studies.truth.tables import Tables, value_at, value_in
from studies.truth.tree import ALONG, LENGTH, Layout, Made, Vector, times, total

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
#: Floor of the approach speed in laws that divide by it, where the scene gives none.
SLOWEST_M_S = 1e-6
FRICTION = ("saturated-linear", "ambrosio", "tanh")
#: Columns of a wall: clearance and bearing radius in m; F = K delta^n (1 + a delta'/v0) + b delta'. Of rigid
#: ones K is infinite, E the restitution, and what comes slower than SLOWEST does not rebound. A law that
#: PULLS is left as it is, but for its friction; friction too where it DRAGS. Friction is MU F f(v), f = 1 at
#: FULL speed, 0 below the DEAD one, or tanh, by KIND in ``FRICTION``.
C, R, K, N, A, B, E, SLOWEST, PULLS, DRAGS, MU, FULL, DEAD, KIND = range(14)
#: Drives: a torque, constant or none, or by time; a motor's, linear or by a table; and prescribed motions.
TORQUE, BY_TIME, MOTOR, BY_SPEED, CONSTANT, RAMP, SINE, COURSE = range(8)
#: Parts of loads: along a row, turning an angle, and a spring between two points.
FORCE, VISCOUS, SPRING, GAS, FORCE_BY_TIME, TURN, TURNING_VISCOUS, TURN_BY_TIME, PULL = range(9)
#: Columns of a part's whole numbers: its kind, the row or the angle that it acts along, of gas the angle that
#: it goes by and the place in the phases, and its table.
WHAT, WHERE, BY, PHASE, TABLE = range(5)


class Drive(NamedTuple):
    """Its kind, the coordinate that it drives (NONE: none), its table, its place in the phases, and numbers.

    The numbers are the torque; a motor's torque at rest and speed without load; else the speed, then its
    change and its duration or its amplitude and rate, and last what the clock reads at the start, or the
    phase.
    """

    kind: int
    coordinate: int
    table: int
    phase: int
    a: float
    b: float
    c: float
    d: float


class Loads(NamedTuple):
    """Parts of loads: ``what`` (p, 5) and ``numbers`` (p, 3), and what the clock reads at the start.

    The numbers are a force or torque, c in N s/m, or k in N/m and a place in m; of gas the angle of its body
    beside the coordinate; of a spring its stiffness, free length and damping.
    """

    what: IntArray
    numbers: FloatArray
    clock_s: float


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


def _stiffness_of(room: ClearanceData) -> float:
    """Return K as given, infinite of a rigid wall, or by Hertz of a pin in a hole of its own material.

    K = 4/(3 (s_i + s_j)) sqrt(R_i R_j/(R_i - R_j)) with s = (1 - nu^2)/E.
    """
    if room.law == "rigid":
        return math.inf
    if room.stiffness is not None:
        return room.stiffness
    E, nu, c = room.young_modulus_Pa, room.poisson_ratio, room.radial_clearance_m
    assert E is not None
    assert nu is not None
    hole = room.bearing_radius_m
    return 2 * E / (3 * (1 - nu * nu)) * math.sqrt(hole * (hole - c) / c)


def wall_of(room: ClearanceData) -> list[float]:
    """Return the columns of a wall."""
    law, friction = room.law, room.friction
    e, rubs = room.restitution or 0.0, [0.0, 1.0, 0.0, 0.0]
    if friction is not None:
        speeds = friction.regularisation_speed_m_s, friction.dead_band_speed_m_s or 0.0
        rubs = [friction.coefficient, *speeds, FRICTION.index(friction.law)]
    return [
        room.radial_clearance_m,
        room.bearing_radius_m,
        _stiffness_of(room),
        room.exponent or (1.0 if law in ("linear", "kelvin-voigt") else 1.5),
        damping_of(law, e),
        room.damping_N_s_m or 0.0,
        e,
        room.minimum_impact_speed_m_s or (0.0 if law == "rigid" else SLOWEST_M_S),
        float(room.may_pull or law == "kelvin-voigt"),
        float(room.may_pull),
        *rubs,
    ]


def drive_of(drive: DriveData, coordinate: int, phase: int, found: list[Table]) -> Drive:
    """Return a drive of a coordinate, and put its table behind those that there are."""
    law, clock = drive.law, drive.clock_s
    kind, numbers = TORQUE, [0.0]
    table: Table | None = None
    if isinstance(law, Torque) and isinstance(law.torque_N_m, Table):
        kind, numbers, table = BY_TIME, [0.0, 0.0, 0.0, clock], law.torque_N_m
    elif isinstance(law, Torque):
        assert not isinstance(law.torque_N_m, Table)
        numbers = [law.torque_N_m]
    elif isinstance(law, Motor) and law.table is not None:
        kind, table = BY_SPEED, law.table
    elif isinstance(law, Motor):
        kind, numbers = MOTOR, [law.stall_torque_N_m, law.no_load_speed_rad_s]
    elif isinstance(law, ConstantSpeed):
        kind, numbers = CONSTANT, [law.speed]
    elif isinstance(law, Ramp):
        kind, numbers = RAMP, [law.first, law.last - law.first, law.duration_s, clock]
    elif isinstance(law, Fluctuation):
        rate = math.tau * law.frequency_Hz
        kind, numbers = SINE, [law.mean, law.amplitude, rate, law.phase_rad + rate * clock]
    elif isinstance(law, Course):
        kind, numbers, table = COURSE, [0.0, 0.0, 0.0, clock], law.table
    else:
        assert law is None, law
    if table is not None:
        found.append(table)
    a, b, c, d = map(float, [*numbers, 0.0, 0.0, 0.0][:4])
    return Drive(kind, coordinate, len(found) - 1 if table is not None else 0, phase, a, b, c, d)


class Acting(NamedTuple):
    """Parts of loads by name while they are put together, their tables, and rows along which forces act."""

    names: list[str]
    what: list[list[int]]
    numbers: list[list[float]]
    tables: list[Table]
    rows: list[tuple[Vector, complex] | Made]


def acting_on(of: MechanismData, layout: Layout, first_phase: int) -> Acting:
    """Return what loads and springs put on a mechanism; every table of gas has a phase, from the first on."""
    acting = Acting([], [], [], [], [])
    for load in of.loads:
        name = of.bodies[load.body].name
        if load.line is not None:
            _add_forces(acting, load, load.line, layout, name, first_phase)
        angle = layout.angle[load.body]
        turns = {"torque": (TURN, load.torque_N_m), "turning_viscous": (TURNING_VISCOUS, load.viscous_N_m_s)}
        for part, (kind, number) in turns.items():
            if number:
                _add(acting, f"{name}.{part}", [kind, angle, 0, 0, 0], [number, 0.0, 0.0])
        if load.torque_by_time is not None:
            acting.tables.append(load.torque_by_time)
            table = len(acting.tables) - 1
            _add(acting, f"{name}.torque_by_time", [TURN_BY_TIME, angle, 0, 0, table], [0.0] * 3)
    for spring in of.springs:
        i, j = layout.point(spring.body_i, spring.point_i), layout.point(spring.body_j, spring.point_j)
        acting.rows.append((LENGTH, total(j, times(i, -1.0)), GROUND, 1.0 + 0j))
        numbers = [spring.stiffness_N_m, spring.free_length_m, spring.damping_N_s_m]
        _add(acting, f"spring:{spring.name}", [PULL, len(acting.rows) - 1, 0, 0, 0], numbers)
    return acting


def _add(acting: Acting, name: str, what: list[int], numbers: list[float]) -> None:
    acting.names.append(name)
    acting.what.append(what)
    acting.numbers.append(numbers)


def _add_forces(acting: Acting, load: Load, line: Line, layout: Layout, name: str, first_phase: int) -> None:
    i, j = layout.point(line.body_i, line.point_i), layout.point(line.body_j, line.point_j)
    angle, along = layout.line(line)
    d, row = total(j, times(i, -1.0)), len(acting.rows)
    acting.rows.append((d, along.conjugate()) if angle == GROUND else (ALONG, d, angle, along))
    numbers = {
        "force": (FORCE, load.force_N, 0.0),
        "viscous": (VISCOUS, load.viscous_N_s_m, 0.0),
        "spring": (SPRING, load.spring_N_m, load.free_position_m),
    }
    for part, (kind, number, other) in numbers.items():
        if number:
            _add(acting, f"{name}.{part}", [kind, row, 0, 0, 0], [number, other, 0.0])
    if load.gas is not None:
        acting.tables.append(load.gas.table)
        phase = first_phase + sum(what[WHAT] == GAS for what in acting.what)
        by, beside = layout.angle[load.gas.body], layout.offset[load.gas.body]
        _add(acting, f"{name}.gas", [GAS, row, by, phase, len(acting.tables) - 1], [beside, 0.0, 0.0])
    if load.force_by_time is not None:
        acting.tables.append(load.force_by_time)
        _add(acting, f"{name}.by_time", [FORCE_BY_TIME, row, 0, 0, len(acting.tables) - 1], [0.0] * 3)


def stops_s(drive: Drive, loads: Loads, of: Tables) -> FloatArray:
    """Return the times at which a derivative of what goes by the time jumps."""
    timed = [drive.table] if drive.kind in (BY_TIME, COURSE) else []
    timed += [int(what[TABLE]) for what in loads.what if what[WHAT] in (FORCE_BY_TIME, TURN_BY_TIME)]
    stops = [of.pieces[first : first + count, 0] - loads.clock_s for first, count in of.at[timed].tolist()]
    ramp = [drive.c - drive.d] if drive.kind == RAMP else []
    return np.unique(np.concatenate([*stops, np.array(ramp, float)]))


@bare
def prescribed(drive: Drive, of: Tables, t: float) -> tuple[float, float, float]:
    """Return how far a driven coordinate has gone since the run began, its speed and its acceleration."""
    first, change, rate, phase = drive.a, drive.b, drive.c, drive.d
    if drive.kind == RAMP:
        x, y = min((phase + t) / rate, 1.0), min(phase / rate, 1.0)
        went = x**4 * (2.5 - 3.0 * x + x * x) - y**4 * (2.5 - 3.0 * y + y * y)
        went = rate * went + max(phase + t - rate, 0.0) - max(phase - rate, 0.0)
        return (
            first * t + change * went,
            first + change * (10.0 * x**3 - 15.0 * x**4 + 6.0 * x**5),
            change / rate * (30.0 * x**2 - 60.0 * x**3 + 30.0 * x**4),
        )
    if drive.kind == SINE:
        half = 0.5 * rate * t
        # cos(phase) - cos(phase + rate t), without their difference
        went = 2.0 * math.sin(half) * math.sin(half + phase)
        now = rate * t + phase
        return (
            first * t + change / rate * went,
            first + change * math.sin(now),
            change * rate * math.cos(now),
        )
    if drive.kind == COURSE:
        place, speed, acceleration = value_at(of, drive.table, t + phase)
        return place - value_at(of, drive.table, phase)[0], speed, acceleration
    return first * t, first, 0.0


@bare
def effort(drive: Drive, of: Tables, piece: float, t: float, speed: float) -> float:
    """Return the torque in N m of a drive that prescribes no motion."""
    if drive.kind == MOTOR:
        return float(drive.a - drive.a / drive.b * speed)
    if drive.kind == BY_TIME:
        return float(value_at(of, drive.table, t + drive.d)[0])
    if drive.kind == BY_SPEED:
        return held(of, drive.table, piece, speed)
    return float(drive.a) if drive.kind == TORQUE else 0.0


@bare
def held(of: Tables, table: int, piece: float, x: float) -> float:
    """Return the value of a table's piece, which before and beyond the table is that of its end."""
    first, count = of.at[table, 0], of.at[table, 1]
    if piece < 0.0:
        return float(of.pieces[first, 4])
    if piece >= count:
        return float(value_in(of, table, count - 1.0, of.ends[table, 0])[0])
    return float(value_in(of, table, piece, x)[0])


@bare
def friction_share(wall: FloatArray, piece: float, sliding: float) -> float:
    """Return the part of mu F that rubs at a sliding speed, with its sign, by one piece of the law.

    Pieces are 0 about rest, +-1 on the ramps beside a dead band, +-2 beyond full speed; that of tanh is
    smooth. Each goes on beyond its ends: who changes pieces knows where.
    """
    if wall[KIND] == 2.0:
        return math.tanh(sliding / wall[FULL])
    if piece == 0.0 and wall[DEAD] > 0.0:
        return 0.0
    if abs(piece) == 2.0:
        return 0.5 * piece
    return float(sliding - piece * wall[DEAD]) / float(wall[FULL] - wall[DEAD])


@bare
def load_part(
    loads: Loads, of: Tables, p: int, piece: float, t: float, by: float, place: float, rate: float
) -> tuple[float, float]:
    """Return a part's force in N, or torque in N m, and how much of it has no potential.

    ``place`` and ``rate`` are those of its row or angle, ``by`` is the angle that gas goes by.
    """
    kind, a, b = loads.what[p, WHAT], loads.numbers[p, 0], loads.numbers[p, 1]
    if kind in (VISCOUS, TURNING_VISCOUS):
        return -a * rate, -a * rate
    if kind == SPRING:
        return a * (b - place), a * (b - place)
    if kind == GAS:
        force = value_in(of, loads.what[p, TABLE], piece, by + a)[0]
        return force, force
    if kind in (FORCE_BY_TIME, TURN_BY_TIME):
        force = value_at(of, loads.what[p, TABLE], t + loads.clock_s)[0]
        return force, force
    if kind == PULL:  # positive where it pulls
        damper = loads.numbers[p, 2] * rate
        return -a * (place - b) - damper, -damper
    return a, a
