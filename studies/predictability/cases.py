"""The runs of the predictability study and what they are made with; see ``studies.predictability.study``."""

from zlib import crc32

import numpy as np

from engine_models import arms
from engine_models.engine import RunSettings, UnsupportedScene
from engine_models.engines import make_engine
from engine_models.scene.scene import Scene
from studies.judges import horizon
from studies.judges.kinds import turns_steadily
from studies.ladders import Rung
from studies.predictability import basins, chains, diagrams
from studies.predictability.ensemble import WATCH
from studies.predictability.scenes import (
    EXPONENTS,
    HORIZONS_S,
    MORE_EXPONENTS,
    MORE_HORIZONS_S,
    SCENES,
    following,
    period_s,
    tighter,
)
from studies.running.case import Case, Value

#: The parts that are no ensembles, beside the diagrams.
HORIZON, EXPONENT = "horizon", "Lyapunov exponent"

#: Longest steps of the reference in flight, in s: of a horizon, of an exponent.
STEP_S, EXPONENT_STEP_S = 1e-5, 5e-5
#: Samples in a revolution, of a horizon and of an ensemble; in a stretch of the exponent; in a scene without
#: revolutions.
SAMPLES, ENSEMBLE_SAMPLES, STRETCH_SAMPLES, FREE_SAMPLES = 200, 50, 500, 400
#: Revolutions from the start that an exponent leaves out, and those it uses.
EXPONENT_REVOLUTIONS = 1, 32
#: Parts of the revolutions used from which an exponent is taken, by the ends of the names of columns.
EXPONENT_PARTS = {"_quarter": 0.25, "_half": 0.5, "": 1.0}
#: Starts of the exponent, quick and full.
EXPONENT_STARTS = {False: 8, True: 16}
#: Members of the reference's ensembles and of the engines', quick and full: one of these takes some 0.5 s.
MEMBERS, ENGINE_MEMBERS = {False: 100, True: 200}, {False: 24, True: 200}
#: Starts are drawn with this number beside the name of what they are for.
SEED = 20240229

REFERENCE = Rung(arms.REFERENCE, STEP_S)
#: What others are compared with, and the same by the paper's method.
SHARP, PAPERS = Rung(arms.REFERENCE_DOP853, 1.0, {"step_tolerance": 1e-8}), Rung(arms.REFERENCE, 1e-4)
#: The engines' arms of the ensembles, at steps and tolerances that resolve an impact. With a hundred times
#: the tolerance 75 of Exudyn's members dissipated less than the reference's, by 7 % +- 3 %.
RUNGS = {
    "DOPRI5": Rung(arms.DOPRI5, 2e-5, {"step_tolerance": 1e-7}),
    "as the scene": Rung(arms.AS_THE_SCENE, 4e-6),
    "native contact": Rung(arms.NATIVE_CONTACT, 2e-6),
    "Taylor": Rung(arms.HEYOKA, 1.0, {"step_tolerance": 1e-8}),
}
_SAME_LAW = ("DOPRI5", "as the scene")
#: Scenes and engines' arms of the ensembles, quick and full.
ENSEMBLES: dict[bool, tuple[tuple[str, tuple[str, ...]], ...]] = {
    False: (("clearance-driven-0.5mm", ()),),
    True: (
        ("clearance-driven-0.5mm", tuple(RUNGS)),
        ("clearance-driven-A", _SAME_LAW),
        ("clearance-driven-rubbing", _SAME_LAW),
    ),
}


def cases(full: bool) -> list[Case]:
    """Return the cases of all parts; the full set contains the quick one, and alone has chains and basins."""
    horizons = HORIZONS_S + (MORE_HORIZONS_S if full else ())
    exponents = EXPONENTS + (MORE_EXPONENTS if full else ())
    out = [_horizon(SCENES[name]().model_copy(update={"end_time_s": end})) for name, end in horizons]
    out += [case for name in exponents for case in _exponents(SCENES[name](), full)]
    for name, parts in ENSEMBLES[full]:
        out += _ensembles(following(SCENES[name](), round(WATCH.turns)), parts, full)
    return out + diagrams.cases(full) + (chains.cases() + basins.cases() if full else [])


def moves_rad(name: str, count: int) -> list[float]:
    """Return by how much the crank angle of each start is moved: independent draws from a whole turn.

    Every ``name`` has draws of its own; the first of many are the few.
    """
    return list(np.random.default_rng([SEED, crc32(name.encode())]).uniform(-np.pi, np.pi, count))


def _horizon(scene: Scene) -> Case:
    turns = scene.end_time_s / period_s(scene) if turns_steadily(scene) else 0.0
    samples = max(round(SAMPLES * turns), 1) if turns else FREE_SAMPLES
    return _case(HORIZON, scene, RunSettings(STEP_S, samples))


def _exponents(scene: Scene, full: bool) -> list[Case]:
    return [_exponent(scene, by) for by in moves_rad(EXPONENT + scene.name, EXPONENT_STARTS[full])]


def _exponent(scene: Scene, by: float) -> Case:
    scene = following(scene, sum(EXPONENT_REVOLUTIONS))
    # The pins of two joints are rarely in flight at the same time.
    run = RunSettings(EXPONENT_STEP_S, STRETCH_SAMPLES * len(scene.joints_with_clearance) ** 2)
    return _case(EXPONENT, horizon.moved(scene, by), run, start_moved_rad=by)


def _case(part: str, scene: Scene, run: RunSettings, rung: Rung = REFERENCE, **columns: Value) -> Case:
    return Case("predictability", scene, rung.arm, run, rung.added, columns={"part": part, **columns})


def _ensembles(scene: Scene, names: tuple[str, ...], full: bool) -> list[Case]:
    """Return the reference's ensembles, then every engine's arm, with its model twin's if that differs.

    Of the reference's own the second differs in nothing but its draws, and the last by more than the margins.
    """
    references, members = MEMBERS[full], ENGINE_MEMBERS[full]
    out = _members(scene, SHARP.arm.label, SHARP, references)
    out += _members(scene, "reference (other starts)", SHARP, references)
    out += _members(scene, "reference (RK4)", PAPERS, references)
    out += _members(tighter(scene), "reference (a tenth less clearance)", SHARP, references)
    for rung in (*(RUNGS[name] for name in names), *(Rung(arm, STEP_S) for arm in arms.newcomers())):
        out += _members(scene, rung.arm.label, rung, members)
        try:
            own = make_engine(rung.arm.engine, **rung.arm.settings).twin(scene)
        except UnsupportedScene:
            continue  # the members say why
        if own != scene:
            out += _members(own, f"reference (twin of {rung.arm.label})", SHARP, members)
    return out


def _members(scene: Scene, part: str, rung: Rung, members: int) -> list[Case]:
    run = RunSettings(rung.step_s, ENSEMBLE_SAMPLES * round(WATCH.turns))
    return [
        _case(part, horizon.moved(scene, by), run, rung, start_moved_rad=by, member=member)
        for member, by in enumerate(moves_rad(f"{part} on {scene.name}", members))
    ]
