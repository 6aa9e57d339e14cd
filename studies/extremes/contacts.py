"""The gallery's cases with contact: everyday ones, extremes of stiffness, clearance, restitution, speed."""

import math
from functools import partial

from studies.extremes.case import Extreme
from studies.extremes.checks import bounced, braked, dropped, loose_motion
from studies.extremes.scenes import (
    CLEARANCE_M,
    STEPS_A_TURN,
    WHEEL_STEP_S,
    driven_loose,
    turning_wheel,
    wheel,
)


def everyday() -> list[Extreme]:
    """Return the same mechanisms at ordinary numbers."""
    ordinary = "Ordinary numbers, for comparison."
    case = partial(Extreme, "everyday", theory=ordinary, check=dropped, step_s=WHEEL_STEP_S, first=True)
    return [
        _loose("everyday", "everyday c = 0.1 mm", 1e-3, 1e-4, ordinary),
        case(wheel("everyday Hertz", 0.02)),
        case(wheel("everyday restitution 0.9", 0.02, law="lankarani-nikravesh", restitution=0.9)),
        case(wheel("everyday linear law", 0.02, law="linear", stiffness=1e6)),
        case(turning_wheel("everyday friction 0.1", 0.02, 0.1), check=braked),
        case(wheel("everyday rigid 0.2", 0.02, law="rigid", stiffness=None, restitution=0.2)),
    ]


def stiffness() -> list[Extreme]:
    """Return the same drop on walls from rubber to beyond diamond."""
    lasts = {
        1e6: "10.9 ms, by its weight 12.1",
        1e10: "0.27 ms",
        1e14: "6.9 µs, less than a step",
        1e15: "2.7 µs, less than a step",
    }
    between = wheel("peak between samples", 0.02, stiffness=1e10)
    return [
        Extreme(
            "stiffness",
            wheel(f"stiffness 1e{math.log10(value):.0f}", 0.02 if value > 1e6 else 0.03, stiffness=value),
            f"Touches at √(2c/g) = 10.1 ms and loses nothing; Hertz's contact lasts {time}.",
            dropped,
            WHEEL_STEP_S,
        )
        for value, time in lasts.items()
    ] + [
        Extreme(
            "stiffness",
            between,
            "One contact of 0.27 ms between two of five samples: only the record of impacts can show it.",
            bounced,
            WHEEL_STEP_S,
            samples=4,
        )
    ]


def clearance() -> list[Extreme]:
    """Return set R with clearances from atoms to half the bearing."""
    case = partial(_loose, "clearance")
    return [
        case(
            "clearance 1 nm",
            5e-4,
            1e-9,
            "Touches at √(2c/a) = 0.32 µs and stays: the ideal joint on an elastic pin.",
        ),
        case("clearance 1 µm", 1e-3, 1e-6, "Touches at √(2c/a) = 10.1 µs and settles on the wall soon."),
        case("clearance 5 mm", 5e-3, 5e-3, "Touches after about √(2c/a) = 0.72 ms, at 13 m/s."),
    ]


def restitution() -> list[Extreme]:
    """Return drops that lose all, nothing, and nearly nothing, by a compliant law and by a rigid one."""
    case = partial(Extreme, "restitution", check=dropped, step_s=WHEEL_STEP_S)
    compliant = partial(wheel, end_time_s=0.06, law="lankarani-nikravesh")
    rigid = partial(wheel, end_time_s=0.06, law="rigid", stiffness=None)
    return [
        case(
            compliant("compliant e = 0", restitution=0.0),
            "Lankarani-Nikravesh at e = 0 really gives back 0.66 of the speed (Lambert W).",
        ),
        case(compliant("compliant e = 1", restitution=1.0), "Bounces to the same height for ever."),
        case(
            compliant("compliant e = nearly 1", restitution=1 - 1e-9),
            "Bounces to the same height, less a part of 2e-9 each time.",
        ),
        case(rigid("rigid e = 0", restitution=0.0), "Touches at 10.1 ms and lies still from then on."),
        case(
            rigid("rigid e = 0.5", restitution=0.5),
            "Infinitely many bounces end at 3√(2c/g) = 30.3 ms, then it lies still.",
        ),
        case(rigid("rigid e = 1", restitution=1.0), "Bounces to the same height for ever, every 20.2 ms."),
    ]


def speed() -> list[Extreme]:
    """Return set R with 0.5 mm of clearance, slow and fast."""
    case = partial(_loose, "speed", clearance_m=CLEARANCE_M)
    return [
        case("1 rpm, loose", 0.05, theory="Hardly turns: the rod's pin drops by its weight.", rpm=1.0),
        case(
            "50 000 rpm, loose",
            3e-4,
            theory="Touches at √(2c/a) = 22.7 µs, at 44 m/s; the forces are 100 times set R's.",
            rpm=50_000.0,
        ),
        _loose(
            "speed",
            "50 000 rpm, c = 1 µm",
            1e-4,
            1e-6,
            "Touches at √(2c/a) = 1.0 µs and is pressed 47 clearances into the steel.",
            rpm=50_000.0,
        ),
    ]


def _loose(
    group: str,
    name: str,
    end_s: float,
    clearance_m: float,
    theory: str,
    rpm: float = 5000.0,
) -> Extreme:
    """Return set R with clearance at B, at a step of a part of a turn but no longer than a wheel's."""
    step = min(60 / rpm / STEPS_A_TURN, WHEEL_STEP_S)
    scene = driven_loose(name, end_s, clearance_m, rpm)
    return Extreme(group, scene, theory, loose_motion, step, first=group == "everyday")
