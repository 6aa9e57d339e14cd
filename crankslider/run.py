"""What the library's functions return: tables, figures, and checks of their accuracy."""

import io
import json
import os
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import numpy as np

from engine_models.engine import MOST_SAMPLES, Engine, Trajectory
from engine_models.mechanics.quality import Quality, quality_of
from engine_models.mechanics.samples import selected
from engine_models.mechanics.states import lever_m
from engine_models.progress import tell
from engine_models.scene.arguments import Place, check_arguments, in_words
from engine_models.scene.format import Positive
from engine_models.scene.plain_words import one_of, shown, unknown
from engine_models.scene.scene import Scene
from studies.failures import BadInput, writing
from studies.whole_file import require_place, write_whole

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from reports.results import Results
    from reports.standings import Standings

#: Endings of the files of tables, of sweeps, of figures and of animations; and the place of no file.
TABLES, ROWS = (".csv", ".json", ".parquet", ""), (".parquet", ".csv")
PICTURES, FILMS = (".png", ".svg", ".pdf"), (".html", ".gif", ".mp4")
STDOUT = Path("-")
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
    ``warnings`` has a line for each doubt about the run. ``trajectory`` has all results as arrays. What is
    before ``start_s`` is a transient. ``checked`` tells whether a tolerance or a run at half the step has
    been a check of it.
    """

    scene: Scene
    engine_name: str
    engine: Engine
    trajectory: Trajectory
    warnings: tuple[str, ...] = ()
    tolerance_m: float | None = None
    start_s: float = 0.0
    checked: bool = True

    @cached_property
    def frame(self) -> "pd.DataFrame":
        """The samples: motion, forces and energies over ``time_s``, with the columns of the command line."""
        import pandas as pd

        return pd.DataFrame(self._samples()).set_index("time_s")

    @cached_property
    def impacts(self) -> "pd.DataFrame":
        """The contacts that have ended, one row each in the order of time; empty in an ideal scene."""
        import pandas as pd

        return pd.DataFrame(self._impacts())

    def _samples(self) -> Mapping[str, Any]:
        from studies.judges.columns import sample_columns

        return sample_columns(self.scene, self.trajectory)

    def _impacts(self) -> Mapping[str, Any]:
        from studies.judges.columns import impact_columns

        return impact_columns(self.trajectory.contacts)

    @property
    def largest_contact_force(self) -> ContactForce | None:
        """The largest normal force after ``start_s`` of all contacts, in impacts and samples.

        None if no pin has touched its bearing, with ideal joints, and with rigid walls.
        """
        return self._largest_force(self.start_s)

    def _largest_force(self, start_s: float) -> ContactForce | None:
        forces, clearances = [], self.scene.clearances
        for joint, contact in self.trajectory.contacts.items():
            force = np.append(contact.normal_force_N, contact.impacts.largest_normal_force_N)
            times = np.append(self.trajectory.time_s, contact.impacts.largest_normal_force_time_s)
            force = np.where(times >= start_s, force, 0.0)
            k = np.nanargmax(force)
            if clearances[joint].law != "rigid" and force[k] > 0:
                forces.append(ContactForce(float(force[k]), joint, float(times[k])))
        return max(forces, default=None)

    @property
    def quality(self) -> Quality:
        """Checks of energy balance, joint gaps and penetration; ``summary()`` gives them in a line."""
        return quality_of(self.scene, self.trajectory)

    @check_arguments
    def plot(self, columns: Sequence[str] = ()) -> "Figure":
        """Return a figure of position, velocity, forces and energy over time, or of ``columns`` of the frame.

        The largest contact force is marked, also if it lies between samples.

        Raises:
            BadInput: there is no such column.
        """
        from reports.run_figures import time_plot

        self.require_columns(columns)
        mark = None
        if largest := self.largest_contact_force:
            label = f"largest contact: {_newtons(largest.force_N)} at {largest.joint}"
            mark = largest.time_s, largest.force_N, label
        return time_plot(self.frame, self._title, self.quality.summary(), mark, columns)

    def require_columns(self, columns: Sequence[str]) -> None:
        """Raise BadInput if the frame lacks one of these."""
        for name in columns:
            if name not in self.frame:
                raise BadInput(unknown("columns", name, self.frame))

    @check_arguments
    def plot_orbit(self, joint: str) -> "Figure":
        """Return a figure of the path of a joint's pin in its clearance circle.

        Raises:
            BadInput: the joint has no clearance.
        """
        from reports.run_figures import orbit_plot

        clearances = self.scene.clearances
        if joint not in clearances:
            expected = "a scene with clearance"
            if clearances:
                expected = f"{one_of([*clearances])}, which has clearance"
            raise BadInput(f"joint: expected {expected}, got {shown(joint)}")
        return orbit_plot(self.frame, joint, clearances[joint].radial_clearance_m, self._title)

    @check_arguments
    def animate(self, file: Place, exaggerate: Positive = 1.0) -> None:
        """Write an animation of the mechanism, with joint forces as arrows, to a .html, .gif or .mp4 file.

        Clearances are enlarged by the factor ``exaggerate``.

        Raises:
            BadInput: the file has another ending or cannot be written, or it is .mp4 without ffmpeg.
        """
        require_file("animate", Path(file), FILMS)
        self.write(animate=file, exaggerate=exaggerate)

    @check_arguments
    def write(
        self,
        out: Place | None = None,
        impacts: Place | None = None,
        plot: Place | None = None,
        animate: Place | None = None,
        plot_columns: Sequence[str] = (),
        exaggerate: Positive = 1.0,
    ) -> None:
        """Write samples and impacts by the endings of their files, a figure and an animation; - is stdout.

        Raises:
            BadInput: a file cannot be written.
        """
        contents = {}
        for name, place, columns in (("out", out, self._samples), ("impacts", impacts, self._impacts)):
            if place is not None:
                contents[name, Path(place)] = self._encoded(columns(), Path(place).suffix.lower())
        if plot is not None:
            from reports.look import picture_bytes

            picture = picture_bytes(self.plot(plot_columns), Path(plot).suffix.lower())
            contents["plot", Path(plot)] = picture
        if animate is not None:
            contents["animate", Path(animate)] = self.film(Path(animate).suffix.lower(), exaggerate)
        for (name, path), content in contents.items():
            with writing(name, path):
                if path == STDOUT:
                    print(content.decode("utf-8"), end="")
                else:
                    write_whole(path, content)

    def film(self, ending: str, exaggerate: float) -> bytes:
        """Return the animation as the bytes of a file; progress is told as that of a run."""
        from reports.film import film_bytes, pictured

        shown = selected(self.trajectory, pictured(len(self.trajectory.time_s)))
        return film_bytes(self.scene, shown, exaggerate, ending, tell)

    def _encoded(self, columns: Mapping[str, Any], ending: str) -> bytes:
        """Return a table as CSV with all digits, or as JSON or Parquet with what made it."""
        if ending == ".parquet":
            import pyarrow as pa
            from pyarrow import parquet

            made_by = {
                name: it if isinstance(it, str) else json.dumps(it) for name, it in self.made_by.items()
            }
            sink = io.BytesIO()
            parquet.write_table(pa.table(dict(columns)).replace_schema_metadata(made_by), sink)
            return sink.getvalue()
        lists = {name: values.tolist() for name, values in columns.items()}
        if ending == ".json":
            known = {name: [None if it != it else it for it in values] for name, values in lists.items()}
            return (json.dumps({"made_by": self.made_by, "columns": known}) + "\n").encode("utf-8")
        rows = zip(*lists.values(), strict=True)
        lines = [",".join(lists), *(",".join(map(str, row)) for row in rows)]
        return ("\n".join(lines) + "\n").encode("utf-8")

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
        """Return a line each on the start, the quality, the steps and the largest force of the run."""
        method = vars(self.engine).get("method")
        of_method = f" of {method}" if method else ""
        steps, allowed_s = self.trajectory.steps, self.trajectory.step_s
        mean_s = self.trajectory.time_s[-1] / max(steps, 1)
        how_long = f"{mean_s:.3g} s on average, up to {allowed_s:.6g} s allowed"
        if mean_s > 0.99 * allowed_s:
            how_long = f"the longest {allowed_s:.6g} s"
        lines = [
            f"quality: {self.quality.summary()}{'' if self.checked else ', not checked'}",
            f"{steps} steps{of_method}, {how_long}",
        ]
        if (moved := self.scene.placed.moved) is not None:
            lines.insert(0, f"start put together: {moved} from what the file tells")
        return lines + self._notes_of_force()

    def _notes_of_force(self) -> list[str]:
        """Return a line on the largest contact force, and one if samples miss it."""
        if (largest := self.largest_contact_force) is None:
            return []
        line = f"the largest contact force is {_newtons(largest.force_N)}"
        lines = [f"{line} at joint {largest.joint} at t = {largest.time_s:.6g} s"]
        overall = self._largest_force(0.0)
        if self.start_s and overall and overall != largest:
            before = f"{_newtons(overall.force_N)} at joint {overall.joint} at t = {overall.time_s:.6g} s"
            lines[0] += f", after the transient to {self.start_s:g} s, in which it is {before}"
        contacts, samples = self.trajectory.contacts, len(self.trajectory.time_s) - 1
        late = self.trajectory.time_s >= self.start_s
        shown_N = contacts[largest.joint].normal_force_N[late].max(initial=0.0)
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
        from reports.run_figures import card

        return card(self._title, [*self.notes(), *self.warnings], self.plot())


@dataclass(frozen=True, repr=False, kw_only=True)
class TrueRun(Run):
    """A reference solution up to the predictability horizon.

    ``certain_m`` is the uncertainty of the slider, of a pendulum's pin along its arc, or of what the scene
    observes: of an angle times the longest lever. ``by`` says who solved it.
    """

    certain_m: float
    by: str

    @property
    def made_by(self) -> dict[str, Any]:
        """Provenance as of a run, with the uncertainty in place of an engine's settings."""
        return {**super().made_by, "settings": {}, "certain_m": self.certain_m, "by": self.by}

    def notes(self) -> list[str]:
        """Return a line each on the uncertainty, the method and the end, and on the largest force."""
        certain = f"{self.certain_m:.1e} m"
        if self.scene.observed.what == "angle":
            certain = f"{self.certain_m / lever_m(self.scene):.1e} rad"
        end = self.trajectory.time_s[-1]
        line = f"{self.scene.observed.name} is certain to {certain} until t = {end:.6g} s, by {self.by}"
        return [line, *self._notes_of_force()]


