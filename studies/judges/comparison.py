"""A run held against the truth of the scene that it solves, and against physics' own laws."""

import math
from collections.abc import Sequence

import numpy as np

from engine_models.engine import Trajectory
from engine_models.mechanics.quality import quality_of
from engine_models.mechanics.samples import selected
from engine_models.scene.scene import Scene
from studies.judges import metrics
from studies.running.case import Curves, Row


def compared(
    scene: Scene, run: Trajectory, truth: Trajectory, repeats: Sequence[Trajectory], until: int | None = None
) -> tuple[dict[str, float], Curves]:
    """Return the largest error of every signal with the truth's uncertainty and scale, and errors as curves.

    ``scene`` is the one that the engine really solves, ``repeats`` are its truth found otherwise. Samples
    before ``until`` count, up to ``compared_until_s``; ``largest_kinetic_energy_J`` is the truth's.
    """
    first = slice(None, until)
    judged = selected(truth, first)
    curves: Curves = dict(metrics.errors(scene, selected(run, first), judged))
    row = {"compared_until_s": float(judged.time_s[-1])}
    row |= {name: float(curve.max()) for name, curve in curves.items()}
    row["largest_kinetic_energy_J"] = float(metrics.kinetic_energy_J(scene, judged).max())
    row |= metrics.uncertainties(scene, judged, [selected(repeat, first) for repeat in repeats])
    return row | metrics.scales(scene, judged), curves


def conserved(scene: Scene, run: Trajectory) -> tuple[Row, Curves]:
    """Return what needs no truth: energy balance, constraints and quality, at their worst, and as curves."""
    curves = {
        "energy_balance_residual_J": metrics.energy_balance_residual_J(scene, run),
        "constraint_violation_m": metrics.constraint_violation_m(scene, run),
    }
    worst = {name: float(np.abs(curve).max()) for name, curve in curves.items()}
    return {**worst, **checked(scene, run)}, curves


def checked(scene: Scene, run: Trajectory) -> Row:
    """Return the columns of the check that ``crankslider simulate`` makes: what it found, and why it failed.

    They are ``unaccounted_energy_part``, ``ideal_gap_part``, ``penetration_part`` as far as the scene has
    them (see ``mechanics.quality``), None where not finite, and ``quality_failure``, empty where the run
    passed.
    """
    quality = quality_of(scene, run)
    parts = {name: part if math.isfinite(part) else None for name, part in quality.parts().items()}
    return {**parts, "quality_failure": quality.failure() or ""}
