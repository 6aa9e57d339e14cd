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
from studies.judges.convergence import RULE, observed_order

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


def orders(rows: pd.DataFrame, column: str) -> pd.DataFrame:
    """Return a column's orders by ``label`` and ``scene``: a ``slope``, NaN where ``verdict`` says why."""
    name = column.replace("_error_", "_scale_")
    rows = rows.assign(error=value(rows, column), doubt=uncertainty(rows, column))
    rows = rows.assign(scale=with_columns(rows, name)[name]).dropna(subset=["label", "scene"])
    ends = rows.groupby("scene").agg(floor=("doubt", "max"), scale=("scale", "max"))
    ends = ends.fillna({"floor": 0.0, "scale": np.inf})
    lines = []
    for (label, scene), of in rows.dropna(subset="error").groupby(["label", "scene"], observed=True):
        order = observed_order(of["mean_step_s"], of["error"], *ends.loc[scene])
        lines.append((label, scene, order.slope, order.verdict))
    return pd.DataFrame(lines, columns=["label", "scene", "slope", "verdict"]).astype({"slope": float})


def _rk4_order(rows: pd.DataFrame, position: str) -> Iterator[Claim]:
    """Yield the observed orders of the reference engine's RK4, which are 4."""
    methods = with_columns(rows, "setting_method")["setting_method"]
    rk4 = rows[(rows["engine"] == REFERENCE) & methods.isna()]
    slopes = {column: orders(rk4, column)["slope"].dropna() for column in (position, FORCE)}
    told = [
        f"{span(of)} in {words(column)[0].replace(' error', '')}" for column, of in slopes.items() if len(of)
    ]
    if told:
        every = pd.concat(slopes.values())
        numbers = {"least": (every.min(), ""), "most": (every.max(), "")}
        text = f"Observed order of the reference engine (RK4): {listed(told)}."
        yield Claim("rk4-order", text, numbers, bool((every.round() == RK4_ORDER).all()))


def _pymunk_orders(rows: pd.DataFrame, position: str) -> Iterator[Claim]:
    """Yield the observed orders of Pymunk's configurations, which theory gives."""
    for label, order in PYMUNK_ORDERS.items():
        slopes = orders(rows[rows["label"] == label], position)["slope"].dropna()
        if len(slopes):
            numbers = {"least": (slopes.min(), ""), "most": (slopes.max(), ""), "order": (order, "")}
            text = f"{label} is of order {{order}} in slider position (observed {span(slopes)})."
            yield Claim(f"order of {label}", text, numbers, bool((slopes.round() == order).all()))


def _shown_errors(rows: pd.DataFrame) -> list[str]:
    """Return the columns of errors that are shown: the largest joint force in place of single joints."""
    single = r"joint_\w+_force_error_N"
    return list(dict.fromkeys(FORCE if re.fullmatch(single, name) else name for name in signal_errors(rows)))


def _orders_by_configuration(rows: pd.DataFrame) -> Table:
    """Return the range of the observed orders over all scenes, by configuration and signal."""
    columns: dict[str, list[str]] = {"configuration": labels(finished(rows))}
    for column in _shown_errors(rows):
        known = orders(rows, column)
        columns[words(column)[0].replace(" error", "")] = cells = []
        for label in columns["configuration"]:
            own = known[known["label"] == label]
            reasons = ", ".join(sorted({*own["verdict"]} - {"order"}))
            some = f"{span(own['slope'], '.2f')}{reasons and f' (else {reasons})'}"
            cells.append(some if own["slope"].notna().any() else reasons or ABSENT)
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
