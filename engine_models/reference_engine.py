"""The crank-slider in the reference solver: the paper's RK4 Lagrange-multiplier algorithm."""

import time
from typing import Annotated, Literal

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass

from engine_models.assembly import assembled
from engine_models.engine import (
    SETTINGS_CONFIG,
    RunSettings,
    SimulationFailed,
    Trajectory,
    require_finite,
    require_ideal,
)
from engine_models.scene import Link, Scene
from reference_solver.arrays import row_slices
from reference_solver.equations import Baumgarte
from reference_solver.errors import SolverError
from reference_solver.mechanism import (
    GROUND,
    Body,
    Mechanism,
    PrescribedSpeed,
    RevoluteJoint,
    StraightGuide,
    Torque,
)
from reference_solver.solver import Stabilisation, make_stepper, record

CRANK, ROD, SLIDER = range(3)


def mechanism_of(scene: Scene) -> Mechanism:
    """Return the scene as a mechanism: joints O, A, B and the guide, then the driver if there is one."""
    crank, rod, slider = scene.crank, scene.rod, scene.slider

    def pins(link: Link) -> tuple[tuple[float, float], tuple[float, float]]:
        return (-link.centre_of_mass_m, 0.0), (link.length_m - link.centre_of_mass_m, 0.0)

    (crank_O, crank_A), (rod_A, rod_B) = pins(crank), pins(rod)
    driven = scene.drive.kind == "constant-speed"
    return Mechanism(
        bodies=tuple(Body(part.mass_kg, part.inertia_kg_m2) for part in (crank, rod, slider)),
        constraints=(
            RevoluteJoint(GROUND, (0.0, 0.0), CRANK, crank_O),
            RevoluteJoint(CRANK, crank_A, ROD, rod_A),
            RevoluteJoint(ROD, rod_B, SLIDER, (0.0, 0.0)),
            StraightGuide(SLIDER, (0.0, 0.0), 0.0),
            *([PrescribedSpeed(CRANK, scene.start.crank_speed_rad_s)] if driven else []),
        ),
        loads=(Torque(CRANK, scene.drive.torque_N_m),) if scene.drive.kind == "torque" else (),
        gravity_m_s2=scene.gravity_m_s2,
    )


@dataclass(frozen=True, config=SETTINGS_CONFIG)
class ReferenceEngine:
    """Settings of the reference solver; the gains in 1/s belong to ``stabilisation = baumgarte``.

    ``kernel`` chooses between the two faces of the algorithm, which agree to round-off.
    """

    stabilisation: Literal["none", "baumgarte", "projection"] = "projection"
    baumgarte_alpha_s: Annotated[float, Field(ge=0)] = 100.0
    baumgarte_beta_s: Annotated[float, Field(ge=0)] = 100.0
    kernel: Literal["compiled", "readable"] = "compiled"

    def simulate(self, scene: Scene, settings: RunSettings) -> Trajectory:
        """Run the scene with fixed-step RK4.

        Raises:
            UnsupportedScene: the scene has joints with clearance.
            SimulationFailed: singular configuration or overflow.
        """
        require_ideal(scene, "reference")
        q, v = (
            a.ravel() for a in assembled(scene, scene.start.crank_angle_rad, scene.start.crank_speed_rad_s)
        )
        stabilisation: Stabilisation = (
            Baumgarte(self.baumgarte_alpha_s, self.baumgarte_beta_s)
            if self.stabilisation == "baumgarte"
            else self.stabilisation
        )
        step = settings.step_used_s(scene.end_time_s)
        steps_per_sample = settings.steps_per_sample(scene.end_time_s)
        stepper = make_stepper(mechanism_of(scene), q, step, stabilisation, self.kernel == "compiled")
        started = time.perf_counter()
        try:
            solution = record(
                stepper,
                q.copy(),
                v,
                end_time_s=scene.end_time_s,
                samples=settings.samples,
                steps_per_sample=steps_per_sample,
            )
        except SolverError as error:
            raise SimulationFailed(str(error)) from error
        solve_time = time.perf_counter() - started
        O, A, B, guide, *driver = row_slices(mechanism_of(scene))  # noqa: E741  the joint's name in the field
        multipliers = solution.multipliers
        position = solution.q.reshape(-1, 3, 3)
        torque = work = None
        if driver:
            torque, work = multipliers[:, driver[0].start], solution.constraint_work_J
        elif scene.drive.kind == "torque":
            torque = np.full(len(multipliers), scene.drive.torque_N_m)
            work = torque * (position[:, CRANK, 2] - position[0, CRANK, 2])
        return require_finite(
            Trajectory(
                time_s=solution.time_s,
                position=position,
                velocity=solution.v.reshape(-1, 3, 3),
                joint_force_N=np.stack([multipliers[:, rows] for rows in (O, A, B)], axis=1),
                guide_normal_force_N=multipliers[:, guide.start],
                driver_torque_N_m=torque,
                driver_work_J=work,
                step_s=step,
                steps=settings.samples * steps_per_sample,
                solve_time_s=solve_time,
            )
        )
