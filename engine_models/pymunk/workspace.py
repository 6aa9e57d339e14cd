"""All memory of a run's compiled loop: the records of run and pins, their logs, the buffers of the space."""

from collections.abc import Mapping
from time import perf_counter
from typing import Any

import numpy as np
import pymunk
from numba import typeof
from numpy.typing import NDArray

from engine_models.engine import FloatArray, SimulationFailed
from engine_models.mechanics.contact_law import law_numbers
from engine_models.pymunk.compiled import loop
from engine_models.pymunk.compiled.chipmunk import BODY, LOAD
from engine_models.pymunk.compiled.records import KICK, LOST, PIN, ROW, RUN
from engine_models.pymunk.exchange import LOADS, SLIDE, STATE, TURN, Batch, address
from engine_models.pymunk.inputs import Inputs
from engine_models.pymunk.model import Bodies
from engine_models.pymunk.native_contact import NativeContact
from engine_models.scene.format import Clearance
from reference_solver.mechanism.data import GROUND

#: Kicks that are worked off at once, at most, and sweeps in them: some tenths of a second, in which nobody is
#: heard.
BLOCK_KICKS, BLOCK_SWEEPS = 16_384, 2**23


class Workspace:
    """The memory of a run of a space with these bodies and pins with room; see ``records`` for the arrays.

    States and loads have one more row for the ground. Logs and rows have room for a block of ``block_kicks``.
    Native contacts are added to the space.
    """

    def __init__(
        self,
        space: pymunk.Space,
        bodies: Bodies,
        inputs: Inputs,
        rooms: Mapping[str, Clearance],
        contact_sweeps: int,
    ) -> None:
        self._inputs, self._names, rows = inputs, [*rooms], len(bodies) + 1
        placed = [bodies[body]._body for body in inputs.order]
        self._kept, self._bodies = (space, bodies), np.array([*map(address, placed)], dtype=np.uintp)
        self._state, self._loads = Batch(STATE, 6 * rows), Batch(LOADS, 3 * rows)
        self._turn = Batch(SLIDE, 4) if inputs.slides else Batch(TURN, 2)
        self.row_of = inputs.row_of[:-1]
        sweeps = max(space.iterations, contact_sweeps)
        self.block_kicks = max(loop.START_KICKS, min(BLOCK_KICKS, BLOCK_SWEEPS // sweeps))
        self.run, self._pins = np.zeros(1, RUN), np.zeros(len(rooms), PIN)
        self._kicks = np.zeros((len(rooms), self.block_kicks), KICK)
        self.rows, self.out = np.zeros(self.block_kicks, ROW), np.zeros((self.block_kicks, len(bodies), 9))
        self._before, self._at = (np.zeros(rows, BODY) for _ in range(2))
        io = self.run[0]["io"]
        io["space"], io["turn"] = address(space._space), self._turn.record
        io["state"], io["loads"] = self._state.record, self._loads.record
        self.run["kick"] = -1
        self.run["flight_sweeps"], self.run["contact_sweeps"] = space.iterations, contact_sweeps
        for name in ("clock_s", "loaded", "followed", "feels", "driven"):
            self.run[name] = getattr(inputs, name)
        self._native = []
        for number, pin in enumerate(inputs.of.loose):
            ends, room = inputs.plan.ends(pin)[:: -1 if pin.bearing_on_j else 1], rooms[pin.name]
            self._set(self._pins[number], ends, room)
            if room.law == "rigid":
                placed_ends = [
                    (space.static_body if body == GROUND else bodies[body], at) for body, at in ends
                ]
                memory = self.run, self._pins[number : number + 1], self._kicks[number]
                self._native.append(NativeContact(space, number, room, placed_ends, *memory))

    def _set(self, record: Any, ends: Any, room: Clearance) -> None:
        (i, (record["x_i"], record["y_i"])), (j, (record["x_j"], record["y_j"])) = ends
        record["bearing"], record["pin"] = self._inputs.row_of[[i, j]]
        record["clearance"], record["radius"] = room.radial_clearance_m, room.bearing_radius_m
        record["native"] = room.law == "rigid"
        if not record["native"]:
            for name, number in law_numbers(room)._asdict().items():
                record[name] = number

    def advance(self, last: int, turns: FloatArray) -> float:
        """Take the kicks up to the last one (see ``loop.advance``); return the wall time of that in s.

        Raises:
            SimulationFailed: a pin went through the wall of its bearing, or a contact's numbers overflowed.
        """
        self.run["last"], given, rows = last, self._inputs, len(self._before)
        state, to_load = (
            self._state.numbers[: 6 * rows].view(BODY),
            self._loads.numbers[: 3 * rows].view(LOAD),
        )
        turn = self._turn.numbers[: 4 if given.slides else 2]
        buffers = self._bodies, state, self._before, self._at, to_load, turn, given.held
        loads = given.lines, given.torques, given.springs, given.curves, given.pieces
        arguments = (self.run, *buffers, *loads, self._pins, self._kicks, turns, self.rows, self.out)
        loop.advance.compile(tuple(map(typeof, arguments)))  # type: ignore[attr-defined]
        started = perf_counter()
        loop.advance(*arguments)
        elapsed = perf_counter() - started
        for name, phase in zip(self._names, self._pins["phase"].tolist(), strict=True):
            if phase >= LOST:
                what = "pin through the wall of its bearing" if phase == LOST else "overflow in the contact"
                raise SimulationFailed(f"{what} at joint {name} at t = {float(self.run[0]['time_s']):.6g} s")
        return elapsed

    def taken(self, number: int) -> NDArray[Any]:
        """Return the kicks in contact that a pin has entered since the last call, and forget them."""
        count = int(self._pins[number]["kicks"])
        self._pins[number]["kicks"] = 0
        return np.array(self._kicks[number, :count])
