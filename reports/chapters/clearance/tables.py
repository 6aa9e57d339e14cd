"""Tables and sentences of the clearance study."""

from collections.abc import Sequence

from reports.chapters.agreement.tables import CASE, failures_table, orders
from reports.parts import Table
from reports.quantities import Quantity, column
from reports.results import Run
from reports.style import Name, ordered, title, words
from reports.tables import ABSENT, error, in_text, number

SLIDER = column("slider_position_error_m")
IMPACT_COLUMNS = (
    "impact_time_error_s",
    "impact_speed_relative_error",
    "impact_impulse_relative_error",
    "impact_loss_relative_error",
)


def smallest(runs: Sequence[Run], quantities: Sequence[Quantity]) -> Table:
    """Return the smallest error that each arm reaches on each scene."""
    rows = []
    for scene, name, here in _by_arm(runs):
        cells = []
        for quantity in quantities:
            found = [(e, quantity.uncertainty(run)) for run in here if (e := quantity.value(run))]
            cells.append(error(*min(found)) if found else ABSENT)
        until = [run.values["compared_until_s"] for run in here if run.ok]
        rows.append((scene, *name, number(max(until)) if until else ABSENT, *cells))
    head = (*CASE, "compared until [s]", *(_heading(q) for q in quantities))
    reading = (
        "The smallest error over the arm's ladder, against its model twin. A dash where no sample has "
        "anything to compare: between rigid walls the contact force is an impulse, and zero "
        "at the samples in flight."
    )
    return Table("clearance-smallest-errors", "Smallest errors", reading, head, tuple(rows))


def impacts(runs: Sequence[Run]) -> Table:
    """Return how the impacts of each arm's finest finished run match its twin's."""
    rows = []
    for scene, name, here in _by_arm(runs):
        finest = _finest(here)
        if finest is None or "impacts_matched" not in finest.values:
            continue
        counts = [f"{finest.values[f'impacts_{what}']:.0f}" for what in ("matched", "unmatched", "missed")]
        cells = [error(finest.values.get(name)) for name in IMPACT_COLUMNS]
        rows.append((scene, *name, number(finest.step_s), *counts, *cells))
    head = (
        *(*CASE, "step [s]", "matched", "unmatched", "missed"),
        *("time [s]", "speed, relative", "impulse, relative", "energy lost, relative"),
    )
    reading = (
        "The arm's most accurate run against its model twin: impacts of both that are nearest to each other, "
        "those of the engine without a partner (unmatched), those of the twin without (missed); and the "
        "largest errors of the matched ones, relative to the largest value."
    )
    return Table("clearance-impacts", "Impacts matched one to one", reading, head, tuple(rows))


def laws(runs: Sequence[Run]) -> Table:
    """Return the distance of each arm's own law from the scene's beside its smallest numerical error."""
    rows = []
    for scene, name, here in _by_arm(runs):
        finest = _finest(here)
        if finest is None:
            continue
        form, off = finest.values.get("slider_position_model_difference_m"), SLIDER.value(finest)
        doubt = SLIDER.uncertainty(finest)
        cells = (error(form, doubt) if form is not None else "the scene's own", error(off, doubt))
        rows.append((scene, *name, *cells))
    head = (*CASE, "model form [m]", "numerical error [m]")
    reading = (
        "Slider position: how far the converged solution of the law that the engine solves is from that of "
        "the scene's law, and how far the engine's most accurate run is from its own law's."
    )
    return Table("clearance-laws", "Model form and numerical error", reading, head, tuple(rows))


def failures(runs: Sequence[Run]) -> Table | None:
    """Return the runs that did not finish, with the reason; None if all did."""
    return failures_table(runs, "clearance")


def orders_found(runs: Sequence[Run], quantity: Quantity) -> tuple[str, ...]:
    """Return the observed orders of the local error in a sentence per arm."""
    out = []
    scenes = sorted({run.scene for run in runs if quantity.of_scene(runs, run.scene)})
    found = {scene: orders(runs, scene, quantity) for scene in scenes}
    for name in ordered(run.name for run in runs if run.ok):
        told = [f"{of[name]} on {scene}" for scene, of in found.items() if name in of and of[name].slope]
        if told:
            out.append(f"{title(name)}: local position error of order {', '.join(told)}.")
    return tuple(out)


def impacts_found(runs: Sequence[Run]) -> tuple[str, ...]:
    """Return which arms find every impact at their most accurate settings."""
    found: dict[Name, list[bool]] = {}
    for _, name, here in _by_arm(runs):
        finest = _finest(here)
        if finest is not None and "impacts_matched" in finest.values:
            lost = finest.values["impacts_unmatched"] + finest.values["impacts_missed"]
            found.setdefault(name, []).append(lost == 0)
    return tuple(
        f"{title(name)}: every impact of the model twin is found, and no other, on {sum(found[name])} of "
        f"{len(found[name])} scenes."
        for name in ordered(found)
    )


def laws_found(runs: Sequence[Run]) -> tuple[str, ...]:
    """Return, for each arm with a law of its own, which of the two differences is the larger."""
    out = []
    for name in ordered(run.name for run in runs if run.ok):
        pairs = []
        for _, other, here in _by_arm(runs):
            finest = _finest(here)
            if other == name and finest is not None:
                form, off = finest.values.get("slider_position_model_difference_m"), SLIDER.value(finest)
                if form is not None and off is not None:
                    pairs.append((form, off))
        if pairs:
            larger = sum(form > off for form, off in pairs)
            most = max(form for form, _ in pairs)
            if most == 0:
                out.append(f"{title(name)} solves a law of its own, with the same motion on all scenes here.")
                continue
            out.append(
                f"{title(name)} solves a law of its own, up to {in_text(most)} m from the scene's; that "
                f"is more than its smallest numerical error on {larger} of {len(pairs)} scenes."
            )
    return tuple(out)


def _finest(runs: Sequence[Run]) -> Run | None:
    """Return the run with the smallest slider position error."""
    finished = [run for run in runs if SLIDER.value(run) is not None]
    return min(finished, key=lambda run: SLIDER.value(run) or 0.0, default=None)


def _by_arm(runs: Sequence[Run]) -> list[tuple[str, Name, list[Run]]]:
    """Return scene, engine and arm, and the runs of each, of those that the engine can run."""
    out = []
    for scene in sorted({run.scene for run in runs}):
        for name in ordered(run.name for run in runs if run.scene == scene):
            here = [run for run in runs if (run.scene, run.name) == (scene, name)]
            if any(run.status != "unsupported" for run in here):
                out.append((scene, name, here))
    return out


def _heading(quantity: Quantity) -> str:
    name, unit = words(quantity.name)
    return f"{name.replace(' error', '')} [{unit}]" if unit else name.replace(" error", "")
