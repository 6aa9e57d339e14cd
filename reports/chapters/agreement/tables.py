"""Tables of the agreement study."""

from collections.abc import Mapping, Sequence

from reports.convergence import RULE, Order, observed_order
from reports.parts import Table
from reports.quantities import Quantity, signal_errors
from reports.results import Run
from reports.style import ordered, words
from reports.tables import ABSENT, error, number

CASE = ("scene", "engine", "arm")
AT_STEP = ("scene", "step [s]", "engine", "arm")


def orders(runs: Sequence[Run], scene: str, quantity: Quantity) -> dict[tuple[str, str], Order]:
    """Return the observed order of a quantity on a scene for each engine and arm with a finished run."""
    floor = quantity.floor(runs, scene)
    out = {}
    for name in ordered(run.name for run in runs):
        points = [(r.mean_step_s, quantity.value(r)) for r in runs if (r.scene, r.name) == (scene, name)]
        seen = [(h, e) for h, e in points if e is not None]
        if seen:
            out[name] = observed_order([h for h, _ in seen], [e for _, e in seen], floor)
    return out


def orders_table(runs: Sequence[Run]) -> Table:
    """Return the observed order of every signal."""
    quantities = signal_errors(runs)
    rows = []
    for scene in _scenes(runs):
        found = [orders(runs, scene, quantity) for quantity in quantities]
        for name in ordered(run.name for run in runs if run.scene == scene):
            cells = [str(by_name[name]) if name in by_name else ABSENT for by_name in found]
            rows.append((scene, *name, *cells))
    head = (*CASE, *(words(q.name)[0].replace(" error", "") for q in quantities))
    return Table("agreement-orders", "Observed order of convergence", RULE, head, tuple(rows))


def errors_table(runs: Sequence[Run], steps: Mapping[str, float]) -> Table:
    """Return the errors of every signal at one step per scene, the truth's uncertainty as the last line."""
    quantities = signal_errors(runs)
    rows = []
    for scene, step in steps.items():
        here = [run for run in runs if run.scene == scene and run.step_s == step]
        rows += [(*_at_step(run), *_cells(run, quantities)) for run in _by_name(here)]
        floors = [number(u) if (u := q.floor(here, scene)) else ABSENT for q in quantities]
        rows.append((scene, number(step), "truth", "uncertainty", *floors))
    reading = (
        "Largest error over all samples; joint forces by the length of the difference vector. An error "
        "below the truth's own uncertainty u is shown as “< u”. The step is the middle one of those that "
        "every engine was run at."
    )
    head = (*AT_STEP, *map(_heading, quantities))
    return Table("agreement-errors", "Largest errors at one step", reading, head, tuple(rows))


def conservation_table(
    runs: Sequence[Run], steps: Mapping[str, float], quantities: Sequence[Quantity]
) -> Table:
    """Return what needs no truth, energy balance and constraints, at one step per scene."""
    here = [run for run in runs if steps.get(run.scene) == run.step_s]
    rows = [
        (*_at_step(run), *_cells(run, quantities))
        for scene in steps
        for run in _by_name(here)
        if run.scene == scene
    ]
    head = (*AT_STEP, *map(_heading, quantities))
    reading = "The largest sizes over all samples. Neither needs a truth: both are zero for an exact run."
    return Table("agreement-conservation", "Energy and constraints at one step", reading, head, tuple(rows))


def settings_table(runs: Sequence[Run], study: str = "agreement") -> Table:
    """Return what each arm sets; what it does not is the default of the engine's model here."""
    rows = []
    for name in ordered(run.name for run in runs):
        settings = next(run.settings for run in runs if run.name == name)
        told = ", ".join(f"{key} = {_setting(value)}" for key, value in settings.items())
        rows.append((*name, told or "the defaults"))
    reading = (
        "What is not set has the default of the engine's model here, which is meant as its best practice."
    )
    head = ("engine", "arm", "settings")
    return Table(f"{study}-settings", "Engines and arms", reading, head, tuple(rows))


def smallest_table(runs: Sequence[Run]) -> Table:
    """Return the smallest error each arm reaches within the ladder of steps."""
    quantities = signal_errors(runs)
    rows = []
    for scene in _scenes(runs):
        for name in ordered(run.name for run in runs if run.scene == scene):
            here = [run for run in runs if (run.scene, run.name) == (scene, name)]
            cells = []
            for q in quantities:
                found = [(e, q.uncertainty(run)) for run in here if (e := q.value(run)) is not None]
                cells.append(error(*min(found)) if found else ABSENT)
            rows.append((scene, *name, *cells))
    reading = (
        "The smallest of the errors over all steps of the ladder. Where the figures show that an error "
        "has stopped falling, this is the engine's own floor; elsewhere a smaller step would give less."
    )
    head = (*CASE, *(_heading(q) for q in quantities))
    return Table("agreement-smallest-errors", "Smallest error over all steps", reading, head, tuple(rows))


def sweep_table(runs: Sequence[Run], setting: str, quantities: Sequence[Quantity]) -> Table:
    """Return errors and status against one setting of an engine."""
    rows = []
    for run in sorted(runs, key=lambda run: (run.scene, run.engine, run.settings[setting])):
        cells = [error(q.value(run), q.uncertainty(run)) for q in quantities]
        rows.append(
            (run.scene, run.engine, str(run.settings[setting]), number(run.step_s), run.status, *cells)
        )
    head = ("scene", "engine", setting, "step [s]", "status", *(_heading(q) for q in quantities))
    reading = "Everything but this setting as in the tuned arm."
    return Table(f"agreement-{setting}", f"Errors against {setting}", reading, head, tuple(rows))


def failures_table(runs: Sequence[Run], study: str = "agreement") -> Table | None:
    """Return the runs that did not finish, with the reason; None if all did."""
    failed = [run for run in runs if not run.ok]
    if not failed:
        return None
    names = ordered(run.name for run in failed)
    failed.sort(key=lambda run: (run.scene, names.index(run.name), -run.step_s))
    rows = tuple((r.scene, *r.name, number(r.step_s), r.status, r.reason) for r in failed)
    head = (*CASE, "step [s]", "status", "reason")
    reading = "The reason is the engine's own message."
    return Table(f"{study}-failures", "Runs that did not finish", reading, head, rows)


def _at_step(run: Run) -> tuple[str, ...]:
    return run.scene, number(run.step_s), *run.name


def _cells(run: Run, quantities: Sequence[Quantity]) -> list[str]:
    """Return the errors of a run, or its status in every cell if it did not finish."""
    return [error(q.value(run), q.uncertainty(run)) if run.ok else run.status for q in quantities]


def _by_name(runs: Sequence[Run]) -> list[Run]:
    names = ordered(run.name for run in runs)
    return sorted(runs, key=lambda run: names.index(run.name))


def _setting(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _scenes(runs: Sequence[Run]) -> list[str]:
    return sorted({run.scene for run in runs})


def _heading(quantity: Quantity) -> str:
    name, unit = words(quantity.name)
    return f"{name.replace(' error', '')} [{unit}]"
