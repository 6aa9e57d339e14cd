"""Events of contacts as ``solve_ivp`` takes them: functions of t and y, called at every step."""

from functools import partial

from engine_models.engine import FloatArray
from engine_models.scipy_ivp.derivative import Derivative

#: An alarm that has just been answered is zero up to rounding, and has to be off at the start of the segment
#: that follows: it goes off above this level there, in m of penetration or as a part of a law's first factor,
#: and by no more than round-off, since a pin that rebounds a hundred times is nudged as often.
NUDGE, ROUND_OFF = 1e-16, 1e-15
#: A pin begins to part from the wall below this rate of its gap, in m/s: not at 0, which is the rate of a pin
#: that starts from the middle of its bearing, where the sign would be lost in rounding.
PARTING_M_S = -1e-9

#: A contact and the kind of its alarm.
Event = tuple[int, int]


class Watch(partial[float]):
    """A compiled function of t and y, and the direction in which it passes zero.

    With an ``event`` the integration stops there.
    """

    contact: int
    direction: float
    event: Event | None

    @property
    def terminal(self) -> bool:
        """Whether the integration is to stop."""
        return self.event is not None


def _watch(
    derivative: Derivative,
    contact: int,
    field: str,
    *,
    sign: float = 1.0,
    level: float = 0.0,
    direction: float,
    event: Event | None = None,
) -> Watch:
    watch = Watch(derivative.watched[field, contact], sign, level)
    watch.contact, watch.direction, watch.event = contact, direction, event
    return watch


def alarms(derivative: Derivative, y: FloatArray, answered: set[Event]) -> list[Watch]:
    """Return every event that can end a segment begun at y; those answered there ended the one before."""
    watches = []
    for contact, kind in derivative.events:
        field, sign = derivative.alarm_of(contact, kind)
        level = 0.0
        if (contact, kind) in answered:
            level = (1 + ROUND_OFF) * max(derivative.alarm(contact, kind, y), 0.0) + NUDGE
        if sign:
            event = contact, kind
            watches.append(
                _watch(derivative, contact, field, sign=sign, level=level, direction=1.0, event=event)
            )
    return watches


def nearest(derivative: Derivative, contact: int) -> Watch:
    """Watch where a pin in flight is nearest to the wall: it may have touched and left within the step."""
    return _watch(derivative, contact, "rate", level=PARTING_M_S, direction=-1.0)


def crossing(derivative: Derivative, contact: int) -> Watch:
    """Watch where a pin passes the wall of its bearing, either way."""
    return _watch(derivative, contact, "g", direction=0.0)
