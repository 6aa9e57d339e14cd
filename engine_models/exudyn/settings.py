"""Settings of Exudyn's solvers, and which of them runs a scene. Exudyn itself is not imported here."""

from typing import Annotated, Literal

import pydantic
from pydantic import Field

from engine_models.engine import SETTINGS_CONFIG
from engine_models.mechanics.loads import integrated_parts
from engine_models.scene.scene import Scene

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
    wherever its model can be built. Implicit solvers run the absolute model: every ideal joint but O is a
    constraint. Explicit ones run the tree model, which has no constraint, and only scenes with clearance.
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
    that the crank turns in a step (``solver.newton_bound``): the trapezoidal rule then takes two iterations
    where 1e-12 asks for three to seven, the generalized-alpha method one, at the same errors. A bound that is
    constant costs digits of forces once it is near the increments. ``modified_newton`` factorises one
    Jacobian a step, not one an iteration: full Newton, and Jacobians kept over steps, are slower.

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
        return "TrapezoidalIndex2" if no_tree(scene) else "DOPRI5"


def no_tree(scene: Scene) -> str:
    """Return why the scene has no model without constraints, nothing if it has one."""
    if not scene.joints_with_clearance:
        return "explicit solvers take no constraints, and ideal joints alone form a closed loop"
    if scene.speed_is_prescribed and scene.joints_with_clearance == ("O",):
        return "with clearance at O alone no coordinate is the crank's angle, whose speed is prescribed"
    return ""


def integrates_work(scene: Scene) -> bool:
    """Return whether a work of the driver or of the load is an integral over every step."""
    return scene.speed_is_prescribed or scene.drive.kind == "motor" or bool(integrated_parts(scene))
