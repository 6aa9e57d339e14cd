"""The ideal crank-slider in Pymunk (Chipmunk): joint impulses and position-first semi-implicit Euler.

One ``space.step(dt)`` first moves the positions with the stored velocities, then kicks the velocities by the
loads and by the joints' impulses, both at the new positions. The impulses also take the joints' position
errors back. So after step k the positions x_k are those of t_k = k dt, and the step's kick was made at x_k.
"""

from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from pydantic.dataclasses import dataclass

from engine_models.assembly import assembled
from engine_models.engine import (
    SETTINGS_CONFIG,
    FloatArray,
    RunSettings,
    SimulationFailed,
    Trajectory,
    require_finite,
    require_ideal,
)
from engine_models.pymunk_forces import joint_gaps, reactions
from engine_models.pymunk_model import build, run
from engine_models.scene import Scene

#: Pymunk's own defaults: a joint loses a tenth of its position error every sixtieth of a second.
LIBRARY_ITERATIONS, LIBRARY_ERROR_BIAS = 10, (1.0 - 0.1) ** 60.0
#: With a joint this many crank lengths apart the bodies are no crank-slider any more, and the run has failed.
LOST_GAP = 0.1


@dataclass(frozen=True, config=SETTINGS_CONFIG)
class PymunkEngine:
    """Settings of the Pymunk model; the defaults are its best practice, ``out_of_the_box`` is Pymunk's own.

    ``iterations`` is the number of Gauss-Seidel sweeps over the joints in a step. ``error_bias`` is the
    fraction of a joint's position error left after a second: 0 takes all of it back in every step, which
    needs enough sweeps to be stable (the library's scenes six, a slider 100 times as heavy over twenty).

    With ``half_kick_start`` the run begins with a kick over dt/2 that moves nothing. The scheme is then the
    leap-frog, of order 2: the velocity stored after step k is that of t_k + dt/2. Reported at t_k are x_k,
    the mean of the velocities before and after kick k, and the forces that made kick k. The first two kicks
    are an exception. The joints learn how their paths curve from the gap that a step opens; kick 0 sees
    none, so it lacks the centripetal half impulse, which kick 1 adds to its own. Their sum is right, and so
    is the motion, but neither is the force of its time: the accelerations at steps 0 and 1 are the parabola
    through those of steps 2 to 4, and forces (and the velocity at step 1) follow from them.

    Without it all is as a user reads it after step k, of order 1: x_k, the stored velocity, the forces that
    made kick k, all taken as those of t_k. There is no kick at t = 0, so step 1's acceleration stands there.
    Step 1 has no earlier impulses to start its sweeps from: forces at t = 0 and for some steps more are off
    by what ten sweeps leave, however short the step, and with ``error_bias`` 0 also by kick 1's extra half.
    """

    iterations: Annotated[int, Field(gt=0, lt=2**31)] = 20
    error_bias: Annotated[float, Field(ge=0, lt=1)] = 0.0
    half_kick_start: bool = True

    @classmethod
    def out_of_the_box(cls) -> "PymunkEngine":
        """Return the engine as it is for a user who sets nothing."""
        return cls(iterations=LIBRARY_ITERATIONS, error_bias=LIBRARY_ERROR_BIAS, half_kick_start=False)

    def check(self, scene: Scene) -> None:
        """Raise UnsupportedScene if a joint has clearance."""
        require_ideal(scene, "pymunk")

    def simulate(self, scene: Scene, settings: RunSettings) -> Trajectory:
        """Run the scene with fixed steps.

        Raises:
            UnsupportedScene: the scene has joints with clearance.
            SimulationFailed: a joint came apart by more than a tenth of the crank, or the rod turned over,
                or the numbers overflowed.
        """
        self.check(scene)
        dt, per_sample = settings.step_used_s(scene.end_time_s), settings.steps_per_sample(scene.end_time_s)
        steps = settings.samples * per_sample
        driven = scene.drive.kind == "constant-speed"
        # The driver's work needs the torque at every step, all else is asked for at the samples alone.
        wanted = np.arange(0, steps + 1, 1 if driven else per_sample)
        sampled = slice(None, None, per_sample if driven else 1)
        with np.errstate(all="ignore"):  # overflow ends as a failure with its time, not as a warning
            position, velocity, acceleration, solve_time = self._motion(scene, dt, wanted)
            _require_the_mechanism(scene, position, np.asarray(dt * wanted, dtype=np.float64))
            force, guide, torque = reactions(scene, position, acceleration)
            work = _driver_work(scene, position, torque, dt)
        if scene.drive.kind == "torque":
            torque = np.full_like(torque, scene.drive.torque_N_m)
        return require_finite(
            Trajectory(
                time_s=np.linspace(0.0, scene.end_time_s, settings.samples + 1),
                position=position[sampled],
                velocity=velocity[sampled],
                joint_force_N=force[sampled],
                guide_normal_force_N=guide[sampled],
                driver_torque_N_m=None if work is None else torque[sampled],
                driver_work_J=None if work is None else work[sampled],
                step_s=dt,
                steps=steps,
                solve_time_s=solve_time,
            )
        )

    def _motion(
        self, scene: Scene, dt: float, wanted: NDArray[np.int64]
    ) -> tuple[FloatArray, FloatArray, FloatArray, float]:
        """Return position, velocity, acceleration (n, 3, 3) at the wanted steps, and the solve time."""
        space, bodies = build(scene, self.iterations, self.error_bias)
        # The step before a wanted one tells the kick, the first few what kicks 0 and 1 should have been.
        read = np.unique(np.concatenate([wanted, wanted[1:] - 1, np.arange(5)]))
        x, v, solve_time = run(
            space,
            bodies,
            dt,
            crank_torque_N_m=scene.drive.torque_N_m if scene.drive.kind == "torque" else None,
            half_kick_start=self.half_kick_start,
            read_after=read,
        )
        at = np.searchsorted(read, wanted)
        position, velocity = x[at], v[at]
        acceleration = (velocity - v[at - 1]) / dt
        kick_1, kick_2, kick_3, kick_4 = np.diff(v[:5], axis=0) / dt
        acceleration[0] = kick_1
        if self.half_kick_start:
            acceleration[wanted == 0] = 6 * kick_2 - 8 * kick_3 + 3 * kick_4
            acceleration[wanted == 1] = 3 * kick_2 - 3 * kick_3 + kick_4
            velocity = velocity - acceleration * dt / 2
            velocity[0] = assembled(scene, scene.start.crank_angle_rad, scene.start.crank_speed_rad_s)[1]
        if scene.drive.kind == "constant-speed":
            _place_driven_crank(scene, position, velocity, acceleration)
        return position, velocity, acceleration, solve_time


