"""One check of a run's quality for every engine, from its scene and trajectory alone.

Engines answer what they are asked, be the step too long for them or a wall like butter. Three things tell
without any truth: energy that no physics accounts for, gaps of what is ideal, and pins outside bearings.
"""

from dataclasses import dataclass

import numpy as np

from engine_models.engine import FloatArray, SimulationFailed, Trajectory
from engine_models.mechanics.energy import unaccounted_part
from engine_models.mechanics.states import off_line, pin_gap, shortest_m, turned_apart
from engine_models.scene.scene import Scene


@dataclass(frozen=True)
class Respect:
    """What a run is checked for, in parts of a scale.

    From ``doubtful`` on a run is one to be warned of, past ``failed`` it is none. ``text`` has a place for
    the part in percent, ``remedy`` is what to do.
    """

    column: str
    text: str
    doubtful: float
    failed: float
    remedy: str


ENERGY = Respect(
    "unaccounted_energy_part",
    "energy off by {} of that in play",
    doubtful=0.01,
    failed=0.1,
    remedy="shorten the step, or sharpen the tolerance",
)
GAP = Respect(
    "ideal_gap_part",
    "ideal joints or guide open by {} of the shortest link",
    doubtful=0.01,
    failed=0.1,
    remedy="shorten the step, or sharpen the tolerance",
)
PENETRATION = Respect(
    "penetration_part",
    "pin in the wall of its bearing by {} of the bearing's radius",
    doubtful=0.1,
    failed=1.0,
    remedy="check stiffness or young_modulus_Pa, or shorten the step",
)


@dataclass(frozen=True)
class Finding:
    """The worst of a run in one respect: the largest ``part``, infinite where not all is finite.

    ``doubtful_s`` and ``failed_s`` are the first samples' times beyond the two limits, None if there is none.
    """

    respect: Respect
    part: float
    doubtful_s: float | None
    failed_s: float | None

    @property
    def in_percent(self) -> str:
        """The worst in percent, as text."""
        return f"{100 * self.part:.3g} %"

    def line(self, limit: float, time_s: float, step_s: float) -> str:
        """Return in one line what was found, when it came past a limit, and what to do."""
        text, when = self.respect.text.format(self.in_percent), f"t = {time_s:.6g} s"
        return f"{text}, past {100 * limit:g} % at {when} with step {step_s:.3g} s: {self.respect.remedy}"


@dataclass(frozen=True)
class Quality:
    """What was found in a run of steps up to ``step_s``, in all respects that its scene has."""

    findings: tuple[Finding, ...]
    step_s: float

    def parts(self) -> dict[str, float]:
        """Return the worst in every respect by its column."""
        return {found.respect.column: found.part for found in self.findings}

    def summary(self) -> str:
        """Return the worst in every respect in one line."""
        return ", ".join(found.respect.text.format(found.in_percent) for found in self.findings)

    def failure(self) -> str | None:
        """Return in one line what makes the run none, the first thing if several do; None if it is one."""
        failed = [(found.failed_s, found) for found in self.findings if found.failed_s is not None]
        if not failed:
            return None
        time_s, first = min(failed, key=lambda one: one[0])
        return first.line(first.respect.failed, time_s, self.step_s)

    def warnings(self) -> list[str]:
        """Return a line for every respect in which the run is doubtful, or none at all."""
        return [
            found.line(found.respect.doubtful, found.doubtful_s, self.step_s)
            for found in self.findings
            if found.doubtful_s is not None
        ]


def quality_of(scene: Scene, trajectory: Trajectory) -> Quality:
    """Return the quality of an engine's run of a scene, as far as its samples show it."""
    with np.errstate(all="ignore"):  # an overflow is a finding
        found = {ENERGY: unaccounted_part(scene, trajectory)}
        of = scene.mechanism
        if of.ideal or of.guides:
            found[GAP] = constraint_violation_m(scene, trajectory) / shortest_m(scene)
        if trajectory.contacts:
            radius = {name: clearance.bearing_radius_m for name, clearance in scene.clearances.items()}
            depths = [contact.penetration_m / radius[name] for name, contact in trajectory.contacts.items()]
            found[PENETRATION] = np.maximum(np.max(depths, axis=0), 0.0)
    findings = tuple(_finding(what, parts, trajectory.time_s) for what, parts in found.items())
    return Quality(findings, trajectory.step_s)


def require_quality(scene: Scene, trajectory: Trajectory) -> Trajectory:
    """Return the trajectory, or raise SimulationFailed where its quality makes it none."""
    if (reason := quality_of(scene, trajectory).failure()) is not None:
        raise SimulationFailed(reason)
    return trajectory


def constraint_violation_m(scene: Scene, trajectory: Trajectory) -> FloatArray:
    """Return the largest gap of the ideal joints and of bodies from their guides, (n,).

    A body that has turned on its guide is off by its angle times the shortest distance of two joints.
    """
    return open_by_m(scene, trajectory.position, trajectory.position[:1])


def open_by_m(scene: Scene, position: FloatArray, start: FloatArray) -> FloatArray:
    """Return the same in positions (n, bodies, 3) of a run from a start (1, bodies, 3)."""
    of, x, still = scene.mechanism, position, np.zeros_like(position)
    violations = [np.zeros(len(position))]
    violations += [np.hypot(*pin_gap(pin, x, still).gap_m.T) for pin in of.ideal]
    for guide in of.guides:
        violations.append(np.abs(off_line(guide, x, still)[0]))
        if not guide.turns:
            turned = turned_apart(guide, x) - turned_apart(guide, start)
            violations.append(shortest_m(scene) * np.abs(turned))
    return np.asarray(np.max(violations, axis=0))


def _finding(respect: Respect, parts: FloatArray, time_s: FloatArray) -> Finding:
    """Return the worst of parts (n,) at times (n,)."""
    parts = np.where(np.isfinite(parts), parts, np.inf)
    doubtful, failed = time_s[parts >= respect.doubtful], time_s[parts > respect.failed]
    first = [float(times[0]) if len(times) else None for times in (doubtful, failed)]
    return Finding(respect, float(parts.max()), *first)
