"""What every engine owes on every scene that it runs, whatever its method: claims, and what was measured.

Everything is worked out from the scene and the trajectory alone, and from independent reference solutions.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from engine_models.engine import AdapterCannot, Engine, RunSettings, Trajectory, UnsupportedScene
from engine_models.mechanics.energy import unaccounted_part
from engine_models.mechanics.forces import accelerations
from engine_models.mechanics.start import start_state
from engine_models.mechanics.states import observed_m
from engine_models.scene.library import ALL_SCENES, SCENES
from engine_models.scene.scene import Scene
from studies.judges.converged_truth import converged, solved
from studies.judges.convergence import observed_order
from studies.judges.impact_matching import FORCE_ERROR, impact_errors
from studies.judges.metrics import constraint_violation_m

SAMPLES = 40
#: End and step in s of library scenes whose speed is constant, up to just before their second impact, and of
#: others, through their first.
CONSTANT, OTHERS = (0.0006, 1e-6), (0.004, 4e-6)
#: The part of a mechanism's end time that is run, in so many steps: Andrews' has to come to speed.
STEPS, PART = 1000, 0.1
PARTS = {"offset-crank-slider": 0.01, "four-bar-clearance": 0.06, "andrews-squeezer": 0.2}
#: The arrays of a run, and of its contacts, that have the shapes of the true solution's.
ARRAYS = ("position", "velocity", "driver_torque_N_m", "driver_work_J", "joint_force_N", "guide_force_N")
CONTACT_ARRAYS = ("gap_m", "penetration_m", "normal_force_N", "friction_force_N", "normal_impulse_N_s")
#: Energy that no line of the ledger explains, as a part of that in play.
LEDGER = 2e-3
#: What the slider may be off in m, and the largest force of an impact as a part of the largest of all.
PLACE_M, STRENGTH = 5e-5, 0.1
#: Smooth motion on which orders are measured, and until when in s.
SMOOTH, SMOOTH_END_S = "ideal-free", 0.1
#: The longest step in s, how often it is halved, and how far the order may be from what is stated.
LONGEST_S, HALVINGS, ORDER = 2e-4, 6, 0.1
#: To what the truth is known in m. It is as much as roundings of 0.2 m add up to by chance in the finest run:
#: the root of its 32 000 steps times 4e-17 m.
KNOWN_TO_M = 1e-14
#: Sharpened so often, an engine's error falls by so much at least, its tolerance by 1000; or to so many m.
SHARPENINGS, GAIN, SHARP_M = 3, 100.0, 2e-12


class Finding(NamedTuple):
    """Whether a claim holds, and in words what was measured, with the bound that it has to keep and why."""

    holds: bool
    measured: str


def within(value: float, bound: float, unit: str, reason: str) -> Finding:
    """Return that a number is within its bound, with the reason of that."""
    return Finding(bool(value <= bound), f"{value:.1e} {unit}, at most {bound:.0e}: {reason}")


@dataclass(frozen=True)
class Trial:
    """An engine on the beginning of a scene."""

    engine: Engine
    scene: Scene
    step_s: float

    @cached_property
    def run(self) -> Trajectory:
        """The engine's run of it."""
        return self.again()

    def again(self) -> Trajectory:
        """Return another run of it."""
        self.engine.check(self.scene)
        return self.engine.simulate(self.scene, RunSettings(self.step_s, SAMPLES))


def trial_of(engine: Engine, name: str) -> Trial:
    """Return an engine on the beginning of a scene of the library."""
    scene = ALL_SCENES[name]()
    if name in SCENES:
        end_s, step_s = CONSTANT if scene.drive.kind == "constant-speed" else OTHERS
    else:
        end_s = PARTS.get(name, PART) * scene.end_time_s
        step_s = end_s / STEPS
    return Trial(engine, scene.replace("end_time_s", end_s), step_s)


def require_arrays(trial: Trial) -> float:
    """Return 0 for arrays of the true solution's shapes at its times; raise ValueError for others."""
    run, true = trial.run, converged(trial.engine.twin(trial.scene), SAMPLES)[0]
    wrong = [name for name in ARRAYS if _shapes(vars(run)[name]) != _shapes(vars(true)[name])]
    for joint, contact in true.contacts.items():
        own = vars(run.contacts[joint])
        wrong += [
            f"{joint} {name}" for name in CONTACT_ARRAYS if _shapes(own[name]) != _shapes(vars(contact)[name])
        ]
    if not np.allclose(run.time_s, true.time_s, rtol=1e-12, atol=0):
        wrong.append("time_s")
    if wrong or [*run.contacts] != [*trial.scene.clearances]:
        raise ValueError(f"not as they should be: {', '.join(wrong) or 'contacts'}")
    return -min(run.steps, run.solve_time_s)


