"""How the crank turns where its speed is prescribed: functions of the time since a run's start."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from engine_models.engine import FloatArray, SimulationFailed
from engine_models.guards import guarded
from engine_models.scene.drives import FluctuatingDrive, RampDrive, TableDrive
from engine_models.scene.parts import AnyScene
from engine_models.scene.scene import Scene

#: Times at which a speed that changes is looked at.
SPEEDS = 1001
#: Steps of a ramp, or of a period of a fluctuation, below which what an engine says of it is nonsense.
FEWEST_STEPS = 4
#: Of times (n,).
OfTime = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True)
class CrankMotion:
    """Functions of times (n,) in s: the angle turned since t = 0 in rad, speed and acceleration."""

    turned_rad: OfTime
    speed_rad_s: OfTime
    acceleration_rad_s2: OfTime

    @property
    def start_speed_rad_s(self) -> float:
        """The speed at t = 0."""
        return float(self.speed_rad_s(np.zeros(1))[0])


def crank_motion(scene: Scene) -> CrankMotion | None:
    """Return the crank's motion, None where its speed is not prescribed."""
    drive, speed, clock = scene.drive, scene.start.crank_speed_rad_s, scene.start.time_s or 0.0
    if not scene.speed_is_prescribed:
        return None
    if isinstance(drive, RampDrive):
        own = _ramp(drive, speed)
    elif isinstance(drive, FluctuatingDrive):
        own = _fluctuating(drive, speed)
    elif isinstance(drive, TableDrive):
        own = _table(drive)
    else:
        own = (lambda t: speed * t, lambda t: np.full_like(t, speed), np.zeros_like)
    angle, rate, acceleration = own
    begin = angle(np.array([clock]))
    return CrankMotion(
        lambda t: angle(clock + t) - begin,
        lambda t: rate(clock + t),
        lambda t: acceleration(clock + t),
    )


def expected_speeds_rad_s(scene: Scene) -> FloatArray:
    """Return the crank's speed at equal intervals of a run, (n,), as far as it is known: else the start's."""
    motion = crank_motion(scene)
    speed = scene.start.crank_speed_rad_s
    if motion is None:
        return np.full(SPEEDS, speed)
    return motion.speed_rad_s(np.linspace(0.0, scene.end_time_s, SPEEDS))


def quickest_s(scene: AnyScene) -> float:
    """Return how long a ramp or a period of a fluctuation takes in s, infinite without one."""
    drive = scene.driven_by
    if isinstance(drive, RampDrive):
        return drive.ramp_time_s
    return 1.0 / drive.frequency_Hz if isinstance(drive, FluctuatingDrive) else math.inf


def require_followed(scene: AnyScene, step_s: float) -> None:
    """Refuse a run whose steps of one length are too long for what the driver does.

    Raises:
        SimulationFailed: a ramp, or a period of a fluctuation, has fewer than ``FEWEST_STEPS`` of them.
    """
    if guarded() and quickest_s(scene) < FEWEST_STEPS * step_s:
        field = "ramp_time_s" if scene.driven_by.kind == "ramp" else "frequency_Hz"
        raise SimulationFailed(
            f"drive.{field}: expected at least {FEWEST_STEPS} steps in {quickest_s(scene):.3g} s, "
            f"got steps of {step_s:.3g} s: shorten the step"
        )


def _ramp(drive: RampDrive, speed: float) -> tuple[OfTime, OfTime, OfTime]:
    gain, duration = drive.final_speed - speed, drive.ramp_time_s

    def part(t: FloatArray) -> FloatArray:
        return np.clip(t / duration, 0.0, 1.0)

    def angle(t: FloatArray) -> FloatArray:
        x = part(t)
        return speed * t + gain * (duration * x**4 * (2.5 - 3 * x + x**2) + np.maximum(t - duration, 0.0))

    return (
        angle,
        lambda t: speed + gain * (x := part(t)) ** 3 * (10 - 15 * x + 6 * x**2),
        lambda t: gain / duration * 30 * (x := part(t)) ** 2 * (1 - x) ** 2,
    )


def _fluctuating(drive: FluctuatingDrive, speed: float) -> tuple[OfTime, OfTime, OfTime]:
    a, rate, phase = drive.amplitude, 2 * math.pi * drive.frequency_Hz, drive.phase_rad
    return (
        # Equal to -cos(rate t + phase) + cos(phase), without their difference.
        lambda t: speed * t + 2 * a / rate * np.sin(rate * t / 2) * np.sin(rate * t / 2 + phase),
        lambda t: speed + a * np.sin(rate * t + phase),
        lambda t: a * rate * np.cos(rate * t + phase),
    )


def _table(drive: TableDrive) -> tuple[OfTime, OfTime, OfTime]:
    spline = drive.spline()
    return (lambda t: spline(t), lambda t: spline(t, 1), lambda t: spline(t, 2))
