"""How the solver fails: each error says when and why, and what helps."""

from collections.abc import Sequence
from typing import Any

#: Names that a message has at the most.
MOST_NAMES = 8


def listed(names: Sequence[str]) -> str:
    """Return names with commas between them, the first of many."""
    more = len(names) - MOST_NAMES
    return ", ".join(names) if more <= 0 else f"{', '.join(names[:MOST_NAMES])} and {more} more"


class SolverError(Exception):
    """Base of the solver's errors: a text, or values, its attributes, for the ``message`` of its class."""

    message = ""
    time_s: float

    def __init__(self, text: str = "", **values: Any) -> None:
        vars(self).update(values)
        super().__init__(text or self.message.format(**values))


class InconsistentStart(SolverError):
    """The initial positions or velocities violate the constraints."""


class SingularConfiguration(SolverError):
    """[B] has lost full row rank: redundant constraints, or a configuration such as a locked dead centre.

    ``joints`` are the names of the constraints whose rows depend on each other.
    """

    rank: int
    rows: int
    joints: tuple[str, ...]
    message = (
        "the joints' rows have rank {rank} of {rows} at t = {time_s:.6g} s, those of {names} depend on each "
        "other: take one of them away, give it clearance, or stop before the singular position"
    )


class TooLight(SolverError):
    """A body has no mass beside another, in numbers: rows of its joints depend on each other."""


class LimitPosition(SolverError):
    """A drive has come to where its mechanism cannot follow."""

    message = (
        "the drive has come to a limit position of its mechanism at t = {time_s:.8g} s, which cannot follow "
        "it any further: end the run before, or drive another body"
    )


class NearSingular(SolverError):
    """A step comes too near to a singular position, which amplifies its error; no way past it is sure."""

    message = (
        "step {step_s:.3g} s from t = {time_s:.6g} s comes too near to a singular position (condition number "
        "{condition:.1e}), which amplifies its error: end the run before it, or try a tolerance"
    )


class EnergyNotConserved(SolverError):
    """The energy of a run does not add up, by more than its steps explain."""

    message = (
        "the energy at t = {time_s:.6g} s does not add up by {created_J:.3g} J, where the steps explain "
        "{allowed_J:.3g} J: {advice}"
    )


class DriftAmplified(SolverError):
    """Constraints that are not projected have been violated where a singular position amplifies that."""

    message = (
        "the constraints' violation at t = {time_s:.6g} s moves bodies by {moved:.2g} of the mechanism's "
        "length where it passes a singular position (condition number {condition:.1e}): project"
    )


class NonFiniteState(SolverError):
    """The state has overflowed or become NaN."""

    message = "non-finite state at t = {time_s:.6g} s: shorten the step"


class StepsCollapsed(SolverError):
    """No step has been found that meets its tolerance, or ends on the event in it."""

    message = (
        "no step from t = {time_s:.6g} s meets its tolerance or its event, not even {step_s:.3g} s: the "
        "forces jump there, or a singular configuration is close: loosen the tolerance or stop before it"
    )


class BlockedImpact(SolverError):
    """The ideal joints and drivers leave a pin no motion along the line of centres."""

    message = (
        "impact at t = {time_s:.6g} s: the ideal joints and drivers prescribe the pin's motion along the "
        "line of centres, which leaves no finite effective mass: free one of them"
    )


class PainleveParadox(SolverError):
    """Friction leaves a pin no motion that answers its wall's push along the normal."""

    message = (
        "rigid joints {joints} at t = {time_s:.6g} s: with friction the normal mobility is not positive "
        "(Painleve's paradox): lower the friction or use a compliant law"
    )


class FrictionTooStiff(SolverError):
    """The step is too long for the damping by regularised friction; one below ``needed_s`` is not."""

    needed_s: float
    message = (
        "step {step_s:.3g} s at t = {time_s:.6g} s: friction in rigid joints damps sliding at {rate:.3g} 1/s "
        "and needs a step below {needed_s:.3g} s: shorten the step or raise the regularisation speed"
    )


class UnsettledEvents(SolverError):
    """The joints' events at one time have no end."""

    message = (
        "the rigid joints' events at t = {time_s:.6g} s have no end (joint {joint} last): give the joints a "
        "minimum impact speed"
    )


class Stalled(SolverError):
    """Steps have become too short to move time on."""

    message = "{steps} steps made no way at t = {time_s:.6g} s: soften the contact law"
