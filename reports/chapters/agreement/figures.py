"""Figures of the agreement study."""

from collections.abc import Mapping, Sequence

from reports.parts import Figure
from reports.plots.step_figures import against_step, panels_of
from reports.plots.sweep_figures import against_setting
from reports.plots.time_figures import over_time, so_far
from reports.quantities import Quantity, column, largest_joint_force_error
from reports.results import FloatArray, Results, Run
from reports.style import label, ordered, title
from reports.tables import in_text

POSITION, VELOCITY = column("slider_position_error_m"), column("slider_velocity_error_m_s")
TORQUE = column("driver_torque_error_N_m")
VIOLATION, ENERGY = column("constraint_violation_m"), column("energy_balance_residual_J")

_GUIDES = "Both axes are logarithmic. Grey lines have the slope of the order written at their fine end"
_BY_STEP = f"{_GUIDES}; the grey area is the truth's own uncertainty, below which no error can be told."


def convergence(runs: Sequence[Run]) -> list[Figure]:
    """Return the errors against the step."""
    return [
        *_by_step("slider-position", "Slider position error", runs, [POSITION], _BY_STEP),
        *_by_step(
            "joint-force",
            "Joint force error",
            runs,
            [largest_joint_force_error(runs)],
            "The largest force error of all joints. Forces belong to the accelerations, so they show what "
            f"a position that is prescribed or corrected can hide. {_BY_STEP}",
        ),
        *_by_step(
            "velocity-and-torque",
            "Slider velocity and driver torque error",
            runs,
            [VELOCITY, TORQUE],
            "A driver torque is compared where it is a reaction, under prescribed crank speed, and has no "
            f"panel elsewhere. {_BY_STEP}",
        ),
    ]


def position_over_time(results: Results, runs: Sequence[Run], steps: Mapping[str, float]) -> list[Figure]:
    """Return the slider position error over time at one step per scene."""
    return _over_time(
        results,
        runs,
        steps,
        POSITION,
        "Slider position error",
        "Shown is the largest error up to each time, so that a zero crossing does not look like "
        "agreement: a line that keeps rising is an error that builds up, a level one is bounded.",
    )


def conservation(results: Results, runs: Sequence[Run], steps: Mapping[str, float]) -> list[Figure]:
    """Return energy and constraint violation over time at one step, and the violation against the step."""
    return [
        *_over_time(
            results,
            runs,
            steps,
            ENERGY,
            "Energy balance residual",
            "Energy gained beyond the driver's work, the largest up to each time, as a part of the "
            "largest kinetic energy. An exact run has none; a rising line is energy made or lost by the "
            "method.",
            per="largest_kinetic_energy_J",
        ),
        *_by_step(
            "constraint-violation",
            "Constraint violation",
            runs,
            [VIOLATION],
            f"The largest gap in a joint, or of the slider from its guide. {_GUIDES}.",
        ),
        *_over_time(
            results,
            runs,
            steps,
            VIOLATION,
            "Constraint violation",
            "The largest gap up to each time: a rising line is drift.",
        ),
    ]


def sweep(runs: Sequence[Run], setting: str, quantities: Sequence[Quantity]) -> list[Figure]:
    """Return the errors of an engine against one of its settings."""
    if not any(run.ok for run in runs):
        return []
    engine = runs[0].engine
    steps = at_steps({run.scene: run.step_s for run in runs})
    return [
        Figure(
            f"agreement-{setting}",
            f"Errors of {engine} against its {setting}",
            f"One line per scene, everything but the {setting} as in the tuned arm, at a step of {steps}. "
            "A crossed-out marker above a panel is a run that failed.",
            f"{len(quantities)} logarithmic panels over {setting}: {_names(quantities)}.",
            against_setting(runs, setting, quantities),
        )
    ]


def at_steps(steps: Mapping[str, float]) -> str:
    """Return the step of each scene in words."""
    return ", ".join(f"{in_text(step)} s on {scene}" for scene, step in steps.items())


def _by_step(
    name: str, what: str, runs: Sequence[Run], quantities: Sequence[Quantity], reading: str
) -> list[Figure]:
    panels = panels_of(runs, quantities)
    if not panels:
        return []
    shown = ", ".join(dict.fromkeys(f"{label(q.name)} on {scene}" for scene, q in panels))
    alt = f"{len(panels)} log-log panels over the step: {shown}. Lines: {_arms(runs)}."
    return [Figure(f"agreement-{name}", f"{what} against the step", reading, alt, against_step(runs, panels))]


def _over_time(
    results: Results,
    runs: Sequence[Run],
    steps: Mapping[str, float],
    quantity: Quantity,
    what: str,
    reading: str,
    per: str = "",
) -> list[Figure]:
    """Return a curve at each scene's step, divided by the row's column ``per`` if one is named."""

    def shown(curve: FloatArray, run: Run) -> FloatArray:
        return so_far(curve) / run.values[per] if per else so_far(curve)

    here = [
        run
        for run in runs
        if run.ok and run.step_s == steps.get(run.scene) and (not per or per in run.values)
    ]
    if not here:
        return []
    axis = (
        f"{what.lower()} so far /\n{per[: per.rindex('_')].replace('_', ' ')}"
        if per
        else label(quantity.name).replace(" [", " so far [")
    )
    scenes = ", ".join(sorted({run.scene for run in here}))
    alt = f"Panels over time of the {what.lower()} on {scenes}. Lines: {_arms(here)}."
    return [
        Figure(
            f"agreement-{what.lower().replace(' ', '-')}-over-time",
            f"{what} over time at one step",
            f"The step is {at_steps(steps)}. {reading}",
            alt,
            over_time(results, here, quantity.name, axis, shown),
        )
    ]


def _arms(runs: Sequence[Run]) -> str:
    return ", ".join(title(name) for name in ordered(run.name for run in runs))


def _names(quantities: Sequence[Quantity]) -> str:
    return ", ".join(label(q.name) for q in quantities)