@dataclass(frozen=True)
class Sweep:
    """A finished sweep: ``frame`` has its rows, one per member, over the ``fields`` that differ."""

    title: str
    fields: tuple[str, ...]
    frame: "pd.DataFrame"

    @cached_property
    def warning(self) -> str | None:
        """A line that counts the members with warnings, with the first of them; None without any."""
        warned = self.frame[self.frame["warnings"].fillna("") != ""]
        if warned.empty:
            return None
        first = warned.iloc[0]
        count = f"{len(warned)} of {len(self.frame)} members have warnings (column warnings)"
        return f"{count}: member {first['member']}: {first['warnings']}"

    @check_arguments
    def plot(self, show: str | None = None) -> "Figure":
        """Return the figure over the one or two fields that differ, of the column ``show`` or of a default.

        Raises:
            BadInput: there is no figure of that number of fields, or no such column.
        """
        from reports.run_figures import NoPicture, sweep_picture

        numbers = list(self.frame.columns[list(self.frame).index("warnings") + 1 :])
        if show is not None and show not in numbers:
            raise BadInput(unknown("show", show, numbers))
        try:
            return sweep_picture(self.frame, self.fields, self.title, show)
        except NoPicture as reason:
            raise BadInput(f"plot: {reason}") from None

    def write(self, path: Path) -> None:
        """Write the rows as .parquet or .csv."""
        if path.suffix.lower() == ".csv":
            write_whole(path, self.frame.to_csv(index=False).encode("utf-8"))
        else:
            write_whole(path, self.frame.to_parquet(index=False))


