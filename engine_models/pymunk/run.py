"""One run of a Pymunk model: what the states and contacts of its steps say at the samples."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from engine_models.engine import (
    Contact,
    FloatArray,
    RunSettings,
    SimulationFailed,
    Trajectory,
    require_finite,
)
from engine_models.guards import guarded
from engine_models.mechanics.crank_motion import crank_motion
from engine_models.mechanics.joints import CRANK, ROD, SLIDER, axis, gaps
from engine_models.mechanics.reactions import Reactions, reactions
from engine_models.mechanics.samples import interpolated, joined, selected
from engine_models.mechanics.trajectory import trajectory_of
from engine_models.pymunk.contact_log import ContactLog
from engine_models.pymunk.model import crank_is_kinematic
from engine_models.pymunk.stepping import Block, Model, Timing, run
from engine_models.pymunk.works import DRIVER, Works
from engine_models.scene.scene import Scene

#: With a joint this many crank lengths apart the bodies are no mechanism any more, and the run has failed.
LOST_GAP = 0.1


def pymunk_run(model: Model, settings: RunSettings, half_kick_start: bool, shorter: float) -> Trajectory:
    """Run the model; see ``PymunkEngine`` for what is reported.

    Raises:
        SimulationFailed: a joint came apart, a pin went through a wall, the rod turned over, or the numbers
            overflowed.
    """
    samples = Samples(model, settings, half_kick_start, shorter)
    return require_finite(samples.trajectory(run(model, samples.timing, half_kick_start, samples.take)))


class Samples:
    """The samples of a run, block by block, and what has to be known of all steps before them."""

    def __init__(self, model: Model, settings: RunSettings, half_kick_start: bool, shorter: float) -> None:
        self.timing = Timing(model.scene, settings, shorter)
        self._scene, self._workspace = model.scene, model.workspace
        self._clearances, self._half_kick_start = model.scene.clearances, half_kick_start
        self._times_s, self._between = settings.times_s(model.scene), np.array(settings.at_s)
        self._logs = {name: ContactLog(room.law == "rigid") for name, room in self._clearances.items()}
        self._parts: list[dict[str, FloatArray]] = []
        self._forces: list[Reactions] = []
        self._load_works: list[dict[str, FloatArray]] = []
        self._contact_parts: dict[str, list[Contact]] = {name: [] for name in self._logs}
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
        require_the_mechanism(scene, position, gap, time_s)
        # A kick's work is half done at its own time, unless it strikes: then all is to come (or all over).
        share = np.where(struck, 0.0 if self._half_kick_start else 1.0, 0.5)
        contacts = {
            name: log.contact(self._clearances[name], gap[name], wanted, share, kick_s)
            for name, log in self._logs.items()
        }
        felt = mean if self._half_kick_start else velocity  # by dampers in these kicks
        forces = reactions(scene, time_s, position, felt, acceleration, contacts)
        torque = forces.driver_torque_N_m
        works = self._works.since_start(time_s, kick_s, share, position, felt, mean, torque)
        arrays = {
            "time_s": time_s,
            "position": position,
            "velocity": velocity,
            "driver_work_J": works.pop(DRIVER, None),
        }
        self._parts.append({name: array[sample] for name, array in arrays.items() if array is not None})
        self._forces.append(selected(forces, sample))
        self._load_works.append({part: work[sample] for part, work in works.items()})
        for name, contact in contacts.items():
            self._contact_parts[name].append(selected(contact, sample))

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
        arrays: dict[str, Any] = _joined(self._parts)
        contacts = {
            name: replace(joined(self._contact_parts[name]), impacts=log.impacts(steps))
            for name, log in self._logs.items()
        }
        trajectory = trajectory_of(
            self._scene,
            **arrays,
            **vars(joined(self._forces)),
            step_s=self.timing.step_s,
            steps=steps,
            solve_time_s=solve_time_s,
            contacts=contacts,
            load_work_J=_joined(self._load_works),
        )
        trajectory = replace(trajectory, evaluations=steps)  # a kick each
        if len(self._between):
            return interpolated(trajectory, self._times_s)
        return replace(trajectory, time_s=self._times_s)

    def _motion(
        self, block: Block, struck: NDArray[np.bool_]
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return position, velocity, mean velocity, acceleration (n, bodies, 3) at the wanted kicks.

        The mean is that of the velocities before and after a kick.
        """
        scene, before, after, acceleration = self._scene, block.before, block.after, block.acceleration
        if block.begin is not None:
            _, kick_1, kick_2, kick_3, kick_4 = block.begin
            acceleration[0] = kick_1
            if self._half_kick_start:
                acceleration[0] = 6 * kick_2 - 8 * kick_3 + 3 * kick_4
                acceleration[block.rows["kick"] == 1] = 3 * kick_2 - 3 * kick_3 + kick_4
        position, velocity, mean = block.position, after, after - acceleration * block.kick_s / 2
        if block.begin is not None:
            mean[0] = before[0]
        if self._half_kick_start:
            at_kick = after - acceleration * (block.kick_s - block.rows["step_s"][:, None, None] / 2)
            if block.begin is not None:
                at_kick[0] = before[0]
            velocity = np.where(struck[:, None, None], before, at_kick)
        if crank_is_kinematic(scene):
            _place_driven_crank(scene, block.rows["time_s"], position, velocity, acceleration)
        return position, velocity, mean, acceleration


