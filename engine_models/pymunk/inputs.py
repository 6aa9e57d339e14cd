"""What the compiled loop is given of a mechanism: its loads as records, and the steps of a driven body.

A step ends by clearing the loads on its bodies, and a driven body moves on at the speed that it was given
last. Loads are set before every step, as Pymunk's manual has it, by the compiled loop (``compiled.loads``).
What a drive prescribes is computed block by block, outside of the time of the run.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from engine_models.engine import FloatArray
from engine_models.mechanics.crank_motion import motion_of
from engine_models.pymunk.compiled.records import CURVE, HELD, LINE, SPRING, TORQUE
from engine_models.pymunk.joints.dampers import Damper
from engine_models.pymunk.joints.plan import Plan
from reference_solver.mechanism.curves import curve_of
from reference_solver.mechanism.data import GROUND, ConstantSpeed, Line, MechanismData, Motor, Table, Torque
from reference_solver.mechanism.motor import motor_damping

NONE = -1


class Inputs:
    """The bodies' order in the loop, and its records of them and their loads.

    The ``order`` (bodies,) begins with those that are ``loaded`` in every step; then come others whose states
    are ``followed`` from step to step, as loads or contacts depend on them. It ``feels`` if a load goes by
    velocities that are foreseen: a table over a speed, or a damper that is not its body's own (see
    ``joints.dampers``). The driven body ``slides`` or turns, in the ``driven_way`` (x, y, phi). ``row_of``
    (bodies + 1,) has the row of every body, the ground's at its end, where ``GROUND`` finds it.
    """

    def __init__(self, of: MechanismData, plan: Plan, dampers: Sequence[Damper] = ()) -> None:
        self.of, self.plan = of, plan
        self._own = {(damper.load, damper.turns) for damper in dampers if damper.own}
        loaded, followed = _touched(of, plan)
        others = set(range(len(of.bodies))) - loaded - followed
        self.order = [*sorted(loaded), *sorted(followed - loaded), *sorted(others)]
        self.loaded, self.followed = len(loaded), len(loaded | followed)
        self.row_of = np.append(np.argsort(self.order), len(of.bodies))
        self.driven, self.slides = int(self.row_of[of.drive.body]), of.drive.guide is not None
        angle = 0.0 if of.drive.guide is None else of.guides[of.drive.guide].angle_rad
        self.driven_way = np.array([np.cos(angle), np.sin(angle), 0.0] if self.slides else [0.0, 0.0, 1.0])
        self.clock_s = of.drive.clock_s
        self._tables: list[tuple[Table, bool]] = []
        self.held = np.concatenate([np.zeros(0, HELD), *(self._held(body) for body in self.order)])
        self.lines, self.torques = _records(LINE, self._lines()), _records(TORQUE, self._torques())
        self.springs = _records(SPRING, self._springs())
        self.curves, self.pieces = self._curves()
        foreseen = [some["viscous"][some["own"] == 0].any() for some in (self.lines, self.torques)]
        self.feels = any(foreseen) or bool(
            (self.torques["by_speed"] >= 0).any() or self.springs["damping"].any()
        )

    def turns(self, steps: NDArray[np.int64], step_s: float, start: FloatArray) -> FloatArray:
        """Return what the driven body is given before steps (n,): (n, 2) or (n, 4), (0, 2) for nothing.

        That is angle and speed, or of one that slides place and velocity (x, y); they count from the body's
        ``start`` (3,). Step 0 is the half kick, which moves nothing. The speed is that of half a step later,
        and the place leads it to its own in the step: the joints' impulses of kick k are those of the speed
        at t_k + dt/2, as of any other velocity after it. The step moves the body first, though, by the same
        speed.
        """
        drive = self.of.drive
        motion = motion_of(drive)
        if motion is None or isinstance(drive.law, ConstantSpeed):
            return np.zeros((0, 2))
        speed = motion.speed_rad_s(np.asarray((steps + 0.5) * step_s, dtype=np.float64))
        moved = np.where(steps > 0, step_s, 0.0) * speed
        way = np.asarray(motion.turned_rad(np.asarray(steps * step_s, dtype=np.float64)))
        given = slice(0, 2) if self.slides else slice(2, 3)
        way, moved, speed = (np.outer(values, self.driven_way)[:, given] for values in (way, moved, speed))
        return np.concatenate([start[given] + way - moved, speed], axis=1)

    def _held(self, body: int) -> NDArray[Any]:
        seat, gravity, record = self.plan.seats[body], np.array(self.of.gravity_m_s2), np.zeros(1, HELD)
        if not seat.is_kinematic:
            record["weight_x"], record["weight_y"] = seat.weight_kg * gravity
            record["centre_x"], record["centre_y"] = seat.centre
        if seat.is_lifted:
            record["lifted"], (record["lift_x"], record["lift_y"]) = True, -seat.mass_kg * gravity
        if seat.along is not None:
            record["runs"], (record["u_x"], record["u_y"]) = True, seat.along
        return record

    def _ends(self, of: Any) -> dict[str, Any]:
        (i, (x_i, y_i)), (j, (x_j, y_j)) = self.plan.ends(of)
        rows = {"row_i": self.row_of[i], "row_j": self.row_of[j]}
        return rows | {"x_i": x_i, "y_i": y_i, "x_j": x_j, "y_j": y_j}

    def _lines(self) -> list[dict[str, Any]]:
        return [
            {
                **self._ends(load.line),
                "u_x": np.cos(load.line.angle_rad),
                "u_y": np.sin(load.line.angle_rad),
                "force": load.force_N,
                "viscous": load.viscous_N_s_m,
                "own": (number, False) in self._own,
                "spring": load.spring_N_m,
                "free": load.free_position_m,
                "gas": self._curve(None if load.gas is None else load.gas.table),
                "gas_row": 0 if load.gas is None else self.row_of[load.gas.body],
                "by_time": self._curve(load.force_by_time),
            }
            for number, load in enumerate(self.of.loads)
            if load.line is not None
        ]

    def _torques(self) -> list[dict[str, Any]]:
        drive, law = self.of.drive, self.of.drive.law
        found: list[tuple[int | None, int, float, float, Table | None, Table | None]] = [
            (number, load.body, load.torque_N_m, load.viscous_N_m_s, load.torque_by_time, None)
            for number, load in enumerate(self.of.loads)
        ]
        if isinstance(law, Torque):
            by_time = law.torque_N_m if isinstance(law.torque_N_m, Table) else None
            constant = 0.0 if isinstance(law.torque_N_m, Table) else law.torque_N_m
            found.append((None, drive.body, constant, 0.0, by_time, None))
        elif isinstance(law, Motor):
            damping = 0.0 if law.table else motor_damping(law)
            found.append((None, drive.body, law.stall_torque_N_m, damping, None, law.table))
        return [
            {
                "row": self.row_of[body],
                "torque": constant,
                "viscous": viscous,
                "own": (number, True) in self._own,
                "by_time": self._curve(by_time),
                "by_speed": self._curve(by_speed, keeps=True),
            }
            for number, body, constant, viscous, by_time, by_speed in found
            if constant or viscous or by_time or by_speed
        ]

    def _springs(self) -> list[dict[str, Any]]:
        return [
            {
                **self._ends(spring),
                "stiffness": spring.stiffness_N_m,
                "free": spring.free_length_m,
                "damping": spring.damping_N_s_m,
            }
            for spring in self.of.springs
        ]

    def _curve(self, table: Table | None, keeps: bool = False) -> int:
        """Return the number of a table's curve."""
        if table is None:
            return NONE
        self._tables.append((table, keeps))
        return len(self._tables) - 1

    def _curves(self) -> tuple[NDArray[Any], FloatArray]:
        records, pieces = np.zeros(len(self._tables), CURVE), [np.zeros((0, 5))]
        for record, (table, keeps) in zip(records, self._tables, strict=True):
            curve = curve_of(table)
            record["first"], record["count"] = sum(map(len, pieces)), len(curve.x) - 1
            record["keeps"], record["period"], record["last"] = keeps, table.period, table.x[-1]
            pieces.append(np.column_stack([curve.x[:-1], curve.c.T]))
        return records, np.concatenate(pieces)


def _records(kind: np.dtype[Any], values: list[dict[str, Any]]) -> NDArray[Any]:
    records = np.zeros(len(values), kind)
    for record, own in zip(records, values, strict=True):
        for name, value in own.items():
            record[name] = value
    return records


def _touched(of: MechanismData, plan: Plan) -> tuple[set[int], set[int]]:
    """Return the bodies that are loaded in every step, and those whose states are needed in every step."""
    loaded, followed = set[int](), set[int]()
    for load in of.loads:
        lines: list[Line] = [] if load.line is None else [load.line]
        loaded |= {load.body, *(line.body_i for line in lines)}
        followed |= set() if load.gas is None else {load.gas.body}
    for spring in of.springs:
        loaded |= {spring.body_i, spring.body_j}
    if isinstance(of.drive.law, Torque | Motor):
        loaded.add(of.drive.body)
    loaded |= {body for body, seat in enumerate(plan.seats) if seat.is_lifted and any(of.gravity_m_s2)}
    for pin in of.loose:
        assert pin.clearance is not None
        followed |= set() if pin.clearance.law == "rigid" else {pin.body_i, pin.body_j}
    return loaded - {GROUND}, followed - {GROUND}
