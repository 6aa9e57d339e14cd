"""The gallery's wheels: on dry bearings, begun in contact, under absurd weight, at the stability limit."""

import math
from functools import partial

from studies.extremes.case import Extreme
from studies.extremes.checks import braked, dropped, resting
from studies.extremes.scenes import CLEARANCE_M, GRAVITY_M_S2, WHEEL, WHEEL_STEP_S, turning_wheel, wheel


def friction() -> list[Extreme]:
    """Return wheels on bearings from frictionless to sticky."""
    case = partial(Extreme, "friction", check=braked, step_s=WHEEL_STEP_S)
    stop = turning_wheel(
        "regularisation 1 µm/s",
        0.185,
        0.3,
        regularisation_speed_m_s=1e-6,
        radial_clearance_m=1e-6,
        stiffness_N_m=1e9,
        spin_rad_s=4.0,
    )
    return [
        case(
            turning_wheel("friction 0", 0.02, 0.0),
            "Turns for ever at the same spin, at the bearing's lowest place.",
        ),
        case(
            turning_wheel("friction 1", 0.02, 1.0),
            "Stays 45° up the wall and is braked evenly, by μ m g cos 45° R/I = 55.4 rad/s².",
        ),
        case(stop, "Braked evenly, stands from 169 ms on; sticking, a damper of 3 million/s."),
    ]


def starts() -> list[Extreme]:
    """Return wheels begun in contact."""
    case = partial(Extreme, "start", check=resting, step_s=WHEEL_STEP_S)
    sag = (WHEEL.mass_kg * GRAVITY_M_S2 / 1e9) ** (2 / 3)
    return [
        case(
            wheel("start on the wall", 0.02, place_m=(0.0, -CLEARANCE_M - sag)),
            "The wall carries the weight, K δ^1.5 = m g: nothing ever moves.",
        ),
        case(
            wheel("start 1 mm in the wall", 1e-3, place_m=(0.0, -CLEARANCE_M - 1e-3)),
            "K δ^2.5/2.5 = 12.6 J throws it at 11 m/s against the other wall, and back.",
            check=dropped,
            step_s=WHEEL_STEP_S / 10,
        ),
        Extreme(
            "load",
            wheel("gravity 1e6, wheel", 2e-4, gravity_m_s2=1e6),
            "Touches at √(2c/g) = 31.6 µs, at 31.6 m/s, and loses nothing.",
            dropped,
            1e-7,
        ),
    ]


def stability() -> list[Extreme]:
    """Return a mass on a spring at RK4's stability limit, omega h = 2 sqrt(2), and just beyond."""
    stiffness_N_m, swings = 1e6, 50
    sag = WHEEL.mass_kg * GRAVITY_M_S2 / stiffness_N_m
    step = math.sqrt(8 * WHEEL.mass_kg / stiffness_N_m)
    texts = {
        1.0: "Swings about its sag for ever. RK4 at ωh = 2√2 keeps the amplitude, not the phase.",
        1.01: "Swings about its sag for ever. RK4 at 1.01 of that gains 15 % of energy a step.",
    }
    return [
        Extreme(
            "step",
            wheel(
                f"step {'at' if factor == 1 else 'beyond'} the limit",
                swings * factor * step,
                law="linear",
                stiffness=stiffness_N_m,
                place_m=(0.0, -CLEARANCE_M - 1.5 * sag),
            ),
            text,
            dropped,
            factor * step,
            samples=swings,
            wanted="answer or word",
            for_all=True,
        )
        for factor, text in texts.items()
    ]