def _joined(parts: Sequence[Mapping[str, FloatArray]]) -> dict[str, FloatArray]:
    """Return the arrays of all parts, put together by name."""
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def _place_driven_crank(
    scene: Scene, time_s: FloatArray, position: FloatArray, velocity: FloatArray, acceleration: FloatArray
) -> None:
    """Fill in the motion of the crank's centre of mass, which circles about the kinematic body's origin O."""
    motion, s = crank_motion(scene), scene.crank.centre_of_mass_m
    assert motion is not None
    omega, alpha = motion.speed_rad_s(time_s), motion.acceleration_rad_s2(time_s)
    radial = axis(position[:, CRANK, 2])
    tangential = np.stack([-radial[:, 1], radial[:, 0]], axis=-1)
    position[:, CRANK, :2] = s * radial
    velocity[:, CRANK, :2], velocity[:, CRANK, 2] = (s * omega)[:, None] * tangential, omega
    towards, along = (-s * omega * omega)[:, None] * radial, (s * alpha)[:, None] * tangential
    acceleration[:, CRANK, :2], acceleration[:, CRANK, 2] = towards + along, alpha


def require_the_mechanism(
    scene: Scene, position: FloatArray, gap_m: dict[str, FloatArray], time_s: FloatArray
) -> None:
    """Check that positions (n, bodies, 3) at times (n,), with the joints' gaps (n, 2), are the scene's still.

    Raises:
        SimulationFailed: at the first time when an ideal joint is too far apart or not finite, or a pin is
            through the wall of its bearing, or when the rod has gone over the vertical, which one that is
            longer than the crank and the clearances never does.
    """
    distance = {name: np.hypot(gap[:, 0], gap[:, 1]) for name, gap in gap_m.items()}
    clearance_of = scene.clearances
    checks = [
        (distance[name] <= clearance.bearing_radius_m, f"pin through the wall of its bearing at joint {name}")
        for name, clearance in clearance_of.items()
    ]
    apart = [np.zeros(len(position)), *(distance[name] for name in scene.joints if name not in clearance_of)]
    if scene.is_crank_slider:
        apart.append(np.abs(position[:, SLIDER, 1]))
        crank, rod, _ = scene.crank_slider()
        reach = crank.length_m + sum(clearance.radial_clearance_m for clearance in clearance_of.values())
        if rod.length_m >= reach:
            checks.append((~(np.cos(position[:, ROD, 2]) <= 0), "rod turned over"))
    worst = np.max(apart, axis=0)
    checks.append(
        (worst <= LOST_GAP * scene.crank.length_m, "constraints lost, a joint is {gap:.3g} m apart,")
    )
    failures = [(int(np.argmin(holds)), what) for holds, what in checks if not holds.all()]
    if failures and guarded():
        first, what = min(failures)
        raise SimulationFailed(f"{what.format(gap=worst[first])} at t = {time_s[first]:.6g} s")
