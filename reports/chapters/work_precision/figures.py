"""The figures of the work-precision study."""

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing

from reports.equal_error import Rung, front, rungs
from reports.parts import Figure
from reports.plots.step_figures import engine_legend, grid
from reports.quantities import Quantity
from reports.results import Run
from reports.style import GREY, label, line_style, ordered, words


def figures(kind: str, runs: Sequence[Run], scenes: Sequence[str], quantity: Quantity) -> list[Figure]:
    """Return errors of a quantity against run time and against steps, a panel per scene that has any."""
    scenes = [scene for scene in scenes if rungs(runs, scene, quantity, quantity.floor(runs, scene))]
    if not scenes:
        return []
    name, unit = words(quantity.name)
    file = quantity.name.removesuffix(f"_{quantity.name.split('_')[-1]}").replace("_", "-")
    time = Figure(
        f"work-precision-{kind}-{file}-time",
        f"{name.capitalize()} against run time",
        "Down and to the left is better. The grey line is the front: what no engine beats in both error and "
        "time. The band is the truth's own uncertainty. Bars are the range of the rounds.",
        f"{name} in {unit} against run time in s, log-log, one panel per scene, one line per engine and arm",
        drawing(runs, scenes, quantity, against_time=True),
    )
    steps = Figure(
        f"work-precision-{kind}-{file}-steps",
        f"{name.capitalize()} against steps",
        "The same errors against the number of steps, whatever a step costs.",
        f"{name} in {unit} against steps, log-log, one panel per scene, one line per engine and arm",
        drawing(runs, scenes, quantity, against_time=False),
    )
    return [time, steps]


def drawing(runs: Sequence[Run], scenes: Sequence[str], quantity: Quantity, against_time: bool) -> Drawing:
    """Return the figure of one quantity."""
    figure, axes = grid(len(scenes), height_in=3.0)
    names = ordered(run.name for run in runs)
    for ax, scene in zip(axes, scenes, strict=True):
        floor = quantity.floor(runs, scene)
        found = rungs(runs, scene, quantity, floor)
        for name in names:
            _line(ax, [rung for rung in found if rung.name == name], against_time, line_style(name, names))
        if against_time and found:
            best = front(found)
            ax.plot(
                [rung.time_s for rung in best],
                [rung.error for rung in best],
                color=GREY,
                linewidth=5,
                alpha=0.35,
                zorder=0.7,
                drawstyle="steps-post",
            )
        ax.set_xscale("log")
        ax.set_yscale("log")
        if floor and found:
            ax.axhspan(min(rung.error for rung in found) / 3, floor, color=GREY, alpha=0.3, linewidth=0)
            ax.set_ylim(bottom=min(rung.error for rung in found) / 3)
        ax.set_xlabel(label("solve_time_s") if against_time else "steps")
        ax.set_ylabel(label(quantity.name))
        ax.set_title(scene)
    engine_legend(figure, names, failures=False)
    return figure


def _line(ax: Axes, of: Sequence[Rung], against_time: bool, style: dict[str, object]) -> None:
    if not of:
        return
    of = sorted(of, key=lambda rung: rung.time_s if against_time else rung.steps)
    errors = [rung.error for rung in of]
    if not against_time:
        ax.plot([rung.steps for rung in of], errors, **style)  # type: ignore[arg-type]
        return
    times = [rung.time_s for rung in of]
    below = [rung.time_s - min(rung.times_s) for rung in of]
    above = [max(rung.times_s) - rung.time_s for rung in of]
    ax.errorbar(times, errors, xerr=[below, above], elinewidth=0.7, **style)  # type: ignore[arg-type]
