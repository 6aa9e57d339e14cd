"""Basins of attraction over the start, and which motions they are of, in sentences."""

from collections.abc import Iterator

import numpy as np
import pandas as pd

from reports.parts import Figure
from reports.plots.sweeps.basins import draw_basins
from reports.plots.sweeps.motions import motions
from reports.quantities import finished
from reports.results import Results

#: The part as the study names it, and the fields that differ.
PART = "basins of attraction"
PLACE, RATE = "start.slider.x_m", "start.slider.velocity_x_m_s"

#: A motion has a sentence if this part of the starts end in it. Basins have a shape where neighbours differ
#: in less than the other part of the pairs that do so among starts drawn at random.
SHOWN, ALONE = 0.02, 0.7


def starts(results: Results, rows: pd.DataFrame) -> pd.DataFrame | None:
    """Return the members of the finest grid of starts that is there as a whole."""
    of_part = finished(rows[rows["part"] == PART])
    for columns, of_size in sorted(of_part.groupby("columns"), reverse=True):
        if of_size["in_case"].sum() == columns**2 and of_size["failed_members"].sum() < columns**2:
            return pd.concat([_members(results, row) for _, row in of_size.iterrows()], ignore_index=True)
    return None


def figure(members: pd.DataFrame) -> Figure:
    """Return the map of the motions by the start."""
    turns = members["turns"].iloc[0]
    return Figure(
        "predictability-basins",
        "Which motion set R ends in, by its start",
        f"Clearance 0.1 mm, crank at 441 rad/s, by the reference: the motion after {turns:.0f} turns, by the "
        "slider's place and speed at the start, which are those of the bearing about the pin. Starts of one "
        "colour are in the basin of attraction of that motion.",
        "A map of motions in colours over place and speed of the slider at the start.",
        draw_basins(members, (PLACE, RATE)),
    )


def findings(members: pd.DataFrame) -> Iterator[str]:
    """Yield from how many starts which motion was found."""
    found = motions(members)
    shares = found.value_counts(normalize=True)
    if len(shares) == 1:
        yield f"From all {len(members)} starts of the slider set R ends in one motion: {shares.index[0]}."
        return
    yield f"From {len(members)} starts of its slider set R ends in {len(shares)} kinds of motion."
    for motion, share in shares[shares >= SHOWN].items():
        yield f"Of these starts {100 * share:.0f} % end in this one: {motion}."
    grid = members.assign(motion=found).pivot_table("motion", PLACE, RATE, aggfunc="first").to_numpy()
    pairs = [(grid[1:], grid[:-1]), (grid[:, 1:], grid[:, :-1])]
    beside = np.concatenate([(one != other).ravel() for one, other in pairs]).mean()
    drawn = 1 - (shares**2).sum()
    yield (
        f"Starts beside each other end in different motions in {100 * beside:.0f} % of all pairs, starts "
        f"drawn at random in {100 * drawn:.0f} %."
    )
    if beside > ALONE * drawn:
        yield "So no basin has a shape at this fineness: the start decides as chance would."
    else:
        yield "So neighbours mostly share their motion, and basins have a shape."


def _members(results: Results, row: pd.Series) -> pd.DataFrame:
    names = ("place_m", "rate_m_s", "impacts_per_revolution", "strobe_m")
    place, rate, impacts, strobe = (results.curve(row["case"], name) for name in names)
    return pd.DataFrame(
        {
            PLACE: place,
            RATE: rate,
            "impacts_per_revolution": impacts,
            "strobe_m": list(strobe.reshape(len(place), -1)),
            "turns": row["transient"] + row["revolutions"],
            "status": "ok",
        }
    )
