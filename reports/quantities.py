"""What is compared: the columns of measured errors, each with the reference solution's uncertainty of it."""

import math

import pandas as pd

from reports.results import with_columns

#: The error of the slider's position.
SLIDER = "slider_position_error_m"
#: The largest error of an impact's peak force in percent of that peak: one that is missed counts as 100.
PEAK = "peak_force_error_percent"
#: The largest error of the force in any joint.
FORCE = "largest_joint_force_error_N"
#: The column of why the check after every run fails one that finished; empty where it does not.
QUALITY = "quality_failure"
#: How the columns begin that only scenes with clearance have.
LOOSE = "^clearance_"


def finished(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of runs that the engine finished."""
    return rows[rows["status"] == "ok"]


def recorded(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of runs whose errors are measured, without those that measure times."""
    of_times = ("round", "compiled_anew")
    return rows[with_columns(rows, *of_times)[[*of_times]].isna().all(axis=1)]


def has_clearance(rows: pd.DataFrame) -> pd.Series:
    """Return of each row whether its scene has a joint with clearance, by the columns of any run on it."""
    loose = rows.filter(regex=LOOSE).notna().any(axis=1)
    return loose.groupby(rows["scene"]).transform("any")


def value(rows: pd.DataFrame, column: str) -> pd.Series:
    """Return a column, NaN where the run failed or the scene has no such thing."""
    return _numbers(rows, column).where(rows["status"] == "ok")


def uncertainty(rows: pd.DataFrame, column: str) -> pd.Series:
    """Return the reference solution's uncertainty of a column, NaN where there is none."""
    return _numbers(rows, column.replace("_error_", "_uncertainty_") if "_error_" in column else "")


def scale(rows: pd.DataFrame, column: str) -> pd.Series:
    """Return how far the signal of a column of errors is from its mean at most, NaN where nobody tells."""
    return _numbers(rows, column.replace("_error_", "_scale_") if "_error_" in column else "")


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
    of_scipy = with_columns(rows, "setting_rtol")["setting_rtol"].notna()
    names = of_scipy.map({True: "rtol", False: "step_tolerance"})
    return names.where(tolerances(rows).notna(), "step")


def signal_errors(rows: pd.DataFrame) -> list[str]:
    """Return the columns of errors of the signals that any of the rows has, in their order."""
    others = ("setting_", "largest_")
    errors = [name for name in rows if "_error_" in name and not name.startswith(others)]
    return [name for name in errors if rows[name].notna().any()]


def motion_error(rows: pd.DataFrame) -> str:
    """Return the column of errors of the motion: the slider's, without a slider that of the first body."""
    others = ("clearance_", "local_")
    found = [
        name for name in signal_errors(rows) if name.endswith(("_m", "_rad")) and not name.startswith(others)
    ]
    return SLIDER if SLIDER in found or not found else found[0]


def with_largest(rows: pd.DataFrame, name: str, pattern: str) -> pd.DataFrame:
    """Return the rows with a column ``name``: the largest of the signal errors whose columns match a pattern.

    Its uncertainty is the largest of theirs, and so is its scale.
    """
    words = ("_error_", "_uncertainty_", "_scale_")
    columns = {name.replace("_error_", word): pattern.replace("_error_", word) for word in words}
    return rows.assign(**{new: rows.filter(regex=f"^{of}$").max(axis=1) for new, of in columns.items()})


def with_forces(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the rows with ``FORCE``, and ``PEAK`` with its uncertainty, NaN where no impact has a force."""
    doubt = PEAK.replace("error", "uncertainty")
    percent = {PEAK: "impact_force_relative_error", doubt: "impact_force_relative_uncertainty"}
    rows = rows.assign(**{name: 100 * _numbers(rows, part) for name, part in percent.items()})
    return with_largest(rows, FORCE, r"joint_[\w.-]+_force_error_N")


def _numbers(rows: pd.DataFrame, column: str) -> pd.Series:
    return rows[column] if column in rows else pd.Series(math.nan, rows.index)
