"""Bifurcation diagrams over clearance and speed, and what they show, in sentences."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pandas as pd
from matplotlib.figure import Figure as Drawing
from numpy.typing import NDArray

from reports.parts import Figure
from reports.plots.sweeps.motions import periods
from reports.plots.sweeps.one_field import draw_over_field, explain
from reports.quantities import finished
from reports.results import FloatArray, Results
from reports.style import BLUE

#: The parts as the study names them, the fields that go from column to column, and words for them.
CLEARANCES, SPEEDS, MAP = "diagram over clearance", "diagram over crank speed", "map of exponents"
CLEARANCE, SPEED = "clearance.B.radial_clearance_m", "start.crank_speed_rad_s"
FIELDS = {CLEARANCES: CLEARANCE, SPEEDS: SPEED, MAP: CLEARANCE}
EXPONENT, HALF = "exponent_per_revolution", "exponent_half_per_revolution"
#: An exponent has converged if half of the revolutions give it within this part. Chaos is claimed from this
#: one in a revolution on: less, of a motion that oscillates at the wall, may be what its start has left.
CONVERGED, NEAR_ZERO = 0.2, 1.0


@dataclass(frozen=True)
class Diagram:
    """A diagram's columns: values ``at`` (n,), the strobe (n, turns), impacts per revolution (n,).

    ``exponents`` has a row for every column that one was measured in: its value, ``EXPONENT`` and ``HALF``.
    """

    at: FloatArray
    strobe_m: FloatArray
    impacts: FloatArray
    exponents: pd.DataFrame

    @property
    def settled(self) -> NDArray[np.bool_]:
        """Columns whose pin stays at the wall, (n,)."""
        return np.asarray(self.impacts == 0)

    @property
    def periods(self) -> NDArray[np.int_]:
        """After how many turns each column's motion repeats, (n,); 0 where it does not within a few."""
        return periods(self.strobe_m)


def diagram(results: Results, rows: pd.DataFrame, part: str) -> Diagram | None:
    """Return the finest diagram of a part that is there as a whole."""
    of_part = finished(rows[rows["part"] == part])
    for _, of_size in sorted(of_part.groupby("columns"), reverse=True):
        if of_size["in_case"].sum() == of_size["columns"].iloc[0]:
            return _joined(results, of_size.sort_values("first"), FIELDS[part])
    return None


def figure(part: str, of: Diagram) -> Figure:
    """Return the figure of a diagram: the strobe, and below it the exponents."""
    words = "the clearance" if part == CLEARANCES else "the crank's speed, with a clearance of 0.1 mm"
    return Figure(
        f"predictability-{part.replace(' ', '-')}",
        f"What the slider does over {words}",
        "Set R by the reference. Above: how far the slider is from where ideal joints would have it, once a "
        f"turn for {of.strobe_m.shape[1]} turns after a transient, at {len(of.at)} values: points on "
        "each other are a motion that repeats. Below: the finite-time exponent of a revolution, also from "
        "half of the revolutions; above zero neighbouring motions part.",
        f"Two panels over {words}: the slider's deviation once a turn, and exponents.",
        _drawn(part, of),
    )


def findings(part: str, of: Diagram) -> Iterator[str]:
    """Yield which values settle, which repeat, and which are chaotic by exponents that have converged."""
    factor, unit = (1e3, "mm") if part == CLEARANCES else (1.0, "rad/s")
    at, settled = factor * of.at, of.settled
    over = "the clearance" if part == CLEARANCES else "the speed of the crank"
    yield from _where(f"Over {over}, the pin stays at the wall", at, settled, unit)
    periods = np.where(settled, 0, of.periods)
    for period in sorted({*periods} - {0}):
        turns = "every turn" if period == 1 else f"after {period} turns"
        yield from _where(f"With impacts, the motion repeats {turns}:", at, periods == period, unit)
    measured = of.exponents.dropna()
    whole, half = measured[EXPONENT], measured[HALF]
    converged = (whole - half).abs() <= CONVERGED * whole.abs()
    chaotic = np.asarray(converged & (whole > NEAR_ZERO))
    if chaotic.any():
        yield from _where("The motion is chaotic", factor * np.asarray(measured["value"]), chaotic, unit)
        yield (
            f"There the exponent is more than {NEAR_ZERO:g} in a revolution, and half of the revolutions "
            f"give it within {100 * CONVERGED:.0f} %. It was measured at {len(measured)} values."
        )
    if open_ := int((~converged & (whole > NEAR_ZERO)).sum()):
        yield f"At {open_} the exponent is as large and has not converged: nothing is claimed."


def _where(what: str, values: FloatArray, which: NDArray[np.bool_], unit: str) -> Iterator[str]:
    """Yield at which values something holds: at all from one end on, and at others; nothing if at none."""
    rest = which.copy()
    if which.all():
        yield f"{what} at all {len(which)} values."
        return
    if which[0]:
        end = int(np.argmin(which))
        rest[:end] = False
        yield f"{what} at all values up to {values[end - 1]:.3g} {unit}."
    elif which[-1]:
        begin = len(which) - int(np.argmin(which[::-1]))
        rest[begin:] = False
        yield f"{what} at all values from {values[begin]:.3g} {unit} on."
    if rest.any():
        low, high = (f"{end:.3g} {unit}" for end in (values[rest].min(), values[rest].max()))
        yield f"{what} at some values between {low} and {high}." if low != high else f"{what} at {low}."


def _drawn(part: str, of: Diagram) -> Drawing:
    points = pd.DataFrame({FIELDS[part]: of.at, "strobe_m": list(of.strobe_m)})
    exponents = of.exponents.rename(columns={"value": FIELDS[part]})
    picture = draw_over_field(pd.concat([points, exponents]), FIELDS[part], ["strobe_m", EXPONENT])
    below = picture.axes[1]
    (line,) = (each for each in below.get_lines() if each.get_linestyle() == "None")
    measured = exponents.dropna(subset=[EXPONENT])
    (half,) = below.plot(
        line.get_xdata(), measured[HALF], "o", color=BLUE, fillstyle="none", markersize=4, zorder=1
    )
    line.set_markersize(5)
    line.set_label("exponent from all revolutions")
    half.set_label("from half of them")
    explain(picture, [line, half])
    return picture


def _joined(results: Results, rows: pd.DataFrame, field: str) -> Diagram:
    curves = {
        name: np.concatenate([results.curve(case, name) for case in rows["case"]])
        for name in ("value", "strobe_m", "impacts_per_revolution")
    }
    strobe = curves["strobe_m"].reshape(len(curves["value"]), -1)
    exponents = [exponents_of(results, row, field == SPEED) for _, row in rows.iterrows()]
    return Diagram(curves["value"], strobe, curves["impacts_per_revolution"], pd.concat(exponents))


def exponents_of(results: Results, row: pd.Series, over_speed: bool = False) -> pd.DataFrame:
    """Return the exponents of a case, in a revolution, by value."""
    value = results.curve(row["case"], "exponent_value")
    period_s = 2 * np.pi / (value if over_speed else row["crank_speed_rad_s"])
    columns = {EXPONENT: "exponent_1_s", HALF: "exponent_half_1_s"}
    found = {name: period_s * results.curve(row["case"], curve) for name, curve in columns.items()}
    return pd.DataFrame({"value": value, **found})
