"""Where the engines stand on one scene at the error asked for, and a recommendation in sentences."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import pandas as pd

from reports.equal_error import (
    ALONE,
    UNRESOLVED,
    UNRESOLVED_MARK,
    is_resolved,
    judged,
    mark,
    ratio,
    reaching,
    settings,
)
from reports.look import axis_label, command, number, plain, quantity, setting, words
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
#: The counts of impacts with a partner in the reference solution, and of those there without one here.
MATCHED, MISSED = "impacts_matched", "impacts_missed"
#: Columns that not every scene and every engine has.
OPTIONAL = ("round", "compared_until_s", "not_judged", "unaccounted_energy_part", MATCHED, MISSED)
#: A comparison ends before its scene if it is short of this part of it.
SHORT_OF = 0.999


@dataclass(frozen=True)
class Standings:
    """The ``recorded`` runs of a comparison from coarse to fine, and the error ``wanted`` of a ``column``.

    ``settings`` are those with errors and times that pass the check after every run (see ``equal_error``);
    ``floor`` is the reference solution's uncertainty.
    """

    recorded: pd.DataFrame
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
        recorded = settings(rows.assign(**{column: value(rows, column) + of_model}))
        known = floor(recorded, column)
        ran = judged(recorded, column, max(wanted, known))
        return cls(recorded, column, wanted, ran[quality_failures(ran) == ""], known)

    @cached_property
    def reached(self) -> pd.DataFrame:
        """Each engine's fastest setting that reaches the error wanted, or the floor if that is larger."""
        return reaching(self.settings)

    @cached_property
    def runs(self) -> pd.DataFrame:
        """A run of each engine that has any: its fastest that reaches the error, or its most accurate."""
        accurate = self.settings.sort_values(["kept", "error", "time_s"])
        return pd.concat([self.reached, accurate]).drop_duplicates("engine")

    @property
    def chosen(self) -> Any:
        """The run to be recommended: the fastest that reaches the error, or else the most accurate one."""
        return next(self.runs.itertuples(), None)

    @property
    def not_run(self) -> list[str]:
        """Of each engine that finished no run, why not."""
        ran = finished(self.recorded)["engine"]
        others = self.recorded[~self.recorded["engine"].isin(ran)].drop_duplicates("engine")
        return [f"{row.engine}: {row.status}, {row.reason}." for row in others.itertuples()]


def sentences(standings: Standings, given: str) -> Iterator[str]:
    """Yield the recommendation and its limits; ``given`` is the scene as it is typed in a command."""
    chosen, (what, unit) = standings.chosen, words(standings.column)
    wanted, signal = quantity(standings.wanted, unit), standings.column.replace("_error_", "_")
    ran = finished(standings.recorded)
    parts = (part.partition(": ") for text in ran["not_judged"].dropna() for part in text.split("; "))
    unjudged = {name: why for name, colon, why in parts if colon}  # "joint_B_force_N: zero; ..."
    if chosen is None:
        why = "no run finished and passed the check of energy, joint gaps and penetration"
        if signal in unjudged:
            why = f"{words(signal)[0]} is not compared ({unjudged[signal]})"
        yield f"No recommendation: {why}."
    else:
        if standings.reached.empty:
            yield f"No engine reached a {what} of {wanted} at any tested setting."
        alone = " (motion only; forces are computed after the solve)" if chosen.motion_alone else ""
        yield f"{'Closest:' if standings.reached.empty else 'Use'} {chosen.label} at {chosen.setting}{alone}."
        row = standings.recorded.loc[chosen.Index]
        yield f"Command: {command(row, given)}"
        bound = f"below {quantity(standings.floor, unit)}, the reference solution's uncertainty"
        error = row[standings.column]
        told = bound if error <= standings.floor else quantity(error, unit)
        yield f"{what[:1].upper()}{what[1:]}: {told}; asked for: {wanted}."
        for other in standings.reached[1:2].itertuples():
            times = ratio(other, chosen)
            slower = "slower" if times.decided else "the time, not resolved by the timing,"
            times_in_words = f"{plain(times.times)}x {slower} at equal error"
            yield f"Next best engine: {other.label} at {other.setting}, {times_in_words}."
        yield from _limit(standings, chosen)
    for name, why in unjudged.items():
        if name != signal and name.startswith("joint_"):
            yield f"{words(name)[0]} is not compared ({why})."
    until, end = ran["compared_until_s"].min(), ran["end_time_s"].max()
    if until < SHORT_OF * end:
        yield (
            f"Predictability horizon: {until:.3g} s of {end:.3g} s. Errors are compared up to there; "
            "beyond it only statistics are meaningful."
        )
    yield from standings.not_run


def _limit(standings: Standings, chosen: Any) -> Iterator[str]:
    """Yield at which coarser setting the recommended configuration misses the error asked for, and how."""
    own = standings.recorded[standings.recorded["label"] == chosen.label]
    coarser = own.iloc[: own.index.get_loc(chosen.Index)]
    failures, errors = quality_failures(coarser), value(coarser, standings.column)
    missed = coarser[(errors > chosen.target) | (coarser["status"] != "ok") | (failures != "")]
    if missed.empty or standings.reached.empty:
        return
    row, (what, unit) = missed.iloc[-1], words(standings.column)
    if row["status"] != "ok":
        how = f"{row['status']}, {row['reason']}"
    else:
        how = failures[row.name] or f"{what} {quantity(row[standings.column], unit)}"
    yield f"Not good enough at {setting(row['knob'], row['value'])}: {how}."


def standings_table(standings: Standings) -> Table:
    """Return each engine's run time at the error asked for, with the errors of that run.

    An engine all of whose finished runs fail the check after every run has no valid run.
    """
    runs, chosen, (what, unit) = standings.runs, standings.chosen, words(standings.column)
    errors = {f"error [{unit}]": standings.column, "joint force error [N]": FORCE}
    errors |= {axis_label(PEAK): PEAK} if standings.recorded[PEAK].notna().any() else {}
    lines: list[dict[str, Any]] = []
    for run in runs.itertuples():
        row, line = runs.loc[run.Index], dict[str, Any](configuration=run.label, setting=run.setting)
        time = f"{'' if is_resolved(run) else UNRESOLVED_MARK}{plain(1e3 * run.time_s)}{mark(run, FORCE)}"
        line["time [ms]"] = time if run.reached else None
        line["ratio"] = str(ratio(run, chosen)) if run.reached and run.Index != chosen.Index else None
        for heading, column in errors.items():
            doubt = uncertainty(runs, column)[run.Index]
            line |= {heading: row[column], f"{heading}{UNCERTAIN}": doubt}
        line["energy error [%]"] = 100 * row["unaccounted_energy_part"]
        if row[MATCHED] + row[MISSED] > 0:
            line["impacts found"] = f"{row[MATCHED]:.0f} of {row[MATCHED] + row[MISSED]:.0f}"
        lines.append(line)
    for row in standings.recorded.drop_duplicates("engine").itertuples():
        if row.engine not in set(runs["engine"]):
            why = "no valid run" if row.status == "ok" else row.status
            lines.append({"configuration": row.engine, "setting": why})
    level = number(max(standings.wanted, standings.floor))
    title = f"Run time of each engine at a {what} of {level} {unit}"
    caption = (
        "Each engine's fastest setting that reaches the error; without a time: the error is not reached, the "
        f"most accurate run is shown. {UNRESOLVED} {ALONE}"
    )
    formats = dict.fromkeys([*errors, "energy error [%]"], number)
    return Table(f"{NAME}-standings", title, caption, NAME, pd.DataFrame(lines), formats)
