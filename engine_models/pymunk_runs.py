"""One run of a Pymunk model: which steps to read, and what their states and contacts say at the samples."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pymunk
from numpy.typing import NDArray

from engine_models.assembly import start_state
from engine_models.engine import Contact, FloatArray, RunSettings, Trajectory, require_finite
from engine_models.pymunk_checks import require_the_mechanism
from engine_models.pymunk_compliant import CompliantContact
from engine_models.pymunk_contacts import ContactLog
from engine_models.pymunk_forces import gaps, reactions
from engine_models.pymunk_model import Bodies, crank_is_kinematic
from engine_models.pymunk_rigid import RigidContact
from engine_models.pymunk_stepping import run
from engine_models.scene import Scene


@dataclass(frozen=True)
class Model:
    """A scene in Pymunk at t = 0: its space, bodies and contacts by joint, O to B."""

    scene: Scene
    space: pymunk.Space
    bodies: Bodies
    contacts: Mapping[str, CompliantContact | RigidContact]


class Timing:
    """The steps of a run: which are read, which of those are samples, how many touch rigid walls."""

    def __init__(self, scene: Scene, settings: RunSettings) -> None:
        self.dt, per_sample = (
            settings.step_used_s(scene.end_time_s),
            settings.steps_per_sample(scene.end_time_s),
        )
        self.steps = settings.samples * per_sample
        # The driver's work needs the torque at every step, all else is asked for at the samples alone.
        driven = scene.drive.kind == "constant-speed"
        self.wanted = np.arange(0, self.steps + 1, 1 if driven else per_sample)
        self.sampled = slice(None, None, per_sample if driven else 1)
        # The step before a wanted one tells the kick, the first few what kicks 0 and 1 should have been.
        self.read: NDArray[np.int64] = np.unique(
            np.concatenate([self.wanted, self.wanted[1:] - 1, np.arange(5)])
        )


def trajectory_of(model: Model, settings: RunSettings, half_kick_start: bool) -> Trajectory:
    """Run the model with fixed steps; see ``PymunkEngine`` for what is reported.

    Raises:
        SimulationFailed: a joint came apart, a pin went through a wall, the rod turned over, or the numbers
            overflowed.
    """
    scene, timing = model.scene, Timing(model.scene, settings)
    dt, wanted, sampled = timing.dt, timing.wanted, timing.sampled
    x, v, solve_time = run(
        model.space,
        model.bodies,
        dt,
        crank_torque_N_m=scene.drive.torque_N_m if scene.drive.kind == "torque" else None,
        half_kick_start=half_kick_start,
        read_after=timing.read,
    )
    for contact in model.contacts.values():
        contact.finish()
    logs = {name: ContactLog(contact.steps, contact.clips) for name, contact in model.contacts.items()}
    touches = [logs[name].touches for name in logs if getattr(scene.clearance, name).law == "rigid"]
    struck = np.isin(wanted, np.concatenate(touches)) if touches else np.zeros(len(wanted), dtype=bool)
    position, velocity, acceleration = _motion(scene, timing, x, v, struck, half_kick_start)
    require_the_mechanism(scene, position, np.asarray(dt * wanted, dtype=np.float64))
    # A kick's work is half done at its own time, unless it strikes: then it is all to come (or all over).
    share = np.where(struck, 0.0 if half_kick_start else 1.0, 0.5)
    gap = gaps(scene, position)
    contacts = {
        name: log.contact(getattr(scene.clearance, name), gap[name], wanted, share, dt, timing.steps)
        for name, log in logs.items()
    }
    force, guide, torque = reactions(scene, position, acceleration, contacts)
    work = _driver_work(scene, position, torque, dt, share)
    if scene.drive.kind == "torque":
        torque = np.full_like(torque, scene.drive.torque_N_m)
    return require_finite(
        Trajectory(
            time_s=np.linspace(0.0, scene.end_time_s, settings.samples + 1),
            position=position[sampled],
            velocity=velocity[sampled],
            joint_force_N=force[sampled],
            guide_normal_force_N=None if guide is None else guide[sampled],
            driver_torque_N_m=None if work is None else torque[sampled],
            driver_work_J=None if work is None else work[sampled],
            step_s=dt,
            steps=timing.steps,
            solve_time_s=solve_time,
            contacts={name: _at(contact, sampled) for name, contact in contacts.items()},
        )
    )


def _motion(
    scene: Scene,
    timing: Timing,
    x: FloatArray,
    v: FloatArray,
    struck: NDArray[np.bool_],
    half_kick_start: bool,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return position, velocity, acceleration (n, bodies, 3) at the wanted steps, from all that was read."""
    dt, wanted = timing.dt, timing.wanted
    at = np.searchsorted(timing.read, wanted)
    position, velocity = x[at], v[at]
    before = v[at - 1]
    acceleration = (velocity - before) / dt
    kick_1, kick_2, kick_3, kick_4 = np.diff(v[:5], axis=0) / dt
    acceleration[0] = kick_1
    if half_kick_start:
        acceleration[wanted == 0] = 6 * kick_2 - 8 * kick_3 + 3 * kick_4
        acceleration[wanted == 1] = 3 * kick_2 - 3 * kick_3 + kick_4
        velocity = np.where(struck[:, None, None], before, velocity - acceleration * dt / 2)
        velocity[0] = start_state(scene)[1]
    if crank_is_kinematic(scene):
        _place_driven_crank(scene, position, velocity, acceleration)
    return position, velocity, acceleration


def _place_driven_crank(
    scene: Scene, position: FloatArray, velocity: FloatArray, acceleration: FloatArray
) -> None:
    """Fill in the motion of the crank's centre of mass, which circles about the kinematic body's origin O."""
    theta, omega, s = position[:, 0, 2], scene.start.crank_speed_rad_s, scene.crank.centre_of_mass_m
    radial = np.stack([np.cos(theta), np.sin(theta)], axis=-1)
    tangential = np.stack([-np.sin(theta), np.cos(theta)], axis=-1)
    position[:, 0, :2] = s * radial
    velocity[:, 0, :2], velocity[:, 0, 2] = s * omega * tangential, omega
    acceleration[:, 0, :2], acceleration[:, 0, 2] = -s * omega * omega * radial, 0.0


def _driver_work(
    scene: Scene, position: FloatArray, torque: FloatArray, dt: float, share: FloatArray
) -> FloatArray | None:
    """Return the driver's work since t = 0 in J; at constant speed kick by kick, the last one in part.

    Without impacts that is the trapezoidal rule.
    """
    if scene.drive.kind == "torque":
        return np.asarray(scene.drive.torque_N_m * (position[:, 0, 2] - position[0, 0, 2]))
    if scene.drive.kind == "free":
        return None
    kick = dt * scene.start.crank_speed_rad_s * torque
    kick[0] /= 2
    work = np.concatenate([[0.0], np.cumsum(kick[:-1])]) + share * kick
    work[0] = 0.0
    return np.asarray(work)


def _at(contact: Contact, sampled: slice) -> Contact:
    """Return a contact at some of its times."""
    parts = {name: value[sampled] for name, value in vars(contact).items() if isinstance(value, np.ndarray)}
    return Contact(**{**vars(contact), **parts})