def _shapes(arrays: Any) -> Any:
    """Return the shape of an array, or those of arrays by their names."""
    return (
        {name: np.shape(it) for name, it in arrays.items()}
        if isinstance(arrays, Mapping)
        else np.shape(arrays)
    )


def off_at_start(trial: Trial) -> float:
    """Return how far the run begins from the scene's own state: in m, rad, and thousandths of the speeds."""
    position, velocity = start_state(trial.scene)
    faster = np.abs(trial.run.velocity[0] - velocity).max() / (1 + np.abs(velocity).max())
    return float(np.max([np.abs(trial.run.position[0] - position).max(), faster / 1000]))


def force_error(trial: Trial) -> float:
    """Return the largest error of forces by accelerations, as a part of the largest force."""
    scene, run = trial.scene, trial.run
    quiet = np.ones(SAMPLES - 1, dtype=bool)  # no contact from the sample before to the one after
    for contact in run.contacts.values():
        quiet &= contact.normal_impulse_N_s[2:] == contact.normal_impulse_N_s[:-2]
    quiet[:2] = False  # a start from rest forces on the first steps (Pymunk's kicks)
    masses = np.array([body.mass_kg for body in scene.mechanism.bodies])[:, None]
    force = masses * accelerations(scene, run)[:, :, :2]
    needed = masses * (run.velocity[2:, :, :2] - run.velocity[:-2, :, :2]) / (2 * run.time_s[1])
    scale = max(np.abs(force[1:-1][quiet]).max(initial=0.0), float((masses * 9.81).max()))
    return float(np.abs(needed - force[1:-1])[quiet].max(initial=0.0) / scale)


def strength_error(trial: Trial) -> float:
    """Return the largest error of an impact's largest force, as a part of the largest of all."""
    own = trial.engine.twin(trial.scene)
    missed, strongest_N, off_N = 0.0, 0.0, 0.0
    for joint, contact in trial.run.contacts.items():
        if own.clearances[joint].law != "rigid":
            true = solved(own, SAMPLES).truth.contacts[joint].impacts
            row = impact_errors(contact.impacts, true, own.end_time_s)
            missed += row["impacts_missed"] + row["impacts_unmatched"]
            strongest_N = max([strongest_N, *true.largest_normal_force_N])
            off_N = max(off_N, row.get(FORCE_ERROR, np.nan if row["impacts_matched"] else 0.0))
    if missed:
        raise ValueError(f"{missed:g} impacts too few or many, none is allowed")
    return off_N / strongest_N if strongest_N else 0.0


def another_time(trial: Trial) -> float:
    """Return how far a second run is from the first, in m, rad or N."""
    first, second = trial.run, trial.again()
    off = [np.abs(first.position - second.position).max()]
    off += [np.abs(force - second.joint_force_N[joint]).max() for joint, force in first.joint_force_N.items()]
    return float(np.max(off))


def states_its_order(engine: Engine) -> Finding:
    """The slider's error falls with the step by the order that the engine states, or with its tolerance."""
    if engine.order is None:
        first, _ = _error(engine, SMOOTH_END_S)
        for _ in range(SHARPENINGS):
            engine = engine.sharper()
        last, _ = _error(engine, SMOOTH_END_S)
        bound = max(first / GAIN, SHARP_M)
        told = f"from {first:.1e} to {last:.1e} m, {SHARPENINGS} times sharper, at most {bound:.1e} m"
        return Finding(last <= bound, f"{told}: a tolerance a thousandth has to bring a hundredth")
    errors, steps = zip(*(_error(engine, LONGEST_S / 2**k) for k in range(HALVINGS + 1)), strict=True)
    order = observed_order(steps, errors, KNOWN_TO_M)
    told = f"{order}, and {engine.order:g} is stated, to be kept within {ORDER:g}"
    holds = order.slope is not None and abs(order.slope - engine.order) <= ORDER
    return Finding(holds, f"{told}: the error is {errors[-1]:.1e} m at a step of {steps[-1]:.1e} s")


