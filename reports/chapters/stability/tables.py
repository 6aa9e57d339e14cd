"""Tables of the stability study."""

from collections.abc import Sequence

from reports.chapters.stability.cells import VARIED, arms, cells, dampings_of, limit_of, limits_of, map_rows
from reports.parts import Table
from reports.results import Run
from reports.tables import ABSENT, number

#: A loss of energy per step below this is round-off.
ROUND_OFF = 1e-10


def limits(runs: Sequence[Run]) -> Table:
    """Return the scalar problem's limits, measured and by theory."""
    rows = []
    for run in sorted(limits_of(runs), key=lambda run: run.values["damping_ratio"]):
        found, expected = (run.values.get(f"{what}limit_frequency_step") for what in ("measured_", ""))
        numbers = (_limit(expected), _limit(found), _part(run.values.get("relative_difference")))
        rows.append((f"{run.values['damping_ratio']:g}", *run.name, *numbers))
    return Table(
        "stability-scalar-limits",
        "Limits of stability on the scalar problem",
        "The ωh from which on an oscillation of a mass on a contact's spring and damper grows, found by "
        "bisection on the step; none is no growth up to ωh = 64. At a damping ratio ζ of 2 both modes of the "
        "motion decay without oscillation, at rates ω(2 ± √3): there RK4's limit, 2.785 on the real "
        "axis, is met at ωh = 2.785/3.732.",
        ("damping ratio ζ", "engine", "arm", "theory ωh", "measured ωh", "relative difference"),
        tuple(rows),
    )


def dampings(runs: Sequence[Run]) -> Table:
    """Return the energy lost per step on the undamped scalar problem, measured and by theory."""
    rows = []
    for run in sorted(dampings_of(runs), key=lambda run: run.values["frequency_step"]):
        values = run.values
        numbers = [values[f"{what}energy_loss_per_step"] for what in ("", "expected_")]
        numbers.append(values.get("leading_energy_loss_per_step", 0.0))
        shown = [f"{x:.4e}" if abs(x) > ROUND_OFF else "0" for x in numbers]
        difference = _part(values.get("relative_difference"))
        rows.append((f"{values['frequency_step']:g}", *run.name, *shown, difference))
    return Table(
        "stability-scalar-damping",
        "Numerical damping on the scalar problem",
        "Part of the energy that a step loses of an oscillation that nothing damps: measured, exactly by the "
        "spectral radius of the method's step matrix, and by the leading term, ((1-ρ)/(1+ρ))³(ωh)⁴ for the "
        "generalized-alpha method (ρ = 0.5 unless named) and (ωh)⁶/72 for RK4. Less than 1e-10 is round-off "
        "and shown as 0.",
        ("ωh", "engine", "arm", "measured", "exact", "leading term", "relative difference"),
        tuple(rows),
    )


def boundaries(runs: Sequence[Run]) -> Table:
    """Return where growth and divergence begin in each map, as omega h and as multiples of theory's limit."""
    rows = []
    for varied, (what, _, _) in VARIED.items():
        for name in arms(cells(runs, varied)):
            found = map_rows(runs, varied, name)
            limit = limit_of([run for run in cells(runs, varied) if run.name == name])
            begins = [[row.growth for row in found], [row.divergence for row in found]]
            multiples = [[x and limit and x / limit for x in some] for some in begins]
            places = (span(begins[0]), span(multiples[0]), span(begins[1]), span(multiples[1]))
            rows.append((what, *name, _limit(limit), *places, span([row.accurate for row in found])))
    return Table(
        "stability-boundaries",
        "Where growth and divergence begin",
        "Ranges over the rows of a map, ω being the first impact's, and multiples of theory's limit. Growth "
        "begins between the longest step up to which every run is at worst inaccurate and the next of the "
        "map: given is their geometric mean, or the shortest step if that grows already; divergence alike. "
        "Accurate is the longest step up to which every run is. Where not all rows of a map have such a "
        "step, how many do is in brackets.",
        (
            *("map", "engine", "arm", "theory ωh", "growth from ωh", "per theory"),
            *("divergence from ωh", "per theory", "accurate up to ωh"),
        ),
        tuple(rows),
    )


def span(values: Sequence[float | None]) -> str:
    """Return the least and the largest of some numbers with two digits, and how many are there if not all."""
    there = [value for value in values if value is not None]
    if not there:
        return ABSENT
    low, high = (f"{value:.2g}" if value < 10 else f"{value:.0f}" for value in (min(there), max(there)))
    text = low if low == high else f"{low} to {high}"
    return text if len(there) == len(values) else f"{text} ({len(there)} of {len(values)})"


def _limit(value: float | None) -> str:
    return "none" if value is None else f"{value:.4f}"


def _part(value: float | None) -> str:
    return ABSENT if value is None else number(value)
