"""Accuracy on ideal joints: errors of every engine against the reference solutions, and observed orders."""

import math
import re
from collections.abc import Iterator, Sequence
from itertools import chain

import pandas as pd

from reports import quantities, shared_tables
from reports.analysis.convergence import RULE
from reports.parts import Chapter, Figure, Finding, Number, Studies, Table
from reports.plots.panels import against, against_tolerance, by_signal
from reports.quantities import FORCE, finished, motion_error, signal_errors, value, with_forces
from reports.results import with_columns
from reports.shared_tables import CASE, head, heading, orders, signal
from reports.style import labels
from reports.tables import ABSENT, error, listed, number, span

STUDY = "agreement"
INTRODUCTION = (
    "Every engine runs every scene without clearance at a series of steps or tolerances. Errors are the "
    "largest over all samples, against reference solutions that share no code with any engine."
)
JOINT_FORCE = r"joint_\w+_force_error_N"
#: The engine that integrates with RK4 where a row sets no other method, and the order of RK4.
REFERENCE, RK4_ORDER = "reference", 4
#: The order that theory gives each of Pymunk's configurations.
PYMUNK_ORDERS = {"pymunk (out of the box)": 1, "pymunk (tuned)": 2}


def findings(studies: Studies) -> Iterator[Finding]:
    """Yield the observed orders, which theory gives, and how many runs finished."""
    if STUDY not in studies:
        return
    rows = with_forces(studies[STUDY].rows)
    steps, position = rows[rows["varied"] == "step"], motion_error(rows)
    found = reference_orders(steps, position), pymunk_orders(steps, position)
    yield from (*filter(None, found), shared_tables.reliability(rows))


def figures(studies: Studies) -> Iterator[Figure | None]:
    """Yield errors against the step and against the tolerance, a panel for each signal and scene."""
    if STUDY not in studies:
        return
    rows = with_forces(studies[STUDY].rows)
    steps, chosen = (rows[rows["varied"] == what] for what in ("step", "tolerance"))
    shown = motion_error(rows), FORCE
    if drawing := by_signal(steps, shown, against):
        title = "How does the error fall with the step?"
        reading = "Grey lines: order at the left end; grey areas: uncertainty of the reference solution."
        yield Figure("agreement-steps", title, reading, STUDY, drawing)
    if drawing := by_signal(chosen, shown, against_tolerance):
        title = "How does the error follow the tolerance of engines that choose their steps?"
        reading = "On the grey line errors are in proportion to the tolerance."
        yield Figure("agreement-tolerance", title, reading, STUDY, drawing)


def tables(studies: Studies) -> Iterator[Table | None]:
    """Yield observed orders and smallest errors, and the numbers behind them as files."""
    if STUDY not in studies:
        return
    rows = with_forces(studies[STUDY].rows)
    steps = rows[rows["varied"] == "step"]
    for table in (orders_by_configuration(steps), errors_by_engine(rows)):
        yield table.on_page() if table.rows and len(table.head) > 1 else None
    cases = steps.drop_duplicates(CASE)
    by_scene = {
        signal(column): shared_tables.order_cells(cases, steps, column) for column in signal_errors(steps)
    }
    yield Table.of("agreement-orders", "Observed orders", RULE, STUDY, {**head(cases, *CASE), **by_scene})
    yield errors_at_step(at_common_steps(steps))
    for parameter, swept in rows.groupby("varied", sort=False):
        if parameter not in ("step", "tolerance"):
            yield sweep(swept, str(parameter))
    yield from shared_tables.runs_tables(rows, STUDY)


def shown_errors(rows: pd.DataFrame) -> list[str]:
    """Return the columns of errors that are shown: the largest joint force in place of single joints."""
    errors = signal_errors(rows)
    return list(dict.fromkeys(FORCE if re.fullmatch(JOINT_FORCE, name) else name for name in errors))


