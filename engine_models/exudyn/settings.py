"""Settings of Exudyn's solvers, and which of them runs a scene. Exudyn itself is not imported here."""

from typing import Annotated, Literal

import pydantic
from pydantic import Field

from engine_models.engine import SETTINGS_CONFIG
from engine_models.exudyn.kinematic_tree import closes_a_loop, turns_above
from engine_models.mechanics.loads import integrated_works
from engine_models.scene.scene import Scene
from reference_solver.mechanism.data import GROUND

#: Fixed-step solvers by their orders.
ORDERS = {
    "TrapezoidalIndex2": 2,
    "GeneralizedAlpha": 2,
    "RK67": 6,
    "RK44": 4,
    "RK33": 3,
    "ExplicitMidpoint": 2,
}
IMPLICIT, ADAPTIVE = ("TrapezoidalIndex2", "GeneralizedAlpha"), ("DOPRI5", "ODE23")


@pydantic.dataclasses.dataclass(frozen=True, config=SETTINGS_CONFIG)
class ExudynSettings:
    """Settings of Exudyn's solvers; the defaults are its best practice.

    ``solver = auto`` is the implicit trapezoidal rule for ideal joints and DOPRI5 for joints with clearance,
    wherever its model can be built. Implicit solvers run the absolute model: ideal joints are constraints,
    but for a pin or a guide on the ground. Explicit ones run the tree model, which has no constraint, and
    only scenes whose ideal joints close no loop.
    DOPRI5 and ODE23 choose their steps, up to the run's, for a local error of ``step_tolerance`` in m, rad,
    m/s and rad/s; the others take the run's step. With larger tolerances than are allowed runs have
    overflowed, and Exudyn then went on for ever. ``step_safety`` is the part that they take of the step that
    the error estimate allows: at Exudyn's own 0.9 steps overflow here and there, at 0.8 they have not. With
    ``locate_events`` steps are shortened to end on touch and release, with explicit solvers as closely as
    ``event_gap``, in parts of the tolerance, and grow again; without it they are as they come. A wider gap
    costs fewer steps and is off by more, and by what is luck: 0.03 with a safety of 0.7 takes 0.7 of the time
    near 1e-5 m, and no less below 1e-6 m.

    ``spectral_radius`` (at infinite frequency) matters to the generalized-alpha method alone: 1 would keep
    the spurious oscillation of its multipliers for ever, 0.5 forgets it within some ten steps. Newton's
    method ends when its increment, in m and rad, is below ``newton_tolerance``: residuals are forces, and no
    bound on those fits both a light mechanism and a heavy one. Without a value the bound goes by the angle
    that the quickest body turns in a step (``solver.newton_bound``): on crank-sliders the trapezoidal rule
    then takes two iterations where 1e-12 asks for three to seven, the generalized-alpha method one, at the
    same errors. A bound that is constant costs digits of forces once it is near the increments.
    ``modified_newton`` factorises one Jacobian a step, not one an iteration: full Newton, and Jacobians kept
    over steps, are slower.

    ``fast`` takes Exudyn's build without range checks. A process has the build of its first run.
    A run that takes longer than ``timeout_s`` has failed.
    """

    solver: Literal[
        "auto",
        "TrapezoidalIndex2",
        "GeneralizedAlpha",
        "DOPRI5",
        "ODE23",
        "RK67",
        "RK44",
        "RK33",
        "ExplicitMidpoint",
    ] = "auto"
    step_tolerance: Annotated[float, Field(gt=0, le=1e-4)] = 1e-10
    step_safety: Annotated[float, Field(gt=0, lt=1)] = 0.8
    event_gap: Annotated[float, Field(gt=0, le=1)] = 1e-4
    locate_events: bool = True
    spectral_radius: Annotated[float, Field(ge=0, lt=1)] = 0.5
    newton_tolerance: Annotated[float, Field(gt=0, le=1e-6)] | None = None
    modified_newton: bool = True
    fast: bool = False
    timeout_s: Annotated[float, Field(gt=0)] = 120.0

    def solver_of(self, scene: Scene) -> str:
        """Return the solver that runs a scene: the one set, or what ``auto`` stands for."""
        if self.solver != "auto":
            return self.solver
        has_tree = scene.joints_with_clearance and not no_tree(scene)
        return "DOPRI5" if has_tree else "TrapezoidalIndex2"


def no_tree(scene: Scene) -> str:
    """Return why the scene has no model without constraints, nothing if it has one."""
    of = scene.mechanism
    drive = of.drive
    if closes_a_loop(of):
        return "explicit solvers take no constraints, and ideal joints alone form a closed loop"
    if drive.prescribes and drive.guide is None and turns_above(of, drive.body) != 1:
        driven = of.bodies[drive.body].name
        return f"no coordinate is the angle of {driven}, whose speed is prescribed, but a sum of them"
    if drive.prescribes and drive.guide is not None and of.guides[drive.guide].body_i != GROUND:
        guide = of.guides[drive.guide]
        return f"guide {guide.name} is driven, and its line moves: explicit solvers drive one of the ground"
    return ""


def integrates_work(scene: Scene) -> bool:
    """Return whether a work of the driver or of a load is an integral over every step."""
    return bool(integrated_works(scene))


def steps_as_they_come(engine: ExudynSettings, scene: Scene) -> bool:
    """Return whether samples may lie between steps: with clearance, and without constraints."""
    return bool(scene.joints_with_clearance) or engine.solver_of(scene) not in IMPLICIT
