"""A run held against the truth of the scene that it solves, and against physics' own laws."""

from collections.abc import Sequence

import numpy as np

from engine_models.engine import Trajectory
from engine_models.mechanics.samples import selected
from engine_models.scene.scene import Scene
from studies.judges import metrics
from studies.running.case import Curves, Row


def compared(
    scene: Scene, run: Trajectory, truth: Trajectory, repeats: Sequence[Trajectory], until: int | None = None
) -> tuple[dict[str, float], Curves]:
    """Return the largest error of every signal with the truth's uncertainty, and errors as curves.

    ``scene`` is the one that the engine really solves, ``repeats`` are its truth found otherwise. Samples
    before ``until`` count, up to ``compared_until_s``; ``largest_kinetic_energy_J`` is the truth's.
    """
    first = slice(None, until)
    judged = selected(truth, first)
    curves: Curves = dict(metrics.errors(scene, selected(run, first), judged))
    row = {"compared_until_s": float(judged.time_s[-1])}
    row |= {name: float(curve.max()) for name, curve in curves.items()}
    row["largest_kinetic_energy_J"] = float(metrics.kinetic_energy_J(scene, judged).max())
    return row | metrics.uncertainties(scene, judged, [selected(repeat, first) for repeat in repeats]), curves


def conserved(scene: Scene, run: Trajectory) -> tuple[Row, Curves]:
    """Return what needs no truth: the energy balance and the constraints, at their worst and as curves."""
    curves = {
        "energy_balance_residual_J": metrics.energy_balance_residual_J(scene, run),
        "constraint_violation_m": metrics.constraint_violation_m(scene, run),
    }
    return {name: float(np.abs(curve).max()) for name, curve in curves.items()}, curves
