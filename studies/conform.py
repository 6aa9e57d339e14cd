"""What every engine owes on every scene that it runs, whatever its method: claims, and what was measured.

Everything is worked out from the scene and the trajectory alone, and from independent reference solutions.
"""

from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cache, cached_property
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np

from engine_models.engine import AdapterCannot, Engine, RunSettings, Trajectory, UnsupportedScene
from engine_models.mechanics.energy import unaccounted_part
from engine_models.mechanics.start import start_state
from engine_models.mechanics.states import observed_m
from engine_models.minimal.forces import Forces
from engine_models.scene.library import ALL_SCENES, SCENES
from engine_models.scene.scene import Scene
from studies.judges.columns import accelerations
from studies.judges.converged_truth import converged, solved
from studies.judges.convergence import observed_order
from studies.judges.impact_matching import FORCE_ERROR, impact_errors
from studies.judges.metrics import constraint_violation_m

if TYPE_CHECKING:
    import pandas as pd

Subject = TypeVar("Subject")

#: Scenes of the library whose speed is constant up to just before their second impact, others through their
#: first: in s, and the steps. Others are given to their end, in so many steps.
END_S, STEP_S = {True: 0.0006, False: 0.004}, {True: 1e-6, False: 4e-6}
STEPS = 1000
SAMPLES = 40
#: The run begins in the scene's own state: in m and rad, and as a part of the speeds.
START, START_SPEED = 1e-12, 1e-9
#: Every ideal joint and the guide are closed to within this in m: Pymunk's sweeps leave the most, 6e-7.
CLOSED_M = 5e-6
#: Energy that no line of the ledger explains, as a part of that in play: first-order engines leave the
#: most, at their first impact.
LEDGER = 2e-3
#: Forces and accelerations by central differences over two samples, as a part of the largest force.
FORCES = 0.02
#: The slider's place, in m: a tenth of the usual clearance. First-order engines are off by the most, 2.7e-5,
#: after rigid impacts in three joints.
PLACE_M = 5e-5
#: The largest force of an impact, as a part of the largest of all: engines that do not end a step on a touch
#: are off by the most, 4.7e-2, in a third impact.
STRENGTH = 0.1


#: Ends in s of the beginnings of mechanisms, which take some thousand steps: Andrews' has to come to speed.
ENDS_S = {
    "offset-crank-slider": 0.01,
    "four-bar": 0.05,
    "four-bar-clearance": 0.006,
    "andrews-squeezer": 0.006,
    "scotch-yoke": 0.03,
    "quick-return": 0.05,
    "v-twin": 0.02,
}
#: Smooth motion on which orders are measured, and until when in s.
SMOOTH, SMOOTH_END_S = "ideal-free", 0.1
#: The longest step in s, and how often it is halved.
LONGEST_S, HALVINGS = 2e-4, 6
#: To what the truth is known in m. It is as much as roundings of 0.2 m add up to by chance in the finest run:
#: the root of its 32 000 steps times 4e-17 m.
KNOWN_TO_M = 1e-14
#: How far the order may be from what is stated.
ORDER = 0.1
#: Sharpened so often, an engine's error falls by so much at least: its tolerance does by 1000.
SHARPENINGS, GAIN = 3, 100.0
#: An error in m that need not fall any further with a tolerance.
SHARP_M = 2e-12


class Finding(NamedTuple):
    """Whether a claim holds, and in words what was measured, with the bound that it has to keep and why."""

    holds: bool
    measured: str


def _within(value: float, bound: float, words: str) -> Finding:
    """Return that a number is within its bound; ``words`` are its unit and the reason of the bound."""
    unit, _, reason = words.partition(": ")
    return Finding(bool(value < bound), f"{value:.1e} {unit}, at most {bound:.0e}: {reason}")


