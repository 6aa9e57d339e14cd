"""The cells of the stability maps as read from rows: verdicts, rows of a map, and where growth begins."""

import math

import pandas as pd

from reports.quantities import finished
from reports.results import NEVER_BEGUN, with_columns

#: The verdicts, their places the column ``verdict_severity``: from growth on a run is no longer stable.
VERDICTS = ("accurate", "inaccurate", "energy-growing", "diverged", "timed out", "refused")
GROWING, DIVERGED, REFUSED = 2, 3, 5
#: What a run was that could not say so itself, by its status.
BY_STATUS = {"timed out": 4, **dict.fromkeys(NEVER_BEGUN, REFUSED)}

#: How columns of other bounds begin, and what the bounds are called.
OTHERWISE = "severity_if_"
BOUND_NAMES = {
    "position": "bound on position is",
    "constraint": "bound on joints is",
    "energy": "bound on energy is",
    "impacts": "impacts compared are",
}

#: A mean step below this part of the map's was no matter of rounding.
CAPPED = 0.99

#: What varies in a map beside the step: its column, what it is called, its unit, that unit in the column's.
VARIED: dict[str, tuple[str, str, float]] = {
    "contact_stiffness_N_m1_5": ("contact stiffness", "N/m$^{1.5}$", 1.0),
    "radial_clearance_m": ("radial clearance", "mm", 1e-3),
    "crank_speed_rpm": ("crank speed", "rpm", 1.0),
}


def prepared(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the rows with every column that the chapter looks for, ``severity`` and ``grows``.

    The first is the place of a cell's verdict, the second whether it gains energy or diverges.
    """
    rows = with_columns(
        rows,
        *(
            *VARIED,
            "map_of",
            "limit_frequency_step",
            "measured_limit_frequency_step",
            "damping_ratio",
            "frequency_step",
        ),
        *("energy_loss_per_step", "expected_energy_loss_per_step", "leading_energy_loss_per_step"),
        *("relative_difference", "verdict_severity", "contact_step_s", "mean_step_s"),
    )
    by_status = rows["status"].map(BY_STATUS).fillna(DIVERGED)
    severity = rows["verdict_severity"].fillna(by_status).astype(int)
    return rows.assign(severity=severity, grows=severity.between(GROWING, REFUSED, inclusive="left"))


def cells(rows: pd.DataFrame, varied: str) -> pd.DataFrame:
    """Return the rows that are cells of a map."""
    return rows[rows[varied].notna()]


def in_all_maps(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the rows that are cells of any map."""
    return pd.concat([cells(rows, varied) for varied in VARIED])


def other_bounds(rows: pd.DataFrame) -> list[str]:
    """Return the columns of what verdicts would be by other bounds."""
    return [name for name in rows if name.startswith(OTHERWISE)]


def changed_verdicts(cells: pd.DataFrame) -> pd.DataFrame:
    """Return how many verdicts of each label (the index) each other bound (a column) would change.

    What did not finish has its verdict by any bounds.
    """
    others = cells[other_bounds(cells)]
    changed = others.notna() & others.ne(cells["severity"], axis=0)
    return changed.groupby(cells["label"], observed=True).sum()


def in_words(column: str) -> str:
    """Return what a column of other bounds is about: the energy bound is halved."""
    what, how = column.removeprefix(OTHERWISE).rsplit("_", 1)
    return f"the {BOUND_NAMES.get(what, what)} {how}"


def limit_of(rows: pd.DataFrame) -> float:
    """Return theory's limit omega h of an arm, NaN if it has none."""
    return float(rows["limit_frequency_step"].iloc[0])


def capped(cells: pd.DataFrame) -> bool:
    """Return whether an arm took shorter steps than the map's in any cell, which are a cap then."""
    return bool((cells["mean_step_s"] < CAPPED * cells["step_s"]).any())


def limits_of(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the scalar problem's rows that looked for a limit."""
    return finished(rows).dropna(subset="damping_ratio")


def dampings_of(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the scalar problem's rows that measured a loss."""
    return finished(rows).dropna(subset="frequency_step")


def map_rows(cells: pd.DataFrame, varied: str) -> pd.DataFrame:
    """Return the rows of an arm's map, by rising value of what varies: steps as omega h of the first impact.

    ``growth`` is where energy growth, or worse, begins: the geometric mean of the longest step up to which
    there is none and the next one, or the shortest step if it is there already, NaN if it never is.
    ``divergence`` is the same for divergence, or worse. ``accurate`` is the longest step up to which every
    run is accurate, NaN if not even the shortest is.
    """
    cells = cells.assign(x=cells["step_s"] * cells["impact_frequency_rad_s"]).sort_values("x")
    begins = []
    for _, row in cells.groupby(varied):
        accurate = row["x"][row["severity"].eq(0).cumprod().astype(bool)]
        begins.append((_begins(row, GROWING), _begins(row, DIVERGED), accurate.max()))
    return pd.DataFrame(begins, columns=["growth", "divergence", "accurate"])


def _begins(row: pd.DataFrame, worst: int) -> float:
    """Return where a severity is first met in a row of a map."""
    there = row["severity"].between(worst, REFUSED, inclusive="left")
    if not there.any():
        return math.nan
    first = int(there.to_numpy().argmax())
    return math.sqrt(row["x"].iloc[max(first - 1, 0)] * row["x"].iloc[first])
