"""Ladders of every engine's own best settings, from cheap to accurate, for work-precision and clearance."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from engine_models import arms
from engine_models.arms import Arm, Setting
from engine_models.engine import FloatArray
from engine_models.mechanics.crank_motion import expected_speeds_rad_s
from engine_models.scene.parts import AnyScene
from engine_models.scene.scene import Scene
from studies.judges.converged_truth import GRID, converged

#: Scenes of the quick set, in all studies that have no others of their own.
QUICK_IDEAL = ("ideal-free", "ideal-driven")
QUICK_LOOSE = ("clearance-free-0.5mm", "clearance-driven-0.5mm")
#: Arms of the full set alone, on ideal joints and with compliant contacts. Where one of these is the best of
#: its engine another one is nearly as good.
MORE_IDEAL = (arms.OUT_OF_THE_BOX, arms.ODEINT, arms.RADAU)
MORE_LOOSE = (
    arms.PLAIN,
    arms.LOCATED_ALONE,
    arms.WIDE_GAP,
    arms.ODE23,
    arms.TRAPEZOIDAL,
    arms.AS_THE_SCENE,
    arms.NATIVE_CONTACT,
    arms.LSODA,
)
#: What Pymunk's sweeps may leave of an open joint, ideal and with compliant contacts. The fewest sweeps that
#: cost no accuracy leave so much; its rungs are steps that resolve contacts, where the engine's own bounds
#: are for any. Under a drive that is neither free nor a torque, forces of the first steps are of order 1 by
#: what sweeps leave: with 0.42 of ideal-driven torques are off by 30 times as much.
LEFT_IDEAL, LEFT_DRIVEN, LEFT_LOOSE = 0.42, 1 / 50, 1 / 8


def only_full(arm: Arm, scene: AnyScene) -> bool:
    """Return whether only the full set has an arm on a scene, of those that its ladders have."""
    if not scene.joints_with_clearance:
        return arm in MORE_IDEAL
    return arm in MORE_LOOSE and not _between_rigid_walls(scene)


@dataclass(frozen=True)
class Rung:
    """An arm at some longest step, with settings ``added`` that its ladder sets."""

    arm: Arm
    step_s: float
    added: Mapping[str, Setting] = field(default_factory=dict)


def by_step(arm: Arm, longest_s: float, count: int, **added: Setting) -> list[Rung]:
    """Return a ladder whose step is halved from one rung to the next."""
    return [Rung(arm, longest_s / 2**k, added) for k in range(count)]


def by_tolerance(arm: Arm, longest_s: float, exponents: range, **added: Setting) -> list[Rung]:
    """Return a ladder of tolerances 10^-k at the same longest step."""
    return [Rung(arm, longest_s, {**added, **dict.fromkeys(arm.tolerances, 10.0**-k)}) for k in exponents]


def ideal_ladder(scene: AnyScene, full: bool = True) -> list[Rung]:
    """Return all engines' ladders for a scene of ideal joints, from fifty steps a revolution on."""
    longest, whole, more = scene.end_time_s / (50 * turns_of(scene)), scene.end_time_s, 2 if full else 0
    every = 1 if full else 2
    left = LEFT_IDEAL if scene.driven_by.kind in ("free", "torque") else LEFT_DRIVEN
    return [
        *(rung for arm in arms.newcomers() for rung in by_step(arm, longest, 5 + more)),
        *by_step(arms.PROJECTION, longest, 6 + more),
        *by_step(arms.NO_STABILISATION, longest, 6 + more),
        *by_tolerance(arms.REFERENCE_DOP853, whole, range(4, 14, every)),
        *by_step(arms.TRAPEZOIDAL, longest, 5 + more, fast=True),
        *by_step(arms.GENERALIZED_ALPHA, longest, 5 + more, fast=True),
        *by_step(arms.TUNED, longest / 4, 5 + more, sweeps_leave=left),
        *by_step(arms.OUT_OF_THE_BOX, longest / 4, 5 + more),
        *by_tolerance(arms.ODE, whole, range(5, 14, every)),
        *by_tolerance(arms.ODEINT, whole, range(5, 14, every)),
        *by_tolerance(arms.RADAU, whole, range(5, 12, every)),
    ]


