"""The crank-slider in the reference solver: the paper's RK4 Lagrange-multiplier algorithm."""

import time
from typing import Annotated, Literal

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass

from engine_models.assembly import assembled
from engine_models.contact_stiffness import elastic_energy_J
from engine_models.engine import (
    JOINTS,
    SETTINGS_CONFIG,
    Contact,
    FloatArray,
    RunSettings,
    SimulationFailed,
    Trajectory,
    UnsupportedScene,
    require_finite,
)
from engine_models.reference_model import CRANK, mechanism_of
from engine_models.scene import Clearance, Scene
from reference_solver.arrays import row_slices
from reference_solver.contact import ContactState
from reference_solver.equations import Baumgarte
from reference_solver.errors import SolverError
from reference_solver.solver import Solution, Stabilisation, make_stepper, record

#: The step at which a contact takes ``steps_per_contact`` steps, and the fewest it takes at any step.
STEP_OF_RATES_S, FEWEST_STEPS_PER_CONTACT = 1e-5, 10.0


@dataclass(frozen=True, config=SETTINGS_CONFIG)
class ReferenceEngine:
    """Settings of the reference solver; the gains in 1/s belong to ``stabilisation = baumgarte``.

    ``kernel`` chooses between the two faces of the algorithm, which agree to round-off. In a scene with
    clearance the run's step is the longest one, taken in flight; a contact takes ``steps_per_contact``
    shorter ones, graded at both ends, and touch and release are located. That number is for a step of 1e-5 s
    and grows as the step falls, so that halving the step halves both. Without ``locate_events`` every step
    has the run's length, as in the paper.
    """

    stabilisation: Literal["none", "baumgarte", "projection"] = "projection"
    baumgarte_alpha_s: Annotated[float, Field(ge=0)] = 100.0
    baumgarte_beta_s: Annotated[float, Field(ge=0)] = 100.0
    kernel: Literal["compiled", "readable"] = "compiled"
    steps_per_contact: Annotated[float, Field(ge=4)] = 100.0
    locate_events: bool = True

    def check(self, scene: Scene) -> None:
        """Raise UnsupportedScene for a rigid contact law, or for contacts in the readable face."""
        mechanism_of(scene)
        if scene.joints_with_clearance and self.kernel == "readable":
            raise UnsupportedScene("reference runs joints with clearance with kernel = compiled only")

    def simulate(self, scene: Scene, settings: RunSettings) -> Trajectory:
        """Run the scene with classical RK4.

        Raises:
            UnsupportedScene: a joint has a rigid contact law, or contacts are asked of the readable face.
            SimulationFailed: singular configuration or overflow.
        """
        self.check(scene)
        start = assembled(scene, scene.start.crank_angle_rad, scene.start.crank_speed_rad_s)
        q, v = (array.ravel() for array in start)
        try:
            if scene.joints_with_clearance:
                return require_finite(self._with_contacts(scene, settings, q, v))
            return require_finite(self._ideal(scene, settings, q, v))
        except SolverError as error:
            raise SimulationFailed(str(error)) from error

    def _stabilisation(self) -> Stabilisation:
        if self.stabilisation == "baumgarte":
            return Baumgarte(self.baumgarte_alpha_s, self.baumgarte_beta_s)
        return self.stabilisation

    def _ideal(self, scene: Scene, settings: RunSettings, q: FloatArray, v: FloatArray) -> Trajectory:
        end, step = scene.end_time_s, settings.step_used_s(scene.end_time_s)
        per_sample = settings.steps_per_sample(end)
        stepper = make_stepper(mechanism_of(scene), q, step, self._stabilisation(), self.kernel == "compiled")
        started = time.perf_counter()
        solution = record(
            stepper, q.copy(), v, end_time_s=end, samples=settings.samples, steps_per_sample=per_sample
        )
        solve_time = time.perf_counter() - started
        return _trajectory(scene, solution, {}, None, step, settings.samples * per_sample, solve_time)

    def _with_contacts(self, scene: Scene, settings: RunSettings, q: FloatArray, v: FloatArray) -> Trajectory:
        from reference_solver.contact_stepper import ContactStepper, StepChoice, record_contacts

        step = settings.step_used_s(scene.end_time_s)
        per_contact = max(FEWEST_STEPS_PER_CONTACT, self.steps_per_contact * STEP_OF_RATES_S / step)
        choice = StepChoice(step, per_contact, self.locate_events)
        stepper = ContactStepper(mechanism_of(scene), q, choice, self._stabilisation())
        started = time.perf_counter()
        run = record_contacts(stepper, q.copy(), v, scene.end_time_s, settings.samples)
        solve_time = time.perf_counter() - started
        contacts = {
            name: _contact(getattr(scene.clearance, name), states)
            for name, states in zip(scene.joints_with_clearance, run.contacts, strict=True)
        }
        lost = run.losses_J.sum(axis=1)
        trajectory = _trajectory(scene, run.motion, contacts, lost, step, run.steps, solve_time)
        for name, states in zip(scene.joints_with_clearance, run.contacts, strict=True):
            force = np.array([state.force_on_pin_N for state in states])
            trajectory.joint_force_N[:, JOINTS.index(name)] = force
        return trajectory


def _contact(clearance: Clearance, states: list[ContactState]) -> Contact:
    penetration = np.array([state.penetration_m for state in states])
    friction = np.array([state.friction_force_N for state in states]) if clearance.friction else None
    return Contact(
        gap_m=np.array([state.gap_m for state in states]),
        penetration_m=penetration,
        normal_force_N=np.array([state.normal_force_N for state in states]),
        friction_force_N=friction,
        elastic_energy_J=elastic_energy_J(clearance, penetration),
    )


def _trajectory(
    scene: Scene,
    solution: Solution,
    contacts: dict[str, Contact],
    lost: FloatArray | None,
    step: float,
    steps: int,
    solve_time: float,
) -> Trajectory:
    """Sort the solver's rows by joint; the force of a joint with clearance is left at zero."""
    mechanism, multipliers = mechanism_of(scene), solution.multipliers
    ideal = [name for name in JOINTS if name not in contacts]
    *joint_rows, guide = row_slices(mechanism)[: len(ideal) + 1]
    joint_force = np.zeros((len(multipliers), len(JOINTS), 2))
    for name, rows in zip(ideal, joint_rows, strict=True):
        joint_force[:, JOINTS.index(name)] = multipliers[:, rows]
    position = solution.q.reshape(-1, 3, 3)
    torque: FloatArray | None = None
    work: FloatArray | None = None
    if scene.drive.kind == "constant-speed":
        torque, work = multipliers[:, -1], solution.constraint_work_J
    elif scene.drive.kind == "torque":
        torque = np.full(len(multipliers), scene.drive.torque_N_m)
        work = torque * (position[:, CRANK, 2] - position[0, CRANK, 2])
    return Trajectory(
        time_s=solution.time_s,
        position=position,
        velocity=solution.v.reshape(-1, 3, 3),
        joint_force_N=joint_force,
        guide_normal_force_N=multipliers[:, guide.start],
        driver_torque_N_m=torque,
        driver_work_J=work,
        step_s=step,
        steps=steps,
        solve_time_s=solve_time,
        contacts=contacts,
        dissipated_energy_J=lost,
    )
