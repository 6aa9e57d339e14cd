"""Writes the true motion of every scene of the library: ``python -m studies.conformance.truths FOLDER``.

Samples are ``SCENE.csv``, ended contacts ``SCENE-impacts.csv``; ``certainty.csv`` has a row for each scene.
"""

import sys
from pathlib import Path

import pandas as pd

from engine_models.scene.library import SCENES
from studies import clearance
from studies.command.options import SimulateOptions
from studies.command.truth import true_run

SAMPLES = 120
#: Digits of a double.
EXACT = "%.17g"


def write_truths(folder: Path, names: list[str]) -> None:
    """Write the true motions of some scenes as far as the studies follow them."""
    folder.mkdir(parents=True, exist_ok=True)
    rows = []
    for name in names:
        scene = SCENES[name]()
        scene = scene.model_copy(update={"end_time_s": clearance.END_S.get(name, scene.end_time_s)})
        run = true_run(scene, SimulateOptions(samples=SAMPLES))
        run.frame.to_csv(folder / f"{name}.csv", float_format=EXACT)
        if run.trajectory.contacts:
            run.impacts.to_csv(folder / f"{name}-impacts.csv", index=False, float_format=EXACT)
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