def states_its_accuracy(engine: Engine) -> Finding:
    """The slider's error on smooth motion is no more than the engine states, if it does."""
    stated = engine.accuracy_m
    if stated is None:
        return Finding(True, "no accuracy_m is stated")
    off, step_s = _error(engine, LONGEST_S)
    return Finding(off <= stated, f"{off:.1e} m at a step of {step_s:.1e} s, and {stated:.1e} m is stated")


def _error(engine: Engine, step_s: float) -> tuple[float, float]:
    """Return the largest error of the slider's position on smooth motion in m, and the step taken in s."""
    scene = SCENES[SMOOTH]().replace("end_time_s", SMOOTH_END_S)
    engine.check(scene)
    run = engine.simulate(scene, RunSettings(step_s, SAMPLES))
    return _off(scene, run), run.step_s


def _off(scene: Scene, run: Trajectory) -> float:
    """Return the largest distance in m of what a scene observes from its reference solution."""
    truth, _ = converged(scene, SAMPLES)
    return float(np.abs(observed_m(scene, run) - observed_m(scene, truth)).max())


def claim(
    measure: Callable[[Trial], float], bound: float, unit: str, reason: str
) -> Callable[[Trial], Finding]:
    """Return what finds that a number of an engine on a scene is within a bound."""
    return lambda trial: within(measure(trial), bound, unit, reason)


#: The claims by their sentences: of an engine on a scene, and of an engine. Bounds are twice to eight times
#: what the engines here need: first-order ones at their first impacts, Pymunk's sweeps in ideal joints.
CLAIMS = {
    "Arrays have the scene's shapes and the grid's times": claim(
        require_arrays, 0.0, "steps or s", "none but takes time"
    ),
    "The run begins in the scene's own state": claim(off_at_start, 1e-12, "m or rad off", "round-off"),
    "Ideal joints and the guide stay closed": claim(
        lambda trial: float(constraint_violation_m(trial.scene, trial.run).max()),
        *(5e-6, "m apart", "eight times what Pymunk's sweeps leave"),
    ),
    "No energy comes or goes that work and losses do not explain": claim(
        lambda trial: float(unaccounted_part(trial.scene, trial.run).max()),
        *(LEDGER, "of the energy in play", "what first-order engines leave at an impact"),
    ),
    "Forces are those that the accelerations need": claim(
        force_error, 0.02, "of the largest force", "what central differences over two samples are good to"
    ),
    "What the scene observes is where the true solution of the engine's own law has it": claim(
        lambda trial: _off(trial.engine.twin(trial.scene), trial.run),
        *(PLACE_M, "m off", "a tenth of the usual clearance, twice what first-order engines are off"),
    ),
    "Every impact is there, as strong as the converged solution of the engine's own law has it": claim(
        strength_error, STRENGTH, "of the largest force off", "twice what engines with equal steps are"
    ),
    "A second run is the same to the last bit": claim(another_time, 0.0, "off", "no numbers are drawn"),
}
OF_ENGINE = {str(each.__doc__).rstrip("."): each for each in (states_its_order, states_its_accuracy)}


class Verdict(NamedTuple):
    """A claim on a scene; ``scene`` is empty where a claim is about the engine."""

    claim: str
    scene: str
    holds: bool
    measured: str


def verdicts(engine: Engine, scenes: Iterable[str] = ("", *ALL_SCENES)) -> Iterator[Verdict]:
    """Yield the verdicts on an engine, scene by scene that it runs; "" stands for the engine itself."""
    for name in scenes:
        if not name:
            yield from (Verdict(claim, "", *tried(holds, engine)) for claim, holds in OF_ENGINE.items())
            continue
        trial = trial_of(engine, name)
        with suppress(Exception):  # others the claims tell
            try:
                trial.run  # noqa: B018  it is kept
            except (UnsupportedScene, AdapterCannot):
                continue
        yield from (Verdict(claim, name, *tried(holds, trial)) for claim, holds in CLAIMS.items())


def tried(claim: Callable[[Any], Finding], subject: Engine | Trial) -> Finding:
    """Return what a claim found; it does not hold where the engine raises anything, unless it refuses."""
    try:
        return claim(subject)
    except Exception as error:
        refused = isinstance(error, UnsupportedScene) and isinstance(subject, Engine)
        return Finding(refused, f"{type(error).__name__}: {error}")
