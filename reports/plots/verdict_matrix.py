"""The extreme cases on one page: a matrix of cases and engines, with theory's expectation beside it."""

from typing import Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing
from matplotlib.layout_engine import PlaceHolderLayoutEngine
from matplotlib.patches import Rectangle

from reports.analysis.verdicts import CONSTRAINT, ENERGY, Row, Verdict
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
ROW, HEAD, FOOT, NAMES, CELL = 0.2, 0.72, 0.42, 2.6, 0.5
#: The part of a divided cell that shows the verdict without our checks.
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
    theory = NAMES + CELL * len(lefts) + 0.3
    _head(ax, arms, theory)
    group = ""
    for place, (case, of_case) in enumerate(answers.groupby("scene", sort=False)):
        top = HEAD + ROW * place
        words = of_case.iloc[0]
        if words["group"] != group:
            group = words["group"]
            ax.plot([0.03, WIDTH_IN - 0.03], [top, top], color="#8C8C8C", linewidth=0.6)
            _text(ax, 0.03, top, group, size=6, ha="left", color="#595959")
        _text(ax, NAMES - 0.05, top, case, size=6.5, ha="right")
        for _, answer in of_case.iterrows():
            _cell(ax, lefts[answer["label"]], top, answer)
        _say(ax, [lefts[label] for label in of_case["label"]], top, of_case)
        _text(ax, theory, top, WANTED[words["wanted"]], size=7)
    _legend(ax, height - FOOT / 2, {*answers["verdict"], *answers["unguarded"].dropna()})
    return drawing


def _head(ax: Axes, arms: pd.DataFrame, theory: float) -> None:
    for column, (engine, arm) in enumerate(zip(arms["engine"], arms["arm"], strict=True)):
        x = NAMES + CELL * (column + 0.5)
        ax.text(x, HEAD - 0.06, f"{engine}\n{arm}", fontsize=5.8, rotation=40, ha="left", va="bottom")
    ax.text(theory, HEAD - 0.06, "Theory", fontsize=6.5, ha="center", va="bottom", weight="bold")
    ax.text(NAMES - 0.05, HEAD - 0.06, "Case", fontsize=6.5, ha="right", va="bottom", weight="bold")


def _cell(ax: Axes, left: float, top: float, answer: Row) -> None:
    """Draw a run's cell: its verdict, and on the right that without checks or how inaccurate it is."""
    verdict, bare = answer["verdict"], answer["unguarded"]
    edge = "#404040" if answer["as_wanted"] else "none"
    _box(ax, left + 0.015, top, CELL - 0.03, verdict, edge)
    if bare is not None:
        _symbol(ax, left + CELL * (1 - BARE) / 2, top, verdict)
        _box(ax, left + CELL * (1 - BARE), top, CELL * BARE - 0.03, bare, "none", 0.03)
        _symbol(ax, left + CELL * (1 - BARE / 2) - 0.015, top, bare)
    elif verdict is Verdict.INACCURATE:
        _symbol(ax, left + 0.09, top, verdict)
        worst = answer["worst"]
        _text(ax, left + 0.31, top, f"{OF_WHAT.get(worst, '')}{answer[worst]:.0e}", size=5)
    else:
        _symbol(ax, left + CELL / 2, top, verdict)


def _box(
    ax: Axes, x: float, top: float, width: float, verdict: Verdict, edge: str, inset: float = 0.015
) -> None:
    """Draw a box in a row in the colour of a verdict."""
    place, colour = (x, top + inset), LOOKS[verdict][1]
    ax.add_patch(Rectangle(place, width, ROW - 2 * inset, facecolor=colour, edgecolor=edge, linewidth=0.7))


def _symbol(ax: Axes, x: float, top: float, verdict: Verdict) -> None:
    _text(ax, x, top, LOOKS[verdict][0], size=6.5, color="white" if verdict in _DARK else BLACK)


def _say(ax: Axes, lefts: list[float], top: float, of_case: pd.DataFrame) -> None:
    """Let a case's cells tell what came of each run, and why, and what theory says."""
    columns = [of_case[name] for name in ("scene", "label", "verdict", "theory", "told_by", "reason")]
    notes = [
        f"{case}, {label}: {verdict.value}"
        + (f" ({': '.join(filter(None, why))})" if any(why) else "")
        + f". Theory: {theory}"
        for case, label, verdict, theory, *why in zip(*columns, strict=True)
    ]
    centres = [left + CELL / 2 for left in lefts]
    mark(ax.plot(centres, [top + ROW / 2] * len(centres), linestyle="none"), "", notes)


def _legend(ax: Axes, middle: float, used: set[Verdict]) -> None:
    x, top = 0.1, middle - ROW / 2
    for verdict in (each for each in LOOKS if each in used):
        _box(ax, x, top, 0.2, verdict, "#8C8C8C", 0.03)
        _symbol(ax, x + 0.1, top, verdict)
        _text(ax, x + 0.25, top, verdict.value, size=6.5, ha="left")
        x += 0.42 + 0.054 * len(verdict.value)


def _text(ax: Axes, x: float, top: float, text: str, size: float, **looks: Any) -> None:
    """Write in the middle of a row."""
    ax.text(x, top + ROW / 2, text, **{"fontsize": size, "ha": "center", "va": "center", **looks})
