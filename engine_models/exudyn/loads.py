"""What acts on bodies by their states or by time, as one object of generalised forces in Exudyn.

It has no mass of its own and stands on the nodes of the bodies. What is linear in their coordinates is in its
constant, damping and stiffness matrices. All else is a function that Exudyn evaluates by itself (see
``symbolic``): tables, the torque that changes a flywheel's speed, and forces along lines that turn, or on
bodies that do.
"""

import math
from dataclasses import replace
from typing import Any

import exudyn as exu
import numpy as np
from exudyn import itemInterface

from engine_models.engine import FloatArray
from engine_models.exudyn.drive import HEAVY_KG, acceleration
from engine_models.exudyn.kinematic_tree import Link, driven_link, up
from engine_models.exudyn.motion import Part
from engine_models.exudyn.symbolic import piecewise, symbolic, user_function
from engine_models.mechanics.states import way
from reference_solver.mechanism.curves import curve_of
from reference_solver.mechanism.data import (
    GROUND,
    ConstantSpeed,
    Guide,
    Line,
    Load,
    MechanismData,
    Motor,
    Point,
    Table,
    Torque,
)
from reference_solver.mechanism.motor import motor_damping, motor_torque

items: Any = itemInterface  # its constructors carry no types
#: What a force of 1 N or a torque of 1 N m puts on every coordinate: numbers, or expressions.
Row = list[Any]


def add_loads(
    mbs: exu.MainSystem, of: MechanismData, parts: tuple[Part, ...], start: FloatArray, flywheel: bool
) -> None:
    """Add the loads and the torque of the drive, if there are any, at a start (bodies, 3).

    ``flywheel``: what is driven has one and no constraint, so that a changing speed takes a torque here.
    """
    bodies = {load.body for load in of.loads}
    bodies |= {load.line.body_i for load in of.loads if load.line is not None}
    bodies |= {load.gas.body for load in of.loads if load.gas is not None}
    law, heavy = of.drive.law, flywheel and of.drive.prescribes
    # On a guide the flywheel has a weight as well.
    heavy = heavy and not (isinstance(law, ConstantSpeed) and of.drive.guide is None)
    if heavy or isinstance(law, Motor) or (isinstance(law, Torque) and isinstance(law.torque_N_m, Table)):
        bodies.add(of.drive.body)
    # No node that is not needed: implicit solvers difference these forces by every coordinate.
    parts = tuple(part for part in parts if bodies & {link.body for link in part.links})
    if not parts:
        return
    acting = _Acting(of, parts, start)
    for load in of.loads:
        acting.load(load)
    acting.torque_of_drive()
    if heavy:
        acting.flywheel()
    acting.add(mbs)


