"""What the library's functions return: tables, figures, and checks of their accuracy."""

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from errno import EISDIR
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryFile
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import numpy as np

from engine_models.engine import Engine, Trajectory
from engine_models.mechanics.quality import Quality, quality_of
from engine_models.mechanics.states import lever_m
from engine_models.scene.arguments import Place, check_arguments, in_words
from engine_models.scene.format import Positive
from engine_models.scene.plain_words import one_of, shown, unknown
from engine_models.scene.scene import Scene
from studies.failures import BadInput, writing
from studies.judges.columns import impact_columns, sample_columns

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from reports.results import Results
    from reports.standings import Standings

#: Endings of the files that a run is written to; and the place of no file.
TABLES, PICTURES = (".csv", ".json", ".parquet", ""), (".png", ".svg", ".pdf")
FILES = {"out": TABLES, "impacts": TABLES, "plot": PICTURES, "animate": (".html", ".gif", ".mp4")}
STDOUT = Path("-")

Times = Annotated[Positive, in_words()]


class ContactForce(NamedTuple):
    """Normal force of a contact, its joint, and its time."""

    force_N: float
    joint: str
    time_s: float

    def __str__(self) -> str:
        return f"{_newtons(self.force_N)} at joint {self.joint} at t = {self.time_s:.6g} s"


