"""Chains over the crank's speed, up and down, and where they end in other motions, by their exponents."""

from collections.abc import Iterator

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from reports.chapters.predictability.diagrams import EXPONENT, NEAR_ZERO, SPEED
from reports.parts import Figure
from reports.plots.sweeps.motions import ALIKE
from reports.plots.sweeps.one_field import draw_over_field
from reports.quantities import finished
from reports.results import Results

#: The part as the study names it.
PART = "chain over crank speed"


def chains(results: Results, rows: pd.DataFrame) -> pd.DataFrame | None:
    """Return the members of the longest chains that are there both ways, by speed and direction."""
    of_part = finished(rows[rows["part"] == PART])
    for _, ways in sorted(of_part.groupby("columns"), reverse=True):
        most = (ways["failed_members"] < ways["columns"] / 2).all()  # so that both have some speeds
        if set(ways["direction"]) == {"up", "down"} and most:
            return pd.concat([_members(results, row) for _, row in ways.iterrows()], ignore_index=True)
    return None


def figure(members: pd.DataFrame) -> Figure:
    """Return the figure of chains up and down: the strobe, and below it the exponents."""
    turns, speeds = len(members["strobe_m"].iloc[0]), members[SPEED].nunique()
    shown = ["strobe_m", *([EXPONENT] if members[EXPONENT].notna().any() else [])]
    return Figure(
        "predictability-chains",
        "What the slider does as the crank's speed goes up and down",
        "Set R with a clearance of 0.1 mm by the reference. Each member goes on from where the one before it "
        "ended: blue as the speed rises, red as it falls. Above: how far the slider is from where ideal "
        f"joints would have it, once a turn for {turns} turns after a transient, at {speeds} speeds. Below: "
        "the finite-time exponent of a revolution; above zero neighbouring motions part.",
        "Two panels over the crank's speed: the slider's deviation once a turn, and exponents, both ways.",
        draw_over_field(members, SPEED, shown),
    )


def findings(members: pd.DataFrame) -> Iterator[str]:
    """Yield where chains up and down end in other motions, so far as their exponents tell.

    Two chaotic motions differ once a turn by chance, and of them nothing is said.
    """
    up, down = (
        of.set_index(SPEED).sort_index() for _, of in sorted(members.groupby("direction"), reverse=True)
    )
    both = up.index.intersection(down.index)
    up, down = up.loc[both], down.loc[both]
    chaotic = np.array([of[EXPONENT] > NEAR_ZERO for of in (up, down)])
    places = [np.sort(np.stack([*of["strobe_m"]]), axis=1) for of in (up, down)]
    largest = max(np.abs(of).max() for of in places)
    other = np.abs(places[0] - places[1]).max(axis=1) > ALIKE * largest
    one, none = chaotic[0] != chaotic[1], ~chaotic.any(axis=0) & other
    yield (
        f"Chains up and down the crank's speed have {len(both)} speeds in common. The exponent is more than "
        f"{NEAR_ZERO:g} in a revolution both ways at {int(chaotic.all(axis=0).sum())} of them, where nothing "
        "can be said of two motions but that they are chaotic."
    )
    yield from _where("It is so one way only", both, one)
    yield from _where("Neither way is it so, and the slider is elsewhere once a turn,", both, none)
    if not (one | none).any():
        yield "At all others both ways end in the same motion: no hysteresis is seen."
    else:
        yield "There it depends on the way in which motion the mechanism is, or the transient is longer yet."


def _where(what: str, speeds: pd.Index, which: NDArray[np.bool_]) -> Iterator[str]:
    if which.any():
        low, high = speeds[which].min(), speeds[which].max()
        where = f"from {low:.3g} to {high:.3g} rad/s" if low != high else f"at {low:.3g} rad/s"
        yield f"{what} at {int(which.sum())} of them, {where}."


def _members(results: Results, row: pd.Series) -> pd.DataFrame:
    names = ("value", "strobe_m", "exponent_1_s")
    speed, strobe, exponent = (results.curve(row["case"], name) for name in names)
    return pd.DataFrame(
        {
            SPEED: speed,
            "direction": row["direction"],
            "strobe_m": list(strobe.reshape(len(speed), int(row["revolutions"]))),
            EXPONENT: exponent * 2 * np.pi / speed,
        }
    )
