"""The independent solution of a scene with clearance as a trajectory, by a method at a tolerance.

Forces are Newton's of the bodies' accelerations, from a joint whose contact tells its own to the others.
Conventions and signs are those of ``engine.Trajectory``.
"""

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from engine_models.engine import (
    Contact,
    Impacts,
    RunSettings,
    SimulationFailed,
    Trajectory,
    UnsupportedScene,
)
from engine_models.scene.scene import Clearance, Scene
from studies.independent import loads
from studies.independent.equations import (
    CONTACT,
    FOLLOWS,
    FRICTION,
    NORMAL,
    OF_JOINT,
    SUMS,
    TIME,
    TORQUE,
    WORK,
    kinematics,
)
from studies.independent.mechanism import JOINTS, SIZE, FloatArray, Mechanism
from studies.independent.motion import SHORTEST_FLIGHT_S, STEPS, Motion
from studies.independent.rigid_walls import Paradox
from studies.independent.stepping import collocated, extrapolated, extrapolation, radau

#: Steps, and trials for events, after which a scene is given up: the library's take some 15,000.
MOST_STEPS = 300_000
#: Stages of the collocation.
STAGES = 7
#: The bodies' coordinates among the rows of ``equations.kinematics``.
CRANK, ROD, SLIDER = slice(0, 3), slice(3, 6), 6


@dataclass(frozen=True)
class Sample:
    """A moment of a motion: its state in the coordinates w, the bodies' motion, and what is told.

    Position, velocity and acceleration are (bodies, 3), ``told`` (4, 3) is as in ``equations``.
    """

    y: FloatArray
    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    told: FloatArray


@dataclass(frozen=True)
class IndependentSolver:
    """Gragg, Bulirsch and Stoer's extrapolation or Radau's collocation, in minimal coordinates."""

    method: Literal["extrapolation", "collocation"]
    tolerance: float
    shortest_flight_s: float = SHORTEST_FLIGHT_S

    def simulate(self, scene: Scene, settings: RunSettings) -> Trajectory:
        """Run a scene; steps are as long as the tolerance lets them be.

        Raises:
            UnsupportedScene: there is no clearance, or a pin begins in a rigid wall.
            SimulationFailed: too many steps, a rod at right angles to its guide, forces that do not fit.
        """
        if not scene.joints_with_clearance:
            raise UnsupportedScene("no joint has clearance: there is a closed form for that")
        explicit = self.method == "extrapolation"
        table = extrapolation(self.tolerance) if explicit else radau(STAGES, self.tolerance)
        step = extrapolated if explicit else collocated
        try:
            motion = Motion(scene, step, table, MOST_STEPS, 0.0, self.shortest_flight_s)
        except ValueError as error:
            raise UnsupportedScene(str(error)) from error
        began, samples = time.perf_counter(), []
        times = settings.times_s(scene)
        for t in times.tolist():
            try:
                reached = motion.to(t)
            except (Paradox, np.linalg.LinAlgError) as error:
                raise SimulationFailed(f"{error} at t = {motion.time_s:.6g} s") from error
            if not reached:
                raise SimulationFailed(f"no more than {MOST_STEPS} steps, by t = {motion.time_s:.6g} s")
            samples.append(_sample(motion, len(scene.bodies)))
        return _trajectory(scene, motion, times, samples, time.perf_counter() - began)


def _sample(motion: Motion, bodies: int) -> Sample:
    """Return the moment that a motion has reached."""
    m, y = motion.mechanism, motion.y
    out, told = motion.answer()
    acceleration = out[SIZE:TIME].copy()
    for k in np.flatnonzero(motion.phases[:, CONTACT] == FOLLOWS).tolist():
        x = 2 * k + 1
        d, psi_2, turn = y[x : x + 2], acceleration[x], motion.z[SIZE + x] ** 2
        acceleration[x : x + 2] = psi_2 * np.array([-d[1], d[0]]) - turn * d
    J, bias = np.empty((SIZE, SIZE)), np.empty(SIZE)
    x_slider = kinematics(m.bodies, y, J, bias)
    position = _places(m, y, x_slider)
    moving, pushed = (_of_bodies(row) for row in (J @ y[SIZE:TIME], J @ acceleration + bias))
    first = slice(bodies)
    return Sample(y, position[first], moving[first], pushed[first], told)


def _of_bodies(row: FloatArray) -> FloatArray:
    """Return what ``kinematics`` has in a row (SIZE,) as (3, 3); the slider neither rises nor turns."""
    return np.array([row[CRANK], row[ROD], [row[SLIDER], 0.0, 0.0]])


def _places(m: Mechanism, y: FloatArray, x_slider: float) -> FloatArray:
    """Return the positions (3, 3) of the bodies."""
    b, theta = m.bodies, y[0]
    along = np.array([math.cos(theta), math.sin(theta)])
    pin = y[1:3] + b.crank_m * along + y[3:5]
    phi = math.asin(-(pin[1] + y[6]) / b.rod_m)
    rod = pin + b.rod_centre_m * np.array([math.cos(phi), math.sin(phi)])
    return np.array([[*(y[1:3] + b.crank_centre_m * along), theta], [*rod, phi], [x_slider, 0.0, 0.0]])


