"""The gallery's mechanisms with clearance: dead centres, Zeno, stick-slip, all joints loose, long runs."""

from functools import partial

from engine_models.scene.library import BEARING_RADIUS_M, clearance
from engine_models.scene.scene import Clearance, Clearances, Start
from studies.extremes.case import Extreme
from studies.extremes.checks import loose_motion, nearly_ideal, settled, swung
from studies.extremes.mechanisms import DRIVEN, FREE_STEP_S, STEP_S
from studies.extremes.scenes import TURN_S, WHEEL_STEP_S, driven, driven_loose, free, hanging, rod

CLEARANCE_M = 1e-4
#: Clearance at B as in everyday scenes.
LOOSE = Clearances(B=clearance(CLEARANCE_M))
LONG_REVOLUTIONS = 10_000


def dead_centres() -> list[Extreme]:
    """Return a free crank at its dead centre, and equal links, both with clearance."""
    case = partial(Extreme, "dead centre", check=loose_motion)
    turning = Start(crank_angle_rad=-0.5, crank_speed_rad_s=20.0)
    return [
        case(
            free("dead centre, loose", 0.05, start=turning, clearance=LOOSE),
            "The crank passes its dead centre on its own, the pin knocks 21 times.",
            step_s=FREE_STEP_S,
            first=True,
        ),
        case(
            driven("L = r, loose", 0.005, rod=rod(DRIVEN, length_m=DRIVEN.crank.length_m), clearance=LOOSE),
            "With clearance B has full rank in the fold: one motion goes through.",
            step_s=STEP_S,
        ),
    ]


def denormal() -> list[Extreme]:
    """Return a clearance of next to nothing."""
    return [
        Extreme(
            "clearance",
            driven_loose("clearance 1e-310 m", 1e-5, 1e-310),
            "Denormal, far below a unit in the last place of any position: the ideal joint, or word.",
            nearly_ideal,
            STEP_S,
            wanted="answer or word",
            long=True,
        )
    ]


def restitution() -> list[Extreme]:
    """Return bounces that add up to an end within a mechanism."""
    rigid = Clearance(
        radial_clearance_m=CLEARANCE_M, bearing_radius_m=BEARING_RADIUS_M, law="rigid", restitution=0.5
    )
    return [
        Extreme(
            "restitution",
            driven("rigid e = 0.5, mechanism", 1e-3, clearance=Clearances(B=rigid)),
            "Infinitely many bounces end after 0.30 ms (Zeno), then the pin follows its wall.",
            loose_motion,
            STEP_S,
            first=True,
        )
    ]


def friction() -> list[Extreme]:
    """Return a pendulum whose dry joint sticks and slips."""
    return [
        Extreme(
            "friction",
            hanging("stick-slip", 0.4, 0.3),
            "Coulomb: slips down from 10°, sticks at the turn while the pin rolls, slips back from 4.5°.",
            swung,
            WHEEL_STEP_S,
            first=True,
        )
    ]


def joints() -> list[Extreme]:
    """Return stiff steel at B, and clearance at all three joints."""
    case = partial(Extreme, "joints", check=loose_motion, step_s=STEP_S)
    stiff = clearance(CLEARANCE_M).model_copy(
        update={"stiffness": 1e15, "young_modulus_Pa": None, "poisson_ratio": None}
    )
    everywhere = {name: clearance(5e-4) for name in ("O", "A", "B")}
    return [
        case(
            driven("K = 1e15, loose", 1e-3, clearance=Clearances(B=stiff)),
            "Ten contacts of 1.2 to 1.6 µs each, a quarter of a step.",
        ),
        case(
            driven("clearance at O, A and B", 6e-4, clearance=Clearances(**everywhere)),
            "Three pins in flight at once; each touches its wall before 0.42 ms.",
            first=True,
        ),
    ]


def long_runs() -> list[Extreme]:
    """Return ten thousand revolutions of a pin that has settled on its wall."""
    end = (LONG_REVOLUTIONS + 1 / 3) * TURN_S
    return [
        Extreme(
            "length",
            driven_loose("10 000 revolutions, loose", end, 2e-5),
            "Settles to continuous contact within a few turns, then repeats itself every turn.",
            settled,
            STEP_S,
            long=True,
        ),
    ]
