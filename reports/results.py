"""Rows of studies as data frames, of a results folder (see ``studies.running.store``) or published ones.

What is published (see ``reports.publication``) is a compressed CSV file a study, and one file of where they
come from; it has no curves.
"""

import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from itertools import takewhile
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from engine_models.scene.plain_words import BadInput
from reports.look import in_legend_order, legend_place
from studies.running.store import FILE, Store

FloatArray = NDArray[np.float64]

#: How the file of a study's published rows ends, and the one that says where all come from.
ENDING, FACTS = ".csv.xz", "facts.json"
#: The error of the slider's position, the largest of the force in any joint, and the largest error of an
#: impact's peak force in percent of that peak: one that is missed counts as 100.
SLIDER, FORCE, PEAK = "slider_position_error_m", "largest_joint_force_error_N", "peak_force_error_percent"
#: The column of why the check after every run fails one that finished; empty where it does not.
QUALITY = "quality_failure"
#: The classes of scenes, by their joints.
IDEAL, LOOSE, RIGID = CLASSES = ("ideal joints", "clearance", "rigid contact")


class NoResults(BadInput):
    """There is nothing to report; the message says what was missing where, and what to run."""


@dataclass(frozen=True)
class Results:
    """The rows of one study as ``frame`` has them, a row per run, and ``facts`` of where they come from.

    Without the ``folder`` of a store, as of published rows, there are no curves.
    """

    rows: pd.DataFrame
    facts: Mapping[str, Any] = field(default_factory=dict)
    folder: Path | None = None

    @property
    def has_curves(self) -> bool:
        """Whether the study's curves are there."""
        return self.folder is not None

    def curve(self, case: str, column: str) -> FloatArray:
        """Return a curve of a finished run, (n,); there has to be a store."""
        assert self.folder is not None
        with Store(self.folder) as store:
            return np.asarray(store.curves(case)[column], dtype=float)


#: The results of the studies at hand, by the names of the studies.
Studies = Mapping[str, Results]


def read_study(folder: Path, study: str) -> Results:
    """Read the rows of a study in a folder of results, or of published ones.

    Raises:
        NoResults: there are none.
        BadInput: a file there is none of ours, or damaged.
    """
    rows, facts = list[dict[str, Any]](), dict[str, Any]()
    if has_store := (folder / FILE).exists():
        with Store(folder) as store:
            rows, facts = store.results(study)
    elif (folder / f"{study}{ENDING}").exists():
        rows = published_rows(folder, study)
        facts = json.loads((folder / FACTS).read_text(encoding="utf-8"))[study]
    if not rows:
        raise NoResults(
            f"results: expected the results of {study}, got none in {folder}; run `crankslider run`"
        )
    return Results(frame(rows), facts, folder if has_store else None)


def published_rows(folder: Path, study: str) -> list[dict[str, Any]]:
    """Return the published rows of a study, each with what it has."""
    path = folder / f"{study}{ENDING}"
    exactly: Any = {"float_precision": "round_trip"} if pd.__version__ < "3" else {}  # as later ones are
    table = pd.read_csv(path, low_memory=False, keep_default_na=False, na_values=[""], **exactly)
    rows = [row.dropna().to_dict() for _, row in table.astype(object).iterrows()]
    return [{"case": f"{study}-{n}", "study": study, "reason": "", **row} for n, row in enumerate(rows)]


def head_of(row: Mapping[str, Any]) -> dict[str, Any]:
    """Return the columns that say what was run, whatever code and machine ran it."""
    told = dict(takewhile(lambda item: item[0] != "status", row.items()))
    return {name: value for name, value in told.items() if name not in ("case", "study")}


def frame(rows: Iterable[Mapping[str, Any]]) -> pd.DataFrame:
    """Return rows as a data frame, in an order that does not depend on when which case finished.

    They go by scene, by label in the order of legends, which is also that of the categories of ``label``, and
    from long steps to short ones. Numbers are float64, NaN where a row has none or one that is not finite;
    settings, text and flags are objects as they were written. Without a mean step of its own a run has its
    step in ``mean_step_s``.
    """

    def place(row: Mapping[str, Any]) -> tuple[Any, ...]:
        head = json.dumps(head_of(row), sort_keys=True)
        return row["scene"], legend_place(row["engine"], row["arm"]), -row["step_s"], head

    table = pd.DataFrame(sorted(rows, key=place), dtype=object)
    numbers = {
        name: pd.to_numeric(column).astype(float).replace([np.inf, -np.inf], np.nan)
        for name, column in table.items()
        if not str(name).startswith("setting_") and column.map(_may_be_number).all()
    }
    numbers["mean_step_s"] = numbers.get("mean_step_s", numbers["step_s"]).fillna(numbers["step_s"])
    columns = {**dict(table.items()), **numbers, "label": in_legend_order(table)}
    return pd.DataFrame(columns)  # in one piece, which is quicker to select from


