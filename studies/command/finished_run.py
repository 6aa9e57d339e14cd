"""The result of a simulation: tables, figures, and checks of its accuracy."""

from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from engine_models.engine import MOST_SAMPLES, Engine, Trajectory
from engine_models.mechanics.quality import Quality, quality_of
from engine_models.mechanics.samples import selected
from engine_models.progress import tell
from engine_models.scene.arguments import Place, check_arguments
from engine_models.scene.data import Positive
from engine_models.scene.general import GeneralScene
from engine_models.scene.parts import AnyScene
from engine_models.scene.plain_words import one_of, shown
from studies.command.options import as_arguments, film_ending
from studies.command.trajectory_table import impact_columns, sample_columns
from studies.failures import BadInput, writing
from studies.whole_file import require_place, write_whole

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

#: A note says that samples miss the largest contact force by more than this part of it.
MISSED = 0.1
#: This number of samples in the shortest impact shows 99 % of the largest force of half a sine.
PER_IMPACT = 10


class ContactForce(NamedTuple):
    """Normal force of a contact, its joint, and its time."""

    force_N: float
    joint: str
    time_s: float


@dataclass(frozen=True)
class Run:
    """A finished simulation: its input and its results.

    ``engine`` has the settings that ran. ``tolerance_m`` is the tolerance of the slider position, or None.
    ``warnings`` has a line for each doubt about the run. ``trajectory`` has all results as arrays.
    """

    scene: AnyScene
    engine_name: str
    engine: Engine
    tolerance_m: float | None
    trajectory: Trajectory
    warnings: tuple[str, ...]

    @cached_property
    def frame(self) -> "pd.DataFrame":
        """The samples: motion, forces and energies over ``time_s``, with the columns of the command line."""
        import pandas as pd

        return pd.DataFrame(sample_columns(self.scene, self.trajectory)).set_index("time_s")

    @cached_property
    def impacts(self) -> "pd.DataFrame":
        """The contacts that have ended, one row each in the order of time; empty in an ideal scene."""
        import pandas as pd

        return pd.DataFrame(impact_columns(self.trajectory.contacts))

    @property
    def largest_contact_force(self) -> ContactForce | None:
        """The largest normal force of all contacts, in impacts and samples, with its joint and time.

        None if no pin has touched its bearing, with ideal joints, and with rigid walls.
        """
        found, loose = [], self.scene.clearances
        for joint, contact in self.trajectory.contacts.items():
            force = np.append(contact.normal_force_N, contact.impacts.largest_normal_force_N)
            times = np.append(self.trajectory.time_s, contact.impacts.largest_normal_force_time_s)
            k = np.nanargmax(force)
            if loose[joint].law != "rigid" and force[k] > 0:
                found.append(ContactForce(float(force[k]), joint, float(times[k])))
        return max(found, default=None)

    @property
    def quality(self) -> Quality:
        """Checks of energy balance, joint gaps and penetration; ``summary()`` gives them in a line."""
        return quality_of(self.scene, self.trajectory)

    @check_arguments
    def plot(self) -> "Figure":
        """Return a figure of position, velocity, forces and energy over time.

        The largest contact force is marked, also if it lies between samples.
        """
        from reports.run.figures import time_plot

        mark = None
        if largest := self.largest_contact_force:
            label = f"largest contact: {_newtons(largest.force_N)} at {largest.joint}"
            mark = largest.time_s, largest.force_N, label
        return time_plot(self.frame, self._title, self.quality.summary(), mark)

    @check_arguments
    def plot_orbit(self, joint: str) -> "Figure":
        """Return a figure of the path of a joint's pin in its clearance circle.

        Raises:
            BadInput: the joint has no clearance.
        """
        from reports.run.figures import orbit_plot

        loose = self.scene.clearances
        if joint not in loose:
            expected = f"{one_of(list(loose))}, which has clearance" if loose else "a scene with clearance"
            raise BadInput(f"joint: expected {expected}, got {shown(joint)}")
        return orbit_plot(self.frame, joint, loose[joint].radial_clearance_m, self._title)

    @check_arguments
    def animate(self, file: Place, exaggerate: Positive = 1.0) -> None:
        """Write an animation of the mechanism, with joint forces as arrows, to a .html, .gif or .mp4 file.

        Clearances are enlarged by the factor ``exaggerate``.

        Raises:
            BadInput: the file has another ending or cannot be written, or it is .mp4 without ffmpeg.
        """
        with as_arguments():
            path, ending = Path(file), film_ending(Path(file))
            with writing("--animate", path):
                require_place(path)
                write_whole(path, self.film(ending, exaggerate))

    def film(self, ending: str, exaggerate: float) -> bytes:
        """Return the animation as the bytes of a file; progress is reported as for a run."""
        from reports.run.film import film_bytes, pictured
        from studies.command.drawing import Shape

        shown = selected(self.trajectory, pictured(len(self.trajectory.time_s)))
        shape = Shape(self.scene, shown, exaggerate)
        return film_bytes(shape.drawing(), self.scene.name, ending, tell)

    @property
    def made_by(self) -> dict[str, Any]:
        """Provenance of the run: version, engine, settings, steps, quality, and the scene as TOML."""
        return {
            "version": version("crankslider"),
            "engine": self.engine_name,
            "settings": dict(vars(self.engine)),
            "tolerance_m": self.tolerance_m,
            "step_s": self.trajectory.step_s,
            "steps": self.trajectory.steps,
            "samples": len(self.trajectory.time_s) - 1,
            "quality": self.quality.parts(),
            "warnings": list(self.warnings),
            "scene": self.scene.to_toml(),
        }

    def notes(self) -> list[str]:
        """Return a line each on the quality, the steps and the largest force of the run."""
        method = vars(self.engine).get("method")
        of_method = f" of {method}" if method else ""
        steps, allowed_s = self.trajectory.steps, self.trajectory.step_s
        mean_s = self.trajectory.time_s[-1] / max(steps, 1)
        how_long = f"{mean_s:.3g} s on average, up to {allowed_s:.6g} s allowed"
        if mean_s > 0.99 * allowed_s:
            how_long = f"the longest {allowed_s:.6g} s"
        steps_taken = f"{steps} steps{of_method}, {how_long}"
        return [*self._start(), f"quality: {self.quality.summary()}", steps_taken, *self._notes_of_force()]

    def _start(self) -> list[str]:
        """Return how a start was put together, a line, of a scene in the general form alone."""
        placed = self.scene.placed if isinstance(self.scene, GeneralScene) else None
        return [] if placed is None else [f"start put together: {placed.moved} from what the file tells"]

    def _notes_of_force(self) -> list[str]:
        """Return a line on the largest contact force, and one if samples miss it."""
        if (largest := self.largest_contact_force) is None:
            return []
        said = f"the largest contact force is {_newtons(largest.force_N)}"
        lines = [f"{said} at joint {largest.joint} at t = {largest.time_s:.6g} s"]
        contacts, samples = self.trajectory.contacts, len(self.trajectory.time_s) - 1
        shown_N = contacts[largest.joint].normal_force_N.max()
        if shown_N < (1 - MISSED) * largest.force_N:
            duration_s = np.concatenate([contact.impacts.duration_s for contact in contacts.values()])
            shortest_s = duration_s[duration_s > 0].min(initial=np.inf)  # it is 0 between rigid walls
            enough = float(f"{PER_IMPACT * self.scene.end_time_s / shortest_s:.2g}")
            resolved = f", --samples {enough:g} resolves them" if samples < enough <= MOST_SAMPLES else ""
            missed = f"{samples} samples show at most {_newtons(shown_N)} of it"
            lines.append(f"{missed}: --impacts FILE has every impact's largest{resolved}")
        return lines

    @property
    def _title(self) -> str:
        return f"{self.scene.name}, {self.engine_name}"

    def __repr__(self) -> str:
        return f"Run of {self._title}: {'; '.join([*self.notes(), *self.warnings])}"

    def _repr_html_(self) -> str:
        """Return the display of a notebook: title, notes, warnings and figure."""
        from reports.run.figures import card

        return card(self._title, [*self.notes(), *self.warnings], self.plot())


def _newtons(force_N: float) -> str:
    """Return a force as text, with three digits."""
    return f"{force_N:.3g} N" if force_N < 999.5 else f"{force_N / 1e3:.3g} kN"
