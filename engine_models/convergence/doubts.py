"""What a run is warned of: doubtful quality, a slider that is not known well, settings without effect.

And what its scene is: splines that leave the values of their tables.
"""

from engine_models.convergence.own_uncertainty import DOUBTFUL_PART, doubtful_from_s
from engine_models.engine import Engine, SimulationFailed, Trajectory
from engine_models.mechanics.quality import quality_of
from engine_models.reference.engine import ReferenceEngine
from engine_models.scene.curves import OVERSHOOT, overshoot
from engine_models.scene.drives import TableDrive
from engine_models.scene.scene import Scene


def doubts_of_tables(scene: Scene) -> list[str]:
    """Return a line for each table of a scene whose spline leaves the range of its values."""
    tables, gas = [], scene.load.slider.gas if scene.load.slider else None
    if gas is not None and gas.interpolation == "spline":
        advice = 'interpolation = "linear" keeps to them'
        tables.append(("load.slider.gas", gas.spline(), gas.force_N, "N", "rad", advice))
    if isinstance(scene.drive, TableDrive) and scene.drive.interpolation == "spline":
        advice = 'more points keep nearer to them (interpolation = "linear" takes a constant speed alone)'
        tables.append(("drive", scene.drive.spline(), scene.drive.angle_rad, "rad", "s", advice))
    lines = []
    for name, spline, values, unit, of, advice in tables:
        if (beyond := overshoot(spline, values)) is not None:
            spans = f"from {beyond.low:.6g} to {beyond.high:.6g} {unit}"
            most = f"{100 * beyond.part:.3g} % of that range beyond at {beyond.at:.4g} {of}"
            own = f"the table's values from {min(values):.6g} to {max(values):.6g} {unit}, {most}"
            lines.append(
                f"{name}: the spline goes {spans}, {own} ({100 * OVERSHOOT:g} % goes unsaid): {advice}"
            )
    return lines


def doubts(engine: Engine, scene: Scene, run: Trajectory, to_tolerance: bool) -> list[str]:
    """Return a line for each doubt about a run; one to a tolerance has been held against more already.

    Raises:
        SimulationFailed: the run is none.
    """
    quality = quality_of(scene, run)
    if (failure := quality.failure()) is not None:
        raise SimulationFailed(failure)
    lines = [*doubts_of_tables(scene), *quality.warnings()]
    if isinstance(engine, ReferenceEngine):
        lines += [f"{name} changes nothing with {by}" for name, by in engine.idle().items()]
    # The readable face is slow, and its runs are those of the compiled one to round-off.
    if isinstance(engine, ReferenceEngine) and engine.kernel == "compiled" and not to_tolerance:
        try:
            when = doubtful_from_s(engine, scene, run)
        except SimulationFailed as failure:
            return [*lines, f"not tested by shorter steps: {failure}"]
        if when is not None:
            measure = "smallest clearance" if scene.joints_with_clearance else "crank"
            doubtful = f"slider position in doubt by {100 * DOUBTFUL_PART:g} % of the {measure} or more"
            advice = "use --tolerance, or end the run before"
            lines.append(f"{doubtful} from t = {when:.6g} s on, by a run at shorter steps: {advice}")
    return lines
