"""Accuracy on ideal joints: errors of every engine against the reference solutions, and observed orders."""

import re
from collections.abc import Iterator
from itertools import chain

import numpy as np
import pandas as pd

from reports.lines import Panel, against, draw, points
from reports.look import ABSENT, axis_label, labels, listed, number, span, words
from reports.page import UNCERTAIN, Chapter, Claim, Figure, Table
from reports.results import (
    FORCE,
    IDEAL,
    Studies,
    accuracy,
    finished,
    motion_error,
    signal_errors,
    tolerances,
    uncertainty,
    value,
    with_columns,
)
from studies.judges.convergence import RULE, Order, observed_order

#: The engine that integrates with RK4 where a row sets no other method, and the order of RK4.
REFERENCE, RK4_ORDER = "reference", 4
#: The order that theory gives each of Pymunk's configurations.
PYMUNK_ORDERS = {"pymunk (out of the box)": 1, "pymunk (tuned)": 2}
INTRODUCTION = (
    "Every engine runs scenes without clearance at a series of steps or tolerances. Errors are the largest "
    "over time, against reference solutions that share no code with any engine."
)


def parts(studies: Studies) -> Iterator[Claim | Figure | Table | None]:
    """Yield observed orders, which theory gives, errors against step and tolerance, and the best errors."""
    rows = accuracy(studies, IDEAL)
    if rows.empty:
        return
    rows = rows.assign(tolerance=tolerances(rows))
    steps, position = rows[rows["tolerance"].isna()], motion_error(rows)
    yield from _rk4_order(steps, position)
    yield from _pymunk_orders(steps, position)
    shown = position, FORCE
    title = "How does the error fall with the step?"
    caption = "Grey lines: order at the left end; grey areas: uncertainty of the reference solution."
    yield _figure("accuracy-steps", title, caption, [against(steps, column) for column in shown])
    chosen = rows[rows["tolerance"].notna()]
    title, caption = "How does the error fall with the tolerance?", "On the grey line it is in proportion."
    by_tolerance = [against(chosen, column, "tolerance", (1,)) for column in shown]
    yield _figure("accuracy-tolerances", title, caption, by_tolerance)
    yield _orders_by_configuration(steps)
    yield errors_by_engine(rows)


def _figure(name: str, title: str, caption: str, by_signal: list[list[Panel]]) -> Figure | None:
    """Return the figure of the panels of some signals; of few scenes each signal has a row of its own."""
    panels = [*chain(*by_signal)]
    across = max(map(len, by_signal))
    drawing = draw(panels, 2.4, across if across <= 3 else None) if panels else None
    return Figure(name, title, caption, "accuracy", drawing, points(panels)) if drawing else None


def orders(rows: pd.DataFrame, column: str) -> dict[str, dict[str, Order]]:
    """Return the observed order of a column by label and scene, where a finished run has it."""
    scale = with_columns(rows, column.replace("_error_", "_scale_"))[column.replace("_error_", "_scale_")]
    rows = rows.assign(error=value(rows, column), doubt=uncertainty(rows, column), scale=scale)
    floors = rows.groupby("scene")["doubt"].max().fillna(0.0)
    scales = rows.groupby("scene")["scale"].max().fillna(np.inf)
    by_label: dict[str, dict[str, Order]] = {label: {} for label in labels(rows)}
    for (label, scene), of in rows.dropna(subset="error").groupby(["label", "scene"], observed=True):
        ends = floors[scene], scales[scene]
        by_label[label][scene] = observed_order(of["mean_step_s"], of["error"], *ends)
    return by_label


def _slopes(rows: pd.DataFrame, column: str) -> dict[str, list[float]]:
    """Return by configuration the observed orders of a column on the scenes where it has one."""
    return {
        label: [of.slope for of in by_scene.values() if of.slope is not None]
        for label, by_scene in orders(rows, column).items()
    }


