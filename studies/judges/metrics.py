"""What is judged, computed from a scene and a trajectory alone, the same way for every engine."""

import math
from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from engine_models.engine import FloatArray, Trajectory
from engine_models.mechanics.energy import energy_balance_residual_J as energy_balance_residual_J
from engine_models.mechanics.energy import kinetic_energy_J as kinetic_energy_J
from engine_models.mechanics.energy import numerical_gain_J as numerical_gain_J
from engine_models.mechanics.energy import potential_energy_J as potential_energy_J
from engine_models.mechanics.energy import unaccounted_part
from engine_models.mechanics.quality import constraint_violation_m as constraint_violation_m
from engine_models.mechanics.quality import quality_of
from engine_models.mechanics.states import guide_column, observed_columns
from engine_models.scene.scene import Scene
from studies.case import Curves, Row


def in_flight(*runs: Trajectory) -> NDArray[np.bool_]:
    """Return at which of their n samples every pin of all the runs is in flight, (n,)."""
    contacts = [contact for run in runs for contact in run.contacts.values()]
    return np.asarray(np.all([contact.penetration_m < 0 for contact in contacts], axis=0))


def finite(run: Trajectory) -> bool:
    """Return whether every number of a trajectory is finite, its contacts' and their impacts' included.

    The largest of an impact's forces may be unknown.
    """
    contacts = run.contacts.values()
    records = (run, *contacts, *(contact.impacts for contact in contacts))
    known = [(name, value) for record in records for name, value in vars(record).items()]
    known += [item for _, value in known if isinstance(value, Mapping) for item in value.items()]
    values = [value for name, value in known if not name.startswith("largest_")]
    return all(np.isfinite(value).all() for value in values if isinstance(value, np.ndarray))


def signals(scene: Scene, trajectory: Trajectory) -> Iterator[tuple[str, FloatArray]]:
    """Yield the compared signals by column name: ``slider_position_m`` (n,) and so on.

    First is what the scene observes, of a pendulum its angle, and its rate. Joint forces, and the places of
    pins in their bearings, are vectors, (n, 2). The driver torque is compared only where it is a reaction:
    under a prescribed speed.
    """
    if scene.is_short and "rod" not in scene.body:
        yield "crank_angle_rad", trajectory.position[:, 0, 2]
        yield "crank_speed_rad_s", trajectory.velocity[:, 0, 2]
    else:
        yield from observed_columns(scene, trajectory).items()
    for joint, force in trajectory.joint_force_N.items():
        yield f"joint_{joint}_force_N", force
    for guide, normal in trajectory.guide_force_N.items():
        yield guide_column(scene, guide), normal
    if scene.mechanism.drive.prescribes and trajectory.driver_torque_N_m is not None:
        along = scene.mechanism.drive.guide is not None
        yield "driver_force_N" if along else "driver_torque_N_m", trajectory.driver_torque_N_m
    for joint, contact in trajectory.contacts.items():
        yield f"clearance_{joint}_m", contact.gap_m
        yield f"contact_{joint}_normal_force_N", contact.normal_force_N
        yield f"contact_{joint}_normal_impulse_N_s", contact.normal_impulse_N_s


def is_force(name: str) -> bool:
    """Return whether a signal, by its name or a column's, is a force, a torque or an impulse, not motion."""
    return name.endswith(("_N", "_N_m", "_N_s"))


def sizes(scene: Scene, trajectory: Trajectory) -> dict[str, FloatArray]:
    """Return the sizes of all signals, (n,), forces by length, by their names."""
    return {name: _size(value) for name, value in signals(scene, trajectory)}


def _size(value: FloatArray) -> FloatArray:
    """Return the size of a signal, (n,), of a vector (n, 2) its length."""
    return np.hypot(*value.T) if value.ndim == 2 else np.abs(value)


