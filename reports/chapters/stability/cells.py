"""The cells of the stability maps as read from rows: verdicts, rows of a map, and where growth begins."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt

from reports.results import Run
from reports.style import Name, ordered

#: The verdicts, their places the column ``verdict_severity``: from growth on a run is no longer stable.
VERDICTS = ("accurate", "inaccurate", "energy-growing", "diverged", "timed out", "refused")
GROWING, DIVERGED, REFUSED = 2, 3, 5
#: What a run was that could not say so itself, by its status.
BY_STATUS = {"timed out": 4, "unsupported": REFUSED}

#: What varies in a map beside the step: its column, what it is called, its unit, that unit in the column's.
VARIED: dict[str, tuple[str, str, float]] = {
    "contact_stiffness_N_m1_5": ("contact stiffness", "N/m$^{1.5}$", 1.0),
    "radial_clearance_m": ("radial clearance", "mm", 1e-3),
    "crank_speed_rpm": ("crank speed", "rpm", 1.0),
}


def severity(run: Run) -> int:
    """Return the place of a cell's verdict among all."""
    value = run.values.get("verdict_severity")
    return BY_STATUS.get(run.status, DIVERGED) if value is None else int(value)


def cells(runs: Sequence[Run], varied: str) -> list[Run]:
    """Return the runs that are cells of a map."""
    return [run for run in runs if varied in run.values]


def arms(runs: Sequence[Run]) -> list[Name]:
    """Return engines and arms in the order of legends, an engine's arms in that of their names."""
    return ordered(run.name for run in runs)


def limit_of(runs: Sequence[Run]) -> float | None:
    """Return theory's limit omega h of an arm, None if it has none."""
    return runs[0].values.get("limit_frequency_step")


def limits_of(runs: Sequence[Run]) -> list[Run]:
    """Return the scalar problem's runs that looked for a limit."""
    return [run for run in runs if run.ok and "damping_ratio" in run.values]


def dampings_of(runs: Sequence[Run]) -> list[Run]:
    """Return the scalar problem's runs that measured a loss."""
    return [run for run in runs if run.ok and "frequency_step" in run.values]


@dataclass(frozen=True)
class MapRow:
    """The cells of one arm at one value of what varies; steps are given as omega h of the first impact.

    ``growth`` is where energy growth, or worse, begins: the geometric mean of the longest step up to which
    there is none and the next one, or the shortest step if it is there already, None if it never is.
    ``divergence`` is the same for divergence, or worse. ``accurate`` is the longest step up to which every
    run is accurate, None if not even the shortest is.
    """

    growth: float | None
    divergence: float | None
    accurate: float | None


def map_rows(runs: Sequence[Run], varied: str, name: Name) -> list[MapRow]:
    """Return the rows of an arm's map, by rising value of what varies."""
    mine = [run for run in cells(runs, varied) if run.name == name]
    out = []
    for value in sorted({run.values[varied] for run in mine}):
        here = [run for run in mine if run.values[varied] == value]
        steps = sorted((run.step_s * run.values["impact_frequency_rad_s"], severity(run)) for run in here)
        accurate = [x for x, _ in steps[: next((k for k, (_, s) in enumerate(steps) if s > 0), len(steps))]]
        out.append(MapRow(_begins(steps, GROWING), _begins(steps, DIVERGED), max(accurate, default=None)))
    return out


def _begins(steps: Sequence[tuple[float, int]], worst: int) -> float | None:
    """Return where a severity is first met among (omega h, severity), sorted."""
    before = None
    for x, found in steps:
        if worst <= found < REFUSED:
            return x if before is None else sqrt(before * x)
        before = x
    return None