def _rk4_order(rows: pd.DataFrame, position: str) -> Iterator[Claim]:
    """Yield the observed orders of the reference engine's RK4, which are 4."""
    methods = with_columns(rows, "setting_method")["setting_method"]
    rk4 = rows[(rows["engine"] == REFERENCE) & methods.isna()]
    found = {column: [*chain(*_slopes(rk4, column).values())] for column in (position, FORCE)}
    told = [f"{span(of)} in {words(column)[0].replace(' error', '')}" for column, of in found.items() if of]
    every = [*chain(*found.values())]
    if told:
        numbers = {"least": (min(every), ""), "most": (max(every), "")}
        text = f"Observed order of the reference engine (RK4): {listed(told)}."
        yield Claim("rk4-order", text, numbers, {*map(round, every)} == {RK4_ORDER})


def _pymunk_orders(rows: pd.DataFrame, position: str) -> Iterator[Claim]:
    """Yield the observed orders of Pymunk's configurations, which theory gives."""
    for label, order in PYMUNK_ORDERS.items():
        if found := _slopes(rows, position).get(label):
            numbers = {"least": (min(found), ""), "most": (max(found), ""), "order": (order, "")}
            text = f"{label} is of order {{order}} in slider position (observed {span(found)})."
            yield Claim(f"order of {label}", text, numbers, {*map(round, found)} == {order})


def _shown_errors(rows: pd.DataFrame) -> list[str]:
    """Return the columns of errors that are shown: the largest joint force in place of single joints."""
    single = r"joint_\w+_force_error_N"
    return list(dict.fromkeys(FORCE if re.fullmatch(single, name) else name for name in signal_errors(rows)))


def _orders_by_configuration(rows: pd.DataFrame) -> Table:
    """Return the range of the observed orders over all scenes, by configuration and signal."""
    columns: dict[str, list[str]] = {"configuration": labels(finished(rows))}
    for column in _shown_errors(rows):
        by_label, known = orders(rows, column), _slopes(rows, column)
        columns[words(column)[0].replace(" error", "")] = cells = []
        for label in columns["configuration"]:
            reasons = ", ".join(sorted({of.verdict for of in by_label[label].values()} - {"order"}))
            some = f"{span(known[label], '.2f')}{reasons and f' (else {reasons})'}"
            cells.append(some if known[label] else reasons or ABSENT)
    title = "Observed orders of convergence, range over all scenes"
    return Table("accuracy-orders", title, RULE, "accuracy", pd.DataFrame(columns))


def errors_by_engine(rows: pd.DataFrame) -> Table:
    """Return of each engine and signal the smallest error, on the scene where that is largest."""
    engines = list(dict.fromkeys(rows.sort_values("label")["engine"]))
    columns: dict[str, object] = {"engine": engines}
    for column in _shown_errors(rows):
        worst = nearest(rows, column).sort_values("error").drop_duplicates("engine", keep="last")
        worst = worst.set_index("engine").reindex(engines)
        heading = axis_label(column).replace(" error", "")
        columns |= {heading: [*worst["error"]], f"{heading}{UNCERTAIN}": [*worst["doubt"]]}
    title = "Best error of each engine, on its worst scene"
    caption = "An error below the uncertainty u of the reference solution is shown as “< u”."
    formats = dict.fromkeys((name for name in columns if name != "engine"), number)
    return Table("accuracy-errors", title, caption, "accuracy", pd.DataFrame(columns), formats)


def nearest(rows: pd.DataFrame, column: str) -> pd.DataFrame:
    """Return each engine's run with the smallest ``error`` of a column on each scene, and its ``doubt``."""
    best = rows.assign(error=value(rows, column), doubt=uncertainty(rows, column).fillna(0.0))
    best = best.dropna(subset="error").sort_values("error", kind="stable")
    return best.drop_duplicates(["engine", "scene"]).sort_index()


CHAPTER = Chapter("accuracy-ideal", "Accuracy, ideal joints", ("accuracy",), INTRODUCTION, parts)
