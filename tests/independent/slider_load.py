"""Torque and slider's load of a scene in the independent mechanics' own formulas, with B-splines."""

from collections.abc import Callable

import numpy as np
from scipy.interpolate import make_interp_spline

from engine_models.scene.scene import Scene

PARTS = ("force", "viscous", "spring", "gas")


def slider_load(scene: Scene) -> Callable[[float, float, float], dict[str, float]]:
    """Return the parts of the load in N as a function of theta, x and x'; those that are absent are zero."""
    load = scene.load.slider
    if load is None:
        return lambda *_: dict.fromkeys(PARTS, 0.0)
    gas = _no_gas if load.gas is None else _gas(load.gas.crank_angle_rad, load.gas.force_N)

    def forces(theta: float, x: float, speed: float) -> dict[str, float]:
        return {
            "force": load.force_N or 0.0,
            "viscous": -(load.viscous_N_s_m or 0.0) * speed,
            "spring": (load.spring_N_m or 0.0) * ((load.free_position_m or 0.0) - x),
            "gas": gas(theta),
        }

    return forces


def _no_gas(_: float) -> float:
    return 0.0


def _gas(angles: tuple[float, ...], forces: tuple[float, ...]) -> Callable[[float], float]:
    angle, force = np.array(angles), np.array(forces)
    angle[-1], force[-1] = angle[0] + 2 * np.pi, force[0]
    spline = make_interp_spline(angle, force, k=3, bc_type="periodic")
    return lambda theta: float(spline(angle[0] + (theta - angle[0]) % (2 * np.pi)))


def torque_on_crank(scene: Scene, speed: float) -> float:
    """Return the torque in N m of a drive that does not prescribe the speed."""
    if scene.drive.kind == "motor":
        slope = scene.drive.stall_torque_N_m / scene.drive.no_load_speed_rad_s
        return slope * (scene.drive.no_load_speed_rad_s - speed)
    return scene.drive.torque_N_m if scene.drive.kind == "torque" else 0.0
