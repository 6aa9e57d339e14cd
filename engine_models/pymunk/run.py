"""One run of a Pymunk model: what the states and contacts of its steps say at the samples."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from engine_models.engine import (
    BareRun,
    Contact,
    FloatArray,
    RunSettings,
    SimulationFailed,
    Trajectory,
    require_finite,
)
from engine_models.mechanics.crank_motion import motion_of
from engine_models.mechanics.joints import gaps
from engine_models.mechanics.quality import open_by_m
from engine_models.mechanics.reactions import reactions
from engine_models.mechanics.samples import interpolated, joined, selected
from engine_models.mechanics.states import lever_m, point_motion, way
from engine_models.mechanics.trajectory import trajectory_of
from engine_models.pymunk.contact_log import ContactLog
from engine_models.pymunk.joints.plan import Plan
from engine_models.pymunk.stepping import Block, Model, run
from engine_models.pymunk.works import DRIVE, Works
from engine_models.scene.scene import Scene

#: With a joint this many levers apart the bodies are no mechanism any more, and the run has failed.
LOST_GAP = 0.1


def pymunk_run(model: Model, settings: RunSettings) -> Trajectory:
    """Run the model; see ``PymunkEngine`` for what is reported.

    Raises:
        SimulationFailed: a joint came apart, a pin went through a wall, or the numbers overflowed.
    """
    samples = Samples(model, settings)
    return require_finite(samples.trajectory(run(model, settings, samples.take)))


def pymunk_bare_run(model: Model, settings: RunSettings) -> BareRun:
    """Run the model without works or forces, and keep its end.

    Raises:
        SimulationFailed: see ``pymunk_run``.
    """
    scene, ends = model.scene, list[Block]()

    def take(block: Block) -> None:
        for number in range(len(scene.clearances)):
            model.workspace.taken(number)
        ends[:] = [block] if len(block.rows) else ends

    solve_time_s = run(model, settings, take, bare=True)
    position, time_s = ends[0].position[-1:], ends[0].rows["time_s"][-1:]
    move_to_centres(model.plan, position, *np.zeros((3, *position.shape)))
    require_the_mechanism(scene, model.plan, position, model.start[None], gaps(scene, position), time_s)
    return BareRun(solve_time_s, position[0])


@dataclass(frozen=True)
class Part:
    """A block's samples (n,), by the names of ``trajectory_of``; contacts without their impacts."""

    time_s: FloatArray
    position: FloatArray
    velocity: FloatArray
    driver_work_J: FloatArray | None
    load_work_J: dict[str, FloatArray]
    contacts: dict[str, Contact]
    joint_force_N: dict[str, FloatArray]
    guide_force_N: dict[str, FloatArray]
    guide_moment_N_m: dict[str, FloatArray]
    driver_torque_N_m: FloatArray | None