@dataclass(frozen=True)
class Run:
    """A finished simulation: its input and its results.

    ``engine`` has the settings that ran. ``tolerance_m`` is the tolerance of the slider position, or None.
    ``warnings`` has a line for each doubt about the run. ``trajectory`` has all results as arrays. What is
    before ``start_s`` is a transient. ``checked``: a tolerance or a run at half the step has been a check.
    ``certain_m`` is the uncertainty of the place that a reference solution, solved ``by`` whom, observes; of
    an angle it is multiplied by the longest lever.
    """

    scene: Scene
    engine_name: str
    engine: Engine
    trajectory: Trajectory
    warnings: tuple[str, ...] = ()
    tolerance_m: float | None = None
    start_s: float = 0.0
    checked: bool = True
    certain_m: float = 0.0
    by: str = ""

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
        """The largest normal force after ``start_s``, in impacts and samples; None of rigid walls."""
        return self._largest_force(self.start_s)

    def _largest_force(self, start_s: float) -> ContactForce | None:
        forces = list[ContactForce]()
        for joint, contact in self.trajectory.contacts.items():
            force = np.append(contact.normal_force_N, contact.impacts.largest_normal_force_N)
            times = np.append(self.trajectory.time_s, contact.impacts.largest_normal_force_time_s)
            force = np.where(times >= start_s, force, 0.0)
            k = np.nanargmax(force)
            if self.scene.clearances[joint].law != "rigid" and force[k] > 0:
                forces.append(ContactForce(float(force[k]), joint, float(times[k])))
        return max(forces, default=None)

    @property
    def quality(self) -> Quality:
        """Checks of energy balance, joint gaps and penetration; ``summary()`` gives them in a line."""
        return quality_of(self.scene, self.trajectory)

    @check_arguments
    def plot(self, columns: Sequence[str] = ()) -> "Figure":
        """Return a figure of motion, forces, the largest marked, and energy, or ``columns``, over time."""
        from reports.run_figures import time_plot

        if missing := [name for name in columns if name not in self.frame]:
            raise BadInput(unknown("columns", missing[0], self.frame))
        mark, largest = None, self.largest_contact_force
        if largest:
            force = f"{_newtons(largest.force_N)} at {largest.joint} after {self.start_s:.6g} s"
            mark = largest.time_s, largest.force_N, f"largest contact: {force}"
        title = f"{self.scene.name}, {self.engine_name}"
        return time_plot(self.frame, title, self.quality.summary(), mark, columns)

    @check_arguments
    def plot_orbit(self, joint: str) -> "Figure":
        """Return a figure of the path of a joint's pin in its clearance circle."""
        from reports.run_figures import orbit_plot

        clearances = self.scene.clearances
        if joint not in clearances:
            raise BadInput(unknown("joint", joint, clearances))
        title = f"{self.scene.name}, {self.engine_name}"
        return orbit_plot(self.frame, joint, clearances[joint].radial_clearance_m, title)

    @check_arguments
    def write(
        self,
        out: Place | None = None,
        impacts: Place | None = None,
        plot: Place | None = None,
        animate: Place | None = None,
        plot_columns: Sequence[str] = (),
        exaggerate: Times = 1.0,
    ) -> None:
        """Write tables by the endings of their files, a figure and an animation.

        Args:
            out: write samples to .csv, .json or .parquet; - is stdout, the default alone.
            impacts: write impacts, one row each, to .csv, .json or .parquet.
            plot: draw it to .png, .svg or .pdf.
            animate: animate the mechanism to .html, .gif or .mp4.
            plot_columns: columns that the figure shows, A,B.
            exaggerate: enlarge clearances in the animation by this factor.
        """
        require_outputs(self.scene, out=out, impacts=impacts, plot=plot, animate=animate)
        if out is not None:
            write_file("out", out, encode(self.frame.reset_index(), out, self.made_by))
        if impacts is not None:
            write_file("impacts", impacts, encode(self.impacts, impacts, self.made_by))
        if plot is not None:
            write_file("plot", plot, self.plot(plot_columns))
        if animate is not None:
            from reports.film import film_bytes  # loads Matplotlib

            film = film_bytes(self.scene, self.trajectory, exaggerate, Path(animate).suffix.lower())
            write_file("animate", animate, film)

    @property
    def made_by(self) -> dict[str, Any]:
        """Provenance of the run: version, engine, settings, steps, quality, and the scene as TOML."""
        return {
            "version": version("crankslider"),
            "engine": self.engine_name,
            "settings": {} if self.by else dict(vars(self.engine)),
            "tolerance_m": self.tolerance_m,
            "step_s": self.trajectory.step_s,
            "steps": self.trajectory.steps,
            "samples": len(self.trajectory.time_s) - 1,
            "quality": self.quality.parts(),
            "warnings": list(self.warnings),
            "scene": self.scene.to_toml(),
            **({"certain_m": self.certain_m, "by": self.by} if self.by else {}),
        }

    def notes(self) -> list[str]:
        """Return a line each on start, quality, steps or uncertainty, and largest force of the run."""
        steps, allowed_s, time_s = self.trajectory.steps, self.trajectory.step_s, self.trajectory.time_s
        if self.by:
            lever = lever_m(self.scene) if (angle := self.scene.observed.what == "angle") else 1.0
            certain = f"{self.certain_m / lever:.1e} {'rad' if angle else 'm'} until t = {time_s[-1]:.6g} s"
            lines = [f"{self.scene.observed.name} is certain to {certain}, by {self.by}"]
        else:
            method, mean_s = vars(self.engine).get("method"), time_s[-1] / max(steps, 1)
            how_long = f"{mean_s:.3g} s on average, up to {allowed_s:.6g} s allowed"
            if mean_s > 0.99 * allowed_s:
                how_long = f"the longest {allowed_s:.6g} s"
            lines = [f"quality: {self.quality.summary()}{'' if self.checked else ', not checked'}"]
            lines.append(f"{steps} steps{f' of {method}' if method else ''}, {how_long}")
            if (moved := self.scene.placed.moved) is not None:
                lines.insert(0, f"start put together: {moved} from what the file tells")
        if largest := self.largest_contact_force:
            lines.append(f"the largest contact force is {largest}")
            if (overall := self._largest_force(0.0)) != largest:
                lines[-1] += f", after the transient to {self.start_s:g} s, in which it is {overall}"
            elif not (self.start_s or self.by):
                lines[-1] += ", the start counted, which --from TIME leaves out"
        return lines

    def __repr__(self) -> str:
        told = "; ".join([*self.notes(), *self.warnings])
        return f"Run of {self.scene.name}, {self.engine_name}: {told}"


