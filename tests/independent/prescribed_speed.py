"""Speeds that a drive prescribes, and their derivatives, in the independent mechanics' own formulas."""

import math
from collections.abc import Callable
from dataclasses import dataclass

from scipy.interpolate import make_interp_spline

from engine_models.scene.scene import Scene


@dataclass(frozen=True)
class PrescribedSpeed:
    """Speed in rad/s and acceleration in rad/s^2 of the crank, functions of the time since the run began."""

    speed: Callable[[float], float]
    acceleration: Callable[[float], float]


def prescribed_speed(scene: Scene) -> PrescribedSpeed | None:
    """Return what the drive prescribes, None where it prescribes nothing."""
    drive, first, clock = scene.drive, scene.start.crank_speed_rad_s, scene.start.time_s or 0.0
    if drive.kind == "constant-speed":
        return PrescribedSpeed(lambda _: first, lambda _: 0.0)
    if drive.kind == "ramp":
        duration, change = drive.ramp_time_s, drive.final_speed_rad_s - first

        def x(t: float) -> float:
            return min((clock + t) / duration, 1.0)

        return PrescribedSpeed(
            lambda t: first + change * (10 * x(t) ** 3 - 15 * x(t) ** 4 + 6 * x(t) ** 5),
            lambda t: change / duration * (30 * x(t) ** 2 - 60 * x(t) ** 3 + 30 * x(t) ** 4),
        )
    if drive.kind == "fluctuating":
        amplitude, rate, phase = drive.amplitude_rad_s, math.tau * drive.frequency_Hz, drive.phase_rad
        return PrescribedSpeed(
            lambda t: first + amplitude * math.sin(rate * (clock + t) + phase),
            lambda t: amplitude * rate * math.cos(rate * (clock + t) + phase),
        )
    if drive.kind == "table":
        angle = make_interp_spline(drive.time_s, drive.angle_rad, k=3)
        speed, acceleration = angle.derivative(), angle.derivative(2)
        return PrescribedSpeed(lambda t: float(speed(clock + t)), lambda t: float(acceleration(clock + t)))
    return None


def speed_at_start(scene: Scene) -> float:
    """Return the crank's speed in rad/s as the run begins."""
    motion = prescribed_speed(scene)
    return scene.start.crank_speed_rad_s if motion is None else motion.speed(0.0)