def _place_driven_crank(
    scene: Scene, position: FloatArray, velocity: FloatArray, acceleration: FloatArray
) -> None:
    """Fill in the motion of the crank's centre of mass, which circles about the kinematic body's origin O."""
    theta, omega, s = position[:, 0, 2], scene.start.crank_speed_rad_s, scene.crank.centre_of_mass_m
    radial = np.stack([np.cos(theta), np.sin(theta)], axis=-1)
    tangential = np.stack([-np.sin(theta), np.cos(theta)], axis=-1)
    position[:, 0, :2] = s * radial
    velocity[:, 0, :2], velocity[:, 0, 2] = s * omega * tangential, omega
    acceleration[:, 0, :2], acceleration[:, 0, 2] = -s * omega * omega * radial, 0.0


def _driver_work(scene: Scene, position: FloatArray, torque: FloatArray, dt: float) -> FloatArray | None:
    """Return the driver's work since t = 0 in J, at constant speed by the trapezoidal rule."""
    if scene.drive.kind == "torque":
        return np.asarray(scene.drive.torque_N_m * (position[:, 0, 2] - position[0, 0, 2]))
    if scene.drive.kind == "free":
        return None
    power = torque * scene.start.crank_speed_rad_s
    return np.concatenate([[0.0], np.cumsum(dt * (power[1:] + power[:-1]) / 2)])


def _require_the_mechanism(scene: Scene, position: FloatArray, time_s: FloatArray) -> None:
    """Check that the positions at the times, (n, 3, 3) at (n,), are still the scene's crank-slider.

    Raises:
        SimulationFailed: at the first time when a joint is too far apart or not finite, or when the rod has
            gone over the vertical, which one as long as the crank or longer never does.
    """
    gap = joint_gaps(scene, position)
    lost = ~(gap <= LOST_GAP * scene.crank.length_m)
    over = (np.cos(position[:, 1, 2]) <= 0) & (scene.rod.length_m >= scene.crank.length_m)
    if (lost | over).any():
        first = int(np.argmax(lost | over))
        what = f"constraints lost, a joint is {gap[first]:.3g} m apart," if lost[first] else "rod turned over"
        raise SimulationFailed(f"{what} at t = {time_s[first]:.6g} s")