def turns_of(scene: AnyScene) -> float:
    """Return how often the crank, or what turns, may turn round by its fastest speed; once at least."""
    return max(1.0, scene.end_time_s * _fastest_rad_s(scene) / (2 * np.pi))


def speeds_rad_s(scene: AnyScene) -> FloatArray:
    """Return the speed of the crank or of the turning body, or the fastest body's, at equal intervals, (n,).

    Of a plain crank-slider it is the drive's or else the start's, of others that of the true motion.

    Raises:
        UnsupportedScene, SimulationFailed: there is no true motion.
    """
    if isinstance(scene, Scene) and scene.is_plain:
        return expected_speeds_rad_s(scene)
    spins = converged(scene, GRID)[0].velocity[:, :, 2]
    return np.abs(spins).max(axis=1) if scene.turning_body is None else spins[:, scene.turning_body]


def _fastest_rad_s(scene: AnyScene) -> float:
    return float(np.abs(speeds_rad_s(scene)).max())


def contact_step_s(scene: AnyScene) -> float:
    """Return a step that just resolves contacts: three thousand a revolution."""
    return 2 * np.pi / (3000 * max(_fastest_rad_s(scene), 20.0))


def clearance_ladder(scene: AnyScene, full: bool = True, fast: bool = True) -> list[Rung]:
    """Return all engines' ladders for a scene with clearance; ``fast`` is Exudyn's build for speed.

    Steps of engines that locate impacts begin at some hundred a revolution; without that a contact has to
    be resolved by the same steps as the flight. Exudyn's DOPRI5 accepts a step that overflows: its longest is
    a twentieth of a revolution, which it seldom takes. Half the reference's usual steps per contact leave as
    much error there as its steps leave in flight.
    """
    contact, whole, more = contact_step_s(scene), scene.end_time_s, 2 if full else 0
    flight, longest = 30 * contact, 150 * contact
    others = [rung for arm in arms.newcomers() for rung in by_step(arm, contact, 4 + more)]
    if _between_rigid_walls(scene):
        return [
            *others,
            *by_step(arms.LOCATED, flight, 5 + more),
            *by_tolerance(arms.REFERENCE_DOP853, whole, range(6, 13, 2)),
            *by_step(arms.NATIVE_CONTACT, contact / 2, 4 + more),
        ]
    build: dict[str, Setting] = {"fast": True} if fast else {}
    every = 1 if full else 2
    return [
        *others,
        *by_step(arms.LOCATED, flight, 7 + more, steps_per_contact=50.0),
        *by_step(arms.LOCATED_ALONE, flight, 7 + more, steps_per_contact=50.0),
        *by_step(arms.PLAIN, contact, 4 + more),
        *by_tolerance(arms.REFERENCE_DOP853, whole, range(6, 13, every)),
        *by_tolerance(arms.DOPRI5, longest, range(4, 12, every), **build),
        *by_tolerance(arms.WIDE_GAP, longest, range(4, 7), **build),
        *by_tolerance(arms.ODE23, longest, range(4, 7, every), **build),
        *by_step(arms.TRAPEZOIDAL, contact, 3 + more, **build),
        *by_step(arms.AS_THE_SCENE, contact / 2, 5 + more),
        *by_step(arms.SHORTER_IN_CONTACT, 4 * contact, 6 + more, sweeps_leave=LEFT_LOOSE),
        *by_step(arms.NATIVE_CONTACT, contact / 2, 3 + more),
        *by_tolerance(arms.SCIPY_DOP853, whole, range(6, 13, every)),
        *by_tolerance(arms.LSODA, whole, range(5, 13, every)),
    ]


def rebound_ladder(scene: AnyScene) -> list[Rung]:
    """Return the ladder of SciPy, which rebounds from rigid walls until bounces accumulate."""
    if not _between_rigid_walls(scene):
        return []
    return by_tolerance(arms.SCIPY_DOP853, scene.end_time_s, range(6, 13, 2))


def _between_rigid_walls(scene: AnyScene) -> bool:
    """Return whether every joint with clearance has a rigid wall."""
    return all(room.law == "rigid" for room in scene.clearances.values())
