"""How what is driven moves where its speed is prescribed: functions of the time since a run's start."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from engine_models.engine import FloatArray, SimulationFailed
from engine_models.scene.format import FluctuatingDrive, RampDrive
from engine_models.scene.scene import Scene
from reference_solver.mechanism import data
from reference_solver.mechanism.curves import curve_of

#: Times at which a speed that changes is looked at.
SPEEDS = 1001
#: Steps of a ramp, or of a period of a fluctuation, below which what an engine says of it is nonsense.
FEWEST_STEPS = 4
#: Of times (n,).
OfTime = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True)
class CrankMotion:
    """Functions of times (n,) in s: the angle turned since t = 0 in rad, speed and acceleration.

    Along a guide they are the way in m, and its rates.
    """

    turned_rad: OfTime
    speed_rad_s: OfTime
    acceleration_rad_s2: OfTime

    @property
    def start_speed_rad_s(self) -> float:
        """The speed at t = 0."""
        return float(self.speed_rad_s(np.zeros(1))[0])


def crank_motion(scene: Scene) -> CrankMotion | None:
    """Return the motion of what is driven, None where its speed is not prescribed.

    Along a guide the angle is a way in m, and so on.
    """
    return motion_of(scene.mechanism.drive)


def motion_of(drive: data.DriveData) -> CrankMotion | None:
    """Return the motion that a drive prescribes, in rad or along a guide in m; None without one."""
    law, clock_s = drive.law, drive.clock_s
    match law:
        case data.ConstantSpeed(speed):
            own: tuple[OfTime, OfTime, OfTime] = (
                lambda t: speed * t,
                lambda t: np.full_like(t, speed),
                np.zeros_like,
            )
        case data.Ramp():
            own = _ramp(law)
        case data.Fluctuation():
            own = _fluctuating(law)
        case data.Course():
            own = _table(law)
        case _:
            return None
    angle, rate, acceleration = own
    begin = angle(np.array([clock_s]))
    return CrankMotion(
        lambda t: angle(clock_s + t) - begin,
        lambda t: rate(clock_s + t),
        lambda t: acceleration(clock_s + t),
    )


def expected_speeds_rad_s(scene: Scene) -> FloatArray:
    """Return the crank's speed at equal intervals of a run, (n,), as far as it is known: else the start's."""
    motion = crank_motion(scene)
    if motion is None:
        return np.full(SPEEDS, scene.placed.v[2])
    return motion.speed_rad_s(np.linspace(0.0, scene.end_time_s, SPEEDS))


def quickest_s(scene: Scene) -> float:
    """Return how long a ramp or a period of a fluctuation takes in s, infinite without one."""
    drive = scene.drive
    if isinstance(drive, RampDrive):
        return drive.ramp_time_s
    return 1.0 / drive.frequency_Hz if isinstance(drive, FluctuatingDrive) else math.inf


def require_followed(scene: Scene, step_s: float) -> None:
    """Refuse a run whose steps of one length are too long for what the driver does.

    Raises:
        SimulationFailed: a ramp, or a period of a fluctuation, has fewer than ``FEWEST_STEPS`` of them.
    """
    if quickest_s(scene) < FEWEST_STEPS * step_s:
        field = "ramp_time_s" if scene.drive.kind == "ramp" else "frequency_Hz"
        raise SimulationFailed(
            f"drive.{field}: expected at least {FEWEST_STEPS} steps in {quickest_s(scene):.3g} s, "
            f"got steps of {step_s:.3g} s: shorten the step"
        )


def _ramp(law: data.Ramp) -> tuple[OfTime, OfTime, OfTime]:
    speed, gain, duration = law.first, law.last - law.first, law.duration_s

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


def _fluctuating(law: data.Fluctuation) -> tuple[OfTime, OfTime, OfTime]:
    a, rate, phase = law.amplitude, 2 * math.pi * law.frequency_Hz, law.phase_rad
    return (
        # Equal to -cos(rate t + phase) + cos(phase), without their difference.
        lambda t: law.mean * t + 2 * a / rate * np.sin(rate * t / 2) * np.sin(rate * t / 2 + phase),
        lambda t: law.mean + a * np.sin(rate * t + phase),
        lambda t: a * rate * np.cos(rate * t + phase),
    )


def _table(law: data.Course) -> tuple[OfTime, OfTime, OfTime]:
    spline = curve_of(law.table)
    return (lambda t: spline(t), lambda t: spline(t, 1), lambda t: spline(t, 2))
