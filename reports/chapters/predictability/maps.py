"""Maps over clearance and speed: of the exponent and of the largest contact force; and what they show."""

from collections.abc import Iterator

import numpy as np
import pandas as pd

from reports.chapters.predictability.diagrams import CLEARANCE, EXPONENT, MAP, SPEED, exponents_of
from reports.parts import Figure
from reports.plots.sweeps.two_fields import colour_ends, draw_map
from reports.quantities import finished
from reports.results import Results

FORCE = "largest_contact_force_N"


def members(results: Results, rows: pd.DataFrame) -> pd.DataFrame | None:
    """Return the members of the map with exponent, largest force and turns; None without a map."""
    of_map = finished(rows[rows["part"] == MAP])
    if of_map.empty:
        return None
    return pd.concat([_members(results, row) for _, row in of_map.iterrows()], ignore_index=True)


def figures(members: pd.DataFrame) -> Iterator[Figure]:
    """Yield the map of exponents and that of the largest contact force."""
    yield _figure(
        members,
        EXPONENT,
        "map-of-exponents",
        "Where set R is chaotic",
        "The finite-time exponent of a revolution over clearance and speed of the crank: above zero "
        "neighbouring motions part.",
    )
    yield _figure(
        members,
        FORCE,
        "map-of-forces",
        "How hard set R knocks",
        "The largest normal force between pin and bearing over clearance and speed of the crank.",
    )


def findings(members: pd.DataFrame) -> Iterator[str]:
    """Yield where the largest force is found, and with which power of the speed it grows."""
    known = members.dropna(subset=[FORCE])
    top = known.loc[known[FORCE].idxmax()]
    yield (
        f"Of {len(members)} members over clearance and speed the hardest contact has "
        f"{top[FORCE] / 1e3:.3g} kN. "
        f"It is found with {1e3 * top[CLEARANCE]:.2g} mm at {top[SPEED]:.0f} rad/s."
    )
    slopes = [
        np.polyfit(np.log(of[SPEED]), np.log(of[FORCE]), 1)[0]
        for _, of in known.groupby(CLEARANCE)
        if len(of) > 1
    ]
    if slopes:
        low, high = np.percentile(slopes, [10, 90])
        yield (
            f"At four of five clearances the largest force grows as the speed to the power of {low:.1f} to "
            f"{high:.1f}; in ideal joints it would be 2."
        )


def _figure(members: pd.DataFrame, column: str, name: str, title: str, what: str) -> Figure:
    measured = members[column].dropna()
    low, high = colour_ends(measured.to_numpy())
    beyond = int((~measured.between(low, high)).sum())
    ends = f" Colours end at {low:.2g} and {high:.2g}; {beyond} members lie beyond." if beyond else ""
    return Figure(
        f"predictability-{name}",
        title,
        f"{what} {len(members)} members, each of {members['turns'].iloc[0]:.0f} revolutions after a "
        f"transient.{ends}",
        "A map in colours over clearance and crank speed.",
        draw_map(members, (CLEARANCE, SPEED), column),
    )


def _members(results: Results, row: pd.Series) -> pd.DataFrame:
    found = exponents_of(results, row).rename(columns={"value": CLEARANCE})
    force = results.curve(row["case"], FORCE)
    return found.assign(
        **{FORCE: force, SPEED: row["crank_speed_rad_s"], "turns": row["exponent_revolutions"]}
    )
