"""Tables of the stability study."""

import math

import pandas as pd

from reports.chapters.stability.map_cells import (
    VARIED,
    cells,
    changed_verdicts,
    in_words,
    limit_of,
    map_rows,
)
from reports.parts import Table
from reports.shared_tables import head
from reports.tables import ABSENT, number

#: A loss of energy per step below this is round-off.
ROUND_OFF = 1e-10


def limits(rows: pd.DataFrame) -> Table | None:
    """Return the scalar problem's limits, measured and by theory; None of no rows."""
    if rows.empty:
        return None
    rows = rows.sort_values(["damping_ratio", "engine", "arm"])
    return Table.of(
        "stability-scalar-limits",
        "Limits of stability on the scalar problem",
        "The ωh from which on an oscillation of a mass on a contact's spring and damper grows, found by "
        "bisection on the step; none is no growth up to ωh = 64. At a damping ratio ζ of 2 both modes of the "
        "motion decay without oscillation, at rates ω(2 ± √3): there RK4's limit, 2.785 on the real "
        "axis, is met at ωh = 2.785/3.732.",
        {
            "damping ratio ζ": rows["damping_ratio"].map("{:g}".format),
            **head(rows, "engine", "arm"),
            "theory ωh": rows["limit_frequency_step"].map(_limit),
            "measured ωh": rows["measured_limit_frequency_step"].map(_limit),
            "relative difference": rows["relative_difference"].map(number),
        },
    )


def dampings(rows: pd.DataFrame) -> Table | None:
    """Return the energy lost per step where nothing damps, measured and by theory; None of no rows."""
    if rows.empty:
        return None
    rows = rows.sort_values(["frequency_step", "engine", "arm"])
    losses = {
        "measured": "energy_loss",
        "exact": "expected_energy_loss",
        "leading term": "leading_energy_loss",
    }
    return Table.of(
        "stability-scalar-damping",
        "Numerical damping on the scalar problem",
        "Part of the energy that a step loses of an oscillation that nothing damps: measured, exactly by the "
        "spectral radius of the method's step matrix, and by the leading term, ((1-ρ)/(1+ρ))³(ωh)⁴ for the "
        "generalized-alpha method (ρ = 0.5 unless named) and (ωh)⁶/72 for RK4. Less than 1e-10 is round-off "
        "and shown as 0.",
        {
            "ωh": rows["frequency_step"].map("{:g}".format),
            **head(rows, "engine", "arm"),
            **{heading: rows[f"{name}_per_step"].map(_loss) for heading, name in losses.items()},
            "relative difference": rows["relative_difference"].map(number),
        },
    )


def boundaries(rows: pd.DataFrame) -> Table:
    """Return where growth and divergence begin in each map, as omega h and as multiples of theory's limit."""
    lines = []
    for varied, (what, _, _) in VARIED.items():
        for (_, engine, arm), of_arm in cells(rows, varied).groupby(
            ["label", "engine", "arm"], observed=True
        ):
            limit, begins = limit_of(of_arm), map_rows(of_arm, varied)
            places = [
                span(part[name]) for name in ("growth", "divergence") for part in (begins, begins / limit)
            ]
            in_contact = span(of_arm["contact_step_s"].dropna() * 1e6)
            lines.append((what, engine, arm, _limit(limit), *places, span(begins["accurate"]), in_contact))
    return Table(
        "stability-boundaries",
        "Where growth and divergence begin",
        "Ranges over the rows of a map, ω being the first impact's, and multiples of theory's linear limit. "
        "Growth begins between the longest step up to which every run is at worst inaccurate and the next "
        "of the map: given is their geometric mean, or the shortest step if that grows already; divergence "
        "alike. Accurate is the longest step up to which every run is. For engines that choose their steps "
        "these are caps; the mean step within the first contact is in the last column. Where not all rows "
        "of a map have such a step, how many do is in brackets.",
        (
            *("map", "engine", "arm", "theory ωh", "growth from ωh", "per theory"),
            *("divergence from ωh", "per theory", "accurate up to ωh", "steps in contact [µs]"),
        ),
        tuple(lines),
    )


def other_bounds(in_maps: pd.DataFrame) -> Table:
    """Return how many verdicts of each arm each bound would change, were it half or twice as large."""
    by_label = in_maps.groupby("label", observed=True)
    changes = changed_verdicts(in_maps)
    return Table.of(
        "stability-bounds",
        "What the bounds decide",
        "How many of an arm's verdicts, in all maps, would be others if one bound were half or twice what it "
        "is. Runs that diverge by themselves do so by any bounds. Half of five impacts are two.",
        {
            **head(by_label.first().reset_index(), "engine", "arm"),
            "verdicts": by_label.size().map(str),
            "accurate": by_label["severity"].agg(lambda of: (of == 0).sum()).map(str),
            **{in_words(name).removeprefix("the "): counts.map(str) for name, counts in changes.items()},
        },
    )


def span(values: pd.Series) -> str:
    """Return the least and the largest of some numbers with two digits, and how many are there if not all."""
    there = values.dropna()
    if there.empty:
        return ABSENT
    low, high = (f"{value:.2g}" if value < 10 else f"{value:.0f}" for value in (there.min(), there.max()))
    text = low if low == high else f"{low} to {high}"
    return text if len(there) == len(values) else f"{text} ({len(there)} of {len(values)})"


def _limit(value: float) -> str:
    return "none" if math.isnan(value) else f"{value:.4f}"


def _loss(value: float) -> str:
    return f"{value:.4e}" if abs(value) > ROUND_OFF else "0"
