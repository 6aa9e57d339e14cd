"""The reference solution of a scene as a run, for the validation of other solvers.

``python -m crankslider.reference_solutions FOLDER`` writes that of every library scene: samples as
``SCENE.csv.xz``, ended contacts as ``SCENE-impacts.csv.xz``, and ``certainty.csv`` with a row for each scene.
"""

import sys
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import cast

import numpy as np
import pandas as pd

from crankslider.run import Run
from engine_models.convergence.doubts import doubts_of_tables
from engine_models.engine import Engine, Impacts
from engine_models.mechanics.samples import selected
from engine_models.mechanics.states import lever_m, observed_m
from engine_models.scene.library import SCENES
from engine_models.scene.scene import Scene
from studies.failures import Failed
from studies.judges.converged_truth import INDEPENDENT, TRUE, converged, followed, solved, truth_by
from studies.judges.metrics import COVERAGE
from studies.settings import END_S

#: Samples that are published, and digits: two more than the most accurate slider position has.
SAMPLES, DIGITS = 120, "%.14g"


def reference_solution(scene: Scene, samples: int) -> Run:
    """Return the reference solution of a scene; raise what an engine does, or Failed, if none is found."""
    true, repeats = converged(scene, samples, judged=True)
    count, contacts = followed(scene, samples, judged=True), solved(scene, samples).truth.contacts
    if not count:
        raise Failed("no reference solution was found: two solutions diverge before the first sample")
    place = observed_m(scene, true)
    apart = max(float(np.abs(observed_m(scene, one) - place)[:count].max()) for one in repeats)
    resolution = float(np.spacing(max(np.abs(place).max(), lever_m(scene))))
    end_s, warnings = true.time_s[count - 1], doubts_of_tables(scene)
    if count <= samples:
        warnings.append(f"two solutions diverge after t = {end_s:.6g} s; samples end there")
    known = selected(true, slice(count))
    ended = {}
    for joint, contact in known.contacts.items():
        every = contacts[joint].impacts
        over = every.time_s + every.duration_s <= end_s
        kept = Impacts(**{name: values[over] for name, values in vars(every).items()})
        ended[joint] = replace(contact, impacts=kept)
    return Run(
        scene,
        "truth",
        cast(Engine, TRUE),
        replace(known, contacts=ended),
        tuple(warnings),
        certain_m=max(COVERAGE * apart, resolution),
        by="independent equations" if truth_by(scene, samples) == INDEPENDENT else "the reference engine",
    )


def write_reference_solutions(folder: Path, names: Iterable[str] = SCENES) -> None:
    """Write the reference solutions of library scenes up to the end times of the studies."""
    folder.mkdir(parents=True, exist_ok=True)
    rows = []
    for name in names:
        scene = SCENES[name]()
        run = reference_solution(scene.replace("end_time_s", END_S.get(name, scene.end_time_s)), SAMPLES)
        run.frame.to_csv(folder / f"{name}.csv.xz", float_format=DIGITS)
        if run.trajectory.contacts:
            run.impacts.to_csv(folder / f"{name}-impacts.csv.xz", index=False, float_format=DIGITS)
        rows.append((name, run.trajectory.time_s[-1], f"{run.certain_m:.1e}", run.by))
    head = ["scene", "certain_until_s", "slider_position_uncertainty_m", "solved_by"]
    pd.DataFrame(rows, columns=head).to_csv(folder / "certainty.csv", index=False)


if __name__ == "__main__":
    write_reference_solutions(Path(sys.argv[1]))
