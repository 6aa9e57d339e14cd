"""The runs of the predictability study and what they are made with; see ``studies.predictability.study``."""

from engine_models import arms
from engine_models.engine import RunSettings, UnsupportedScene
from engine_models.engines import make_engine
from engine_models.scene.scene import Scene
from studies.judges import horizon
from studies.ladders import Rung
from studies.predictability.ensemble import period_s
from studies.predictability.scenes import (
    EXPONENTS,
    HORIZONS_S,
    MORE_EXPONENTS,
    MORE_HORIZONS_S,
    SCENES,
    at_clearance,
    at_speed,
    following,
)
from studies.running.case import Case, Value

#: The parts that are no ensembles.
HORIZON, EXPONENT = "horizon", "Lyapunov exponent"
CLEARANCES, SPEEDS = "against clearance", "against crank speed"

#: Longest step of the reference in flight, in s, and in a revolution of the pictures.
STEP_S, STEPS_OF_PICTURE = 1e-5, 1200
#: Samples in a revolution; in a stretch of the exponent; in a scene without revolutions.
SAMPLES, STRETCH_SAMPLES, FREE_SAMPLES = 200, 500, 400
#: Revolutions from the start that exponent, ensemble and picture leave out, and those they use.
EXPONENT_REVOLUTIONS, ENSEMBLE_REVOLUTIONS, PICTURE_REVOLUTIONS = (1, 9), (4, 4), (6, 6)
#: Starts of the exponent, quick and full: the crank angle is moved by this much from one to the next.
EXPONENT_STARTS, EXPONENT_SPACING_RAD = {False: 4, True: 12}, 1e-4
#: Members of an ensemble, and sizes by which their starts are moved: far above round-off, far below physics.
MEMBERS, MOVES_RAD = {False: 20, True: 40}, (1e-6, 1e-4)
#: Ends of the pictures, clearances in m and speeds in rev/min; points of the full set, of which the quick
#: has every 8th.
CLEARANCES_M, SPEEDS_RPM, POINTS, QUICK_EVERY = (1e-5, 1e-3), (500.0, 8000.0), 97, 8

REFERENCE = Rung(arms.REFERENCE, STEP_S)
#: Arms of the ensembles, at steps and tolerances that resolve an impact cheaply. Distributions over 60
#: members with Exudyn's tolerance a hundredth of this, and with half and twice Pymunk's step, could not be
#: told from the model twin's either (Kolmogorov and Smirnov, six numbers).
RUNGS = {
    "DOP853": Rung(arms.REFERENCE_DOP853, 1.0, {"tolerance": 1e-7}),
    "DOPRI5": Rung(arms.DOPRI5, 2e-5, {"tolerance": 1e-6}),
    "as the scene": Rung(arms.AS_THE_SCENE, 4e-6),
    "native contact": Rung(arms.NATIVE_CONTACT, 2e-6),
}
_SAME_LAW = ("DOP853", "DOPRI5", "as the scene")
#: Scenes and engines' arms of the ensembles, quick and full.
ENSEMBLES = {
    False: (("clearance-driven-0.5mm", _SAME_LAW),),
    True: (
        ("clearance-driven-0.5mm", tuple(RUNGS)),
        ("clearance-driven-0.1mm", _SAME_LAW),
        ("clearance-driven-A", _SAME_LAW),
    ),
}


def cases(full: bool) -> list[Case]:
    """Return horizons, exponents, ensembles and pictures; the full set contains the quick one."""
    horizons = HORIZONS_S + (MORE_HORIZONS_S if full else ())
    exponents = EXPONENTS + (MORE_EXPONENTS if full else ())
    out = [_horizon(name, end) for name, end in horizons]
    out += [_exponent(name, start) for name in exponents for start in range(EXPONENT_STARTS[full])]
    for name, parts in ENSEMBLES[full]:
        out += _ensembles(following(SCENES[name](), sum(ENSEMBLE_REVOLUTIONS)), parts, MEMBERS[full])
    places = [k / (POINTS - 1) for k in range(0, POINTS, 1 if full else QUICK_EVERY)]
    (small, large), (slow, fast) = CLEARANCES_M, SPEEDS_RPM
    out += [_picture(CLEARANCES, at_clearance(small * (large / small) ** place)) for place in places]
    return out + [_picture(SPEEDS, at_speed(slow + (fast - slow) * place)) for place in places]


def moves_rad(members: int, mirrored: bool = False) -> list[float]:
    """Return by how much the crank angle of each member is moved: evenly in the logarithm, to either side.

    The first of many are the few. ``mirrored`` gives as many others.
    """
    golden = (1 + 5**0.5) / 2  # its multiples fill an interval evenly, however many there are
    small, large = MOVES_RAD
    parts = [(k * golden + (0.5 if mirrored else 0.0)) % 1.0 for k in range(members)]
    return [(-1) ** (k + mirrored) * small * (large / small) ** part for k, part in enumerate(parts)]


def _horizon(name: str, end_s: float) -> Case:
    scene = SCENES[name]().model_copy(update={"end_time_s": end_s})
    turns = scene.drive.kind == "constant-speed"
    samples = round(SAMPLES * end_s / period_s(scene)) if turns else FREE_SAMPLES
    return _case(HORIZON, scene, RunSettings(STEP_S, samples))


def _exponent(name: str, start: int) -> Case:
    scene, by = following(SCENES[name](), sum(EXPONENT_REVOLUTIONS)), start * EXPONENT_SPACING_RAD
    # The pins of two joints are rarely in flight at the same time.
    run = RunSettings(STEP_S, STRETCH_SAMPLES * len(scene.joints_with_clearance) ** 2)
    return _case(EXPONENT, horizon.moved(scene, by), run, start_moved_rad=by)


def _case(part: str, scene: Scene, run: RunSettings, rung: Rung = REFERENCE, **columns: Value) -> Case:
    return Case("predictability", scene, rung.arm, run, rung.added, columns={"part": part, **columns})


def _ensembles(scene: Scene, names: tuple[str, ...], members: int) -> list[Case]:
    """Return the reference and its repeats, then every engine's arm with its model twin if that differs."""
    starts, others = moves_rad(members), moves_rad(members, mirrored=True)
    out = _members(scene, "reference (scene's law)", REFERENCE, starts)
    out += _members(scene, "reference (other starts)", REFERENCE, others)
    out += _members(scene, "reference (half the step)", Rung(arms.REFERENCE, STEP_S / 2), starts)
    for rung in (*(RUNGS[name] for name in names), *(Rung(arm, STEP_S) for arm in arms.newcomers())):
        out += _members(scene, rung.arm.label, rung, starts)
        try:
            own = make_engine(rung.arm.engine, **rung.arm.settings).twin(scene)
        except UnsupportedScene:
            continue  # the members say why
        if own != scene:
            out += _members(own, f"reference (twin of {rung.arm.label})", REFERENCE, others)
    return out


def _members(scene: Scene, part: str, rung: Rung, starts: list[float]) -> list[Case]:
    run = RunSettings(rung.step_s, SAMPLES * sum(ENSEMBLE_REVOLUTIONS))
    return [_case(part, horizon.moved(scene, by), run, rung, start_moved_rad=by) for by in starts]


def _picture(part: str, scene: Scene) -> Case:
    """Return a point of a picture; a quarter of a revolution is a whole number of samples."""
    scene = following(scene, sum(PICTURE_REVOLUTIONS))
    run = RunSettings(period_s(scene) / STEPS_OF_PICTURE, 4 * sum(PICTURE_REVOLUTIONS))
    return _case(part, scene, run)
