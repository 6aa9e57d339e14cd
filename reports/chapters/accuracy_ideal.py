"""Accuracy on ideal joints: errors of every engine against the reference solutions, and observed orders."""

import re
from collections.abc import Iterator
from itertools import chain

import numpy as np
import pandas as pd

from reports.lines import Panel, against, figure_of
from reports.look import ABSENT, axis_label, listed, number, span, words
from reports.page import UNCERTAIN, Chapter, Claim, Figure, Table
from reports.results import (
    FORCE,
    IDEAL,
    SLIDER,
    Studies,
    accuracy,
    finished,
    signal_errors,
    tolerances,
    uncertainty,
    value,
    with_columns,
)
from studies.judges.convergence import RULE, observed_order

#: The order that theory gives each of Pymunk's configurations, and RK4.
PYMUNK_ORDERS, RK4_ORDER = {"pymunk (out of the box)": 1, "pymunk (tuned)": 2}, 4
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
    steps, chosen = rows[rows["tolerance"].isna()], rows[rows["tolerance"].notna()]
    yield from _orders_of_theory(steps)
    caption = "Grey lines: order at the left end; grey areas: uncertainty of the reference solution."
    by_step = [against(steps, column) for column in (SLIDER, FORCE)]
    yield _figure("accuracy-steps", "How does the error fall with the step?", caption, by_step)
    title, caption = "How does the error fall with the tolerance?", "On the grey line it is in proportion."
    by_tolerance = [against(chosen, column, "tolerance", (1,)) for column in (SLIDER, FORCE)]
    yield _figure("accuracy-tolerances", title, caption, by_tolerance)
    yield _orders_by_configuration(steps)
    yield errors_by_engine(rows)


def _figure(name: str, title: str, caption: str, by_signal: list[list[Panel]]) -> Figure | None:
    """Return the figure of the panels of some signals; of few scenes each signal has a row of its own."""
    across = max(map(len, by_signal))
    return figure_of(
        name, title, caption, "accuracy", [*chain(*by_signal)], 2.4, across if across <= 3 else None
    )


def orders(rows: pd.DataFrame, column: str) -> pd.DataFrame:
    """Return a column's orders by ``label`` and ``scene``: a ``slope``, NaN where ``verdict`` says why."""
    scale = column.replace("_error_", "_scale_")
    rows = with_columns(rows, scale).assign(error=value(rows, column), doubt=uncertainty(rows, column))
    ends = rows.groupby("scene")[["doubt", scale]].max().fillna({"doubt": 0.0, scale: np.inf})
    lines = []
    for (label, scene), of in rows.dropna(subset="error").groupby(["label", "scene"], observed=True):
        order = observed_order(of["mean_step_s"], of["error"], *ends.loc[scene])
        lines.append((label, scene, order.slope, order.verdict))
    return pd.DataFrame(lines, columns=["label", "scene", "slope", "verdict"]).astype({"slope": float})


def _orders_of_theory(steps: pd.DataFrame) -> Iterator[Claim]:
    """Yield the observed orders of methods whose order theory gives: RK4 of the reference, and Pymunk's."""
    methods = with_columns(steps, "setting_method")["setting_method"]
    rk4 = steps[(steps["engine"] == "reference") & methods.isna()]
    claims: list[tuple[str, str, pd.DataFrame, tuple[str, ...], int]] = []
    claims.append(("rk4-order", "the reference engine (RK4)", rk4, (SLIDER, FORCE), RK4_ORDER))
    for label, order in PYMUNK_ORDERS.items():
        claims.append((f"order of {label}", label, steps[steps["label"] == label], (SLIDER,), order))
    for name, who, rows, columns, order in claims:
        slopes = {words(column)[0].replace(" error", ""): orders(rows, column)["slope"] for column in columns}
        every = pd.concat(slopes.values()).dropna()
        if len(every):
            told = listed(f"{span(of)} in {what}" for what, of in slopes.items() if of.notna().any())
            numbers = {"least": (every.min(), ""), "most": (every.max(), ""), "order": (order, "")}
            text = f"Observed order of {who}: {told}; theory: {{order}}."
            yield Claim(name, text, numbers, bool((every.round() == order).all()))


def _shown_errors(rows: pd.DataFrame) -> list[str]:
    """Return the columns of errors that are shown: the largest joint force in place of single joints."""
    single = r"joint_\w+_force_error_N"
    return list(dict.fromkeys(FORCE if re.fullmatch(single, name) else name for name in signal_errors(rows)))


def _orders_by_configuration(rows: pd.DataFrame) -> Table:
    """Return the range of the observed orders over all scenes, by configuration and signal."""
    columns: dict[str, list[str]] = {
        "configuration": [*finished(rows)["label"].drop_duplicates().sort_values()]
    }
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