def _trajectory(
    scene: Scene, motion: Motion, times: FloatArray, samples: Sequence[Sample], took_s: float
) -> Trajectory:
    states, told = (np.array([getattr(s, name) for s in samples]) for name in ("y", "told"))
    contacts = {}
    for k, name in enumerate(JOINTS):
        clearance: Clearance | None = getattr(scene.clearance, name)
        if clearance is not None:
            contacts[name] = _contact(clearance, motion, k, states, told[:, k])
    joint_force, guide = _forces(scene, samples, contacts)
    has_drive = scene.drive.kind != "free"
    works = dict(zip(loads.PARTS, states[:, WORK + 1 :].T, strict=True))
    steps = int(motion.clock[STEPS])
    return Trajectory(
        time_s=times,
        position=np.array([s.position for s in samples]),
        velocity=np.array([s.velocity for s in samples]),
        joint_force_N=joint_force,
        guide_force_N=guide,
        guide_moment_N_m={name: -_turned_by_B(scene, contacts) + 0 * force for name, force in guide.items()},
        driver_torque_N_m=told[:, TORQUE, 0] if has_drive else None,
        driver_work_J=states[:, WORK] if has_drive else None,
        step_s=scene.end_time_s / steps,
        steps=steps,
        solve_time_s=took_s,
        contacts=contacts,
        load_work_J={part: works[part] for part in _parts(scene)},
    )


def _parts(scene: Scene) -> list[str]:
    """Return which parts the slider's load has."""
    load = scene.load.slider
    if load is None:
        return []
    there = (load.force_N, load.viscous_N_s_m, load.spring_N_m, load.gas)
    return [part for part, value in zip(loads.PARTS, there, strict=True) if value]


def _contact(clearance: Clearance, motion: Motion, k: int, states: FloatArray, told: FloatArray) -> Contact:
    """Return what joint k did, from states (n, STATE) and what they told of it (n, 3)."""
    walls, x = motion.mechanism.walls, 2 * k + 1
    gap, sums = states[:, x : x + 2], states[:, SUMS + OF_JOINT * k : SUMS + OF_JOINT * (k + 1)]
    depth = np.hypot(*gap.T) - walls.c[k]
    elastic = np.zeros(len(depth))
    if clearance.law != "rigid":
        elastic = walls.K[k] * np.maximum(depth, 0.0) ** (walls.n[k] + 1) / (walls.n[k] + 1)
    rubs, clips = clearance.friction is not None, walls.a[k] > 0 and not clearance.may_pull
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


def _forces(
    scene: Scene, samples: Sequence[Sample], contacts: dict[str, Contact]
) -> tuple[dict[str, FloatArray], dict[str, FloatArray]]:
    """Return joint forces (n, 2) and the guide's (n,), body by body from a joint with clearance."""
    weight = np.array([0.0, scene.weight_m_s2])
    masses = np.array([body.mass_kg for body in scene.bodies])
    # All forces on each body, (n, bodies, 2), but its weight and its load.
    pushed = masses[:, None] * (np.array([s.acceleration[:, :2] for s in samples]) + weight)
    known = {name: _force_on_pin(contact) for name, contact in contacts.items()}
    if not scene.is_crank_slider:
        return known, {}
    crank, rod = pushed[:, 0], pushed[:, 1]
    if "A" not in known:
        known["A"] = rod + known["B"] if "B" in known else known["O"] - crank
    forces = (known.get("O", crank + known["A"]), known["A"], known.get("B", known["A"] - rod))
    guide = masses[2] * scene.weight_m_s2 - forces[2][:, 1]
    return dict(zip(JOINTS, forces, strict=True)), {"guide": guide}


def _turned_by_B(scene: Scene, contacts: dict[str, Contact]) -> FloatArray | float:
    """Return the torque on the slider, (n,), of the friction on its pin: at half of the penetration."""
    room, contact = scene.clearance.B, contacts.get("B")
    if room is None or contact is None or contact.friction_force_N is None:
        return 0.0
    pin_m = room.bearing_radius_m - room.radial_clearance_m
    return np.asarray((pin_m - np.maximum(contact.penetration_m, 0.0) / 2) * contact.friction_force_N)


def _force_on_pin(contact: Contact) -> FloatArray:
    """Return -F_n n + F_t t, (n, 2)."""
    distance = np.hypot(*contact.gap_m.T)
    n = contact.gap_m / np.where(distance > 0, distance, 1.0)[:, None]
    force = -contact.normal_force_N[:, None] * n
    if contact.friction_force_N is not None:
        force += contact.friction_force_N[:, None] * np.stack([-n[:, 1], n[:, 0]], axis=1)
    return np.asarray(force)
