"""The true solution of a scene of any mechanism as a trajectory, by a method at a tolerance.

Conventions and signs are those of ``engine.Trajectory``.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from engine_models.engine import (
    Contact,
    Impacts,
    ImpossibleStart,
    RunSettings,
    SimulationFailed,
    Trajectory,
    UnsupportedScene,
)
from engine_models.scene.parts import AnyScene
from engine_models.scene.scene import Scene
from reference_solver.mechanism.data import ClearanceData, MechanismData
from studies.truth.equations import FRICTION, NORMAL
from studies.truth.forces import reactions
from studies.truth.motion import SHORTEST_FLIGHT_S, STEPS, Motion
from studies.truth.physics import A, C, K, N
from studies.truth.record import OF_JOINT, OF_TOLD
from studies.truth.rigid_walls import Paradox
from studies.truth.stepping import collocated, extrapolated, extrapolation, radau

FloatArray = NDArray[np.float64]
#: Steps, and trials for events, after which a scene is given up: the library's take some 15,000.
MOST_STEPS = 300_000
#: Stages of the collocation.
STAGES = 7


@dataclass(frozen=True)
class Sample:
    """A moment of a motion: coordinates, sums, the bodies' motion (bodies, 3) each, and what is told."""

    u: FloatArray
    sums: FloatArray
    told: FloatArray
    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray


@dataclass(frozen=True)
class TrueSolver:
    """Gragg, Bulirsch and Stoer's extrapolation or Radau's collocation, in coordinates of a spanning tree."""

    method: Literal["extrapolation", "collocation"]
    tolerance: float
    shortest_flight_s: float = SHORTEST_FLIGHT_S

    def simulate(self, scene: AnyScene, settings: RunSettings) -> Trajectory:
        """Run a scene; steps are as long as the tolerance lets them be.

        Raises:
            UnsupportedScene: a pin begins in a rigid wall, or no start closes the joints.
            SimulationFailed: too many steps, loops that do not close, forces that do not fit.
        """
        explicit = self.method == "extrapolation"
        method = extrapolation(self.tolerance) if explicit else radau(STAGES, self.tolerance)
        step = extrapolated if explicit else collocated
        try:
            motion = Motion(scene, step, method, MOST_STEPS, self.shortest_flight_s)
        except ImpossibleStart as error:
            raise UnsupportedScene(str(error)) from error
        began, samples = time.perf_counter(), []
        times = settings.times_s(scene)
        for t in times.tolist():
            try:
                reached = motion.to(t)
            except (Paradox, np.linalg.LinAlgError) as error:
                raise SimulationFailed(f"{error} at t = {motion.time_s:.6g} s") from error
            if not reached:
                spent = motion.clock[STEPS] >= MOST_STEPS
                why = f"no more than {MOST_STEPS} steps" if spent else "no step is short enough"
                raise SimulationFailed(f"{why}, by t = {motion.time_s:.6g} s")
            samples.append(_sample(motion))
        return _trajectory(scene, motion, times, samples, time.perf_counter() - began)


def _sample(motion: Motion) -> Sample:
    """Return the moment that a motion has reached."""
    _, told = motion.answer()
    sums = motion.z[motion.time + 1 :].copy()
    return Sample(motion.mechanism.work.u.copy(), sums, told, *motion.bodies())


def _trajectory(
    scene: AnyScene, motion: Motion, times: FloatArray, samples: Sequence[Sample], took_s: float
) -> Trajectory:
    names = ("u", "sums", "told", "position", "velocity", "acceleration")
    u, sums, told, position, velocity, acceleration = (
        np.array([getattr(sample, name) for sample in samples]) for name in names
    )
    of, joints, built = scene.mechanism, motion.joints, motion.built
    contacts = {}
    for k, pin in enumerate(of.loose):
        assert pin.clearance is not None
        own = sums[:, OF_JOINT * k : OF_JOINT * (k + 1)], told[:, OF_TOLD * k : OF_TOLD * (k + 1)]
        contacts[pin.name] = _contact(
            pin.clearance, motion, k, u[:, built.layout.gaps[pin.name] :][:, :2], *own
        )
    acting = told[:, OF_TOLD * joints :]
    effort = acting[:, 0] if of.drive.law is not None else None
    parts = dict(zip(built.parts, acting[:, 1:].T, strict=True))
    forces, across, moments = reactions(of, position, acceleration, contacts, parts, effort)
    works = sums[:, OF_JOINT * joints :]
    steps = int(motion.clock[STEPS])
    return Trajectory(
        time_s=times,
        position=position,
        velocity=velocity,
        joint_force_N=forces,
        guide_force_N=across,
        driver_torque_N_m=effort,
        driver_work_J=None if effort is None else works[:, 0],
        step_s=scene.end_time_s / steps,
        steps=steps,
        solve_time_s=took_s,
        contacts=contacts,
        load_work_J=_works(scene, of, dict(zip(built.parts, works[:, 1:].T, strict=True))),
        guide_moment_N_m=moments,
    )


def _works(scene: AnyScene, of: MechanismData, works: dict[str, FloatArray]) -> dict[str, FloatArray]:
    """Return works by the names of ``Trajectory``; of springs only dampers' have no potential."""
    short = "slider." if isinstance(scene, Scene) else ""
    undamped = {f"spring:{spring.name}" for spring in of.springs if not spring.damping_N_s_m}
    return {name.removeprefix(short): work for name, work in works.items() if name not in undamped}


def _contact(
    room: ClearanceData, motion: Motion, k: int, gap: FloatArray, sums: FloatArray, told: FloatArray
) -> Contact:
    """Return what joint k did, from its gap (n, 2), sums (n, 4) and what was told of it (n, 3)."""
    wall = motion.mechanism.walls[k]
    depth = np.hypot(*gap.T) - wall[C]
    elastic = np.zeros(len(depth))
    if room.law != "rigid":
        elastic = wall[K] * np.maximum(depth, 0.0) ** (wall[N] + 1) / (wall[N] + 1)
    rubs, clips = room.friction is not None, wall[A] > 0 and not room.may_pull
    over = np.array(motion.contacts[k]).reshape(-1, 5)
    over = np.pad(over[np.argsort(over[:, 0], kind="stable")], ((0, 0), (0, 4)), constant_values=np.nan)
    return Contact(
        gap_m=gap,
        penetration_m=depth,
        normal_force_N=told[:, NORMAL],
        friction_force_N=told[:, FRICTION] if rubs else None,
        elastic_energy_J=elastic,
        normal_impulse_N_s=sums[:, 0],
        normal_loss_J=sums[:, 1],
        friction_loss_J=sums[:, 3] if rubs else None,
        clipped_loss_J=sums[:, 2] if clips else None,
        impacts=Impacts(*over.T),
    )
