"""``python -m crankslider.reference_solutions FOLDER`` writes the reference solutions of library scenes.

They are samples, ``SCENE.csv.xz``, ended contacts, ``SCENE-impacts.csv.xz``, and ``certainty.csv``.
"""

import sys
from collections.abc import Iterable
from pathlib import Path

import pandas as pd

from crankslider.library import scenes, truth
from engine_models.scene.library import SCENES
from studies.settings import END_S

#: Samples that are published, and digits: two more than the most accurate slider position has.
SAMPLES, DIGITS = 120, "%.14g"


def write_reference_solutions(folder: Path, names: Iterable[str] = SCENES) -> None:
    """Write the reference solutions of library scenes up to the end times of the studies."""
    folder.mkdir(parents=True, exist_ok=True)
    rows = []
    for name in names:
        run = truth(name, end=END_S.get(name, scenes[name].end_time_s), samples=SAMPLES)
        run.frame.to_csv(folder / f"{name}.csv.xz", float_format=DIGITS)
        if run.trajectory.contacts:
            run.impacts.to_csv(folder / f"{name}-impacts.csv.xz", index=False, float_format=DIGITS)
        rows.append((name, run.trajectory.time_s[-1], f"{run.certain_m:.1e}", run.by))
    head = ["scene", "certain_until_s", "slider_position_uncertainty_m", "solved_by"]
    pd.DataFrame(rows, columns=head).to_csv(folder / "certainty.csv", index=False)


if __name__ == "__main__":
    write_reference_solutions(Path(sys.argv[1]))
