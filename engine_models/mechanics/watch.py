"""What is gathered of a member of a sweep."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Watch:
    """What is gathered of a member: over ``revolutions`` after a ``transient``.

    Both are in turns of the crank at its start's speed.
    """

    transient: float = 0.0
    revolutions: float = 2.0
    exponent: bool = False  # the finite-time exponent, by a second start 1e-7 of the clearance beside
