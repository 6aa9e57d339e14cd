"""The end of runs that would take for ever, with the field of the scene that forces their steps."""

import math
import sys

import numpy as np

from engine_models.engine import SimulationFailed
from engine_models.mechanics.start import start_state
from engine_models.mechanics.states import lever_m
from engine_models.scene.format import FluctuatingDrive, RampDrive
from engine_models.scene.scene import Scene
from reference_solver.mechanism.contacts import exponent_of, stiffness_of

#: A run that needs more steps than this would take hours or more.
MOST_STEPS = 1e10
#: Steps that engines may take in the shortest time of a scene, and more.
RESOLVED = 1e6
#: Steps of a ramp, or of a period of a fluctuation, below which what an engine says of it is nonsense.
FEWEST_STEPS = 4


class Pace:
    """Judges every so many steps, enough to outlast any one contact, whether a run comes to its end."""

    def __init__(self, scene: Scene, outlasting: int, most_steps: float = MOST_STEPS) -> None:
        self._scene, self._outlasting, self._most_steps = scene, outlasting, most_steps
        self._judged, self._judged_s = 0, 0.0

    def judge(self, reached_s: float, steps: int) -> None:
        """Judge the time passed since the last time by the steps done since then, if they are enough.

        Raises:
            SimulationFailed: at this pace the run would need more than ``most_steps``; the message names the
                field of the scene that forces it.
        """
        passed_s, since = max(reached_s - self._judged_s, 0.0), steps - self._judged
        if since < self._outlasting:
            return
        if passed_s * self._most_steps < since * self._scene.end_time_s:
            raise too_slow(self._scene, passed_s / since, f" at t = {reached_s:.6g} s")
        self._judged, self._judged_s = steps, reached_s


def too_slow(scene: Scene, step_s: float, when: str = "") -> SimulationFailed:
    """Return the failure of a run whose steps are too short to come to its end.

    A field of the scene is to blame only if its own time is not much longer than the steps.
    """
    (field, value), time_s = forcing_field(scene)
    steps = f"steps of {step_s:.3g} s{when}"
    if time_s > RESOLVED * max(step_s, sys.float_info.min):
        return SimulationFailed(f"{steps} do not come to an end: take a longer step, or a looser tolerance")
    return SimulationFailed(
        f"{field}: expected a value that lets a run come to its end, got {value:g} (forces {steps})"
    )


def forcing_field(scene: Scene) -> tuple[tuple[str, float], float]:
    """Return name and value of the field that makes the shortest time in the scene, and that time in s.

    The times are those of an impact on the lightest body, at the speed of the crank's pin or of a body at the
    start, of a fall from the crank's height, or of one that crosses a clearance within the scene.
    """
    r, rooms = lever_m(scene), scene.clearances.values()
    told, turning_rad_s = _start_speeds(scene)
    crossing = (room.radial_clearance_m / scene.end_time_s for room in rooms)
    pin_m_s = math.hypot(r * turning_rad_s, math.sqrt(2 * math.hypot(*scene.gravity) * r))
    speed = np.float64(max([pin_m_s, sys.float_info.min, *told, *crossing]))
    mass = min(body.mass_kg for body in scene.mechanism.bodies)
    times = {("end_time_s", scene.end_time_s): scene.end_time_s}
    with np.errstate(all="ignore"):
        for joint, clearance in scene.clearances.items():
            field, c = f"clearance.{joint}", clearance.radial_clearance_m
            times[f"{field}.radial_clearance_m", c] = float(c / speed)
            force = np.float64(mass * speed**2 / r)
            if clearance.law != "rigid":
                # All kinetic energy goes into the spring: m v^2/2 = K d^(n+1)/(n+1).
                K, n = min(stiffness_of(clearance), sys.float_info.max), exponent_of(clearance)
                depth = (mass * speed**2 * (n + 1) / (2 * K)) ** (1 / (n + 1))
                force = K * depth**n
                stiff = "young_modulus_Pa" if clearance.stiffness is None else "stiffness"
                times[f"{field}.{stiff}", getattr(clearance, stiff)] = float(depth / speed)
            if damping := clearance.damping_N_s_m:
                times[f"{field}.damping_N_s_m", damping] = mass / damping
            if (friction := clearance.friction) is not None and friction.coefficient > 0:
                full = friction.regularisation_speed_m_s
                name = f"{field}.friction.regularisation_speed_m_s"
                times[name, full] = float(mass * full / (friction.coefficient * force))
    return min(times.items(), key=lambda entry: entry[1])


def _start_speeds(scene: Scene) -> tuple[list[float], float]:
    """Return speeds in m/s of bodies at the start that are told, and the crank's or the fastest in rad/s."""
    if scene.is_short:
        states = scene.start.states.values()
        told = [math.hypot(body.velocity_x_m_s, body.velocity_y_m_s) for body in states]
        return told, scene.short.start.crank_speed_rad_s
    _, velocity = start_state(scene)
    return np.hypot(velocity[:, 0], velocity[:, 1]).tolist(), float(np.abs(velocity[:, 2]).max())


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
