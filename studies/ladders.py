"""Ladders of every engine's own best settings, from cheap to accurate, for work-precision and clearance."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np

from engine_models import engines
from engine_models.pymunk.engine import LIBRARY_ERROR_BIAS, LIBRARY_ITERATIONS
from engine_models.scene.scene import Scene
from studies.running.case import Value

Settings = Mapping[str, Value]

#: Exudyn's build without range checks, as a user who wants speed has it, and SciPy's tolerances.
FAST: Settings = MappingProxyType({"fast": True})
SCIPY = ("rtol", "atol")
#: The reference with error control.
CONTROLLED: Settings = MappingProxyType({"method": "dop853"})
#: Pymunk's joints for a user who sets nothing.
PYMUNK_AS_IT_COMES: Settings = MappingProxyType(
    {"iterations": LIBRARY_ITERATIONS, "error_bias": LIBRARY_ERROR_BIAS, "half_kick_start": False}
)


#: Engines whose own best settings are named here and in the studies. Any other takes part as it comes.
NAMED, AS_IT_COMES = ("reference", "exudyn", "pymunk", "scipy"), "default"


def newcomers() -> list[str]:
    """Return the engines of which no study names settings: each is an arm ``AS_IT_COMES`` of all studies."""
    return [name for name in engines.ENGINES if name not in NAMED]


@dataclass(frozen=True)
class Rung:
    """An engine at some settings and longest step. ``arm`` names what its ladder has in common."""

    engine: str
    arm: str
    step_s: float
    settings: Settings = field(default_factory=dict)


def by_step(engine: str, arm: str, settings: Settings, longest_s: float, count: int) -> list[Rung]:
    """Return a ladder whose step is halved from one rung to the next."""
    return [Rung(engine, arm, longest_s / 2**k, settings) for k in range(count)]


def by_tolerance(
    engine: str, arm: str, settings: Settings, names: tuple[str, ...], longest_s: float, exponents: range
) -> list[Rung]:
    """Return a ladder of tolerances 10^-k at the same longest step, the named settings sharing each."""
    return [Rung(engine, arm, longest_s, {**settings, **dict.fromkeys(names, 10.0**-k)}) for k in exponents]


def ideal_ladder(scene: Scene, full: bool = True) -> list[Rung]:
    """Return all engines' ladders for a scene of ideal joints, from fifty steps a revolution on."""
    turns = max(1.0, scene.end_time_s * abs(scene.start.crank_speed_rad_s) / (2 * np.pi))
    longest, whole, more = scene.end_time_s / (50 * turns), scene.end_time_s, 2 if full else 0
    every = 1 if full else 2
    return [
        *(rung for name in newcomers() for rung in by_step(name, AS_IT_COMES, {}, longest, 5 + more)),
        *by_step("reference", "projection", {}, longest, 6 + more),
        *by_step("reference", "none", {"stabilisation": "none"}, longest, 6 + more),
        *by_tolerance("reference", "DOP853", CONTROLLED, ("tolerance",), whole, range(4, 14, every)),
        *by_step("exudyn", "trapezoidal", {"solver": "TrapezoidalIndex2", **FAST}, longest, 5 + more),
        *by_step("exudyn", "generalized-alpha", {"solver": "GeneralizedAlpha", **FAST}, longest, 5 + more),
        *by_step("pymunk", "tuned", {}, longest / 4, 5 + more),
        *by_step("pymunk", "out of the box", PYMUNK_AS_IT_COMES, longest / 4, 5 + more),
        *by_tolerance("scipy", "DOP853", {"method": "DOP853"}, SCIPY, whole, range(5, 14, 2 * every)),
        *by_tolerance("scipy", "LSODA", {"method": "LSODA"}, SCIPY, whole, range(5, 14, 2 * every)),
        *by_tolerance("scipy", "Radau", {"method": "Radau"}, SCIPY, whole, range(5, 12, 2 * every)),
    ]


def clearance_ladder(scene: Scene, full: bool = True, fast: bool = True) -> list[Rung]:
    """Return all engines' ladders for a scene with clearance; ``fast`` is Exudyn's build for speed.

    Steps of engines that locate impacts begin at some hundred a revolution; without that a contact has to
    be resolved by the same steps as the flight.
    """
    turn = 2 * np.pi / max(abs(scene.start.crank_speed_rad_s), 20.0)
    flight, contact, whole, more = turn / 100, turn / 3000, scene.end_time_s, 2 if full else 0
    others = [rung for name in newcomers() for rung in by_step(name, AS_IT_COMES, {}, contact, 4 + more)]
    if all(getattr(scene.clearance, joint).law == "rigid" for joint in scene.joints_with_clearance):
        return [
            *others,
            *by_step("reference", "located", {}, flight, 5 + more),
            *by_tolerance("reference", "DOP853", CONTROLLED, ("tolerance",), whole, range(6, 13, 2)),
            *by_step("pymunk", "native contact", {"contact": "rigid"}, contact / 2, 4 + more),
        ]
    build: Settings = FAST if fast else {}
    dopri5, every = {"solver": "DOPRI5", **build}, 1 if full else 2
    return [
        *others,
        *by_step("reference", "located", {"steps_per_contact": 200.0}, flight, 7 + more),
        *by_step("reference", "plain", {"locate_events": False}, contact, 4 + more),
        *by_tolerance("reference", "DOP853", CONTROLLED, ("tolerance",), whole, range(6, 13, every)),
        *by_tolerance("exudyn", "DOPRI5", dopri5, ("tolerance",), whole, range(6, 12, every)),
        *by_step("exudyn", "trapezoidal", {"solver": "TrapezoidalIndex2", **build}, contact, 3 + more),
        *by_step("pymunk", "as the scene", {}, contact / 2, 3 + more),
        *by_step("pymunk", "native contact", {"contact": "rigid"}, contact / 2, 3 + more),
        *by_tolerance("scipy", "DOP853", {"method": "DOP853"}, SCIPY, whole, range(6, 13, every)),
        *by_tolerance("scipy", "LSODA", {"method": "LSODA"}, SCIPY, whole, range(5, 13, 2 * every)),
    ]