def errors(scene: Scene, trajectory: Trajectory, truth: Trajectory) -> dict[str, FloatArray]:
    """Return the error of each signal over time, (n,), forces by the length of the difference vector.

    The keys are the signals' names with ``_error`` before the unit, as in ``slider_position_error_m``.

    Raises:
        ValueError: the truth has other samples than the run.
    """
    n, there = len(trajectory.time_s), len(truth.time_s)
    if n != there or not np.allclose(trajectory.time_s, truth.time_s, rtol=1e-9, atol=0.0):
        expected = f"the run's {n} times up to {trajectory.time_s[-1]:g} s"
        raise ValueError(f"truth: expected {expected}, got {there} up to {truth.time_s[-1]:g} s")
    out = {}
    for (name, value), (_, true) in zip(signals(scene, trajectory), signals(scene, truth), strict=True):
        out[with_suffix(name, "error")] = _size(value - true)
    return out


def uncertainties(scene: Scene, truth: Trajectory, repeats: list[Trajectory]) -> dict[str, float]:
    """Return the truth's own uncertainty of each signal: ``COVERAGE`` distances from a repeat plus round-off.

    The keys have ``_uncertainty`` before the unit, as in ``slider_position_uncertainty_m``.
    """
    distances = [errors(scene, repeat, truth).values() for repeat in repeats]
    return {
        with_suffix(name, "uncertainty"): float(COVERAGE * np.max(apart) + ROUND_OFF * np.abs(value).max())
        for (name, value), apart in zip(signals(scene, truth), zip(*distances, strict=True), strict=True)
    }


def scales(scene: Scene, truth: Trajectory) -> dict[str, float]:
    """Return how far each signal is from its mean at most, forces by length: an error as large knows nothing.

    The mean is that over time. The keys have ``_scale`` before the unit, as in ``slider_position_scale_m``.
    """
    weights = np.gradient(truth.time_s) if len(truth.time_s) > 1 else np.ones(1)
    return {
        with_suffix(name, "scale"): float(_size(value - np.average(value, axis=0, weights=weights)).max())
        for name, value in signals(scene, truth)
    }


def conserved(scene: Scene, run: Trajectory) -> tuple[Row, Curves]:
    """Return what needs no truth: energy balance, constraints and quality, at their worst, and as curves."""
    violation = constraint_violation_m(scene, run)
    worst: Row = {
        "energy_balance_residual_J": float(np.abs(energy_balance_residual_J(scene, run)).max()),
        "constraint_violation_m": float(violation.max()),
    }
    curves = {"unaccounted_energy_part": unaccounted_part(scene, run), "constraint_violation_m": violation}
    return worst | checked(scene, run), curves


def checked(scene: Scene, run: Trajectory) -> Row:
    """Return the columns of the check that ``crankslider simulate`` makes: what it found, and why it failed.

    They are ``unaccounted_energy_part``, ``ideal_gap_part``, ``penetration_part`` as far as the scene has
    them (see ``mechanics.quality``), None where not finite, and ``quality_failure``, empty where the run
    passed.
    """
    quality = quality_of(scene, run)
    parts = {name: part if math.isfinite(part) else None for name, part in quality.parts().items()}
    return {**parts, "quality_failure": quality.failure() or ""}


#: Round-off of a signal relative to its largest value: the closed-form reactions are within 2.2 units in the
#: last place of their values in extended precision; the margin is 2.
ROUND_OFF = 4 * float(np.finfo(float).eps)

#: The truth may be off by so many times its largest distance from a repeat. Where impacts magnify round-off,
#: that is a draw of the same spread, and may be small by chance. Of solutions of a scene with every number a
#: place off, 96 % at least are within six distances in each signal of twelve scenes, and 91 % by other starts
#: of the repeats; within three 74 and 67 %.
COVERAGE = 6.0

#: Units at the end of column names, longest first.
UNITS = ("rad_s", "m_s", "N_m", "N_s", "rad", "m", "N", "J", "s")


def with_suffix(column: str, word: str) -> str:
    """Return a column's name with a word put before its unit: force_N, error -> force_error_N."""
    for unit in UNITS:
        if column.endswith(f"_{unit}"):
            return f"{column[: -len(unit)]}{word}_{unit}"
    raise ValueError(f"column: expected a name that ends in one of {UNITS}, got {column}")