@dataclass(frozen=True)
class Comparison:
    """A comparison of engines on a scene.

    ``results`` has the rows and their curves. ``run`` is the recommended run with more samples, None if there
    is no recommendation. ``given`` is the scene as it is typed in a command.
    """

    scene: Scene
    results: "Results"
    run: Run | None
    given: str

    @property
    def frame(self) -> "pd.DataFrame":
        """The rows, one per recorded or timed run, with settings, errors, times and reasons."""
        return self.results.rows

    @cached_property
    def standings(self) -> "Standings":
        """The result of every engine."""
        from reports.standings import Standings

        return Standings.of(self.frame)

    @property
    def recommendation(self) -> str:
        """The recommended engine and setting, its cost, and its limit, in sentences."""
        from reports.standings import sentences

        return "\n".join(sentences(self.standings, self.given))

    def table(self) -> "pd.DataFrame":
        """Return a line for each engine, as on the page."""

        from reports.standings import standings_table

        return standings_table(self.standings).cells()

    @check_arguments
    def save(self, folder: Place) -> None:
        """Write the page, ``index.html``, its figures and tables, and the rows, ``rows.csv``, to a folder.

        Raises:
            BadInput: the folder cannot be written.
        """
        from reports.comparison import write_comparison

        place, pictures = Path(folder), {}
        if self.run is not None:
            pictures["What does the recommended run look like?"] = self.run.plot()
            for joint in self.scene.joints_with_clearance:
                pictures[f"Where is pin {joint} in its bearing?"] = self.run.plot_orbit(joint)
        with writing("folder", place):
            write_comparison(place, self.results, pictures, self.scene.to_toml(), self.given)
            write_whole(place / "rows.csv", self.frame.to_csv(index=False).encode("utf-8"))

    def __repr__(self) -> str:
        return self.recommendation