def at_common_steps(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of each scene at the middle one of the steps that every engine was run at."""
    steps = {}
    for scene, of_scene in rows.groupby("scene"):
        engines = of_scene.groupby("step_s")["engine"].nunique()
        common = engines.index[engines == of_scene["engine"].nunique()]
        if len(common):
            steps[scene] = common[len(common) // 2]
    return rows[rows["step_s"] == rows["scene"].map(steps)]


def slopes(rows: pd.DataFrame, column: str) -> dict[str, list[float]]:
    """Return by configuration the observed orders of a column on the scenes where it has one."""
    found = orders(rows, column).items()
    return {
        label: [of.slope for of in by_scene.values() if of.slope is not None] for label, by_scene in found
    }


def reference_orders(rows: pd.DataFrame, position: str) -> Finding | None:
    """Return the observed orders of the reference engine's RK4, which are 4."""
    methods = with_columns(rows, "setting_method")["setting_method"]
    rk4 = rows[(rows["engine"] == REFERENCE) & methods.isna()]
    parts, values, judged = list[str](), dict[str, Number](), list[float]()
    for column in (position, FORCE):
        if found := list(chain(*slopes(rk4, column).values())):
            parts.append(f"{_range(found, values)} in {signal(column)}")
        judged += found
    text = f"Observed order of the reference engine (RK4): {listed(parts or [ABSENT])}."
    finding = Finding("rk4-order", text, **values).require(set(map(round, judged)) <= {RK4_ORDER})
    return finding if parts else None


def pymunk_orders(rows: pd.DataFrame, position: str) -> Finding | None:
    """Return the observed orders of Pymunk's two configurations, None unless both have one."""
    by_label = slopes(rows, position)
    default, tuned = PYMUNK_ORDERS
    if not by_label.get(default) or not by_label.get(tuned):
        return None
    values = dict[str, Number]()
    text = (
        f"{default} is a first-order method (observed order {_range(by_label[default], values)} in "
        f"{signal(position)}); {tuned}, with joint errors corrected in full in every step and a half-step "
        f"start, is of second order ({_range(by_label[tuned], values)})."
    )
    holds = all({order} == set(map(round, by_label[label])) for label, order in PYMUNK_ORDERS.items())
    return Finding("pymunk-orders", text, **values).require(holds)


def _range(found: Sequence[float], values: dict[str, Number]) -> str:
    """Return the text of a range, one number if both ends read the same; the numbers are put into values."""
    ends = {str(Number(end)): Number(end) for end in (min(found), max(found))}
    names = [f"n{len(values) + k}" for k in range(len(ends))]
    values |= dict(zip(names, ends.values(), strict=True))
    return " to ".join(f"{{{name}}}" for name in names)


def orders_by_configuration(rows: pd.DataFrame) -> Table:
    """Return the range of the observed orders over all scenes, by configuration and signal."""
    columns: dict[str, list[str]] = {"configuration": labels(finished(rows))}
    for column in shown_errors(rows):
        by_label, known = orders(rows, column), slopes(rows, column)
        columns[signal(column)] = cells = []
        for label in columns["configuration"]:
            reasons = ", ".join(sorted({of.verdict for of in by_label[label].values()} - {"order"}))
            some = f"{span(known[label], '.2f')}{reasons and f' (else {reasons})'}"
            cells.append(some if known[label] else reasons or ABSENT)
    title = "Observed orders of convergence, range over all scenes"
    return Table.of("agreement-orders-by-configuration", title, RULE, STUDY, columns)


def errors_by_engine(rows: pd.DataFrame) -> Table:
    """Return of each engine and signal the smallest error, on the scene where that is largest."""
    engines = list(dict.fromkeys(rows.sort_values("label")["engine"]))
    columns: dict[str, list[str]] = {"engine": engines}
    for column in shown_errors(rows):
        best = shared_tables.nearest(rows, column).sort_values("error")
        worst = best.drop_duplicates("engine", keep="last").set_index("engine").reindex(engines)
        columns[heading(column)] = list(map(error, worst["error"], worst["doubt"]))
    title = "Best error of each engine, on its worst scene"
    reading = "An error below the uncertainty u of the reference solution is shown as “< u”."
    return Table.of("agreement-errors-by-engine", title, reading, STUDY, columns)


def errors_at_step(at_step: pd.DataFrame) -> Table:
    """Return the errors of every signal at one step per scene, and the reference solution's uncertainty."""
    errors = signal_errors(at_step)
    doubts = pd.DataFrame(
        {
            "scene": scene,
            "step [s]": number(of_scene["step_s"].iloc[0]),
            "engine": "reference solution",
            "configuration": "uncertainty",
            **{heading(column): number(quantities.floor(of_scene, column) or math.nan) for column in errors},
        }
        for scene, of_scene in at_step.groupby("scene")
    )
    reading = f"The step is the middle one of those of all engines. {shared_tables.not_judged(at_step)}"
    cells = pd.concat([_errors(at_step, errors), doubts]).sort_values("scene", kind="stable")
    return Table.of("agreement-errors", "Largest errors at one step", reading.strip(), STUDY, cells)


def sweep(rows: pd.DataFrame, parameter: str) -> Table:
    """Return errors and status against one parameter of an engine."""
    rows = rows.sort_values(["scene", "engine", f"setting_{parameter}"])
    cells = _errors(rows, (motion_error(rows), FORCE, "constraint_violation_m"))
    cells.insert(3, parameter, [*map(str, rows[f"setting_{parameter}"])])
    return Table.of(f"agreement-{parameter}", f"Errors against {parameter}", "", STUDY, cells)


def _errors(rows: pd.DataFrame, columns: Sequence[str]) -> pd.DataFrame:
    """Return the runs with their errors as text, or their status where they did not finish."""
    cells = pd.DataFrame(head(rows, "scene", "step_s", "engine", "arm"))
    for name in columns:
        texts = map(error, value(rows, name), quantities.uncertainty(rows, name))
        cells[heading(name)] = [
            text if status == "ok" else status for status, text in zip(rows["status"], texts, strict=True)
        ]
    return cells


CHAPTER = Chapter(
    "accuracy-ideal", "Accuracy, ideal joints", (STUDY,), INTRODUCTION, findings, figures, tables
)