class Samples:
    """The samples of a run, block by block, and what has to be known of all steps before them."""

    def __init__(self, model: Model, settings: RunSettings) -> None:
        self._step_s = settings.step_used_s(model.scene.end_time_s)
        self._scene, self._plan, self._start = model.scene, model.plan, model.start[None]
        self._workspace, self._driven_way = model.workspace, model.inputs.driven_way
        self._clearances, self._half_kick_start = model.scene.clearances, model.half_kick_start
        self._times_s, self._between = settings.times_s(model.scene), np.array(settings.at_s)
        self._logs = {name: ContactLog(room.law == "rigid") for name, room in self._clearances.items()}
        self._parts: list[Part] = []
        self._works = Works(model.scene)

    def take(self, block: Block) -> None:
        """Work off a block.

        Raises:
            SimulationFailed: see ``require_the_mechanism``.
        """
        scene, rows = self._scene, block.rows
        wanted, time_s, kick_s = rows["kick"], rows["time_s"], rows["kick_s"]
        rigid = []
        for number, (name, log) in enumerate(self._logs.items()):
            log.add(self._workspace.taken(number))
            if self._clearances[name].law == "rigid":
                rigid.append(log.touches)
        if not len(wanted):
            return
        struck = np.isin(wanted, np.concatenate(rigid)) if rigid else np.zeros(len(wanted), dtype=bool)
        sample = rows["sample"] | self._beside(time_s)
        position, velocity, mean, acceleration = self._motion(block, struck)
        gap = gaps(scene, position)
        require_the_mechanism(scene, self._plan, position, self._start, gap, time_s)
        # A kick's work is half done at its own time, unless it strikes: then all is to come (or all over).
        share = np.where(struck, 0.0 if self._half_kick_start else 1.0, 0.5)
        contacts = {
            name: log.contact(self._clearances[name], gap[name], wanted, share, kick_s)
            for name, log in self._logs.items()
        }
        felt = mean if self._half_kick_start else velocity  # by dampers in these kicks
        forces = reactions(scene, time_s, position, felt, acceleration, contacts)
        torque = forces.driver_torque_N_m
        works = self._works.since_start(time_s, kick_s, share, position, mean, torque)
        work = works.pop(DRIVE, None)
        part = Part(time_s, position, velocity, work, works, contacts, **vars(forces))
        self._parts.append(selected(part, sample))

    def _beside(self, time_s: FloatArray) -> NDArray[np.bool_]:
        """Return which steps of a block, at times (n,), are beside a time asked for between steps."""
        beside = np.zeros(len(time_s), dtype=bool)
        if len(self._between):
            after = np.searchsorted(time_s, self._between)
            beside[np.clip([after - 1, after], 0, len(time_s) - 1)] = beside[[0, -1]] = True
        return beside

    def trajectory(self, solve_time_s: float) -> Trajectory:
        """Return the trajectory at all samples; between steps it is interpolated (see ``interpolated``)."""
        steps = int(self._workspace.run[0]["end"])
        whole = joined(self._parts)
        contacts = {
            name: replace(contact, impacts=self._logs[name].impacts(steps))
            for name, contact in whole.contacts.items()
        }
        trajectory = trajectory_of(
            self._scene,
            **{**vars(whole), "contacts": contacts},
            step_s=self._step_s,
            steps=steps,
            solve_time_s=solve_time_s,
        )
        if len(self._between):
            return interpolated(trajectory, self._times_s)
        return replace(trajectory, time_s=self._times_s)

    def _motion(
        self, block: Block, struck: NDArray[np.bool_]
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return position, velocity, mean velocity, acceleration (n, bodies, 3) at the wanted kicks.

        The mean is that of the velocities before and after a kick.
        """
        before, after, acceleration = block.before, block.after, block.acceleration
        if block.begin is not None:
            _, kick_1, _, kick_3, kick_4, kick_5 = block.begin
            acceleration[0] = kick_1
            if self._half_kick_start:
                acceleration[0] = 10 * kick_3 - 15 * kick_4 + 6 * kick_5
                acceleration[block.rows["kick"] == 1] = 6 * kick_3 - 8 * kick_4 + 3 * kick_5
                acceleration[block.rows["kick"] == 2] = 3 * kick_3 - 3 * kick_4 + kick_5
        position, velocity, mean = block.position, after, after - acceleration * block.kick_s / 2
        if block.begin is not None:
            mean[0] = before[0]
        if self._half_kick_start:
            at_kick = after - acceleration * (block.kick_s - block.rows["step_s"][:, None, None] / 2)
            if block.begin is not None:
                at_kick[0] = before[0]
            velocity = np.where(struck[:, None, None], before, at_kick)
        self._enter_driven(block.rows["time_s"], velocity, acceleration)
        move_to_centres(self._plan, position, velocity, mean, acceleration)
        return position, velocity, mean, acceleration

    def _enter_driven(self, time_s: FloatArray, velocity: FloatArray, acceleration: FloatArray) -> None:
        """Enter the motion of a kinematic body, of which the space knows positions alone."""
        drive, motion = self._scene.mechanism.drive, motion_of(self._scene.mechanism.drive)
        if motion is None or not self._plan.seats[drive.body].is_kinematic:
            return
        velocity[:, drive.body] = np.outer(motion.speed_rad_s(time_s), self._driven_way)
        acceleration[:, drive.body] = np.outer(motion.acceleration_rad_s2(time_s), self._driven_way)


def move_to_centres(
    plan: Plan, position: FloatArray, velocity: FloatArray, mean: FloatArray, acceleration: FloatArray
) -> None:
    """Make of what is known of the bodies' origins, (n, bodies, 3) each, that of their centres of mass."""
    for body, seat in enumerate(plan.seats):
        if seat.origin == (0.0, 0.0):
            continue
        spin, alpha = velocity[:, body, 2:], acceleration[:, body, 2:]
        arm = point_motion(body, seat.place((0.0, 0.0)), position, velocity).place_m - position[:, body, :2]
        across = np.stack([-arm[:, 1], arm[:, 0]], axis=-1)
        position[:, body, :2] += arm
        velocity[:, body, :2] += spin * across
        mean[:, body, :2] += mean[:, body, 2:] * across
        acceleration[:, body, :2] += alpha * across - spin * spin * arm


def require_the_mechanism(
    scene: Scene,
    plan: Plan,
    position: FloatArray,
    start: FloatArray,
    gap_m: Mapping[str, FloatArray],
    time_s: FloatArray,
) -> None:
    """Check that positions (n, bodies, 3) at times (n,), with the joints' gaps (n, 2), are the scene's still.

    The run began at the ``start`` (1, bodies, 3).

    Raises:
        SimulationFailed: at the first time when an ideal joint or guide is too far open or not finite, a body
            is beyond the end of its groove, or a pin is through the wall of its bearing.
    """
    still = np.zeros_like(position)
    checks = [
        (
            np.hypot(*gap_m[name].T) <= room.bearing_radius_m,
            f"pin through the wall of its bearing at joint {name}",
        )
        for name, room in scene.clearances.items()
    ]
    for guide in scene.mechanism.guides:
        on = np.abs(way(guide, position, still)[0]) <= plan.groove_m
        checks.append(
            (on | ~np.isfinite(position).all(axis=(1, 2)), f"body beyond the end of guide {guide.name}")
        )
    worst = open_by_m(scene, position, start)
    checks.append((worst <= LOST_GAP * lever_m(scene), "constraints lost, a joint is {gap:.3g} m apart,"))
    failures = [(int(np.argmin(holds)), what) for holds, what in checks if not holds.all()]
    if failures:
        first, what = min(failures)
        raise SimulationFailed(f"{what.format(gap=worst[first])} at t = {time_s[first]:.6g} s")
