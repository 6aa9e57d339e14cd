"""Tables of the energy study: hidden power, the ledger of every scene, and drift of the constraints."""

from collections.abc import Mapping, Sequence

from reports.chapters.agreement.tables import orders
from reports.chapters.energy.runs import (
    DISSIPATED,
    GAIN,
    GAP,
    LARGEST_ENERGY,
    MEAN_POWER,
    OPENING,
    POWER,
    STABILISED,
    at_rung,
    half_width,
    is_told,
    resolution,
    tolerance,
)
from reports.convergence import RULE, observed_order
from reports.parts import Table
from reports.results import Run
from reports.style import words
from reports.tables import ABSENT, number

#: The ends of the columns that are lines of the ledger, in its order.
LINES = ("_change_J", "driver_work_J", "_loss_J")
RESIDUAL = "energy_balance_residual_J"


def power_table(runs: Sequence[Run], rungs: Mapping[str, float]) -> Table:
    """Return the hidden power of every arm, by itself and beside what it has to be compared with."""
    head = (
        "scene",
        "mean step [s]",
        "engine",
        "arm",
        "hidden power [W]",
        "± [W]",
        "per largest kinetic energy [1/s]",
        "order of the power",
        "mean over the run [W]",
        "of it stabilisation [W]",
        "mean per dissipated power",
        "order of the largest gain",
    )
    rows = []
    for run in at_rung(runs, rungs):
        case = (run.scene, _step(run), *run.name)
        if not run.ok:
            rows.append((*case, *[run.status] * (len(head) - len(case))))
            continue
        mean, dissipated = run.values[MEAN_POWER], run.values.get(DISSIPATED)
        rows.append(
            (
                *case,
                _told(run, 1.0),
                number(half_width(run)),
                _told(run, run.values[LARGEST_ENERGY]),
                _power_order(runs, run),
                number(mean),
                _cell(run, STABILISED),
                number(mean / dissipated) if dissipated else ABSENT,
                str(orders(runs, run.scene, GAIN)[run.name]),
            )
        )
    reading = (
        "Positive where the method makes energy, negative where it loses it. The slope over time has the "
        "half-width of its 95 % confidence interval beside it; “< x” is not told from zero, and of a size "
        "below x. The mean is the gain at the end over the length of the run: it differs from the slope "
        "where the rate changes or the energy swings. Stabilisation is that part of the mean which the "
        f"engine tells it removed ({ABSENT}: it tells none). Only slopes told from zero count for the order. "
        f"{RULE}"
    )
    return Table("energy-hidden-power", "Hidden power on the middle rung", reading, head, tuple(rows))


def ledger_table(runs: Sequence[Run], scene: str, rung: float) -> Table:
    """Return the ledger at the end of one scene's runs, a row for each arm; only its own lines are there."""
    here = at_rung([run for run in runs if run.scene == scene], {scene: rung})
    names = list(dict.fromkeys(name for run in here for name in run.values))
    lines = [name for end in LINES for name in names if name.endswith(end)]
    rows = []
    for run in here:
        cells = [_digits(run.values.get(name)) for name in lines] + [_cell(run, RESIDUAL)]
        rows.append((*run.name, *(cells if run.ok else [run.status] * len(cells))))
    head = ("engine", "arm", *map(_heading, lines), "residual [J]")
    reading = (
        "Changes from start to end of the run. What is stored (changes) less what the driver gave plus "
        f"what was lost is the residual: zero if exact. {ABSENT}: the engine or its law has no such line."
    )
    title = f"Energy ledger of {scene} at {resolution(runs, scene, rung)}"
    return Table(f"energy-ledger-{scene}", title, reading, head, tuple(rows))


def drift_table(runs: Sequence[Run], rungs: Mapping[str, float]) -> Table:
    """Return the largest violation of the constraints, how it grows with time, and its order in the step."""
    head = (
        "scene",
        "mean step [s]",
        "engine",
        "arm",
        "largest gap [m]",
        "exponent of time",
        "order in the step",
        "largest gap speed [m/s]",
        "exponent of time",
        "order in the step",
    )
    rows = []
    for run in at_rung(runs, rungs):
        cells = []
        for quantity, name in ((GAP, "constraint_violation"), (OPENING, "constraint_speed")):
            value = quantity.value(run)
            if value is None:
                cells += [run.status if not run.ok else ABSENT] * 3
                continue
            grows = run.values.get(f"{name}_exponent")
            told = (
                (f"{abs(grows):.2f}", str(orders(runs, run.scene, quantity)[run.name]))
                if grows is not None
                else ()
            )
            cells += [number(value), *(told or (ABSENT, ABSENT))]
        rows.append((run.scene, _step(run), *run.name, *cells))
    reading = (
        "A gap is the distance between the two sides of an ideal joint, or of the slider from its guide. The "
        "exponent is that of the power of time which the largest gap so far follows: 1 grows in proportion "
        f"to time, 2 with its square, 0 is bounded. {ABSENT}: round-off, or a scene with impacts, between "
        "which nothing grows steadily."
    )
    return Table("energy-drift", "Drift of the constraints on the middle rung", reading, head, tuple(rows))


def _step(run: Run) -> str:
    """Return the mean step, which a run that did not finish and chooses its own has not."""
    return number(run.mean_step_s) if run.ok or tolerance(run) is None else ABSENT


def _told(run: Run, per: float) -> str:
    """Return the hidden power divided by something, or below what it is if it is not told from zero."""
    power = run.values[POWER]
    return number(power / per) if is_told(run) else f"< {number((abs(power) + half_width(run)) / per)}"


def _power_order(runs: Sequence[Run], run: Run) -> str:
    ladder = [r for r in runs if (r.scene, r.name) == (run.scene, run.name) and r.ok and is_told(r)]
    return str(observed_order([r.mean_step_s for r in ladder], [abs(r.values[POWER]) for r in ladder]))


def _cell(run: Run, name: str) -> str:
    return number(run.values[name]) if name in run.values else ABSENT


def _digits(value: float | None) -> str:
    """Return a line of the ledger with the digits that its sum needs; round-off with two."""
    if value is None:
        return ABSENT
    if value == 0:
        return "0"
    return f"{value:.5f}" if abs(value) >= 1e-3 else number(value)


def _heading(name: str) -> str:
    text, unit = words(name)
    return f"{text} [{unit}]"