def ending_of(argument: str, path: Path, endings: Collection[str]) -> str:
    """Return the ending of a file's name in lower case; raise BadInput if it is none of these."""
    ending = path.suffix.lower()
    if ending not in endings:
        expected = f"a file that ends in {one_of([each for each in endings if each])}"
        raise BadInput(f"{argument}: expected {expected}, got {shown(str(path))}")
    return ending


def require_file(argument: str, path: Path, endings: Collection[str], inputs: Collection[Path] = ()) -> None:
    """Refuse, before any work, a file that cannot be written, has another ending, or is one of the inputs."""
    ending = ending_of(argument, path, endings)
    if path == STDOUT and "" in endings:
        return
    if ending == ".mp4":
        from reports.film import can_write

        if not can_write(ending):
            expected = "a file that ends in .html or .gif where ffmpeg is not installed"
            raise BadInput(f"{argument}: expected {expected}, got {shown(str(path))}")
    if any(os.path.realpath(path) == os.path.realpath(other) for other in inputs):
        expected = "a file that neither the scene is read from nor another is written to"
        raise BadInput(f"{argument}: expected {expected}, got {path}")
    with writing(argument, path):
        require_place(path)


@check_arguments
def factor(exaggerate: Annotated[Positive, in_words()] = 1.0) -> float:
    """Return the factor by which clearances are enlarged in an animation, which may be text."""
    return exaggerate


def _newtons(force_N: float) -> str:
    """Return a force as text, with three digits."""
    return f"{force_N:.3g} N" if force_N < 999.5 else f"{force_N / 1e3:.3g} kN"
