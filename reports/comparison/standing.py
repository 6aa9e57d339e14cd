"""Where the engines stand on one scene: the fastest setting of each that reaches the error asked for."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import pandas as pd

from reports.analysis.equal_error import (
    ALONE,
    UNRESOLVED,
    Choice,
    choice_at,
    choices,
    from_coarse_to_fine,
    ratio,
    settings,
)
from reports.parts import Table
from reports.quantities import FORCE, PEAK, finished, floor, quality_failures, uncertainty, value, with_forces
from reports.results import with_columns
from reports.style import axis_label, words
from reports.tables import ABSENT, error, number

#: The study's name, which begins the names of figures and tables.
NAME = "comparison"
#: The counts of impacts with a partner in the reference solution, without one there, and without one here.
IMPACTS = ("impacts_matched", "impacts_missed", "impacts_unmatched")
#: Columns that not every scene and every engine has.
OPTIONAL = (
    "round",
    "compiled_anew",
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
        """How each engine that reaches the level does so in the least time, the fastest first."""
        return choices(self.settings, self.level)

    @cached_property
    def reached_with_forces(self) -> list[Choice]:
        """The same of configurations whose solve gives the forces, too."""
        return choices(self.settings[~self.settings["motion_alone"].astype(bool)], self.level)

    @cached_property
    def runs(self) -> list[Choice]:
        """A run of each engine that has any: its fastest that reaches the level, or its most accurate."""
        reached = {each.engine: self.run_at(each) for each in self.reached}
        accurate = self.settings.sort_values(["kept", "error", "time_s"]).drop_duplicates("engine")
        others = accurate[~accurate["engine"].isin(reached)]
        return [*reached.values(), *map(choice_at, others.itertuples())]

    @property
    def chosen(self) -> Choice | None:
        """The run to be recommended: the fastest that reaches the level, or else the most accurate one."""
        return next(iter(self.runs), None)

    def run_at(self, choice: Choice) -> Choice:
        """Return the fastest setting that was run and reaches the level, of a choice's configuration."""
        own = self.settings[(self.settings["label"] == choice.label) & (self.settings["kept"] <= self.level)]
        return choice_at(next(own.sort_values("time_s").itertuples()))

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
    """Return each engine's run time at the error asked for, with the errors of the run at that setting.

    An engine all of whose finished runs fail the check after every run has no valid run.
    """
    rows, reached = standings.rows, {each.engine: each for each in standings.reached}
    fastest = next(iter(standings.reached), None)
    what, unit = words(standings.column)
    errors = {
        f"error [{unit}]": standings.column,
        "joint force error [N]": FORCE,
        **({axis_label(PEAK): PEAK} if rows[PEAK].notna().any() else {}),
    }
    lines = []
    for run in standings.runs:
        time = share = ABSENT
        if there := reached.get(run.engine):
            time = there.shown_ms(FORCE)
            share = str((there is not fastest and fastest and ratio(there, fastest)) or ABSENT)
        at = rows.loc[[run.row]]
        cells = (error(value(at, of).iloc[0], uncertainty(at, of).iloc[0]) for of in errors.values())
        lines.append((run.label, run.setting, time, share, *cells))
    recorded, shown = standings.recorded, {run.engine for run in standings.runs}
    for engine in recorded["engine"][~recorded["engine"].isin(shown)].drop_duplicates():
        status = recorded["status"][recorded["engine"] == engine].iloc[0]
        lines.append((engine, "no valid run" if status == "ok" else status, *[ABSENT] * (2 + len(errors))))
    return Table(
        f"{NAME}-standings",
        f"Run time of each engine at a {what} of {number(standings.level)} {unit}",
        "The time of the solve is interpolated between settings; the errors are those of the run at the "
        "setting. Without a time: the error is not reached, the most accurate run is shown. "
        f"{UNRESOLVED} {ALONE}",
        NAME,
        ("configuration", "setting", "time [ms]", "ratio", *errors),
        tuple(lines),
        shown=True,
    )