@dataclass(frozen=True)
class Sweep:
    """A finished sweep: ``frame`` has its rows, one per member, over the ``fields`` that differ."""

    title: str
    fields: tuple[str, ...]
    frame: "pd.DataFrame"

    @check_arguments
    def plot(self, show: str | None = None) -> "Figure":
        """Return the figure over the one or two fields that differ, of a column or of a default one."""
        from reports.run_figures import sweep_picture

        return sweep_picture(self.frame, self.fields, self.title, show)


@dataclass(frozen=True, repr=False)
class Comparison:
    """A comparison of engines on a scene.

    ``results`` has the rows and their curves, kept in ``folder``; ``given`` is the scene as it is typed.
    """

    scene: Scene
    results: "Results"
    given: str
    folder: Path

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

    @check_arguments
    def save(self, folder: Place) -> None:
        """Write the page, ``index.html``, its figures and tables, and the rows, ``rows.csv``, to a folder."""
        from reports.comparison import write_comparison

        with writing("folder", Path(folder)):
            write_comparison(Path(folder), self.results, self.scene.to_toml(), self.given)
        write_file("folder", Path(folder, "rows.csv"), self.frame.to_csv(index=False).encode())


def require_outputs(scene: Scene, **files: str | Path | None) -> None:
    """Refuse, before any work, files that cannot be written, have other endings, or are one."""
    places = {name: Path(place) for name, place in files.items() if place is not None}
    if len(set(map(os.path.realpath, places.values()))) < len(places):
        raise BadInput(f"out: expected a file each, got {', '.join(map(str, places.values()))}")
    for name, path in places.items():
        if name == "impacts" and not scene.clearances:
            raise BadInput(f"impacts: expected a scene with clearance, got {scene.name}, which has none")
        if path.suffix.lower() not in FILES[name]:
            expected = f"a file that ends in {one_of([each for each in FILES[name] if each])}"
            raise BadInput(f"{name}: expected {expected}, got {shown(str(path))}")
        with writing(name, path):
            if path.is_dir():
                raise IsADirectoryError(EISDIR, os.strerror(EISDIR))
            if path != STDOUT and (path.is_file() or not path.exists()):  # not a device
                TemporaryFile(dir=os.path.realpath(path.parent)).close()


def encode(frame: "pd.DataFrame", place: str | Path, made_by: Mapping[str, Any]) -> bytes:
    """Return a table as CSV with all digits, or by its file's ending as JSON or Parquet with what made it."""
    ending = Path(place).suffix.lower()
    if ending == ".parquet":
        frame.attrs = dict(made_by)  # which Parquet keeps
        return bytes(frame.to_parquet(index=False))
    if ending == ".json":
        columns = frame.astype(object).where(frame.notna(), None).to_dict("list")
        return (json.dumps({"made_by": made_by, "columns": columns}) + "\n").encode("utf-8")
    return str(frame.to_csv(index=False, lineterminator="\n")).encode("utf-8")


def write_file(argument: str, place: str | Path, content: "bytes | Figure") -> None:
    """Write to stdout, a device, or a file that takes its place once it is on the disk."""
    if not isinstance(content, bytes):
        from reports.look import picture_bytes  # loads Matplotlib

        content = picture_bytes(content, Path(place).suffix.lower())
    with writing(argument, Path(place)):
        if Path(place) == STDOUT:
            print(content.decode("utf-8"), end="")
        elif (path := Path(os.path.realpath(place))).exists() and not path.is_file():
            path.write_bytes(content)
        else:
            new = path.with_name(f".{path.name}.{os.getpid()}.new")
            try:
                new.write_bytes(content)
                new.replace(path)
            finally:
                new.unlink(missing_ok=True)


def _newtons(force_N: float) -> str:
    return f"{force_N:.3g} N" if force_N < 999.5 else f"{force_N / 1e3:.3g} kN"