@dataclass(frozen=True)
class Trial:
    """An engine on the beginning of a scene."""

    engine: Engine
    whole: Scene

    @cached_property
    def scene(self) -> Scene:
        """The beginning of the scene."""
        return self._beginning[0]

    @cached_property
    def run(self) -> Trajectory:
        """The engine's run of it."""
        return self.again()

    @cached_property
    def _beginning(self) -> tuple[Scene, float]:
        if self.whole.name not in SCENES:
            return self.whole, self.whole.end_time_s / STEPS
        constant = self.whole.drive.kind == "constant-speed"
        return self.whole.replace("end_time_s", END_S[constant]), STEP_S[constant]

    @cached_property
    def refusal(self) -> str:
        """Why the engine's model does not express the scene, or how it goes on; empty if it does."""
        try:
            self.engine.check(self.whole)
            self.run  # noqa: B018  it is kept
        except (UnsupportedScene, AdapterCannot) as reason:
            return str(reason)
        except Exception:
            return ""  # which the claims tell
        return ""

    def again(self) -> Trajectory:
        """Return another run of it."""
        return self.engine.simulate(self.scene, RunSettings(self._beginning[1], SAMPLES))


def arrays_fit(trial: Trial) -> Finding:
    """Arrays have the scene's shapes and the grid's times."""
    scene, run, n = trial.scene, trial.run, SAMPLES + 1
    own, driven, states = (
        trial.engine.twin(scene),
        scene.drive.kind != "free",
        (n, len(scene.mechanism.bodies), 3),
    )
    expected = {
        "time_s": (n,),
        "position": states,
        "velocity": states,
        "driver_torque_N_m": (n,) if driven else None,
        "driver_work_J": (n,) if driven else None,
        "joint_force_N": dict.fromkeys(scene.joints, (n, 2)),
        "guide_force_N": {guide.name: (n,) for guide in scene.mechanism.guides},
    }
    wrong = [name for name, shape in expected.items() if _shapes(getattr(run, name)) != shape]
    if not np.allclose(run.time_s, np.linspace(0, scene.end_time_s, n), rtol=1e-12, atol=0):
        wrong.append("time_s")
    wrong += [name for name in ("steps", "solve_time_s") if not getattr(run, name) > 0]
    if tuple(run.contacts) != scene.joints_with_clearance:
        wrong.append("contacts")
    for joint, contact in run.contacts.items():
        rubs = own.clearances[joint].friction is not None
        shapes = {"gap_m": (n, 2), "friction_force_N": (n,) if rubs else None}
        shapes |= dict.fromkeys(("penetration_m", "normal_force_N", "normal_impulse_N_s"), (n,))
        wrong += [f"{joint} {it}" for it, shape in shapes.items() if _shapes(getattr(contact, it)) != shape]
    return Finding(not wrong, f"not as they should be: {', '.join(wrong)}" if wrong else "all")


def _shapes(arrays: Any) -> Any:
    """Return the shape of an array, or those of arrays by their names."""
    if isinstance(arrays, Mapping):
        return {name: _shapes(each) for name, each in arrays.items()}
    return None if arrays is None else arrays.shape


def begins_in_the_scenes_state(trial: Trial) -> Finding:
    """The run begins in the scene's own state."""
    position, velocity = start_state(trial.scene)
    off = np.abs(trial.run.position[0] - position).max()
    speed = np.abs(trial.run.velocity[0] - velocity).max() / (1 + np.abs(velocity).max())
    place = f"{off:.1e} m or rad off, at most {START:.0e}"
    rates = f"{speed:.1e} of the speeds, at most {START_SPEED:.0e}: both are round-off"
    return Finding(bool(off <= START and speed <= START_SPEED), f"{place}; {rates}")


def joints_stay_closed(trial: Trial) -> Finding:
    """Ideal joints and the guide stay closed."""
    apart = float(constraint_violation_m(trial.scene, trial.run).max())
    return _within(apart, CLOSED_M, "m apart: eight times what Pymunk's sweeps leave")


def ledger_closes(trial: Trial) -> Finding:
    """No energy comes or goes that work and losses do not explain."""
    left = float(unaccounted_part(trial.scene, trial.run).max())
    return _within(left, LEDGER, "of the energy in play: what first-order engines leave at an impact")


