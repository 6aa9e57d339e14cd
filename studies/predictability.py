"""Predictability: how long a scene can be followed, and what holds past that.

Parts are told apart by the column ``part``. ``HORIZON``: until when the reference agrees with its own
perturbed and step-halved runs, with how far they part as curves. All others are ensembles: a case is a
member, which starts at a crank angle of its own.
"""

import math
from statistics import median
from zlib import crc32

import numpy as np

from engine_models import arms
from engine_models.engine import RunSettings
from engine_models.engines import make_engine
from engine_models.scene.format import Clearance, Friction
from engine_models.scene.library import CLEARANCE_SCENES, RIGID_SCENES, clearance, ideal_driven
from engine_models.scene.scene import Scene
from studies.case import Case, Curves, Row, Value
from studies.judges import horizon
from studies.judges.kinds import turns_steadily
from studies.judges.metrics import checked
from studies.settings import Rung
from studies.sweep import summary

NAME, HORIZON = "predictability", "horizon"
#: Tolerances on the slider's position by the words in the names of columns.
TOLERANCES_M = {"1nm": 1e-9, "1um": 1e-6, "100um": 1e-4}


def clearance_driven_lossy() -> Scene:
    """Set R with 0.5 mm at the rod-slider pin and a restitution of 0.5 (Hu-Guo): chaotic, but slowly."""
    return _at_slider("clearance-driven-lossy", clearance(5e-4, "hu-guo", 0.5))


def clearance_driven_rubbing() -> Scene:
    """Set R with 0.5 mm at the rod-slider pin and friction 0.03."""
    friction = Friction(law="tanh", coefficient=0.03, regularisation_speed_m_s=0.01)
    return _at_slider("clearance-driven-rubbing", clearance(5e-4, friction=friction))


def _at_slider(name: str, at_slider: Clearance) -> Scene:
    return ideal_driven().model_copy(update={"name": name, "clearance": {"B": at_slider}})


SCENES = {
    **CLEARANCE_SCENES,
    **RIGID_SCENES,
    "clearance-driven-lossy": clearance_driven_lossy,
    "clearance-driven-rubbing": clearance_driven_rubbing,
}
#: Scenes whose horizon is sought and until when in s: quick, ...
HORIZONS_S = (("clearance-driven-0.5mm", 0.06), ("clearance-driven-AB", 0.036))
#: ... and what the full set adds. What settles is followed for 39 revolutions, rigid contact for as long as
#: the reference does in a minute.
MORE_HORIZONS_S = (
    ("clearance-driven-damped", 0.072),
    ("clearance-driven-0.1mm", 0.072),
    ("clearance-driven-0.02mm", 0.072),
    ("clearance-free-0.5mm", 0.2),
    ("clearance-driven-A", 0.048),
    ("clearance-driven-lossy", 0.12),
    ("clearance-free-OAB", 0.15),
    ("clearance-pendulum", 0.3),
    ("clearance-driven-0.02mm", 0.468),
    ("clearance-driven-damped", 0.468),
    ("clearance-driven-rubbing", 0.18),
    ("clearance-pendulum", 3.0),
    ("rigid-driven-0.5mm", 0.048),
    ("rigid-driven-0.1mm", 0.048),
    ("rigid-driven-A", 0.036),
    ("rigid-free-0.5mm", 0.1),
)
#: Longest step of the reference in flight in a horizon, in s; samples in a revolution, of a horizon and of an
#: ensemble, and in a scene without revolutions.
STEP_S, SAMPLES, ENSEMBLE_SAMPLES, FREE_SAMPLES = 1e-5, 200, 50, 400

#: Revolutions of a member left out and used. What has begun anywhere has forgotten it after the four.
TRANSIENT, REVOLUTIONS = 4, 8
#: Members of an ensemble. Starts are drawn with the seed beside the name of the ensemble.
MEMBERS, SEED = 24, 20240229
REFERENCE = Rung(arms.REFERENCE_DOP853, 1.0, {"step_tolerance": 1e-8})
#: The engines' arms of the ensembles, at steps and tolerances that resolve an impact. With a hundred times
#: the tolerance 75 of Exudyn's members dissipated less than the reference's, by 7 % +- 3 %.
DOPRI5, AS_THE_SCENE = Rung(arms.DOPRI5, 2e-5, {"step_tolerance": 1e-7}), Rung(arms.AS_THE_SCENE, 4e-6)
NATIVE_CONTACT = Rung(arms.NATIVE_CONTACT, 2e-6)
#: Scenes and engines' arms of the ensembles, quick and full, beside the reference.
ENSEMBLES: dict[bool, tuple[tuple[str, tuple[Rung, ...]], ...]] = {
    False: (("clearance-driven-0.5mm", ()),),
    True: (
        ("clearance-driven-0.5mm", (DOPRI5, AS_THE_SCENE, NATIVE_CONTACT)),
        ("clearance-driven-A", (DOPRI5, AS_THE_SCENE)),
        ("clearance-driven-rubbing", (DOPRI5, AS_THE_SCENE)),
    ),
}


