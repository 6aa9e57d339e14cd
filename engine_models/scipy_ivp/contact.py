"""Events of contacts as ``solve_ivp`` takes them: functions of t and y, called at every step."""

from collections.abc import Callable
from dataclasses import dataclass

from engine_models.engine import FloatArray
from engine_models.scipy_ivp.model import Derivative

#: An alarm that has just been answered is zero up to rounding, and has to be off at the start of the segment
#: that follows: it goes off above this level there, in m of penetration or as a part of a law's first factor.
NUDGE = 1e-16
#: A pin begins to part from the wall below this rate of its gap, in m/s: not at 0, which is the rate of a pin
#: that starts from the middle of its bearing, where the sign would be lost in rounding.
PARTING_M_S = -1e-9

#: A contact and the kind of its alarm.
Event = tuple[int, int]


@dataclass(frozen=True)
class Watch:
    """Where a value of y passes zero in a direction; with an ``event`` the integration stops there."""

    contact: int
    value: Callable[[FloatArray], float]
    direction: float
    event: Event | None = None

    @property
    def terminal(self) -> bool:
        """Whether the integration is to stop."""
        return self.event is not None

    def __call__(self, _: float, y: FloatArray) -> float:
        """Return the value."""
        return self.value(y)


def alarms(derivative: Derivative, y: FloatArray, answered: set[Event]) -> list[Watch]:
    """Return every event that can end a segment begun at y; those answered there ended the one before."""
    watches = []
    for contact, kind in derivative.events:
        level = 0.0
        if (contact, kind) in answered:
            level = 2 * max(derivative.alarm(contact, kind, y), 0.0) + NUDGE
        watches.append(_alarm(derivative, (contact, kind), level))
    return watches


def _alarm(derivative: Derivative, event: Event, level: float) -> Watch:
    return Watch(event[0], lambda y: derivative.alarm(*event, y) - level, 1.0, event)


def nearest(derivative: Derivative, contact: int) -> Watch:
    """Watch where a pin in flight is nearest to the wall: it may have touched and left within the step."""
    return Watch(contact, lambda y: float(derivative.gaps(y)["rate"][contact]) - PARTING_M_S, -1.0)


def crossing(derivative: Derivative, contact: int) -> Watch:
    """Watch where a pin passes the wall of its bearing, either way."""
    return Watch(contact, lambda y: float(derivative.gaps(y)["g"][contact]), 0.0)