def forces_fit_accelerations(trial: Trial) -> Finding:
    """Forces are those that the accelerations need."""
    scene, run = trial.scene, trial.run
    quiet = np.ones(SAMPLES - 1, dtype=bool)  # no contact from the sample before to the one after
    for contact in run.contacts.values():
        quiet &= contact.normal_impulse_N_s[2:] == contact.normal_impulse_N_s[:-2]
    quiet[:2] = False  # a start from rest forces on the first steps (Pymunk's kicks)
    masses = np.array([body.mass_kg for body in scene.mechanism.bodies])[:, None]
    force = masses * accelerations(Forces(scene), run)[:, :, :2]
    needed = masses * (run.velocity[2:, :, :2] - run.velocity[:-2, :, :2]) / (2 * run.time_s[1])
    scale = max(np.abs(force[1:-1][quiet]).max(initial=0.0), float((masses * 9.81).max()))
    off = float(np.abs(needed - force[1:-1])[quiet].max(initial=0.0) / scale)
    return _within(off, FORCES, "of the largest force: what central differences over two samples are good to")


def observed_is_where_it_should_be(trial: Trial) -> Finding:
    """What the scene observes is where the true solution of the engine's own law has it."""
    return _within(
        _off(trial.engine.twin(trial.scene), trial.run), PLACE_M, "m off: a tenth of the usual clearance"
    )


def impacts_are_as_strong_as_they_should_be(trial: Trial) -> Finding:
    """Every impact is there, as strong as the converged solution of the engine's own law has it."""
    own = trial.engine.twin(trial.scene)
    missed, strongest_N, off_N = 0.0, 0.0, 0.0
    for joint, contact in trial.run.contacts.items():
        if own.clearances[joint].law != "rigid":
            true = solved(own, SAMPLES).truth.contacts[joint].impacts
            row = impact_errors(contact.impacts, true, own.end_time_s)
            missed += row["impacts_missed"] + row["impacts_unmatched"]
            strongest_N = max([strongest_N, *true.largest_normal_force_N])
            off_N = max(off_N, row.get(FORCE_ERROR, np.nan if row["impacts_matched"] else 0.0))
    part = off_N / strongest_N if strongest_N else 0.0
    reason = "twice what engines that end no step on a touch are"
    holds, measured = _within(part, STRENGTH, f"of the largest force off: {reason}")
    return Finding(holds and not missed, f"{missed:g} impacts too few or many, none is allowed; {measured}")


def repeats_itself(trial: Trial) -> Finding:
    """A second run is the same to the last bit."""
    first, second = trial.run, trial.again()
    same = np.array_equal(first.position, second.position) and all(
        np.array_equal(force, second.joint_force_N[joint]) for joint, force in first.joint_force_N.items()
    )
    return Finding(same, "the same" if same else "another, and an engine draws no numbers")


@cache
def scene_of(name: str) -> Scene:
    """Return a scene of the library, or the beginning of a mechanism."""
    scene = ALL_SCENES[name]()
    return scene.replace("end_time_s", ENDS_S[name]) if name in ENDS_S else scene


def states_its_order(engine: Engine) -> Finding:
    """The slider's error falls with the step by the order that the engine states, or with its tolerance."""
    scene = smooth_scene(engine)
    if engine.order is None:
        first, _ = _error(engine, scene, scene.end_time_s)
        for _ in range(SHARPENINGS):
            engine = engine.sharper()
        last, _ = _error(engine, scene, scene.end_time_s)
        bound = max(first / GAIN, SHARP_M)
        told = f"from {first:.1e} to {last:.1e} m, {SHARPENINGS} times sharper, at most {bound:.1e} m"
        return Finding(last <= bound, f"{told}: a tolerance a thousandth has to bring a hundredth")
    errors, steps = zip(*(_error(engine, scene, LONGEST_S / 2**k) for k in range(HALVINGS + 1)), strict=True)
    order = observed_order(steps, errors, KNOWN_TO_M)
    told = f"{order}, and {engine.order:g} is stated, to be kept within {ORDER:g}"
    holds = order.slope is not None and abs(order.slope - engine.order) <= ORDER
    return Finding(holds, f"{told}: the error is {errors[-1]:.1e} m at a step of {steps[-1]:.1e} s")