class _Acting:
    """Generalised forces on the coordinates of parts: linear ones by matrices, others by expressions."""

    def __init__(self, of: MechanismData, parts: tuple[Part, ...], start: FloatArray) -> None:
        self._of, self._parts, self._start, links = of, parts, start, list[Link]()
        for part in parts:
            links += [
                replace(link, parent=link.parent + len(links)) if link.parent >= 0 else link
                for link in part.links
            ]
        self._links, count = tuple(links), len(links)
        self._own = {link.body: k for k, link in enumerate(links) if link.body is not None}
        self._at = np.concatenate([part.start for part in parts]).tolist()
        self._constant, (self._damping, self._stiffness) = np.zeros(count), np.zeros((2, count, count))
        self._forces: Row = [None] * count
        self._t = symbolic.Real("t", 0.0)
        self._clock = self._t + of.drive.clock_s
        self._q, self._rates = (symbolic.Vector(name, [0.0] * count) for name in ("q", "q_t"))

    def load(self, load: Load) -> None:
        """Add a load."""
        if load.line is not None:
            self._along(load, load.line)
        turn = self._turning(load.body)
        self._constant += load.torque_N_m * turn
        self._damping += load.viscous_N_m_s * np.outer(turn, turn)
        if load.torque_by_time is not None:
            self._push(turn, piecewise(self._clock, curve_of(load.torque_by_time)))

    def torque_of_drive(self) -> None:
        """Add the torque of a drive by speed or time; a constant one is a load of Exudyn's own."""
        law = self._of.drive.law
        if isinstance(law, Torque) and isinstance(law.torque_N_m, Table):
            self._push(self._turning(self._of.drive.body), piecewise(self._clock, curve_of(law.torque_N_m)))
        elif isinstance(law, Motor):
            turn = self._turning(self._of.drive.body)
            if law.table is None:
                self._constant += motor_torque(law, 0.0) * turn
                self._damping += motor_damping(law) * np.outer(turn, turn)
            else:
                first, last = (symbolic.Real(x) for x in (law.table.x[0], law.table.x[-1]))
                speed = symbolic.max(first, symbolic.min(last, self._sum(turn, self._rates)))
                self._push(turn, piecewise(speed, curve_of(law.table)))

    def flywheel(self) -> None:
        """Add what changes the speed of a flywheel, and on a guide what carries its weight."""
        drive, row = self._of.drive, np.zeros(len(self._links))
        row[driven_link(self._of, self._links)] = 1.0
        if drive.guide is not None:
            weight_m_s2 = np.dot(_direction(self._of.guides[drive.guide].angle_rad), self._of.gravity_m_s2)
            self._constant -= HEAVY_KG * weight_m_s2 * row
        if not isinstance(drive.law, ConstantSpeed):
            self._push(row, HEAVY_KG * acceleration(drive, self._t))

    def add(self, mbs: exu.MainSystem) -> None:
        """Add the object that has them all."""
        what: dict[str, Any] = {
            "massMatrix": np.zeros_like(self._damping),
            "stiffnessMatrix": self._stiffness,
            "dampingMatrix": self._damping,
            "forceVector": self._constant,
        }
        if any(force is not None for force in self._forces):
            forces = [symbolic.Real(0.0) if force is None else force for force in self._forces]
            arguments = [self._t, symbolic.Real("itemNumber", 0), self._q, self._rates]
            value = symbolic.Vector(forces)
            function = user_function(mbs, "ObjectGenericODE2", "forceUserFunction", arguments, value)
            what["forceUserFunction"] = function
        mbs.AddObject(items.ObjectGenericODE2(nodeNumbers=[part.node for part in self._parts], **what))

    def _along(self, load: Load, line: Line) -> None:
        """Add the forces along a line: as matrices where it does not turn, nor the point's way onto it."""
        row, forces = self._row(line), list[Any]()
        c, k, free = load.viscous_N_s_m, load.spring_N_m, load.free_position_m
        if all(isinstance(each, float) for each in row):
            s = float(way(line, self._start[None], np.zeros((1, *self._start.shape)))[0][0])
            fixed = np.array(row)
            self._constant += (load.force_N - k * (s - free)) * fixed
            self._damping += c * np.outer(fixed, fixed)
            self._stiffness += k * np.outer(fixed, fixed)
        else:
            if load.force_N:
                forces.append(symbolic.Real(load.force_N))
            if c:
                forces.append(-c * self._sum(row, self._rates))
            if k:
                forces.append(-k * (self._way(line) - free))
        if load.gas is not None:
            forces.append(gas_force(load.gas.table, self._angle(load.gas.body)))
        if load.force_by_time is not None:
            forces.append(piecewise(self._clock, curve_of(load.force_by_time)))
        if forces:
            self._push(row, sum(forces[1:], forces[0]))

    def _push(self, row: Row | FloatArray, force: Any) -> None:
        """Add a force or a torque."""
        for k, each in _entries(row):
            own = _product(each, force)
            self._forces[k] = own if self._forces[k] is None else self._forces[k] + own

    def _turning(self, body: int) -> FloatArray:
        """Return which coordinates add up to a body's angle, as ones among zeros."""
        row = np.zeros(len(self._links))
        for k in up(self._links, self._own[body]):
            row[k] = self._links[k].joint == "turn"
        return row

    def _angle(self, body: int) -> Any:
        return float(self._start[body, 2]) + self._sum(self._turning(body), self._q)

    def _sum(self, row: Row | FloatArray, values: Any) -> Any:
        return sum((_product(each, values[k]) for k, each in _entries(row)), symbolic.Real(0.0))

    # Q_k = F d.(dP/dq_k) on body j, and the opposite on body i at the same place P: what moves both does
    # nothing. A link that turns about O moves P by z x (P - O), one that slides by its axis.
    def _row(self, line: Line) -> Row:
        """Return what a force of 1 N along a line puts on every coordinate: on a guide's own it is 1."""
        row: Row = [0.0] * len(self._links)
        for k, link in enumerate(self._links):
            if isinstance(line, Guide) and link.name == line.name and link.joint == "x":
                row[k] = -1.0 if link.body == line.body_i else 1.0
                return row
        place, d = self._place(line.body_j, line.point_j), _direction(self._line_angle(line))
        above_j, above_i = ([*up(self._links, self._own.get(b, -1))] for b in (line.body_j, line.body_i))
        for k in {*above_j} ^ {*above_i}:
            unit = self._unit(k, line, place, d)
            row[k] = unit if k in above_j else -1.0 * unit
        return row

    def _unit(self, k: int, line: Line, place: tuple[Any, Any], d: tuple[Any, Any]) -> Any:
        link, (x, y, angle) = self._links[k], self._frame(k)
        if link.joint != "turn":
            axis = _axis(link, angle)
            return axis[0] * d[0] + axis[1] * d[1]
        if link.body == line.body_j and not any(link.place(line.point_j)):
            return 0.0
        return (place[0] - x) * d[1] - (place[1] - y) * d[0]

    def _way(self, line: Line) -> Any:
        (x, y), d = self._place(line.body_j, line.point_j), _direction(self._line_angle(line))
        from_x, from_y = self._place(line.body_i, line.point_i)
        return (x - from_x) * d[0] + (y - from_y) * d[1]

    def _line_angle(self, line: Line) -> Any:
        return line.angle_rad if line.body_i == GROUND else self._angle(line.body_i) + line.angle_rad

    def _place(self, body: int, point: Point) -> tuple[Any, Any]:
        if body == GROUND:
            return point
        k = self._own[body]
        (x, y, angle), (dx, dy) = self._frame(k), self._links[k].place(point)
        cos, sin = _direction(angle)
        return x + (cos * dx - sin * dy), y + (sin * dx + cos * dy)

    def _frame(self, k: int) -> tuple[Any, Any, Any]:
        """Return place and angle of a link's frame."""
        if k < 0:
            return 0.0, 0.0, 0.0
        link, (x, y, angle) = self._links[k], self._frame(self._links[k].parent)
        (dx, dy), (cos, sin) = link.offset_m, _direction(angle)
        x, y, angle = x + (cos * dx - sin * dy), y + (sin * dx + cos * dy), angle + link.angle_rad
        moved = self._at[k] + self._q[k]
        if link.joint == "turn":
            return x, y, angle + moved
        along = _axis(link, angle)
        return x + along[0] * moved, y + along[1] * moved, angle


def gas_force(table: Table, angle: Any) -> Any:
    """Return the force in N of a table that repeats, as an expression of an angle in rad."""
    period, first = table.period, table.x[0]
    return piecewise(angle - period * symbolic.floor((angle - first) / period), curve_of(table))


def _direction(angle: Any) -> tuple[Any, Any]:
    """Return the unit vector at an angle: of a number, numbers."""
    if isinstance(angle, float):
        return math.cos(angle), math.sin(angle)
    return symbolic.cos(angle), symbolic.sin(angle)


def _axis(link: Link, angle: Any) -> tuple[Any, Any]:
    """Return the unit vector along which a link slides in a frame at an angle."""
    cos, sin = _direction(angle)
    return (cos, sin) if link.joint == "x" else (-1.0 * sin, cos)


def _entries(row: Row | FloatArray) -> list[tuple[int, Any]]:
    """Return the entries of a row that are no zeros, with their places."""
    return [(k, each) for k, each in enumerate(row) if not (isinstance(each, float) and each == 0)]


def _product(factor: Any, value: Any) -> Any:
    """Return an expression times a number or an expression."""
    if not isinstance(factor, float):
        return factor * value
    return value if factor == 1 else float(factor) * value
