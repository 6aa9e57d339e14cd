"""The one figure of the answer: what each engine gets right for how much time, with the target drawn in."""

import pandas as pd
from matplotlib.axes import Axes

from reports.chapters.answer.picks import POSITION, Race
from reports.equal_error import Judged, front
from reports.parts import Figure
from reports.plots.series import mark
from reports.plots.step_figures import grid
from reports.results import Results, with_columns
from reports.style import GREY, axis_label, legend_place, variant
from reports.tables import listed, setting

#: The scenes shown, a driven one and a free one, where they were raced on; otherwise the first ones.
SHOWN = ("clearance-driven-0.5mm", "clearance-free-0.5mm")


def figure(timed: Results, races: list[Race]) -> Figure | None:
    """Return each engine's front of slider error over run time, a panel for each of a few races' scenes."""
    if not races:
        return None
    shown = [race for race in races if race.scene in SHOWN] or races[: len(SHOWN)]
    others = f" The table has all {len(races)} scenes." if len(shown) < len(races) else ""
    ladders = Judged("", with_columns(timed.rows, POSITION), POSITION).ladders
    drawing, axes = grid(len(shown), height_in=3.1)
    engines: list[str] = []
    for ax, race in zip(axes, shown, strict=True):
        rungs, _ = ladders[race.scene]
        for engine, of_engine in sorted(rungs.groupby("engine"), key=lambda each: legend_place(each[0], "")):
            _line(ax, engine, front(of_engine))
            engines.append(engine)
        ax.axhline(race.target, color=GREY, linestyle="--", linewidth=1.0)
        for best in race.cheapest:
            ax.plot(
                best.way.time_s, best.error, "o", markersize=13, markerfacecolor="none", markeredgecolor=GREY
            )
        ax.set(
            xscale="log", yscale="log", title=race.scene, xlabel="run time [s]", ylabel=axis_label(POSITION)
        )
    scenes = listed(race.scene for race in shown)
    handles = {line.get_label(): line for ax in axes for line in ax.lines if line.get_label() in engines}
    drawing.legend(handles=list(handles.values()), loc="outside lower center", ncols=max(1, len(handles)))
    return Figure(
        "answer",
        "What the slider's position costs",
        "Each line is an engine with its best settings: down and to the left is better. Dashed is the error "
        "asked for. The ring is the cheapest run within it; there are several rings where the timing does "
        f"not resolve which run is the cheapest.{others}",
        f"Slider position error against run time, log-log, on {scenes}: a line for each of "
        f"{listed(dict.fromkeys(engines))}.",
        drawing,
    )


def _line(ax: Axes, engine: str, best: pd.DataFrame) -> None:
    drawn = ax.plot(best["time_s"], best["kept"], label=engine, **variant(engine, 0))
    settings = zip(best["label"], best["knob"], best["value"], strict=True)
    mark(drawn, engine, [f"{label}, {setting(knob, value)}" for label, knob, value in settings])