def states_its_accuracy(engine: Engine) -> Finding:
    """The slider's error on smooth motion is no more than the engine states, if it does."""
    stated = engine.accuracy_m
    if stated is None:
        return Finding(True, "no accuracy_m is stated")
    off, step_s = _error(engine, smooth_scene(engine), LONGEST_S)
    return Finding(off <= stated, f"{off:.1e} m at a step of {step_s:.1e} s, and {stated:.1e} m is stated")


def smooth_scene(engine: Engine) -> Scene:
    """Return smooth motion; raise UnsupportedScene where an engine has no model of it."""
    scene = SCENES[SMOOTH]().replace("end_time_s", SMOOTH_END_S)
    engine.check(scene)
    return scene


def _error(engine: Engine, scene: Scene, step_s: float) -> tuple[float, float]:
    """Return the largest error of the slider's position in m, and the step that was taken in s."""
    run = engine.simulate(scene, RunSettings(step_s, SAMPLES))
    return _off(scene, run), run.step_s


def _off(scene: Scene, run: Trajectory) -> float:
    """Return the largest distance in m of what a scene observes from its reference solution."""
    truth, _ = converged(scene, SAMPLES)
    return float(np.abs(observed_m(scene, run) - observed_m(scene, truth)).max())


#: The claims by their sentences: of an engine on a scene, and of an engine.
CLAIMS: dict[str, Callable[[Trial], Finding]] = {
    str(claim.__doc__).rstrip("."): claim
    for claim in (
        arrays_fit,
        begins_in_the_scenes_state,
        joints_stay_closed,
        ledger_closes,
        forces_fit_accelerations,
        observed_is_where_it_should_be,
        impacts_are_as_strong_as_they_should_be,
        repeats_itself,
    )
}
OF_ENGINE: dict[str, Callable[[Engine], Finding]] = {
    str(claim.__doc__).rstrip("."): claim for claim in (states_its_order, states_its_accuracy)
}


class Verdict(NamedTuple):
    """A claim on a scene; ``scene`` is empty where a claim is about the engine."""

    claim: str
    scene: str
    holds: bool
    measured: str


def scenes_of(engine: Engine) -> list[str]:
    """Return the scenes that an engine runs."""
    runs = []
    for name in ALL_SCENES:
        with suppress(UnsupportedScene):
            engine.check(scene_of(name))
            runs.append(name)
    return runs


def verdicts(engine: Engine) -> Iterator[Verdict]:
    """Yield the verdicts on an engine, scene by scene."""
    for claim, holds_of in OF_ENGINE.items():
        yield Verdict(claim, "", *tried(holds_of, engine))
    for scene in scenes_of(engine):
        trial = Trial(engine, scene_of(scene))
        for claim, holds in CLAIMS.items() if not trial.refusal else ():
            yield Verdict(claim, scene, *tried(holds, trial))


def tried(claim: Callable[[Subject], Finding], subject: Subject) -> Finding:
    """Return what a claim found; it does not hold where the engine raises anything, unless it refuses."""
    try:
        return claim(subject)
    except Exception as error:
        refused = isinstance(error, UnsupportedScene) and isinstance(subject, Engine)
        return Finding(refused, f"{type(error).__name__}: {error}")


def verdicts_on_table(columns: "pd.DataFrame", truth: "pd.DataFrame") -> Iterator[Verdict]:
    """Yield a verdict on each column of another solver's table, up to where the reference solution is known.

    Both have the same columns at the same times, ``time_s`` among them.
    """
    for name in truth.columns.drop("time_s"):
        off = float((columns[name] - truth[name]).abs().max())
        largest = float(truth[name].abs().max())
        bound = PLACE_M if name.endswith("position_m") else STRENGTH * largest
        words = f"off, the largest is {largest:.3g}: what is asked of every engine"
        yield Verdict(name, "", *_within(off, bound, words))
