"""The search of settings behind the ladders: every arm again with a knob turned, in error and in time.

It is no study of the report but what ``studies.ladders`` rests on: ``crankslider search`` runs it and keeps
the record. Errors and times are measured as in ``work-precision``.
"""

from collections.abc import Iterator
from dataclasses import replace
from random import Random

from engine_models import arms
from engine_models.arms import Arm, Setting
from engine_models.scene.library import SCENES
from engine_models.scene.scene import Scene
from studies import clearance
from studies.ladders import Rung, by_step, contact_step_s
from studies.running.case import Case, Curves, Row
from studies.running.execution import Limits
from studies.work_precision import study as work_precision
from studies.work_precision.study import ROUNDS, SAMPLES, case_of, ladder

#: Scenes on which the settings were chosen, and what the full search adds: scenes that had no say in them.
CHOSEN_ON = ("ideal-free", "ideal-driven", "clearance-free-0.5mm", "clearance-driven-0.5mm")
UNSEEN = ("ideal-compressor", "clearance-driven-AB", "clearance-compressor", "rigid-free-0.5mm")

#: Some settings have no end: Exudyn's DOPRI5 at its shortest step tries again and again. Compiling counts.
LIMITS = Limits(time_limit_s=60.0, memory_limit_bytes=4 * 2**30)

#: What Pymunk's model is built of, and the order of its joints.
OF_PYMUNK: dict[str, tuple[Setting, ...]] = {"joints": ("all",), "joint_order": ("reversed",)}
#: Settings tried in place of an arm's own, one at a time.
KNOBS: dict[Arm, dict[str, tuple[Setting, ...]]] = {
    arms.LOCATED: {"steps_per_contact": (12.0, 25.0, 100.0, 200.0), "stabilisation": ("none", "baumgarte")},
    arms.PROJECTION: {"stabilisation": ("baumgarte",)},
    arms.REFERENCE_DOP853: {"stabilisation": ("none",), "method": ("dopri5",)},
    arms.TRAPEZOIDAL: {
        "newton_tolerance": (1e-6, 1e-8, 1e-10, 1e-12),
        "modified_newton": (False,),
        "fast": (False,),
    },
    arms.GENERALIZED_ALPHA: {
        "newton_tolerance": (1e-6, 1e-9, 1e-12),
        "spectral_radius": (0.0, 0.3, 0.7, 0.9),
        "modified_newton": (False,),
    },
    arms.DOPRI5: {"fast": (False,), "step_safety": (0.7, 0.9), "event_gap": (1e-3, 1e-2, 0.03)},
    arms.WIDE_GAP: {"step_safety": (0.8, 0.9), "event_gap": (0.01, 0.1)},
    arms.TUNED: {
        **OF_PYMUNK,
        "iterations": (1, 2, 3, 4, 8),
        "half_kick_start": (False,),
        "error_bias": (1e-6,),
    },
    arms.AS_THE_SCENE: {**OF_PYMUNK, "iterations": (2, 4, 8)},
    arms.SHORTER_IN_CONTACT: {
        **OF_PYMUNK,
        "iterations": (2, 4, 8),
        "shorter_in_contact": (4.0, 8.0, 12.0),
    },
    arms.NATIVE_CONTACT: {**OF_PYMUNK, "contact_iterations": (50, 100, 400), "iterations": (2, 4, 8)},
    arms.SCIPY_DOP853: {"method": ("RK45",)},
    arms.LSODA: {"atol": (1e-10, 1e-14)},
    arms.ODEINT: {"method": ("LSODA",), "atol": (1e-10, 1e-14)},
    arms.ODE: {"method": ("DOP853",)},
}
#: Fixed-step solvers of Exudyn that no ladder has; they need the tree model, and so joints with clearance.
MORE_SOLVERS = ("RK67", "RK44", "RK33", "ExplicitMidpoint", "GeneralizedAlpha")


def scenes(full: bool) -> list[Scene]:
    """Return the scenes, those with clearance cut to the time for which they are followed."""
    names = CHOSEN_ON + (UNSEEN if full else ())
    made = [SCENES[name]() for name in names]
    ends = [clearance.END_S.get(scene.name, scene.end_time_s) for scene in made]
    return [scene.model_copy(update={"end_time_s": end}) for scene, end in zip(made, ends, strict=True)]


def cases(full: bool) -> list[Case]:
    """Return the recorded run of every rung, turned or not, then shuffled rounds of bare runs of all."""
    rungs = [(scene, rung, turned) for scene in scenes(full) for rung, turned in _turned(scene)]
    out = [case_of(__name__, scene, rung, SAMPLES, turned=turned) for scene, rung, turned in rungs]
    for k in range(ROUNDS):
        for scene, rung, turned in Random(k).sample(rungs, len(rungs)):
            out.append(case_of(__name__, scene, rung, 1, timed=True, round=k, turned=turned))
    limited = [replace(one, limits=LIMITS) for one in out]
    return list({str(one.head()): one for one in limited}.values())  # samples may cut two rungs to one step


def measure(case: Case) -> tuple[Row, Curves]:
    """Return what ``work_precision.measure`` does."""
    return work_precision.measure(case)


def _turned(scene: Scene) -> Iterator[tuple[Rung, str]]:
    """Yield the rungs of all ladders, and each with every knob turned, with what was turned."""
    yield from ((rung, f"solver = {rung.arm.name}") for rung in _more(scene))
    for rung in ladder(scene, full=False):
        yield rung, ""
        for knob, settings in KNOBS.get(rung.arm, {}).items():
            for setting in settings:
                yield replace(rung, added={**rung.added, knob: setting}), f"{knob} = {setting}"


def _more(scene: Scene) -> list[Rung]:
    """Return ladders of Exudyn's other solvers where they can run."""
    if not scene.joints_with_clearance:
        return []
    longest = contact_step_s(scene)
    others = [Arm("exudyn", solver, {"solver": solver}) for solver in MORE_SOLVERS]
    return [rung for arm in others for rung in by_step(arm, longest, 4, fast=True)]
