"""Tables of the predictability study."""

from collections.abc import Sequence

from reports.chapters.predictability import data
from reports.chapters.predictability.statistics import (
    CONFIDENCE,
    mean_interval,
    student_interval,
)
from reports.parts import Table
from reports.results import Run
from reports.style import title
from reports.tables import ABSENT

_PERCENT = f"{100 * CONFIDENCE:.0f} %"


def horizons(runs: Sequence[Run]) -> Table:
    """Return the horizon of each scene and tolerance."""
    rows = []
    for run in runs:
        turns = run.values.get("revolutions")
        followed = f"{turns:.0f} revolutions" if turns else f"{run.values['end_time_s']:g} s"
        cells = [run.scene, followed]
        for words in data.TOLERANCES:
            cells += [_horizon(run, words), _after(run, f"horizon_halved_{words}_s")]
        rows.append(tuple(cells))
    head = ["scene", "followed for"]
    for told, _ in data.TOLERANCES.values():
        head += [f"{told}: perturbed [ms]", f"{told}: step halved [ms]"]
    return Table(
        "predictability-horizons",
        "Predictability horizons",
        "The time at which the slider of the reference's perturbed twins, and of its step-halved one, is off "
        "by more than a tolerance. In brackets are the least and the largest of six perturbations, of both "
        "signs and half to twice the nominal size: they bound the median with a confidence of 97 %. A dash "
        "is a horizon beyond the end of the run.",
        tuple(head),
        tuple(rows),
    )


def _horizon(run: Run, words: str) -> str:
    least, largest = (run.values.get(f"horizon_{words}_{part}_s") for part in ("least", "largest"))
    if least is None:
        return ABSENT
    most = f"{1e3 * largest:.3g}" if largest is not None else "later"
    return f"{_after(run, f'horizon_{words}_s')} ({1e3 * least:.3g} to {most})"


def _after(run: Run, column: str) -> str:
    return f"{1e3 * run.values[column]:.3g}" if column in run.values else ABSENT


def exponents(runs: Sequence[Run]) -> Table:
    """Return the exponent of each scene with its interval."""
    rows = []
    for scene, starts in data.exponents(runs).items():
        values = data.measured(starts)
        cells = [scene, str(len(starts)), str(len(starts) - len(values))]
        if len(values) > 1:
            mean = student_interval(values)
            rows.append((*cells, f"{mean.mean:.2f}", f"{mean.low:.2f} to {mean.high:.2f}"))
        else:
            rows.append((*cells, ABSENT, ABSENT))
    return Table(
        "predictability-exponents",
        "Finite-time Lyapunov exponents",
        f"Per revolution, means over starts with Student's {_PERCENT} interval. A start that settles to "
        "continuous contact has no exponent.",
        ("scene", "starts", "settled", "exponent per revolution", f"{_PERCENT} interval"),
        tuple(rows),
    )


def means(found: data.Ensembles, scene: str) -> Table:
    """Return the mean of every quantity of every ensemble, with its interval."""
    quantities = data.shown(found)
    rows = []
    for name, members in found.items():
        cells = [title(name), str(len(members))]
        for column in data.matrix(members, quantities).T:
            mean = mean_interval(column)
            cells.append(f"{mean.mean:.3g} ± {(mean.high - mean.low) / 2:.1g}")
        rows.append(tuple(cells))
    return Table(
        f"predictability-means-{scene}",
        f"Ensembles on {scene}",
        f"Means over members and half the width of their {_PERCENT} bootstrap interval.",
        ("engine", "members", *(data.QUANTITIES[q] for q in quantities)),
        tuple(rows),
    )


def failures(runs: Sequence[Run]) -> Table | None:
    """Return the runs that did not finish, a line for each reason."""
    failed = [run for run in runs if not run.ok]
    if not failed:
        return None
    told: dict[tuple[str, str, str, str], int] = {}
    for run in failed:
        line = (run.scene, title(run.name), run.status, run.reason)
        told[line] = told.get(line, 0) + 1
    return Table(
        "predictability-failures",
        "Runs that did not finish",
        "Runs with the same reason are counted.",
        ("scene", "engine", "outcome", "reason", "runs"),
        tuple((*line, str(count)) for line, count in sorted(told.items())),
    )
