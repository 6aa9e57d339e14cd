"""All memory of a run's compiled loop: the records of run and pins, their logs, the buffers of the space."""

import math
from collections.abc import Mapping
from time import perf_counter
from typing import Any

import numpy as np
import pymunk
from numba import typeof, types
from numpy.typing import NDArray

from engine_models.engine import FloatArray, SimulationFailed
from engine_models.guards import guarded
from engine_models.mechanics.contact_law import law_numbers
from engine_models.pymunk.compiled import loop
from engine_models.pymunk.compiled.records import KICK, LOST, PIN, ROW, RUN
from engine_models.pymunk.exchange import Exchange
from engine_models.pymunk.model import Bodies, Pin
from engine_models.pymunk.native_contact import NativeContact
from engine_models.reference.kernels import compiled

#: Kicks that are worked off at once, at most, and sweeps in them: some tenths of a second, in which nobody is
#: heard.
BLOCK_KICKS, BLOCK_SWEEPS = 16_384, 2**23


class Workspace:
    """The memory of a run of a space with these bodies and pins by joint; see ``records`` for the arrays.

    Logs and rows have room for a block of ``block_kicks``. Native contacts are added to the space.
    """

    def __init__(
        self, space: pymunk.Space, bodies: Bodies, pins: Mapping[str, Pin], contact_sweeps: int
    ) -> None:
        self.exchange, self.names = Exchange(space, bodies), tuple(pins)
        sweeps = max(space.iterations, contact_sweeps)
        self.block_kicks = max(loop.START_KICKS, min(BLOCK_KICKS, BLOCK_SWEEPS // sweeps))
        self.run, self.pins = np.zeros(1, RUN), np.zeros(len(pins), PIN)
        self.kicks = np.zeros((len(pins), self.block_kicks), KICK)
        self.rows, self.out = np.zeros(self.block_kicks, ROW), np.zeros((self.block_kicks, len(bodies), 9))
        self.weights = np.array([-space.gravity.y * _mass_kg(body) for body in bodies])
        self.run["io"], self.run["kick"] = self.exchange.record, -1
        self.run["flight_sweeps"], self.run["contact_sweeps"] = space.iterations, contact_sweeps
        for number, pin in enumerate(pins.values()):
            self._set(self.pins[number], pin, [*bodies, space.static_body])
        self._native = [
            NativeContact(space, number, pin, self.run, self.pins[number : number + 1], self.kicks[number])
            for number, pin in enumerate(pins.values())
            if pin.clearance.law == "rigid"
        ]

    def _set(self, record: Any, pin: Pin, rows: list[pymunk.Body]) -> None:
        clearance = pin.clearance
        record["bearing"], record["pin"] = (rows.index(body) for body in (pin.bearing, pin.pin))
        record["bearing_x"], record["pin_x"] = pin.bearing_x, pin.pin_x
        record["clearance"], record["radius"] = clearance.radial_clearance_m, clearance.bearing_radius_m
        record["reach"] = clearance.bearing_radius_m if guarded() else math.inf
        record["native"] = clearance.law == "rigid"
        if not record["native"]:
            for name, number in law_numbers(clearance)._asdict().items():
                record[name] = number

    def advance(self, last: int, turns: FloatArray, gas: FloatArray) -> float:
        """Take the kicks up to the last one (see ``loop.advance``); return the wall time of that in s.

        Raises:
            SimulationFailed: a pin went through the wall of its bearing, or a contact's numbers overflowed.
        """
        self.run["last"], of = last, self.exchange
        buffers = of.bodies, of.state_of, of.loads_of, of.turn.numbers, self.weights
        arguments = (self.run, *buffers, self.pins, self.kicks, turns, gas, self.rows, self.out)
        function = compiled(loop.advance, types.none(*map(typeof, arguments)))
        started = perf_counter()
        function(*arguments)
        elapsed = perf_counter() - started
        for name, phase in zip(self.names, self.pins["phase"].tolist(), strict=True):
            if phase >= LOST:
                what = "pin through the wall of its bearing" if phase == LOST else "overflow in the contact"
                raise SimulationFailed(f"{what} at joint {name} at t = {float(self.run[0]['time_s']):.6g} s")
        return elapsed

    def taken(self, number: int) -> NDArray[Any]:
        """Return the kicks in contact that a pin has entered since the last call, and forget them."""
        count = int(self.pins[number]["kicks"])
        self.pins[number]["kicks"] = 0
        return np.array(self.kicks[number, :count])


def _mass_kg(body: pymunk.Body) -> float:
    return float(body.mass) if body.body_type == pymunk.Body.DYNAMIC else 0.0
