"""The gallery on one page: a matrix of cases and engines, with theory's expectation beside it."""

import textwrap
from typing import Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing
from matplotlib.layout_engine import PlaceHolderLayoutEngine
from matplotlib.patches import Rectangle

from reports.chapters.extremes.verdict import CONSTRAINT, ENERGY, Row, Verdict
from reports.plots.series import mark
from reports.style import BLACK, WIDTH_IN

#: Symbol and colour of each verdict. Lightness falls from one to the next, so that greyscale keeps the order.
LOOKS = {
    Verdict.RIGHT: ("✓", "#F4F8FB"),
    Verdict.REFUSED: ("⊘", "#CFE3F1"),
    Verdict.FAILED: ("F", "#A2C8E4"),
    Verdict.NOTICED: ("N", "#7FB2D6"),
    Verdict.INACCURATE: ("≈", "#D98D2B"),
    Verdict.FAILED_OBSCURELY: ("f", "#D27328"),
    Verdict.TIMED_OUT: ("T", "#B0502A"),
    Verdict.OUT_OF_MEMORY: ("M", "#8F2F26"),
    Verdict.CRASHED: ("C", "#631A2B"),
    Verdict.WRONG: ("✗", "#20122E"),
}
#: What theory asks for, in the same symbols.
WANTED = {"answer": "✓", "answer or word": "✓ F", "refusal": "⊘", "stop": "F"}
#: What an inaccurate run's number is of, where it is not the error of the motion.
OF_WHAT = {ENERGY: "E ", CONSTRAINT: "C "}
#: From this verdict on symbols are white.
_DARK = list(LOOKS)[6:]
#: In inches: the heights of a row, the head and the legend; where the columns begin; a cell's width.
ROW, HEAD, FOOT, NAMES, CELL = 0.2, 0.72, 0.42, 1.66, 0.425
WRAP = 66
#: The part of a guarded cell that shows the verdict without guards.
BARE = 0.45


def verdict_matrix(answers: pd.DataFrame) -> Drawing:
    """Return the matrix; a frame marks every verdict that is what theory asks for."""
    arms = answers.drop_duplicates("label").sort_values("label")
    lefts = {label: NAMES + CELL * place for place, label in enumerate(arms["label"])}
    height = HEAD + ROW * answers["scene"].nunique() + FOOT
    drawing = Drawing(figsize=(WIDTH_IN, height), layout=PlaceHolderLayoutEngine(False, False))
    ax = drawing.add_axes((0.0, 0.0, 1.0, 1.0))
    ax.set(xlim=(0, WIDTH_IN), ylim=(height, 0))
    ax.axis("off")
    theory = NAMES + CELL * len(lefts) + 0.36
    _head(ax, arms, theory)
    group = ""
    for place, (case, of_case) in enumerate(answers.groupby("scene", sort=False)):
        top = HEAD + ROW * place
        words = of_case.iloc[0]
        if words["group"] != group:
            group = words["group"]
            ax.plot([0.03, WIDTH_IN - 0.03], [top, top], color="#8C8C8C", linewidth=0.6)
            _text(ax, 0.03, top, group, size=5, ha="left", color="#595959")
        _text(ax, NAMES - 0.05, top, case, size=6, ha="right")
        for _, answer in of_case.iterrows():
            _cell(ax, lefts[answer["label"]], top, answer)
        _say(ax, [lefts[label] for label in of_case["label"]], top, of_case)
        _text(ax, theory - 0.2, top, WANTED[words["wanted"]], size=7)
        lines = "\n".join(textwrap.wrap(words["theory"], WRAP))
        _text(ax, theory, top, lines, size=4.9, ha="left")
    _legend(ax, height - FOOT / 2, {*answers["verdict"], *answers["unguarded"].dropna()})
    return drawing


def _head(ax: Axes, arms: pd.DataFrame, theory: float) -> None:
    for column, (engine, arm) in enumerate(zip(arms["engine"], arms["arm"], strict=True)):
        x = NAMES + CELL * (column + 0.5)
        ax.text(x, HEAD - 0.06, f"{engine}\n{arm}", fontsize=5.8, rotation=40, ha="left", va="bottom")
    ax.text(theory - 0.28, HEAD - 0.06, "Theory", fontsize=6.5, ha="left", va="bottom", weight="bold")
    ax.text(NAMES - 0.05, HEAD - 0.06, "Case", fontsize=6.5, ha="right", va="bottom", weight="bold")


def _cell(ax: Axes, left: float, top: float, answer: Row) -> None:
    verdict, worst = answer["verdict"], answer["worst"]
    symbol, colour = LOOKS[verdict]
    patch = Rectangle((left + 0.015, top + 0.015), CELL - 0.03, ROW - 0.03, facecolor=colour, linewidth=0.7)
    patch.set_edgecolor("#404040" if answer["as_wanted"] else "none")
    ax.add_patch(patch)
    ink = "white" if verdict in _DARK else BLACK
    if answer["unguarded"] is not None:
        _text(ax, left + CELL * (1 - BARE) / 2, top, symbol, size=7, color=ink)
        _bare(ax, left + CELL * (1 - BARE), top, answer["unguarded"])
        return
    if verdict is not Verdict.INACCURATE:
        _text(ax, left + CELL / 2, top, symbol, size=7, color=ink)
        return
    off = f"{OF_WHAT.get(worst, '')}{answer[worst]:.0e}"
    _text(ax, left + 0.09, top, symbol, size=7, color=ink)
    _text(ax, left + 0.28, top, off, size=4.3, color=ink)


def _say(ax: Axes, lefts: list[float], top: float, of_case: pd.DataFrame) -> None:
    """Let a case's cells tell what came of each run, and why."""
    columns = [of_case[name] for name in ("scene", "label", "verdict", "told_by", "reason")]
    notes = [
        f"{case}, {label}: {verdict.value}" + (f" ({': '.join(filter(None, why))})" if any(why) else "")
        for case, label, verdict, *why in zip(*columns, strict=True)
    ]
    centres = [left + CELL / 2 for left in lefts]
    mark(ax.plot(centres, [top + ROW / 2] * len(centres), linestyle="none"), "", notes)


def _bare(ax: Axes, left: float, top: float, verdict: Verdict) -> None:
    """Fill the right part of a cell by the verdict without guards."""
    symbol, colour = LOOKS[verdict]
    ax.add_patch(
        Rectangle((left, top + 0.03), CELL * BARE - 0.03, ROW - 0.06, facecolor=colour, edgecolor="none")
    )
    ink = "white" if verdict in _DARK else BLACK
    _text(ax, left + CELL * BARE / 2 - 0.015, top, symbol, size=6, color=ink)


def _legend(ax: Axes, y: float, used: set[Verdict]) -> None:
    x = 0.1
    for verdict, (symbol, colour) in LOOKS.items():
        if verdict not in used:
            continue
        ax.add_patch(
            Rectangle((x, y - 0.07), 0.2, 0.14, facecolor=colour, edgecolor="#8C8C8C", linewidth=0.5)
        )
        ink = "white" if verdict in _DARK else BLACK
        ax.text(x + 0.1, y, symbol, fontsize=6.5, ha="center", va="center", color=ink)
        ax.text(x + 0.25, y, verdict.value, fontsize=6.5, va="center")
        x += 0.42 + 0.056 * len(verdict.value)


def _text(ax: Axes, x: float, top: float, text: str, size: float, **looks: Any) -> None:
    """Write in the middle of a row."""
    ax.text(x, top + ROW / 2, text, **{"fontsize": size, "ha": "center", "va": "center", **looks})
