"""The work-precision study on the page: error against run time, and who is cheapest at equal error."""

from collections.abc import Sequence

from reports.chapters.work_precision import figures, tables
from reports.parts import Section
from reports.quantities import column, largest_joint_force_error
from reports.results import Results, Run

TITLE = "Work and precision"
INTRODUCTION = (
    "Every engine climbs a ladder of its own best settings, and what it takes is set against what it gets "
    "right. Errors are those of recorded runs, against the converged solution of the law that the engine "
    "really solves, so that a different contact law is no error; times are those of bare runs of the native "
    "solve, made alone on the machine in rounds over all engines. SciPy integrates the reference's own "
    "equations: the pick of a user without an engine. Times are of one machine; ratios are what counts."
)
POSITION = column("slider_position_error_m")


def sections(results: Results) -> list[Section]:
    """Return the sections of the study."""
    runs = [run for run in results.runs if run.ok]
    out = []
    for name, title, scenes in (
        ("ideal", "Ideal joints", _scenes(runs, clearance=False)),
        ("clearance", "Joints with clearance", _scenes(runs, clearance=True)),
    ):
        if scenes:
            here = [run for run in runs if run.scene in scenes]
            out.append(_section(name, title, here, scenes))
    return [*out, _costs(results.runs)]


def _section(name: str, title: str, runs: Sequence[Run], scenes: Sequence[str]) -> Section:
    quantities = [POSITION, largest_joint_force_error(runs)]
    drawn = [figure for quantity in quantities for figure in figures.figures(name, runs, scenes, quantity)]
    text = [tables.reference_against_rivals(runs, scene, POSITION) for scene in scenes]
    return Section(
        f"work-precision-{name}",
        title,
        tuple(sentence for sentence in text if sentence),
        tuple(drawn),
        tuple(tables.cheapest(name, runs, scenes, quantity) for quantity in quantities),
    )


def _costs(runs: Sequence[Run]) -> Section:
    text = (
        "Compiling kernels, building the model and reading results out are outside all times above; this is "
        "what they take. Only the reference's rigid contact loads kernels as it goes, within its times.",
    )
    shown = (tables.building(runs), tables.compiling(runs), tables.failures(runs))
    present = tuple(table for table in shown if table)
    return Section("work-precision-costs", "What is outside the times", text, (), present)


def _scenes(runs: Sequence[Run], clearance: bool) -> list[str]:
    """Return the scenes with or without clearance."""
    loose = {run.scene for run in runs if any(name.startswith("clearance_") for name in run.values)}
    return sorted(scene for scene in {run.scene for run in runs} if (scene in loose) == clearance)
