"""Members of the sweeps of the predictability study: diagrams over one field, chains, maps and basins."""

import numpy as np
import pandas as pd

from reports.quantities import finished
from reports.results import FloatArray, Results

#: The parts as the study names them, the fields that vary within a case, and what a reader calls them.
OVER_CLEARANCE, OVER_SPEED = "diagram over clearance", "diagram over crank speed"
CHAIN, MAP, BASINS = "chain over crank speed", "map of exponents", "basins of attraction"
CLEARANCE, SPEED = "clearance.B.radial_clearance_m", "start.crank_speed_rad_s"
FIELDS = {OVER_CLEARANCE: CLEARANCE, OVER_SPEED: SPEED, CHAIN: SPEED, MAP: CLEARANCE}
VARIED = {OVER_CLEARANCE: "clearance", OVER_SPEED: "crank speed", CHAIN: "crank speed, up and down"}
#: Both are varied by a map, and both of these by basins: the start of the slider.
START = ("start.slider.x_m", "start.slider.velocity_x_m_s")

#: Columns of members: Lyapunov exponents per revolution from all and from half of the revolutions, the force.
EXPONENT, HALF, FORCE = "exponent_per_revolution", "exponent_half_per_revolution", "largest_contact_force_N"
#: An exponent has converged if half of the revolutions give it within this part. Chaos is claimed from this
#: exponent on: a smaller one, of a pin that swings along its wall, may be what the start has left.
CONVERGED, CHAOTIC = 0.2, 1.0


def finest(results: Results, part: str) -> pd.DataFrame:
    """Return the finished cases of the finest sweep of a part of which all cases are there; empty without."""
    rows = finished(results.rows[results.rows["part"] == part])
    for columns, of_size in sorted(rows.groupby("columns") if len(rows) else (), reverse=True):
        needed = {CHAIN: 2 * columns, BASINS: columns**2}.get(part, columns)
        own = of_size["in_case"] if "in_case" in of_size else pd.Series(np.nan, of_size.index)
        if part == MAP or own.fillna(columns).sum() == needed:
            return of_size.sort_values("first") if "first" in of_size else of_size
    return rows.head(0)


def members(results: Results, part: str) -> pd.DataFrame | None:
    """Return the members of a sweep, a row each, by the field or fields varied; None without a whole sweep.

    ``strobe_m`` has the slider's deviation from ideal joints once a turn.
    """
    cases = finest(results, part)
    if cases.empty:
        return None
    parts = [_of_case(results, row, part) for _, row in cases.iterrows()]
    return pd.concat(parts, ignore_index=True)


def _of_case(results: Results, row: pd.Series, part: str) -> pd.DataFrame:
    def curve(name: str) -> FloatArray:
        return results.curve(row["case"], name)

    strobe = curve("strobe_m")
    turns = strobe.reshape(-1, int(row["revolutions"]))
    columns = {"strobe_m": [*turns], "status": "ok"}
    if part == BASINS:
        of_start = dict(zip(START, (curve("place_m"), curve("rate_m_s")), strict=True))
        return pd.DataFrame(
            {**of_start, **columns, "impacts_per_revolution": curve("impacts_per_revolution")}
        )
    value = curve("value")
    frame = pd.DataFrame({FIELDS[part]: value, **columns})
    if part == CHAIN:
        return frame.assign(
            **{EXPONENT: 2 * np.pi / value * curve("exponent_1_s"), "direction": row["direction"]}
        )
    if part == MAP:
        frame = frame.assign(**{FORCE: curve(FORCE), SPEED: row["crank_speed_rad_s"]})
    measured = curve("exponent_value")
    period_s = 2 * np.pi / (measured if part == OVER_SPEED else row["crank_speed_rad_s"])
    found = {
        FIELDS[part]: measured,
        EXPONENT: period_s * curve("exponent_1_s"),
        HALF: period_s * curve("exponent_half_1_s"),
    }
    return frame.merge(pd.DataFrame(found), how="left", on=FIELDS[part])


def chaotic(members: pd.DataFrame) -> pd.Series:
    """Return of each member with an exponent whether its motion is chaotic: it is large and has converged."""
    measured = members.dropna(subset=[EXPONENT, HALF])
    whole, half = measured[EXPONENT], measured[HALF]
    return (whole > CHAOTIC) & ((whole - half).abs() <= CONVERGED * whole)