def _may_be_number(value: object) -> bool:
    return value is None or (isinstance(value, int | float) and not isinstance(value, bool))


def with_columns(rows: pd.DataFrame, *names: str) -> pd.DataFrame:
    """Return the rows with these columns, NaN throughout where no row has one."""
    return rows.reindex(columns=[*rows, *(name for name in names if name not in rows)])


# What is compared


def finished(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of runs that the engine finished."""
    return rows[rows["status"] == "ok"]


def value(rows: pd.DataFrame, column: str) -> pd.Series:
    """Return a column, NaN where there is no such thing, as where a run failed."""
    return rows[column] if column in rows else pd.Series(math.nan, rows.index)


def uncertainty(rows: pd.DataFrame, column: str) -> pd.Series:
    """Return the reference solution's uncertainty of a column of errors, NaN where there is none."""
    return value(rows, column.replace("_error_", "_uncertainty_") if "_error_" in column else "")


def floor(rows: pd.DataFrame, column: str) -> float:
    """Return the reference solution's largest uncertainty of a column, 0 where there is none."""
    largest = uncertainty(rows, column).max()
    return 0.0 if math.isnan(largest) else float(largest)


def quality_failures(rows: pd.DataFrame) -> pd.Series:
    """Return why the check after every run fails each run, empty where it does not or was not made."""
    found = with_columns(rows, QUALITY)[QUALITY].astype(object)
    return found.where(found.notna(), "")


def tolerances(rows: pd.DataFrame) -> pd.Series:
    """Return the tolerance of a step that each run was set to, NaN where it had none."""
    rows = with_columns(rows, "setting_rtol", "setting_step_tolerance")
    return rows["setting_rtol"].astype(float).fillna(rows["setting_step_tolerance"].astype(float))


def knobs(rows: pd.DataFrame) -> pd.Series:
    """Return what resolves each run: its tolerance of a step by that setting's name, or else ``step``."""
    rows = with_columns(rows, "setting_rtol")
    names = rows["setting_rtol"].notna().map({True: "rtol", False: "step_tolerance"})
    return names.where(tolerances(rows).notna(), "step")


def signal_errors(rows: pd.DataFrame) -> list[str]:
    """Return the columns of errors of the signals that any of the rows has, in their order."""
    others = ("setting_", "largest_", "impact_", "peak_")
    errors = [name for name in rows if "_error_" in name and not name.startswith(others)]
    return [name for name in errors if rows[name].notna().any()]


def with_forces(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the rows with ``FORCE`` and its scale, and ``PEAK``, NaN where no impact has a force.

    Both have uncertainties; that of ``FORCE`` is the largest of those of the joints, and so is its scale.
    """
    columns = {}
    for word in ("error", "uncertainty", "scale"):
        joints = rows.filter(regex=rf"^joint_[\w.-]+_force_{word}_N$")
        columns[FORCE.replace("error", word)] = joints.max(axis=1)
        columns[PEAK.replace("error", word)] = 100 * value(rows, f"impact_force_relative_{word}")
    return rows.assign(**columns)


def classes(rows: pd.DataFrame) -> "pd.Series[str]":
    """Return the class of each row's scene by its columns; rigid contact is impacts without a ``PEAK``."""
    loose = rows.filter(regex="^clearance_").notna().any(axis=1).groupby(rows["scene"]).transform("any")
    peaks = value(rows, PEAK).notna().groupby(rows["scene"]).transform("any")
    return pd.Series(np.select([loose & peaks, loose], [LOOSE, RIGID], IDEAL), rows.index)


def accuracy(studies: Studies, *kinds: str) -> pd.DataFrame:
    """Return the recorded runs on scenes of some classes, or all, without those of one impact."""
    rows = with_forces(with_columns(studies["accuracy"].rows, "view").query("view.isna()"))
    rows = rows.assign(joints=classes(rows))
    return rows[rows["joints"].isin(kinds or CLASSES)]
