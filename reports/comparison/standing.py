"""Where the engines stand on one scene: the fastest setting of each that reaches the error asked for."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import pandas as pd

from reports.equal_error import (
    ALONE,
    UNRESOLVED,
    Choice,
    choice_at,
    from_coarse_to_fine,
    ratio,
    reaching,
    settings,
)
from reports.look import axis_label, number, words
from reports.page import UNCERTAIN, Table
from reports.results import (
    FORCE,
    PEAK,
    finished,
    floor,
    quality_failures,
    uncertainty,
    value,
    with_columns,
    with_forces,
)

#: The study's name, which begins the names of figures and tables.
NAME = "comparison"
#: The counts of impacts with a partner in the reference solution, without one there, and without one here.
IMPACTS = ("impacts_matched", "impacts_missed", "impacts_unmatched")
#: Columns that not every scene and every engine has.
OPTIONAL = (
    "round",
    "compared_until_s",
    "solve_time_s",
    "build_time_s",
    "motion_alone",
    *IMPACTS,
)


@dataclass(frozen=True)
class Standings:
    """The rows of a comparison, the ``column`` of errors that is compared, and the error ``wanted`` of it.

    ``settings`` are those with errors and times that pass the check after every run (see ``equal_error``);
    ``floor`` is the reference solution's uncertainty.
    """

    rows: pd.DataFrame
    column: str
    wanted: float
    settings: pd.DataFrame
    floor: float

    @classmethod
    def of(cls, rows: pd.DataFrame) -> "Standings":
        """Return the standings in the rows of one scene.

        An error is the run's distance from the solution of the engine's own model, and that model's from the
        scene's.
        """
        column, wanted = str(rows["judged_by"].iloc[0]), float(rows["wanted_error"].iloc[0])
        rows = with_forces(with_columns(rows, *OPTIONAL, column))
        of_model = value(rows, column.replace("_error_", "_model_difference_")).fillna(0.0)
        rows = rows.assign(**{column: value(rows, column) + of_model})
        known = floor(rows, column)
        ran = settings(rows, column, known)
        return cls(rows, column, wanted, ran[quality_failures(rows)[ran.index] == ""], known)

    @cached_property
    def recorded(self) -> pd.DataFrame:
        """The rows of recorded runs, not of timed ones, from coarse to fine, with ``knob`` and ``value``."""
        return from_coarse_to_fine(self.rows[self.rows["round"].isna()])

    @property
    def level(self) -> float:
        """The error at which run times are compared: the one wanted, or the floor if that is larger."""
        return max(self.wanted, self.floor)

    @cached_property
    def reached(self) -> list[Choice]:
        """Each engine's fastest setting that reaches the level, the fastest engine first."""
        return reaching(self.settings, self.level)

    @cached_property
    def reached_with_forces(self) -> list[Choice]:
        """The same of configurations whose solve gives the forces, too."""
        return reaching(self.settings[~self.settings["motion_alone"].astype(bool)], self.level)

    @cached_property
    def runs(self) -> list[Choice]:
        """A run of each engine that has any: its fastest that reaches the level, or its most accurate."""
        there = {each.engine for each in self.reached}
        accurate = self.settings.sort_values(["kept", "error", "time_s"]).drop_duplicates("engine")
        return [*self.reached, *map(choice_at, accurate[~accurate["engine"].isin(there)].itertuples())]

    @property
    def chosen(self) -> Choice | None:
        """The run to be recommended: the fastest that reaches the level, or else the most accurate one."""
        return next(iter(self.runs), None)

    def fails_at(self, run: Choice) -> "pd.Series[Any] | None":
        """Return the recorded row of the nearest coarser setting that misses the level, None without one."""
        own = self.recorded[self.recorded["label"] == run.label]
        coarser = own.iloc[: own.index.get_loc(run.row)]
        missed = value(coarser, self.column) > self.level
        missed |= (coarser["status"] != "ok") | (quality_failures(coarser) != "")
        return coarser[missed].iloc[-1] if missed.any() else None

    @property
    def not_run(self) -> pd.DataFrame:
        """A row of each engine that finished no run."""
        ran = set(finished(self.recorded)["engine"])
        return self.recorded[~self.recorded["engine"].isin(ran)].drop_duplicates("engine")


def standings_table(standings: Standings) -> Table:
    """Return each engine's run time at the error asked for, with the errors of that run.

    An engine all of whose finished runs fail the check after every run has no valid run.
    """
    rows, reached = standings.rows, {each.row for each in standings.reached}
    fastest = next(iter(standings.reached), None)
    what, unit = words(standings.column)
    errors = {f"error [{unit}]": standings.column, "joint force error [N]": FORCE}
    errors |= {axis_label(PEAK): PEAK} if rows[PEAK].notna().any() else {}
    lines: list[dict[str, Any]] = []
    for run in standings.runs:
        there = run.row in reached
        line: dict[str, Any] = {"configuration": run.label, "setting": run.setting}
        line["time [ms]"] = run.shown_ms(FORCE) if there else None
        line["ratio"] = str(ratio(run, fastest)) if there and fastest and run is not fastest else None
        at = rows.loc[[run.row]]
        for heading, column in errors.items():
            line[heading] = value(at, column).iloc[0]
            line[f"{heading}{UNCERTAIN}"] = uncertainty(at, column).iloc[0]
        lines.append(line)
    recorded, shown = standings.recorded, {run.engine for run in standings.runs}
    for engine in recorded["engine"][~recorded["engine"].isin(shown)].drop_duplicates():
        status = recorded["status"][recorded["engine"] == engine].iloc[0]
        lines.append({"configuration": engine, "setting": "no valid run" if status == "ok" else status})
    title = f"Run time of each engine at a {what} of {number(standings.level)} {unit}"
    caption = (
        "Each engine's fastest setting that reaches the error; without a time: the error is not reached, the "
        f"most accurate run is shown. {UNRESOLVED} {ALONE}"
    )
    formats = dict.fromkeys(errors, number)
    return Table(f"{NAME}-standings", title, caption, NAME, pd.DataFrame(lines), formats)
