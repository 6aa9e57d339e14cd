"""The gallery's cases of ideal joints: speed, masses, dead centres, starts, loads, long runs."""

from collections.abc import Mapping
from functools import partial

import numpy as np

from engine_models.engine import FloatArray, Trajectory
from engine_models.mechanics.assembly import start_state, started_from
from engine_models.scene.library import SLIDER, ideal_driven, ideal_free
from engine_models.scene.scene import Scene, Slider
from studies.extremes.case import Extreme
from studies.extremes.checks import ideal_motion, impossible, slider_by
from studies.extremes.scenes import STEPS_A_TURN, TURN_S, driven, free, rod

FREE, DRIVEN = ideal_free(), ideal_driven()
#: Set F's and set R's everyday steps.
FREE_STEP_S, STEP_S = 0.1 / STEPS_A_TURN, TURN_S / STEPS_A_TURN
REVOLUTIONS = 100_000


def everyday() -> list[Extreme]:
    """Return sets F and R as they are."""
    case = partial(Extreme, "everyday", check=ideal_motion, step_s=FREE_STEP_S, first=True)
    ordinary = "Ordinary numbers, for comparison."
    return [
        case(free("everyday free", 0.1), ordinary),
        case(driven("everyday driven (c = 0)", 0.012), ordinary, step_s=STEP_S),
    ]


def speed() -> list[Extreme]:
    """Return set R, slow and fast."""
    return [
        Extreme(
            "speed",
            driven(f"{label}, ideal", 60 / rpm, rpm=rpm),
            f"Set R's motion; {forces}.",
            ideal_motion,
            60 / rpm / STEPS_A_TURN,
        )
        for rpm, label, forces in (
            (1.0, "1 rpm", "inertia adds a ten-thousandth to the weights' forces"),
            (50_000.0, "50 000 rpm", "forces are 100 times set R's, 2.7e5 N at B"),
        )
    ]


def masses() -> list[Extreme]:
    """Return set F with sliders and rods a million times as heavy or light."""
    case = partial(Extreme, "mass", check=ideal_motion, step_s=FREE_STEP_S)
    heavy = Slider(mass_kg=SLIDER.mass_kg * 1e6, inertia_kg_m2=SLIDER.inertia_kg_m2)
    light = Slider(mass_kg=SLIDER.mass_kg * 1e-6, inertia_kg_m2=SLIDER.inertia_kg_m2)
    denormal = Slider(mass_kg=1e-310, inertia_kg_m2=SLIDER.inertia_kg_m2)
    slender, massless = {"inertia_kg_m2": 1e-12}, {"mass_kg": 0.21e-6, "inertia_kg_m2": 1e-12}
    stops = "From the dead centre the slider's share of J grows to all within 7e-4 rad (11 µs)"
    return [
        case(free("slider mass × 1e6", 0.01, slider=heavy), f"{stops}.", step_s=FREE_STEP_S / 200),
        case(
            free("slider × 1e6, long step", 0.01, slider=heavy),
            f"{stops}: a step of 50 µs cannot follow.",
            wanted="answer or word",
        ),
        case(
            free("slider mass × 1e-6", 0.1, slider=light),
            "Crank and rod move as if the slider were not there.",
        ),
        case(
            free("slider mass 1e-310", 0.1, slider=denormal),
            "Denormal, its inverse is infinite; crank and rod move as if the slider were not there.",
            check=_without_slider,
            wanted="answer or word",
        ),
        case(
            free("rod inertia 1e-12", 0.1, rod=rod(FREE, **slender)),
            "Close to a point mass at the rod's middle: nothing special happens.",
        ),
        case(
            free("rod mass × 1e-6", 0.1, rod=rod(FREE, **massless)),
            "A rod without mass carries force along itself alone: nothing special happens.",
        ),
        case(
            free("rod inertia 0", 0.1, rod=rod(FREE, inertia_kg_m2=0.0)),
            "Not a rigid body with mass: M has no inverse, equation (3) needs one.",
            check=impossible,
            wanted="refusal",
        ),
    ]


def _without_slider(scene: Scene, run: Trajectory) -> Mapping[str, float]:
    """Judge a slider of next to no mass by the motion with one of 1e-12 kg, the same to a part in 1e11."""
    return ideal_motion(scene.replace("slider.mass_kg", 1e-12), run)


def starts() -> list[Extreme]:
    """Return starts that no mechanism can have."""
    position, velocity = start_state(FREE)
    apart, sliding = position.copy(), velocity.copy()
    apart[1:, 0] += 1e-3
    sliding[2, 0] += 1.0
    case = partial(Extreme, "start", check=impossible, step_s=FREE_STEP_S, wanted="refusal")
    return [
        case(
            started_from(free("joint A open by 1 mm", 0.1), apart, velocity),
            "g ≠ 0 at t = 0: an ideal joint cannot be open.",
        ),
        case(
            started_from(free("slider off by 1 m/s", 0.1), position, sliding),
            "B q' ≠ 0 at t = 0: the rod would have to stretch.",
        ),
    ]


def loads() -> list[Extreme]:
    """Return set F without gravity and with a hundred thousand times the Earth's."""
    case = partial(Extreme, "load", check=ideal_motion, step_s=FREE_STEP_S)
    return [
        case(
            free("gravity 0", 0.1, gravity_m_s2=0.0),
            "Kinetic energy alone, and that is constant.",
            first=True,
        ),
        case(
            free("gravity 1e6", 2e-3, gravity_m_s2=1e6),
            "Turned back within 5 µs, then swings half a turn each way in 0.78 ms.",
            step_s=FREE_STEP_S / 50,
        ),
    ]


def _turning(scene: Scene, time_s: FloatArray) -> FloatArray:
    """Return the slider's position (n,) where the crank keeps its speed, its angle reduced to one turn."""
    crank, rod, _ = scene.crank_slider()
    turned = scene.start.crank_angle_rad + scene.start.crank_speed_rad_s * time_s
    r, theta = crank.length_m, np.remainder(turned, 2 * np.pi)
    return np.asarray(r * np.cos(theta) + np.sqrt(rod.length_m**2 - (r * np.sin(theta)) ** 2))


def long_runs() -> list[Extreme]:
    """Return a hundred thousand revolutions in one run, at a hundred steps each."""
    return [
        Extreme(
            "length",
            driven("100 000 revolutions", (REVOLUTIONS + 1 / 3) * TURN_S),
            "Periodic: x repeats itself; only the driver's work could add up, and averages to zero.",
            slider_by(_turning),
            TURN_S / 100,
            long=True,
        )
    ]
