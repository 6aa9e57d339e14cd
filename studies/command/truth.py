"""The reference solution of a scene as a run, for the validation of other solvers.

``python -m studies.command.truth FOLDER`` writes that of every library scene: samples as ``SCENE.csv.xz``,
ended contacts as ``SCENE-impacts.csv.xz``, and ``certainty.csv`` with a row for each scene.
"""

import sys
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeGuard, cast

import numpy as np
import pandas as pd

from engine_models.convergence.doubts import doubts_of_tables
from engine_models.engine import Engine, FloatArray, Impacts, SimulationFailed, Trajectory, UnsupportedScene
from engine_models.kernels import KernelsRefused
from engine_models.mechanics.samples import selected
from engine_models.mechanics.states import lever_m, observed_m
from engine_models.scene.library import SCENES
from engine_models.scene.parts import AnyScene
from engine_models.scene.scene import Scene
from studies import clearance
from studies.command.finished_run import Run
from studies.command.options import SimulateOptions
from studies.failures import BadInput, Failed
from studies.judges.converged_truth import INDEPENDENT, TRUE, converged, followed, solved, truth_by
from studies.judges.metrics import COVERAGE

#: Samples that are published, and digits: two more than the most accurate slider position has.
SAMPLES, DIGITS = 120, "%.14g"


@dataclass(frozen=True, repr=False)
class TrueRun(Run):
    """A reference solution up to the predictability horizon.

    ``certain_m`` is the uncertainty of the slider, of a pendulum's pin along its arc, or of what the scene
    observes: of an angle times the longest lever.
    """

    certain_m: float
    by: str

    @property
    def made_by(self) -> dict[str, Any]:
        """Provenance as of a run, with the uncertainty in place of an engine's settings."""
        return {**super().made_by, "settings": {}, "certain_m": self.certain_m, "by": self.by}

    def notes(self) -> list[str]:
        """Return a line each on the uncertainty, the method and the end, and on the largest force."""
        end = self.trajectory.time_s[-1]
        known = f"{_observed(self.scene)} is certain to {self._certain} until t = {end:.6g} s"
        by = "independent equations" if self.by == INDEPENDENT else "the reference engine"
        return [f"{known}, by {by}", *self._notes_of_force()]

    @property
    def _certain(self) -> str:
        if self.scene.observed.what == "angle":
            return f"{self.certain_m / lever_m(self.scene):.1e} rad"
        return f"{self.certain_m:.1e} m"


def true_run(scene: AnyScene, options: SimulateOptions) -> TrueRun:
    """Return the reference solution of a scene.

    Raises:
        BadInput: the folder of saved runs is refused.
        Failed: no solution was found, or two solutions diverge before the first sample.
    """
    try:
        truth, repeats = converged(scene, options.samples)
        count = followed(scene, options.samples)
        by = truth_by(scene, options.samples)
        impacts = {joint: of.impacts for joint, of in solved(scene, options.samples).truth.contacts.items()}
    except KernelsRefused as reason:
        raise BadInput(str(reason)) from None
    except (UnsupportedScene, SimulationFailed) as reason:
        raise Failed(f"no reference solution was found: {reason}") from None
    if not count:
        raise Failed("no reference solution was found: two solutions diverge before the first sample")
    apart = max(float(np.abs(_place(scene, one) - _place(scene, truth))[:count].max()) for one in repeats)
    resolution = float(np.spacing(max(np.abs(_place(scene, truth)).max(), lever_m(scene))))
    known, warnings = _until(truth, impacts, count), doubts_of_tables(scene)
    if count <= options.samples:
        warnings.append(f"two solutions diverge after t = {known.time_s[-1]:.6g} s; samples end there")
    solver, certain = cast(Engine, TRUE), max(COVERAGE * apart, resolution)
    return TrueRun(scene, "truth", solver, None, known, tuple(warnings), certain, by)


def _is_pendulum(scene: AnyScene) -> TypeGuard[Scene]:
    return isinstance(scene, Scene) and scene.is_plain and not scene.is_crank_slider


def _place(scene: AnyScene, run: Trajectory) -> FloatArray:
    """Return what is observed in m, or the arc length of the end of a pendulum."""
    return lever_m(scene) * run.position[:, 0, 2] if _is_pendulum(scene) else observed_m(scene, run)


def _observed(scene: AnyScene) -> str:
    """Return in words what the uncertainty is of."""
    if isinstance(scene, Scene) and scene.is_crank_slider:
        return "the slider"
    return "the crank's pin" if _is_pendulum(scene) else scene.observed.name


def _until(truth: Trajectory, impacts_of: Mapping[str, Impacts], count: int) -> Trajectory:
    """Return the first ``count`` samples, and the impacts that have ended by then."""
    cut, end = selected(truth, slice(count)), truth.time_s[count - 1]
    contacts = {}
    for joint, contact in cut.contacts.items():
        all_of = vars(impacts_of[joint])
        over = all_of["time_s"] + all_of["duration_s"] <= end
        impacts = Impacts(**{name: values[over] for name, values in all_of.items()})
        contacts[joint] = replace(contact, impacts=impacts)
    return replace(cut, contacts=contacts)


def write_truths(folder: Path, names: list[str]) -> None:
    """Write the reference solutions of scenes up to the end times of the studies."""
    folder.mkdir(parents=True, exist_ok=True)
    rows = []
    for name in names:
        scene = SCENES[name]()
        scene = scene.model_copy(update={"end_time_s": clearance.END_S.get(name, scene.end_time_s)})
        run = true_run(scene, SimulateOptions(samples=SAMPLES))
        run.frame.to_csv(folder / f"{name}.csv.xz", float_format=DIGITS)
        if run.trajectory.contacts:
            run.impacts.to_csv(folder / f"{name}-impacts.csv.xz", index=False, float_format=DIGITS)
        rows.append(
            {
                "scene": name,
                "certain_until_s": run.trajectory.time_s[-1],
                "slider_position_uncertainty_m": f"{run.certain_m:.1e}",
                "solved_by": run.by,
            }
        )
    pd.DataFrame(rows).to_csv(folder / "certainty.csv", index=False)


if __name__ == "__main__":
    write_truths(Path(sys.argv[1]), list(SCENES))
