"""Where every engine stands on one scene: the cheapest way to the error wanted, and the most accurate one."""

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import pandas as pd

from reports.equal_error import Arrival, Judged, Ratio, arrivals, from_coarse_to_fine, ratio
from reports.quantities import finished, value, with_peak
from reports.results import with_columns
from reports.shared_tables import NOT_JUDGED, quality_failures, unjudged

#: The signals that are joint forces, and the columns of their errors.
FORCE, FORCES = r"^joint_\w_force_N$", r"^joint_\w_force_error_N$"
#: Columns that not every scene has.
OPTIONAL = (
    "round",
    "compiled_anew",
    "compared_until_s",
    "solve_time_s",
    "build_time_s",
    "compile_time_s",
    "motion_alone",
)


@dataclass(frozen=True)
class Standings:
    """The rows of a comparison, judged by a ``column`` of errors; ``wanted`` is the error asked for."""

    rows: pd.DataFrame
    column: str
    wanted: float

    @classmethod
    def of(cls, rows: pd.DataFrame) -> "Standings":
        """Return the standings in the rows of one scene.

        An error is that of the run from its engine's own law, and how far that law is from the scene's.
        """
        column, wanted = rows["judged_by"].iloc[0], float(rows["wanted_error"].iloc[0])
        rows = with_peak(with_columns(rows, *OPTIONAL, column))
        form = column.replace("_error_", "_model_difference_")
        law = value(rows, form).fillna(0.0)
        return cls(rows.assign(**{column: value(rows, column) + law}), column, wanted)

    def whole(self) -> "Standings":
        """Return the same with what building the model and reading out takes within the run times."""
        return replace(self, rows=self.judged.whole().rows)

    @cached_property
    def recorded(self) -> pd.DataFrame:
        """The rows of recorded runs, not of timed ones, from coarse to fine, with ``knob`` and ``value``."""
        return from_coarse_to_fine(self.rows[self.rows["round"].isna()])

    @cached_property
    def judged(self) -> Judged:
        """The rows, by the errors that are wanted."""
        return Judged("comparison", self.rows, self.column)

    @property
    def rungs(self) -> pd.DataFrame:
        """The rungs that have errors and times and pass the check after every run (see ``equal_error``)."""
        rungs = next((ladder for ladder, _ in self.judged.ladders.values()), pd.DataFrame())
        return rungs if rungs.empty else rungs[quality_failures(self.rows)[rungs.index] == ""]

    @property
    def floor(self) -> float:
        """The truth's own uncertainty."""
        return next((floor for _, floor in self.judged.ladders.values()), 0.0)

    @property
    def level(self) -> float:
        """The error at which run times are compared: the one wanted, or the truth's uncertainty if larger."""
        return max(self.wanted, self.floor)

    @cached_property
    def there(self) -> list[Arrival]:
        """How each engine that gets to that error does so, the cheapest first."""
        return [] if self.rungs.empty else arrivals(self.rungs, self.level)

    @property
    def motion_alone(self) -> pd.Series:
        """Of each row whether its solve leaves the forces for later."""
        return self.rows["motion_alone"].isin([True])

    def force_error_N(self, row: object) -> tuple[float, float]:
        """Return the largest error of a run's joint forces, and to what the truth knows that force."""
        errors = self.rows.loc[row].filter(regex=FORCES).dropna().astype(float)
        if errors.empty:
            return math.nan, 0.0
        known = self.rows.loc[row].get(errors.idxmax().replace("_error_", "_uncertainty_"), 0.0)
        return float(errors.max()), float(known)

    @property
    def unjudged(self) -> list[tuple[str, str]]:
        """The signal by which engines are judged and why it is not judged, if any finished run says so."""
        signal, told = self.column.replace("_error_", "_"), finished(self.recorded).get(NOT_JUDGED, ())
        return [each for text in told for each in unjudged(text, f"^{signal}$")][:1]

    @cached_property
    def with_forces(self) -> list[Arrival]:
        """The same of what gives forces in its solve, and does not leave them for later."""
        alone = self.motion_alone[self.rungs.index]
        return [] if alone.all() else arrivals(self.rungs[~alone], self.level)

    def rung(self, arrival: Arrival) -> Any:
        """Return the cheapest rung that was run and is as good, of the arm that arrives."""
        arm = self.rungs[self.rungs["label"] == arrival.label]
        return next(arm[arm["kept"] <= self.level].sort_values("time_s").itertuples())

    def share(self, arrival: Arrival) -> Ratio | None:
        """Return what one takes in times of the cheapest; None where no round has both."""
        return ratio(arrival, self.there[0])

    @property
    def nearest(self) -> Any:
        """The rung that keeps the smallest error, the cheapest of equal ones; None if there is none."""
        if self.rungs.empty:
            return None
        return next(self.rungs.sort_values(["kept", "error", "time_s"]).itertuples())

    @property
    def chosen(self) -> Any:
        """The rung to be recommended: of the cheapest arrival, or else the nearest; None if there is none."""
        return self.rung(self.there[0]) if self.there else self.nearest

    def coarser(self, rung: Any) -> pd.DataFrame:
        """Return the recorded rows of a rung's arm at coarser settings, the next one last."""
        own = self.recorded[self.recorded["label"] == rung.label]
        return own[: own.index.get_loc(rung.Index)]

    def finer(self, rung: Any) -> pd.DataFrame:
        """Return the rungs of a rung's arm at finer settings."""
        own = self.rungs[self.rungs["label"] == rung.label]
        return own[own.index.get_loc(rung.Index) + 1 :]

    @property
    def silent(self) -> pd.DataFrame:
        """A row of each engine that finished no run."""
        ran = set(finished(self.recorded)["engine"])
        return self.recorded[~self.recorded["engine"].isin(ran)].drop_duplicates("engine")
