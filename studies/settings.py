"""The scenes that accuracy and cost share, and every engine's settings on them, from cheap to accurate.

The quick set leaves out configurations that are at no error the cheapest of their engine. On scenes with
clearance all sets leave out SciPy's calls without events, and Exudyn's RK44.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from engine_models import arms
from engine_models.arms import Arm, Setting
from engine_models.engine import FloatArray
from engine_models.mechanics.forces import driven_speeds
from engine_models.scene.library import CLEARANCE_SCENES, IDEAL_SCENES, RIGID_SCENES
from engine_models.scene.scene import Scene
from studies.judges.converged_truth import GRID, converged

#: How far scenes with clearance are followed in s: to the horizon (see ``converged_truth.followed``), where
#: they have one. What settles to continuous contact has none in ten revolutions and is followed for three;
#: the pendulum for half a swing to either side.
END_S = {
    "clearance-driven-0.5mm": 0.029,
    "clearance-driven-0.1mm": 0.033,
    "clearance-driven-0.02mm": 0.036,
    "clearance-driven-damped": 0.036,
    "clearance-driven-A": 0.021,
    "clearance-driven-AB": 0.01,
    "clearance-free-0.5mm": 0.071,
    "clearance-free-OAB": 0.04,
    "clearance-pendulum": 0.3,
    "clearance-start-up": 0.1,
    "clearance-compressor": 0.052,
    "rigid-driven-0.5mm": 0.026,
    "rigid-driven-damped": 0.036,
    "rigid-free-0.5mm": 0.29,
    "rigid-pendulum": 0.3,
    "rigid-start-up": 0.05,
    "rigid-compressor": 0.084,
}
#: The same of rigid walls in studies: to where bounces first accumulate, which coarse settings have sooner.
#: With damping they do so at once.
BEFORE_REST_S = {
    "rigid-driven-0.5mm": 0.006,
    "rigid-free-0.5mm": 0.07,
    "rigid-pendulum": 0.11,
    "rigid-start-up": 0.008,
    "rigid-compressor": 0.0075,
}
QUICK = ("ideal-free", "ideal-driven", "clearance-free-0.5mm", "clearance-driven-0.5mm", "rigid-free-0.5mm")

#: Pymunk's sweeps over the joints of a crank-slider, and of one whose crank is driven: with as many as the
#: others have forces are off by up to 24 times as much. More leave nothing to gain.
SWEEPS, SWEEPS_DRIVEN = 10, 20

#: Times at which a drive is looked at for its speed.
LOOKS = 1001
#: How often the longest step is halved, or the exponents of the tolerance, of every configuration in the
#: quick set and in the full one: on ideal joints, with compliant contacts, between rigid walls. Those of the
#: quick set are around an error of 1 um.
Series = Mapping[Arm, tuple[Sequence[int], Sequence[int]]]
IDEAL: Series = {
    arms.PROJECTION: ((0, 1, 2, 4), (0, 1, 2, 4, 6)),
    arms.NO_STABILISATION: ((), range(0, 8, 2)),
    arms.BAUMGARTE: ((), range(0, 8, 2)),
    arms.REFERENCE_DOP853: ((6, 8, 10), range(4, 14, 2)),
    arms.TRAPEZOIDAL: ((1, 4, 7), (1, 2, 4, 7)),
    arms.GENERALIZED_ALPHA: ((1, 4, 7), (1, 2, 4, 7)),
    arms.TUNED: ((0, 2, 4, 6), (0, 2, 4, 6)),
    arms.OUT_OF_THE_BOX: ((), range(0, 7, 2)),
    arms.SCIPY_DOP853: ((5, 7, 9), range(5, 14, 2)),
    arms.LSODA: ((), range(5, 14, 2)),
    arms.RADAU: ((), range(5, 12, 2)),
}
COMPLIANT: Series = {
    arms.LOCATED: ((1, 3, 5), range(1, 8, 2)),
    arms.LOCATED_ALONE: ((), range(1, 8, 2)),
    arms.PLAIN: ((), range(0, 6, 2)),
    arms.REFERENCE_DOP853: ((8, 10, 12), range(6, 14, 2)),
    arms.DOPRI5: ((6, 8, 10), range(4, 12, 2)),
    arms.TRAPEZOIDAL: ((), range(4)),
    arms.AS_THE_SCENE: ((), range(4)),
    arms.SHORTER_IN_CONTACT: ((1, 2), range(4)),
    arms.NATIVE_CONTACT: ((), range(3)),
    arms.SCIPY_DOP853: ((8, 10, 12), range(6, 14, 2)),
    arms.LSODA: ((), range(5, 13, 2)),
}
RIGID: Series = {
    arms.LOCATED: ((0, 2, 4), range(0, 8, 2)),
    arms.REFERENCE_DOP853: ((6, 10), range(6, 14, 2)),
    arms.NATIVE_CONTACT: ((0, 2), range(4)),
    arms.SCIPY_DOP853: ((6, 10), range(6, 14, 2)),
}
#: The same of an engine that the catalogue does not know.
NEWCOMER = ((0, 2, 4), range(0, 8, 2))
#: Steps of those with contacts, in parts of one that resolves them: three thousand a revolution. Who ends
#: a step on every touch takes longer ones in flight.
CONTACT_STEPS = {arms.LOCATED: 30.0, arms.LOCATED_ALONE: 30.0, arms.SHORTER_IN_CONTACT: 4.0}


@dataclass(frozen=True)
class Rung:
    """A configuration at some longest step, with settings ``added`` that its series sets."""

    arm: Arm
    step_s: float
    added: Mapping[str, Setting] = field(default_factory=dict)


def scenes(full: bool) -> list[Scene]:
    """Return the scenes of accuracy and cost, those with clearance cut to the time that is followed."""
    library = {**IDEAL_SCENES, **CLEARANCE_SCENES, **RIGID_SCENES}
    ends = {**END_S, **BEFORE_REST_S}
    made = [library[name]() for name in ((*IDEAL_SCENES, *END_S) if full else QUICK)]
    return [scene.model_copy(update={"end_time_s": ends.get(scene.name, scene.end_time_s)}) for scene in made]


def ladder(scene: Scene, full: bool) -> list[Rung]:
    """Return the settings of all configurations for a scene.

    On ideal joints steps begin with fifty a revolution. Exudyn's DOPRI5 accepts a step that overflows: its
    longest is a twentieth of a revolution, which it seldom takes.
    """
    out: list[Rung] = []
    for arm, (quick, every) in _series(scene).items():
        added = _added(scene, arm)
        places = every if full else quick
        if arm.tolerances:
            longest = 150 * contact_step_s(scene) if arm.engine == "exudyn" else scene.end_time_s
            out += by_tolerance(arm, longest, places, **added)
        else:
            out += by_step(arm, _longest_s(scene, arm), places, **added)
    return out


def configurations(scene: Scene) -> list[Arm]:
    """Return the configurations of the quick set."""
    return [arm for arm, (quick, _) in _series(scene).items() if quick]


def by_step(arm: Arm, longest_s: float, halvings: Iterable[int], **added: Setting) -> list[Rung]:
    """Return a series of steps: the longest one halved so many times each."""
    return [Rung(arm, longest_s / 2**k, added) for k in halvings]


def by_tolerance(arm: Arm, longest_s: float, exponents: Iterable[int], **added: Setting) -> list[Rung]:
    """Return a series of tolerances 10^-k at the same longest step."""
    return [Rung(arm, longest_s, {**added, **dict.fromkeys(arm.tolerances, 10.0**-k)}) for k in exponents]


def _series(scene: Scene) -> Series:
    others = dict.fromkeys(arms.newcomers(), NEWCOMER)
    if not scene.clearances:
        return {**others, **IDEAL}
    return {**others, **(RIGID if _between_rigid_walls(scene) else COMPLIANT)}


def _added(scene: Scene, arm: Arm) -> dict[str, Setting]:
    """Return what the studies set beside the step."""
    if arm in (arms.TUNED, arms.SHORTER_IN_CONTACT):
        driven = arm == arms.TUNED and scene.mechanism.drive.prescribes
        return {"iterations": SWEEPS_DRIVEN if driven else SWEEPS}
    if arm in (arms.LOCATED, arms.LOCATED_ALONE) and not _between_rigid_walls(scene):
        return {"steps_per_contact": 50.0}  # as much error there as its steps leave in flight
    return {}


def _longest_s(scene: Scene, arm: Arm) -> float:
    """Return the longest step of a configuration with fixed steps."""
    if not scene.clearances:
        longest = scene.end_time_s / (50 * turns_of(scene))
        return longest / 4 if arm.engine == "pymunk" else longest
    return CONTACT_STEPS.get(arm, 0.5 if arm.engine == "pymunk" else 1.0) * contact_step_s(scene)


def turns_of(scene: Scene) -> float:
    """Return how often the crank, or what turns, may turn round by its fastest speed; once at least."""
    return max(1.0, scene.end_time_s * float(np.abs(speeds_rad_s(scene)).max()) / (2 * np.pi))


def speeds_rad_s(scene: Scene) -> FloatArray:
    """Return the speed of the crank or of the turning body, or the fastest body's, at equal intervals, (n,).

    Of a crank-slider it is the drive's or else the start's, of others, or where the slider is driven, that of
    the true motion.

    Raises:
        UnsupportedScene, SimulationFailed: there is no true motion.
    """
    if scene.is_short and scene.drive.guide is None:
        if not scene.mechanism.drive.prescribes:
            return np.array([scene.placed.v[2]])
        return driven_speeds(scene.mechanism, np.linspace(0.0, scene.end_time_s, LOOKS))
    spins = converged(scene, GRID)[0].velocity[:, :, 2]
    return np.abs(spins).max(axis=1) if scene.turning_body is None else spins[:, scene.turning_body]


def contact_step_s(scene: Scene) -> float:
    """Return a step that just resolves contacts: three thousand a revolution."""
    return 2 * np.pi / (3000 * max(float(np.abs(speeds_rad_s(scene)).max()), 20.0))


def _between_rigid_walls(scene: Scene) -> bool:
    return all(room.law == "rigid" for room in scene.clearances.values())
