"""One run of a Pymunk model: which steps to read, and what their states and contacts say at the samples."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pymunk
from numpy.typing import NDArray

from engine_models.engine import Contact, FloatArray, RunSettings, Trajectory, require_finite
from engine_models.mechanics.assembly import start_state
from engine_models.mechanics.samples import joined, selected
from engine_models.pymunk.checks import require_the_mechanism
from engine_models.pymunk.compliant import CompliantContact
from engine_models.pymunk.contact import ContactLog
from engine_models.pymunk.forces import gaps, reactions
from engine_models.pymunk.model import Bodies, crank_is_kinematic
from engine_models.pymunk.rigid import RigidContact
from engine_models.pymunk.stepping import Block, run
from engine_models.scene.scene import Scene

#: Steps that are worked off at once.
BLOCK_STEPS = 16_384


@dataclass(frozen=True)
class Model:
    """A scene in Pymunk at t = 0: its space, bodies and contacts by joint, O to B."""

    scene: Scene
    space: pymunk.Space
    bodies: Bodies
    contacts: Mapping[str, CompliantContact | RigidContact]


class Timing:
    """The steps of a run, in blocks: which of them are wanted, and which of those are samples."""

    def __init__(self, scene: Scene, settings: RunSettings) -> None:
        self.per_sample = settings.steps_per_sample(scene.end_time_s)
        self.dt, self.steps = settings.step_used_s(scene.end_time_s), settings.samples * self.per_sample
        # The driver's work needs the torque at every step, all else is asked for at the samples alone.
        self._every = 1 if scene.drive.kind == "constant-speed" else self.per_sample

    def blocks(self) -> Iterator[Block]:
        """Yield the blocks, in order; memory holds no more of a run than one of them, and the samples."""
        for first in range(0, self.steps + 1, BLOCK_STEPS):
            last = min(first + BLOCK_STEPS - 1, self.steps)
            wanted, ahead = self._wanted(first, last), self._wanted(first + 1, last + 1)
            # The step before a wanted one tells the kick, the first few what kicks 0 and 1 should have been.
            read = np.concatenate([wanted, ahead[ahead <= self.steps] - 1, np.arange(0 if first else 5)])
            yield Block(last, wanted, np.unique(read))

    def _wanted(self, first: int, last: int) -> NDArray[np.int64]:
        every = self._every
        return np.arange(-(-first // every) * every, last + 1, every)


def trajectory_of(model: Model, settings: RunSettings, half_kick_start: bool) -> Trajectory:
    """Run the model with fixed steps; see ``PymunkEngine`` for what is reported.

    Raises:
        SimulationFailed: a joint came apart, a pin went through a wall, the rod turned over, or the numbers
            overflowed.
    """
    scene, samples = model.scene, Samples(model, settings, half_kick_start)
    solve_time = run(
        model.space,
        model.bodies,
        samples.timing.dt,
        crank_torque_N_m=scene.drive.torque_N_m if scene.drive.kind == "torque" else None,
        half_kick_start=half_kick_start,
        blocks=samples.timing.blocks(),
        work_off=samples.take,
    )
    return require_finite(samples.trajectory(solve_time))


class Samples:
    """The samples of a run, block by block, and what has to be known of all steps before them."""

    def __init__(self, model: Model, settings: RunSettings, half_kick_start: bool) -> None:
        self.timing, self._scene, self._contacts = Timing(model.scene, settings), model.scene, model.contacts
        self._count, self._half_kick_start = settings.samples, half_kick_start
        self._logs = {name: ContactLog(contact.clips) for name, contact in model.contacts.items()}
        self._parts: list[dict[str, FloatArray | None]] = []
        self._contact_parts: dict[str, list[Contact]] = {name: [] for name in self._logs}
        self._last_v: FloatArray | None = None
        self._work = 0.0

    def take(self, block: Block, x: FloatArray, v: FloatArray) -> None:
        """Work off a block from what was read of it.

        Raises:
            SimulationFailed: see ``require_the_mechanism``.
        """
        scene, wanted, dt = self._scene, block.wanted, self.timing.dt
        rigid = []
        for name, log in self._logs.items():
            log.add(self._contacts[name].taken())
            if getattr(scene.clearance, name).law == "rigid":
                rigid.append(log.touches)
        before = self._last_v
        if len(v):
            self._last_v = v[-1]
        if not len(wanted):
            return
        struck = np.isin(wanted, np.concatenate(rigid)) if rigid else np.zeros(len(wanted), dtype=bool)
        position, velocity, acceleration = self._motion(block, x, v, before, struck)
        require_the_mechanism(scene, position, np.asarray(dt * wanted, dtype=np.float64))
        # A kick's work is half done at its own time, unless it strikes: then all is to come (or all over).
        share = np.where(struck, 0.0 if self._half_kick_start else 1.0, 0.5)
        gap = gaps(scene, position)
        contacts = {
            name: log.contact(getattr(scene.clearance, name), gap[name], wanted, share, dt)
            for name, log in self._logs.items()
        }
        force, guide, torque = reactions(scene, position, acceleration, contacts)
        parts: dict[str, FloatArray | None] = {
            "position": position,
            "velocity": velocity,
            "joint_force_N": force,
            "guide_normal_force_N": guide,
            "driver_torque_N_m": None,
            "driver_work_J": None,
        }
        if scene.drive.kind == "constant-speed":
            parts["driver_torque_N_m"] = torque
            parts["driver_work_J"] = self._driver_work(torque, share, wanted)
        sampled = wanted % self.timing.per_sample == 0
        self._parts.append({name: None if part is None else part[sampled] for name, part in parts.items()})
        for name, contact in contacts.items():
            self._contact_parts[name].append(selected(contact, sampled))

    def trajectory(self, solve_time_s: float) -> Trajectory:
        """Return the trajectory at all samples."""
        scene, timing = self._scene, self.timing
        names = [name for name, part in self._parts[0].items() if part is not None]
        arrays: dict[str, Any] = dict.fromkeys(self._parts[0])
        arrays |= {name: np.concatenate([part[name] for part in self._parts]) for name in names}
        if scene.drive.kind == "torque":
            angle = arrays["position"][:, 0, 2]
            arrays["driver_torque_N_m"] = np.full_like(angle, scene.drive.torque_N_m)
            arrays["driver_work_J"] = scene.drive.torque_N_m * (angle - angle[0])
        return Trajectory(
            time_s=np.linspace(0.0, scene.end_time_s, self._count + 1),
            **arrays,
            step_s=timing.dt,
            steps=timing.steps,
            solve_time_s=solve_time_s,
            contacts={
                name: replace(joined(self._contact_parts[name]), impacts=log.impacts(timing.dt, timing.steps))
                for name, log in self._logs.items()
            },
        )

    def _motion(
        self,
        block: Block,
        x: FloatArray,
        v: FloatArray,
        last_v: FloatArray | None,
        struck: NDArray[np.bool_],
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return position, velocity, acceleration (n, bodies, 3) at the wanted steps, from all that was read.

        ``last_v`` (bodies, 3) was read before the block.
        """
        scene, dt, wanted = self._scene, self.timing.dt, block.wanted
        at = np.searchsorted(block.read, wanted)
        position, velocity, before = x[at], v[at], v[at - 1]
        if last_v is not None and at[0] == 0:
            before[0] = last_v
        acceleration = (velocity - before) / dt
        begins = wanted[0] == 0
        kick_1, kick_2, kick_3, kick_4 = np.diff(v[:5], axis=0) / dt if begins else np.zeros(4)
        if begins:
            acceleration[0] = kick_1
        if self._half_kick_start:
            if begins:
                acceleration[0] = 6 * kick_2 - 8 * kick_3 + 3 * kick_4
                acceleration[wanted == 1] = 3 * kick_2 - 3 * kick_3 + kick_4
            velocity = np.where(struck[:, None, None], before, velocity - acceleration * dt / 2)
            if begins:
                velocity[0] = start_state(scene)[1]
        if crank_is_kinematic(scene):
            _place_driven_crank(scene, position, velocity, acceleration)
        return position, velocity, acceleration

    def _driver_work(self, torque: FloatArray, share: FloatArray, wanted: NDArray[np.int64]) -> FloatArray:
        """Return the work since t = 0 in J of a driver of constant speed: kick by kick, the last one in part.

        Without impacts that is the trapezoidal rule.
        """
        kick = self.timing.dt * self._scene.start.crank_speed_rad_s * torque
        if wanted[0] == 0:
            kick[0] /= 2
        sums = np.cumsum(np.append(self._work, kick))
        self._work = float(sums[-1])
        work = sums[:-1] + share * kick
        work[wanted == 0] = 0.0
        return np.asarray(work)


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
