"""What a scene's load puts on its slider: forces along +x in any states, and the works of its parts."""

from collections.abc import Callable, Mapping

import numpy as np

from engine_models.engine import FloatArray
from engine_models.mechanics.joints import CRANK, SLIDER
from engine_models.scene.scene import Scene

#: Parts of a load whose works are integrals over time: those of the others follow from where the slider is.
INTEGRATED = ("viscous", "gas")


def parts_of(scene: Scene) -> tuple[str, ...]:
    """Return the parts of the slider's load that there are: force, viscous, spring, gas, in this order."""
    load = scene.load.slider
    if load is None:
        return ()
    values = {
        "force": load.force_N,
        "viscous": load.viscous_N_s_m,
        "spring": load.spring_N_m,
        "gas": load.gas,
    }
    return tuple(name for name, value in values.items() if value)


def integrated_parts(scene: Scene) -> tuple[str, ...]:
    """Return those parts of the load whose works an engine has to integrate."""
    return tuple(part for part in parts_of(scene) if part in INTEGRATED)


def gas_force(scene: Scene) -> Callable[[FloatArray], FloatArray]:
    """Return the gas's force in N on the slider along +x as a function of crank angles (n,) in rad."""
    assert scene.load.slider is not None
    assert scene.load.slider.gas is not None
    spline = scene.load.slider.gas.spline()
    return lambda angle: np.asarray(spline(angle))


def slider_forces(scene: Scene, position: FloatArray, velocity: FloatArray) -> dict[str, FloatArray]:
    """Return the force of each part of the load in N, (n,), in states (n, bodies, 3)."""
    load = scene.load.slider
    if load is None:
        return {}
    x, x_rate, angle = position[:, SLIDER, 0], velocity[:, SLIDER, 0], position[:, CRANK, 2]
    forces: dict[str, Callable[[], FloatArray]] = {
        "force": lambda: np.full(len(x), load.force_N or 0.0),
        "viscous": lambda: -(load.viscous_N_s_m or 0.0) * x_rate,
        "spring": lambda: -(load.spring_N_m or 0.0) * (x - (load.free_position_m or 0.0)),
        "gas": lambda: gas_force(scene)(angle),
    }
    return {part: forces[part]() for part in parts_of(scene)}


def load_works_J(
    scene: Scene, position: FloatArray, integrated: Mapping[str, FloatArray]
) -> dict[str, FloatArray]:
    """Return the work of each part of the load since the first of positions (n, bodies, 3), (n,).

    Those of ``integrated_parts`` are given.
    """
    load = scene.load.slider
    if load is None:
        return {}
    x = position[:, SLIDER, 0]
    way, middle = x - x[0], (x + x[0]) / 2
    exact = {
        "force": (load.force_N or 0.0) * way,
        "spring": -(load.spring_N_m or 0.0) * way * (middle - (load.free_position_m or 0.0)),
    }
    return {part: exact[part] if part in exact else integrated[part] for part in parts_of(scene)}
