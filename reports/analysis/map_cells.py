"""The cells of the stability maps as read from rows: verdicts, and where in a map growth begins."""

import math

import pandas as pd

from reports.quantities import finished
from reports.results import NEVER_BEGUN, with_columns

#: The verdicts, their places the column ``verdict_severity``: from growth on a run is no longer stable.
VERDICTS = ("accurate", "inaccurate", "energy-growing", "diverged", "timed out", "refused")
GROWING, DIVERGED, REFUSED = 2, 3, 5
#: What varies in a map beside the step: its column, what it is called, its unit, that unit in the column's.
VARIED: dict[str, tuple[str, str, float]] = {
    "contact_stiffness_N_m1_5": ("contact stiffness", "N/m$^{1.5}$", 1.0),
    "radial_clearance_m": ("clearance", "mm", 1e-3),
    "crank_speed_rpm": ("crank speed", "rpm", 1.0),
}
#: What a run was that could not say so itself, by its status.
BY_STATUS = {"timed out": 4, **dict.fromkeys(NEVER_BEGUN, REFUSED)}
#: How columns of the verdict by other bounds begin, and what the bounds are called.
OTHERWISE = "severity_if_"
BOUNDS = {
    "position": "bound on position",
    "constraint": "bound on joints",
    "energy": "bound on energy",
    "impacts": "number of impacts compared",
}


def prepared(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the stability study's rows with every column that is looked for, ``severity`` and ``grows``.

    The first is the place of a cell's verdict, the second whether it gains energy or diverges.
    """
    rows = with_columns(
        rows,
        *(*VARIED, "limit_frequency_step", "measured_limit_frequency_step", "damping_ratio"),
        *("frequency_step", "energy_loss_per_step", "expected_energy_loss_per_step"),
        *("leading_energy_loss_per_step", "relative_difference", "verdict_severity", "contact_step_s"),
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


def changed_verdicts(cells: pd.DataFrame) -> pd.DataFrame:
    """Return how many verdicts of each label (the index) each other bound (a column) would change.

    What did not finish has its verdict by any bounds.
    """
    others = cells[[name for name in cells if name.startswith(OTHERWISE)]]
    changed = others.notna() & others.ne(cells["severity"], axis=0)
    return changed.groupby(cells["label"], observed=True).sum()


def in_words(column: str) -> str:
    """Return what a column of other bounds is about: bound on energy halved."""
    what, how = column.removeprefix(OTHERWISE).rsplit("_", 1)
    return f"{BOUNDS.get(what, what)} {how}"


def limit_of(rows: pd.DataFrame) -> float:
    """Return theory's limit omega h of a configuration, NaN if it has none."""
    return float(rows["limit_frequency_step"].iloc[0])


def limits_of(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the scalar problem's rows that looked for a limit."""
    return finished(rows).dropna(subset="damping_ratio")


def dampings_of(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the scalar problem's rows that measured a loss."""
    return finished(rows).dropna(subset="frequency_step")


def map_rows(cells: pd.DataFrame, varied: str) -> pd.DataFrame:
    """Return the rows of a configuration's map, by rising value of what varies: omega h of the first impact.

    ``growth`` is where energy growth, or worse, begins: the geometric mean of the longest step up to which
    there is none and the next one, or the shortest step if it is there already, NaN if it never is.
    ``divergence`` is the same for divergence, or worse. ``accurate`` is the longest step up to which every
    run is accurate, NaN if not even the shortest is.
    """
    cells = cells.assign(x=cells["step_s"] * cells["impact_frequency_rad_s"]).sort_values("x")
    begins = []
    for _, row in cells.groupby(varied):
        held = row["x"][row["severity"].eq(0).cumprod().astype(bool)]
        begins.append((_begins(row, GROWING), _begins(row, DIVERGED), held.max()))
    return pd.DataFrame(begins, columns=["growth", "divergence", "accurate"])


def _begins(row: pd.DataFrame, worst: int) -> float:
    """Return where a severity is first met in a row of a map."""
    there = row["severity"].between(worst, REFUSED, inclusive="left")
    if not there.any():
        return math.nan
    first = int(there.to_numpy().argmax())
    return math.sqrt(row["x"].iloc[max(first - 1, 0)] * row["x"].iloc[first])