def cases(full: bool) -> list[Case]:
    """Return the cases of all parts; the full set contains the quick one."""
    horizons = HORIZONS_S + (MORE_HORIZONS_S if full else ())
    out = [_horizon_case(SCENES[name]().model_copy(update={"end_time_s": end})) for name, end in horizons]
    for name, engines in ENSEMBLES[full]:
        scene = SCENES[name]()
        scene = scene.model_copy(update={"end_time_s": (TRANSIENT + REVOLUTIONS) * period_s(scene)})
        for rung in (REFERENCE, *engines, *(Rung(arm, STEP_S) for arm in arms.newcomers())):
            out += _members(scene, rung)
    return out


def measure(case: Case) -> tuple[Row, Curves]:
    """Run one case and return its part's columns and curves."""
    if case.columns["part"] == HORIZON:
        return _horizon(case)
    run = make_engine(case.engine, **case.settings).simulate(case.scene, case.run)
    numbers = summary(case.scene, run, TRANSIENT, REVOLUTIONS)
    known: Row = {name: value for name, value in numbers.items() if math.isfinite(value)}
    return {"revolutions": REVOLUTIONS, **checked(case.scene, run), **known}, {}


def period_s(scene: Scene) -> float:
    """Return the time of a revolution of a crank at constant speed.

    Raises:
        ValueError: the crank is not driven at constant speed, or stands still.
    """
    if scene.drive.kind != "constant-speed" or scene.start.speed_rad_s["crank"] == 0:
        raise ValueError(f"scene {scene.name}: expected a crank that turns at constant speed")
    return 2 * math.pi / abs(scene.start.speed_rad_s["crank"])


def moves_rad(name: str, count: int) -> list[float]:
    """Return by how much the crank angle of each start is moved: independent draws from a whole turn.

    Every ``name`` has draws of its own; the first of many are the few.
    """
    return list(np.random.default_rng([SEED, crc32(name.encode())]).uniform(-np.pi, np.pi, count))


def _horizon_case(scene: Scene) -> Case:
    turns = scene.end_time_s / period_s(scene) if turns_steadily(scene) else 0.0
    samples = max(round(SAMPLES * turns), 1) if turns else FREE_SAMPLES
    return _case(HORIZON, scene, RunSettings(STEP_S, samples), Rung(arms.REFERENCE, STEP_S))


def _members(scene: Scene, rung: Rung) -> list[Case]:
    run = RunSettings(rung.step_s, ENSEMBLE_SAMPLES * (TRANSIENT + REVOLUTIONS))
    part = rung.arm.label
    return [
        _case(part, horizon.moved(scene, by), run, rung, start_moved_rad=by, member=member)
        for member, by in enumerate(moves_rad(f"{part} on {scene.name}", MEMBERS))
    ]


def _case(part: str, scene: Scene, run: RunSettings, rung: Rung, **columns: Value) -> Case:
    return Case(NAME, scene, rung.arm, run, rung.added, columns={"part": part, **columns})


def _horizon(case: Case) -> tuple[Row, Curves]:
    """Return the horizon of each tolerance: median, least and largest over the perturbations.

    The least and the largest of n values bound the median with a confidence of 1 - 2^(1-n). A horizon that
    lies past the end is absent, as is a bound that does. The halved step's is one number.
    """
    parted = horizon.apart(case.scene, case.run.samples, step_s=case.run.step_s)
    row: Row = {
        "perturbations": len(parted.perturbed_m),
        "perturbation_rad": horizon.PERTURBATION_RAD,
        "largest_distance_perturbed_m": float(parted.perturbed_m.max()),
        "largest_distance_halved_m": float(parted.halved_m.max()),
    }
    if turns_steadily(case.scene):
        row["revolutions"] = case.scene.end_time_s / period_s(case.scene)
    for words, tolerance in TOLERANCES_M.items():
        times = [horizon.first_beyond_s(parted.time_s, one, tolerance) for one in parted.perturbed_m]
        halved = horizon.first_beyond_s(parted.time_s, parted.halved_m, tolerance)
        horizons = {
            f"horizon_{words}_s": median(times),
            f"horizon_{words}_least_s": min(times),
            f"horizon_{words}_largest_s": max(times),
            f"horizon_halved_{words}_s": halved,
        }
        row |= {name: value for name, value in horizons.items() if math.isfinite(value)}
    sizes = {f"perturbed_{k}_m": one for k, one in enumerate(parted.perturbed_m)}
    return row, {"time_s": parted.time_s, **sizes, "halved_m": parted.halved_m}
