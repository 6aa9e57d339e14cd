"""The largest finite-time Lyapunov exponent of a scene: how fast neighbouring motions part.

Benettin's method (Benettin et al. 1980): a run and a companion begun SIZE_M beside it; whenever they have
parted further, the companion is put back along the same direction, and the logarithms of what it was put back
by are summed. It needs no more of an engine than ``simulate`` from a given state.

Impacts. Rigid ones make the motion jump, compliant ones nearly so, and the two runs hit the wall at different
times. A method that follows the linearised motion would need the saltation matrix of every impact. Here both
runs go through their own impacts, which does to their distance what that matrix does, to first order in it;
they are compared, and the companion put back, at equal times at which all pins of both fly free. Else the
distance might be that of a pin before its bounce from one after it, and a restart in the wall would not know
the speed at which that contact began.
"""

from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from engine_models.engine import Engine, FloatArray, RunSettings, SimulationFailed, Trajectory
from engine_models.mechanics.assembly import start_state, started_from
from engine_models.mechanics.quality import require_quality
from engine_models.mechanics.states import lever_m
from engine_models.mechanics.wrenches import inertias
from engine_models.scene.parts import AnyScene
from engine_models.scene.scene import Scene
from studies.judges.horizon import moved
from studies.judges.metrics import in_flight

T = TypeVar("T", bound=AnyScene)

#: The companion is put back to this distance in m, far above round-off, ...
SIZE_M = 1e-12
#: ... at the last moment at which it is closer than this part of the least clearance: so far, distances grow
#: in proportion.
LARGEST_PART = 0.01
#: A stretch without such a moment is made up to this many times as long; then it is the last. Of 150 starts
#: of set R, followed for 64 revolutions, none took off again after twelve in contact.
LONGEST = 16


@dataclass(frozen=True)
class Growth:
    """Times (n,) in s and ln of the distance's growth since t = 0 at each (n,), of one not put back.

    ``settled``: in the last stretch, ``LONGEST`` times as long, no pin left its bearing's wall.
    """

    time_s: FloatArray
    log_growth: FloatArray
    settled: bool

    def exponent_per_s(self, from_s: float, until_s: float = np.inf) -> float:
        """Return the mean growth rate from a time on, and until another or the end.

        Raises:
            SimulationFailed: distances could not be followed that far.
        """
        within = slice(*np.searchsorted(self.time_s, [from_s, until_s]))
        time, growth = self.time_s[within], self.log_growth[within]
        if len(time) < 2:
            raise SimulationFailed(f"the companion could not be put back until t = {from_s:g} s")
        return float((growth[-1] - growth[0]) / (time[-1] - time[0]))


def growth(engine: Engine, scene: AnyScene, step_s: float, stretch_s: float, samples: int) -> Growth:
    """Return how a distance grows in a scene, until its end or until the companion cannot be put back.

    Runs are made in stretches of ``stretch_s`` with ``samples`` samples each. What is left at the end and
    shorter than a stretch is not run: it would count as one that ends in another phase of the motion.

    Raises:
        ValueError: the scene has no joint with clearance, or of another mechanism than a crank-slider, no
            start angle to be moved (see ``start_angle``).
        UnsupportedScene, SimulationFailed: as ``simulate`` and ``require_quality`` do.
    """
    if not scene.joints_with_clearance:
        raise ValueError(f"scene {scene.name}: expected a joint with clearance, got none")
    first, second = scene, _beside(scene, stretch_s)
    largest_m = LARGEST_PART * min(room.radial_clearance_m for room in scene.clearances.values())
    time, total, longer, settled = [0.0], [0.0], 1, False
    while longer <= LONGEST and scene.end_time_s - time[-1] > stretch_s * (1 - 1e-9):
        run, end = RunSettings(step_s, longer * samples), {"end_time_s": longer * stretch_s}
        begun = (scene.model_copy(update=end) for scene in (first, second))
        one, other = (require_quality(scene, engine.simulate(scene, run)) for scene in begun)
        distance = distances_m(scene, one, other, stretch_s)
        near = int(np.argmax(np.append(distance, np.inf) >= largest_m))
        flights = np.flatnonzero(in_flight(one, other)[1:near]) + 1  # one sample on at least
        if len(flights):
            at, longer = int(flights[-1]), 1
        else:
            longer = 2 * longer if near == len(distance) else LONGEST + 1  # no use in going on once far apart
            if longer <= LONGEST:
                continue
            at = near - 1
            settled = near == len(distance) and not _leaves(one) and not _leaves(other)
        time += list(time[-1] + one.time_s[1 : at + 1])
        total += list(total[-1] + np.log(distance[1 : at + 1] / distance[0]))
        part = SIZE_M / distance[at]
        now = float(one.time_s[at])
        first = started_from(first, one.position[at], one.velocity[at], now)
        second = started_from(
            first,
            one.position[at] + part * (other.position[at] - one.position[at]),
            one.velocity[at] + part * (other.velocity[at] - one.velocity[at]),
            now,
        )
    return Growth(np.array(time), np.array(total), settled)


def distances_m(scene: AnyScene, one: Trajectory, other: Trajectory, stretch_s: float) -> FloatArray:
    """Return the distance of two runs at their n times, (n,): the mass-weighted mean of all displacements.

    Velocities count as displacements in the time in which a circle of period ``stretch_s`` turns by 1 rad, so
    that all is in m. The exponent does not depend on such a choice.
    """
    mass = inertias(scene.mechanism)
    moves = (one.position - other.position) ** 2
    moves = moves + ((one.velocity - other.velocity) * stretch_s / (2 * np.pi)) ** 2
    return np.asarray(np.sqrt(np.sum(mass * moves, axis=(1, 2)) / mass[:, 0].sum()))


def _beside(scene: T, stretch_s: float) -> T:
    """Return the scene begun about SIZE_M beside its start."""
    if not (isinstance(scene, Scene) and scene.start.states):
        return moved(scene, SIZE_M / lever_m(scene))
    position, velocity = start_state(scene)
    # The last body is free to move along x while its pin, or that of the rod, is in flight.
    velocity[-1, 0] += SIZE_M * 2 * np.pi / stretch_s
    return started_from(scene, position, velocity)


def _leaves(run: Trajectory) -> bool:
    """Return whether any pin flies at any sample after the first, where a stretch may begin in flight."""
    return any(bool((contact.penetration_m[1:] < 0).any()) for contact in run.contacts.values())
