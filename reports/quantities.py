"""What is compared: the columns of measured errors, each with the truth's uncertainty of it."""

import math

import pandas as pd

from reports.results import with_columns

#: The largest error of an impact's peak force in percent of that peak: one that is missed counts as 100.
PEAK = "peak_force_error_percent"


def finished(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of runs that the engine finished."""
    return rows[rows["status"] == "ok"]


def own_scenes(rows: pd.DataFrame) -> pd.Series:
    """Return of each row whether it is on a scene of the study's own, of which theory says what to expect.

    The others are of scenes that a user gave, on which anything may come out.
    """
    content = rows["scene_content"] if "scene_content" in rows else pd.Series(None, rows.index, dtype=object)
    return content.isna()


def value(rows: pd.DataFrame, column: str) -> pd.Series:
    """Return a column, NaN where the run failed or the scene has no such thing."""
    return _numbers(rows, column).where(rows["status"] == "ok")


def uncertainty(rows: pd.DataFrame, column: str) -> pd.Series:
    """Return the truth's uncertainty of a column, NaN where there is none."""
    return _numbers(rows, column.replace("_error_", "_uncertainty_") if "_error_" in column else "")


def scale(rows: pd.DataFrame, column: str) -> pd.Series:
    """Return how far the signal of a column of errors is from its mean at most, NaN where nobody tells."""
    return _numbers(rows, column.replace("_error_", "_scale_") if "_error_" in column else "")


def floor(rows: pd.DataFrame, column: str) -> float:
    """Return the truth's largest uncertainty of a column, 0 where there is none."""
    largest = uncertainty(rows, column).max()
    return 0.0 if math.isnan(largest) else float(largest)


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


def with_largest(rows: pd.DataFrame, name: str, pattern: str) -> pd.DataFrame:
    """Return the rows with a column ``name``: the largest of the signal errors whose columns match a pattern.

    Its uncertainty is the largest of theirs, and so is its scale.
    """
    words = ("_error_", "_uncertainty_", "_scale_")
    columns = {name.replace("_error_", word): pattern.replace("_error_", word) for word in words}
    return rows.assign(**{new: rows.filter(regex=f"^{of}$").max(axis=1) for new, of in columns.items()})


def with_peak(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the rows with ``PEAK`` and its uncertainty, NaN where no impact is judged by its force."""
    doubt = PEAK.replace("error", "uncertainty")
    percent = {PEAK: "impact_force_relative_error", doubt: "impact_force_relative_uncertainty"}
    return rows.assign(**{name: 100 * _numbers(rows, part) for name, part in percent.items()})


def _numbers(rows: pd.DataFrame, column: str) -> pd.Series:
    return rows[column] if column in rows else pd.Series(math.nan, rows.index)
