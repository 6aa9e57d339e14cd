"""Events of contacts as ``solve_ivp`` takes them: functions of t and y, called at every step."""

from dataclasses import dataclass

import numpy as np

from engine_models.engine import FloatArray
from engine_models.scipy_ivp.model import Derivative

#: An alarm that has just been answered is zero up to rounding, and has to be off at the start of the segment
#: that follows: it goes off above this level there, in m of penetration or as a part of a law's first factor.
NUDGE = 1e-16
#: A pin begins to part from the wall below this rate of its gap, in m/s: not at 0, which is the rate of a pin
#: that starts from the middle of its bearing, where the sign would be lost in rounding.
PARTING_M_S = -1e-9


@dataclass(frozen=True)
class Alarm:
    """Stops the integration where an alarm of ``Derivative`` rises above ``level``."""

    derivative: Derivative
    contact: int
    kind: int
    level: float = 0.0
    terminal: bool = True
    direction: float = 1.0

    def __call__(self, _: float, y: FloatArray) -> float:
        """Return how far the alarm is above its level."""
        return self.derivative.alarm(self.contact, self.kind, y) - self.level


@dataclass(frozen=True)
class Nearest:
    """Marks where a pin in flight is nearest to the wall: it may have touched and left within the step."""

    derivative: Derivative
    contact: int
    terminal: bool = False
    direction: float = -1.0

    def __call__(self, _: float, y: FloatArray) -> float:
        """Return how far the rate of the gap, in m/s, is from that of parting."""
        return float(self.derivative.gaps(y)["rate"][self.contact]) - PARTING_M_S


@dataclass(frozen=True)
class Crossing:
    """Marks where a pin passes the wall of its bearing, either way."""

    derivative: Derivative
    contact: int
    terminal: bool = False
    direction: float = 0.0

    def __call__(self, _: float, y: FloatArray) -> float:
        """Return the gap in m, positive inside the wall."""
        return float(self.derivative.gaps(y)["g"][self.contact])


@dataclass
class Steps:
    """Counts accepted steps: ``solve_ivp`` calls every event once at the start and once after each of them.

    With ``memory`` (K,) given, each call also keeps it up to date (``Derivative.remember``).
    """

    derivative: Derivative
    memory: FloatArray | None = None
    accepted: int = 0
    last_time_s: float = 0.0
    terminal: bool = False
    direction: float = 0.0

    def __post_init__(self) -> None:
        self._times: list[float] = []
        self._memories: list[FloatArray] = []

    def __call__(self, t: float, y: FloatArray) -> float:
        """Return 1: this event never happens."""
        self.accepted, self.last_time_s = self.accepted + 1, t
        if self.memory is not None:
            self.memory[:] = self.derivative.remember(y, self.memory)
            if not (self._memories and np.array_equal(self.memory, self._memories[-1], equal_nan=True)):
                self._times.append(t)
                self._memories.append(self.memory.copy())
        return 1.0

    def memory_at(self, t: float) -> FloatArray:
        """Return the memory (K,) that was valid in the step that t is in."""
        return self._memories[max(int(np.searchsorted(self._times, t)) - 1, 0)]


Watch = Alarm | Nearest | Crossing


def alarms(derivative: Derivative, y: FloatArray, answered: set[tuple[int, int]]) -> list[Alarm]:
    """Return every event that can end a segment begun at y; those answered there ended the one before."""
    out = []
    for contact, kind in derivative.events:
        level = 0.0
        if (contact, kind) in answered:
            level = 2 * max(derivative.alarm(contact, kind, y), 0.0) + NUDGE
        out.append(Alarm(derivative, contact, kind, level))
    return out
