"""The predictability horizon: until when what a scene observes can be told at all.

Two things part from a run of the reference: its perturbed runs, begun at a crank angle that is off by far
less than anybody could build or measure, and its own run at half the step. The horizon for a tolerance is the
time at which the first of them is off by more than that. Pointwise errors beyond it mean nothing.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from engine_models.engine import FloatArray, RunSettings
from engine_models.mechanics.quality import require_quality
from engine_models.mechanics.start import start_angle
from engine_models.mechanics.states import observed_m
from engine_models.reference.engine import ReferenceEngine
from engine_models.scene.scene import Scene

#: By how much the crank angle at the start is moved, in rad: some 5e-12 m at the crank pin of the library's
#: scenes, far above round-off. Both signs and sizes around it tell how certain a horizon is.
PERTURBATION_RAD = 1e-10
SIZES = (-2.0, -1.0, -0.5, 0.5, 1.0, 2.0)
#: The longest step of the runs that are perturbed, and that of the run whose step is halved, in s: a
#: perturbation grows as well at a coarser step, while the halved run shall show what is left at a fine one.
STEP_S, FINE_STEP_S = 1e-5, 2e-6


@dataclass(frozen=True)
class Apart:
    """How far slider positions are apart at n times: ``perturbed_m`` (p, n) by run, ``halved_m`` (n,)."""

    time_s: FloatArray
    perturbed_m: FloatArray
    halved_m: FloatArray


def moved(scene: Scene, by_rad: float) -> Scene:
    """Return the scene started at another angle of its turning body, with velocities that fit.

    Raises:
        ValueError: the scene tells no such angle from which all follows.
    """
    path, angle = start_angle(scene)
    return scene.replace(path, angle + by_rad)


def a_place_off(scene: Scene, places: float = 1.0) -> Scene:
    """Return the scene started a unit in the last place off, or so many: nobody knows a start better.

    So are the angles and speeds that the start tells, or the state of every body. A place of an angle is one
    of a radian at least, and of another number that is zero none.
    """
    return scene.replace("start", _a_place_off(scene.as_written()["start"], places))


def _a_place_off(start: Mapping[str, Any], places: float, of: str = "") -> dict[str, Any]:
    """Return the entries of a start, or of its part ``of``, so many places off."""
    off: dict[str, Any] = {}
    for name, value in start.items():
        if isinstance(value, Mapping):
            off[name] = _a_place_off(value, places, name)
        elif isinstance(value, tuple) and of == "place_m":
            off[name] = tuple(_place_off(name, each, places) for each in value)
        else:
            moves = isinstance(value, float) and name != "time_s"
            off[name] = (
                _place_off(of if of.endswith("angle_rad") else name, value, places) if moves else value
            )
    return off


def _place_off(name: str, value: float, places: float) -> float:
    if name.endswith("angle_rad"):
        return value + places * float(np.spacing(max(abs(value), 1.0)))
    return value + places * float(np.spacing(abs(value))) if value else value


def apart(
    scene: Scene,
    samples: int,
    sizes: tuple[float, ...] = SIZES,
    step_s: float = STEP_S,
    fine_step_s: float = FINE_STEP_S,
) -> Apart:
    """Return how the reference's perturbed and step-halved runs part from it.

    ``sizes`` are the perturbations in parts of ``PERTURBATION_RAD``.

    Raises:
        UnsupportedScene, SimulationFailed: the reference cannot run the scene, or not well.
    """
    reference = ReferenceEngine()

    def position(of: Scene, step: float) -> FloatArray:
        return observed_m(of, require_quality(of, reference.simulate(of, RunSettings(step, samples))))

    base = position(scene, step_s)
    # What the moved angle itself does to a driven crank stays of its size and is part of the distance.
    perturbed = [position(moved(scene, size * PERTURBATION_RAD), step_s) - base for size in sizes]
    halved = position(scene, fine_step_s) - position(scene, fine_step_s / 2)
    time = np.linspace(0.0, scene.end_time_s, samples + 1)
    return Apart(time, np.abs(np.array(perturbed)), np.abs(halved))


def first_beyond_s(time_s: FloatArray, distance_m: FloatArray, tolerance_m: float) -> float:
    """Return the first of n times at which a distance (n,) exceeds a tolerance, infinite without one."""
    beyond = distance_m > tolerance_m
    return float(time_s[np.argmax(beyond)]) if beyond.any() else np.inf
