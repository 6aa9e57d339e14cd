"""Tables of the energy study: hidden power, the ledger of every scene, and drift of the constraints."""

from collections.abc import Mapping

import pandas as pd

from reports.chapters.energy.rungs import FAR_OFF, SMALL, UNACCOUNTED, resolution
from reports.convergence import RULE
from reports.parts import Table
from reports.shared_tables import order_cells
from reports.style import axis_label
from reports.tables import ABSENT, number

#: The ends of the columns that are lines of the ledger, in its order.
LINES = ("_change_J", "_work_J", "_loss_J")


def power_table(at_rung: pd.DataFrame, rows: pd.DataFrame) -> Table:
    """Return the hidden power of every arm, by itself and beside what it has to be compared with.

    ``at_rung`` are the rows at one rung for each scene, ``rows`` the whole ladders.
    """
    sized = rows.assign(
        size=rows["hidden_power_W"].abs().where(rows["significant"] & rows["near"]),
        gain=rows["largest_numerical_gain_J"].where(rows["near"]),
    )
    cells = {
        "hidden power [W]": _power(at_rung),
        "± [W]": at_rung["half_width"].map(number),
        "± as a part": at_rung["uncertain_part"].map(number),
        "order of the power": order_cells(at_rung, sized, "size", "too few points"),
        "mean over the run [W]": at_rung["mean_hidden_power_W"].map(number),
        "of it stabilisation [W]": at_rung["stabilisation_power_W"].map(number),
        "largest gain, of the energy in play": at_rung[UNACCOUNTED].map(number),
        "order of the largest gain": order_cells(at_rung, sized, "gain", "too few points"),
    }
    reading = (
        "Positive where the method makes energy, negative where it loses it. The slope over time has the "
        "half-width of its 95 % confidence interval beside it, in W and as a part of the energy in play over "
        "the length of the run; “< x” is not told from zero, and of a size below x; “unknown” is neither, "
        f"that part being above {SMALL:g}. In play is the largest of kinetic energy, potential energy gained "
        "or spent, and the works of driver and loads. "
        "The mean is the gain at the end over the length of the run: it differs from the slope where the "
        "rate changes or the energy swings. Stabilisation is that part of the mean which the engine tells it "
        f"removed ({ABSENT}: it tells none). Only slopes told from zero count for the order, and no run that "
        f"gains or loses more than {FAR_OFF:g} of the energy in play. "
        f"{RULE}"
    )
    return Table.of(
        "energy-hidden-power",
        "Hidden power on the middle rung",
        reading,
        pd.concat([_case(at_rung), _or_status(at_rung, cells)], axis=1),
    )


def ledger_table(at_rung: pd.DataFrame) -> Table:
    """Return the ledger at the end of one scene's runs, a row for each arm; only its own lines are there."""
    scene = at_rung["scene"].iloc[0]
    present = at_rung.columns[at_rung.notna().any()]
    lines = [name for end in LINES for name in present if name.endswith(end)]
    cells = {axis_label(name): at_rung[name].map(_digits) for name in lines}
    cells["residual [J]"] = at_rung["energy_balance_residual_J"].map(number)
    reading = (
        "Changes from start to end of the run. What is stored (changes) less what driver and loads gave "
        f"(works) plus what was lost is the residual: zero if exact. {ABSENT}: the engine or its law has no "
        "such line."
    )
    return Table.of(
        f"energy-ledger-{scene}",
        f"Energy ledger of {scene} at {resolution(at_rung)}",
        reading,
        pd.concat([at_rung[["engine", "arm"]], _or_status(at_rung, cells)], axis=1),
    )


def drift_table(at_rung: pd.DataFrame, rows: pd.DataFrame) -> Table:
    """Return the largest violation of the constraints, how it grows with time, and its order in the step.

    ``at_rung`` are the rows at one rung for each scene, ``rows`` the whole ladders.
    """
    parts = [_case(at_rung)]
    for what, column, exponent in (
        ("gap [m]", "constraint_violation_m", "constraint_violation_exponent"),
        ("gap speed [m/s]", "constraint_speed_m_s", "constraint_speed_exponent"),
    ):
        grows = at_rung[exponent].notna()
        cells = {
            f"largest {what}": at_rung[column].map(number),
            "exponent of time": at_rung[exponent].abs().map("{:.2f}".format).where(grows, ABSENT),
            "order in the step": order_cells(at_rung, rows, column).where(grows, ABSENT),
        }
        parts.append(_or_status(at_rung, cells))
    reading = (
        "A gap is the distance between the two sides of an ideal joint, or of the slider from its guide. The "
        "exponent is that of the power of time which the largest gap so far follows: 1 grows in proportion "
        f"to time, 2 with its square, 0 is bounded. {ABSENT}: round-off, or a scene with impacts, between "
        "which nothing grows steadily."
    )
    title = "Drift of the constraints on the middle rung"
    return Table.of("energy-drift", title, reading, pd.concat(parts, axis=1))


def _case(rows: pd.DataFrame) -> pd.DataFrame:
    """Return what was run, with the mean step, which an unfinished run that chooses its own has not."""
    known = (rows["status"] == "ok") | rows["tolerance"].isna()
    steps = rows["mean_step_s"].where(known).map(number)
    return pd.DataFrame(
        {"scene": rows["scene"], "mean step [s]": steps, "engine": rows["engine"], "arm": rows["arm"]}
    )


def _or_status(rows: pd.DataFrame, cells: Mapping[str, pd.Series]) -> pd.DataFrame:
    """Return columns of cells, with the status in those of runs that did not finish."""
    ok = rows["status"] == "ok"
    return pd.DataFrame({name: column.where(ok, rows["status"]) for name, column in cells.items()})


def _power(rows: pd.DataFrame) -> pd.Series:
    """Return the hidden power, or below what it is if it is not told from zero."""
    below = "< " + (rows["hidden_power_W"].abs() + rows["half_width"]).map(number)
    known = below.where(rows["uncertain_part"] <= SMALL, "unknown")
    return rows["hidden_power_W"].map(number).where(rows["significant"], known)


def _digits(value: float) -> str:
    """Return a line of the ledger with the digits that its sum needs; round-off with two."""
    if value == 0:
        return "0"
    return f"{value:.5f}" if abs(value) >= 1e-3 else number(value)
