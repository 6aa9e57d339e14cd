"""Result of the search of settings: the run time of a changed parameter relative to the studies' series."""

from collections.abc import Iterator
from pathlib import Path

import pandas as pd

from reports.analysis.equal_error import SLIDER, fastest, levels, ratio, settings_by_scene
from reports.quantities import FORCE, finished, has_clearance, with_forces
from reports.results import read_study, with_columns

#: A changed parameter counts if it significantly takes less than this part of the time of the series.
BEATEN = 0.75
#: A setting counts only if the error of the next finer one is below this part of its error. Otherwise its
#: error is small by chance, where errors of either sign cancel.
FALLS = 0.8
TORQUE = "driver_torque_error_N_m"


def found(folder: Path) -> pd.DataFrame:
    """Return a row per scene, signal, error and engine: the fastest choice of the series and of the search.

    ``part`` is the time of the search relative to that of the series, ``low`` and ``high`` the ends of its
    interval. It is 1 if no changed parameter is faster, and NaN if the series does not reach the error.

    Raises:
        NoResults, BrokenResults: see ``reports.results.read_study``.
    """
    rows = with_columns(finished(read_study(folder).rows), "round", "compiled_anew", TORQUE)
    labels = rows["label"].astype(str) + rows["turned"].map(lambda knob: f", {knob}" if knob else "")
    rows = with_forces(rows.assign(label=labels))
    driven = rows[TORQUE].notna().groupby(rows["scene"]).transform("any") & ~has_clearance(rows)
    compared = ((rows[~driven], SLIDER), (rows[driven], TORQUE), (rows, FORCE))
    return pd.DataFrame([line for some, column in compared for line in _compare(some, column)])


def beaten(record: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of a record in which a changed parameter is significantly faster than the series."""
    return record[record["high"] < BEATEN]


def _compare(rows: pd.DataFrame, column: str) -> Iterator[dict[str, object]]:
    """Yield the row of every error that an engine's settings reach on a scene, by a column of errors."""
    for scene, (ran, floor) in settings_by_scene(rows, column).items():
        finer = ran.groupby("label", observed=True)["error"].shift(-1)
        meant = ran[finer.isna() | (finer < FALLS * ran["error"])]
        for engine, own in meant.groupby("engine"):
            usual = own[~own["label"].str.contains(" = ", regex=False)]
            for error in levels(own, floor):
                before, best = fastest(usual, error), fastest(own, error)
                assert best is not None, "levels lie within the errors of the settings"
                share = ratio(best, before) if before else None
                yield {
                    "scene": scene,
                    "signal": column,
                    "error": error,
                    "engine": engine,
                    "ladder": f"{before.label}, {before.setting}" if before else "",
                    "search": f"{best.label}, {best.setting}",
                    "part": share.times if share else None,
                    "low": share.low if share else None,
                    "high": share.high if share else None,
                }
