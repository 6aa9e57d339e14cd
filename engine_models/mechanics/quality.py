"""One check of a run's quality for every engine, from its scene and trajectory alone.

Engines answer what they are asked, be the step too long for them or a wall like butter. Three things tell
without any truth: energy that no physics accounts for, gaps of what is ideal, and pins outside bearings.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine_models.engine import FloatArray, SimulationFailed, Trajectory
from engine_models.mechanics.energy import unaccounted_part
from engine_models.mechanics.states import pin_gap, shortest_m, way
from engine_models.scene.scene import Scene


class Respect(NamedTuple):
    """What a run is checked for, in parts of a scale, as ``text`` says in percent, and what to do.

    From ``doubtful`` on a run is one to be warned of, past ``failed`` it is none.
    """

    column: str
    text: str
    doubtful: float
    failed: float
    remedy: str


SHORTER = "shorten the step, or sharpen the tolerance"
ENERGY = Respect("unaccounted_energy_part", "energy off by {} of that in play", 0.01, 0.1, SHORTER)
OPEN = "ideal joints or guide open by {} of the shortest link"
GAP = Respect("ideal_gap_part", OPEN, 0.01, 0.1, SHORTER)
DEEP = "pin in the wall of its bearing by {} of the bearing's radius"
SOFT = "check stiffness or young_modulus_Pa, or shorten the step"
PENETRATION = Respect("penetration_part", DEEP, 0.1, 1.0, SOFT)


@dataclass(frozen=True)
class Quality:
    """A run of steps up to ``step_s`` in all respects that its scene has: the parts (n,) at ``time_s`` (n,).

    They are infinite where not finite.
    """

    found: Mapping[Respect, FloatArray]
    time_s: FloatArray
    step_s: float

    def parts(self) -> dict[str, float]:
        """Return the worst in every respect by its column."""
        return {what.column: float(part.max()) for what, part in self.found.items()}

    def summary(self) -> str:
        """Return the worst in every respect in one line."""
        return ", ".join(what.text.format(_in_percent(part)) for what, part in self.found.items())

    def failure(self) -> str | None:
        """Return in one line what makes the run none, the first thing if several do; None if it is one."""
        past = [self._line(what, what.failed, part > what.failed) for what, part in self.found.items()]
        return min(filter(None, past), default=(0.0, None))[1]

    def warnings(self) -> list[str]:
        """Return a line for every respect in which the run is doubtful, or none at all."""
        past = [self._line(what, what.doubtful, part >= what.doubtful) for what, part in self.found.items()]
        return [line for _, line in filter(None, past)]

    def _line(self, what: Respect, limit: float, past: NDArray[np.bool_]) -> tuple[float, str] | None:
        """Return when a run came past a limit first, and in one line how far, and what to do."""
        if not past.any():
            return None
        text, when = what.text.format(_in_percent(self.found[what])), float(self.time_s[past.argmax()])
        at = f"past {100 * limit:g} % at t = {when:.6g} s with step {self.step_s:.3g} s"
        return when, f"{text}, {at}: {what.remedy}"


def _in_percent(part: FloatArray) -> str:
    return f"{100 * float(part.max()):.3g} %"


def quality_of(scene: Scene, trajectory: Trajectory) -> Quality:
    """Return the quality of an engine's run of a scene, as far as its samples and impacts show it."""
    with np.errstate(all="ignore"):  # an overflow is a finding
        found = {ENERGY: unaccounted_part(scene, trajectory)}
        of = scene.mechanism
        if of.ideal or of.guides:
            found[GAP] = constraint_violation_m(scene, trajectory) / shortest_m(scene)
        if trajectory.contacts:
            found[PENETRATION] = np.zeros(len(trajectory.time_s))
        for name, contact in trajectory.contacts.items():  # an impact's deepest is at the sample after it
            impacts, depth = contact.impacts, contact.penetration_m.copy()
            after = np.searchsorted(trajectory.time_s, impacts.largest_penetration_time_s)
            np.fmax.at(depth, after.clip(max=len(depth) - 1), impacts.largest_penetration_m)  # NaN: rigid
            part = depth / scene.clearances[name].bearing_radius_m
            found[PENETRATION] = np.maximum(found[PENETRATION], part)
    finite = {what: np.where(np.isfinite(part), part, np.inf) for what, part in found.items()}
    return Quality(finite, trajectory.time_s, trajectory.step_s)


def require_quality(scene: Scene, trajectory: Trajectory) -> Trajectory:
    """Return the trajectory, or raise SimulationFailed where its quality makes it none."""
    if (reason := quality_of(scene, trajectory).failure()) is not None:
        raise SimulationFailed(reason)
    return trajectory


def constraint_violation_m(scene: Scene, trajectory: Trajectory) -> FloatArray:
    """Return the largest gap of the ideal joints and of bodies from their guides, (n,).

    A body that has turned on its guide is off by its angle times the shortest distance of two joints.
    """
    of, x, still = scene.mechanism, trajectory.position, np.zeros_like(trajectory.position)
    angles = np.pad(x[:, :, 2], ((0, 0), (0, 1)))  # the ground's are the last
    violations = [np.zeros(len(x)), *(np.hypot(*pin_gap(pin, x, still)[0].T) for pin in of.ideal)]
    for guide in of.guides:
        violations.append(np.abs(way(guide, x, still, across=True)[0]))
        if not guide.turns:
            turned = angles[:, guide.body_j] - angles[:, guide.body_i]
            violations.append(shortest_m(scene) * np.abs(turned - turned[0]))
    return np.asarray(np.max(violations, axis=0))
