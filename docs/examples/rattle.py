"""RATTLE (Andersen 1983) on a crank-slider with ideal joints: velocity Verlet that keeps its constraints.

The coordinates q are (x, y, phi) of crank, rod and slider. Joints, guide and drive are rows of

    g(q, t) = linear q + cosine cos(phi) + sine sin(phi) - target(t) = 0,  G = dg/dq.

The multiplier of a row is the force or torque on the body that is entered with a positive sign.
"""

import time
from dataclasses import dataclass

import numpy as np

from engine_models.engine import (
    FloatArray,
    RunSettings,
    SimulationFailed,
    Trajectory,
    UnsupportedScene,
    require_finite,
)
from engine_models.mechanics.assembly import start_state
from engine_models.progress import tell
from engine_models.scene.scene import Scene

#: Rows: two for each of the joints O, A and B, then y and phi of the slider, then phi of a driven crank.
JOINTS = {"O": slice(0, 2), "A": slice(2, 4), "B": slice(4, 6)}
GUIDE, DRIVE = 6, 8
#: Allowed error of the rows after a step in m and rad, and the largest number of corrections in a step.
CLOSED, MOST_CORRECTIONS = 1e-14, 50


@dataclass(frozen=True)
class Rattle:
    """RATTLE with equal steps, of order 2; it has no settings."""

    order = 2

    def check(self, scene: Scene) -> None:
        """Raise UnsupportedScene for a scene that the model does not cover."""
        if not scene.is_crank_slider or scene.joints_with_clearance:
            raise UnsupportedScene("rattle runs crank-sliders with ideal joints only")
        if scene.drive.kind not in ("free", "torque", "constant-speed"):
            raise UnsupportedScene(f"rattle has no drive of kind '{scene.drive.kind}'")
        if scene.load.slider is not None or scene.start.states:
            raise UnsupportedScene("rattle has no loads, and starts with closed joints")

    def twin(self, scene: Scene) -> Scene:
        """Return the scene itself: the model solves it without changes."""
        self.check(scene)
        return scene

    def sharper(self) -> "Rattle":
        """Return the engine itself: only the step sets its accuracy."""
        return self

    def simulate(self, scene: Scene, settings: RunSettings) -> Trajectory:
        """Run the scene; raise SimulationFailed if the joints cannot be closed."""
        self.check(scene)
        per_sample, step = settings.steps_per_sample(scene.end_time_s), settings.step_used_s(scene.end_time_s)
        times = np.linspace(0.0, scene.end_time_s, settings.samples + 1)
        motion, started = Motion(scene), time.perf_counter()
        samples = [motion.sample()]
        for sampled in times[1:]:
            for _ in range(per_sample):
                motion.advance(step)
            samples.append(motion.sample())
            tell(float(sampled))
        solve_time = time.perf_counter() - started
        position, velocity, multipliers, torque, work = map(np.array, zip(*samples, strict=True))
        free = scene.drive.kind == "free"
        return require_finite(
            Trajectory(
                time_s=times,
                position=position.reshape(-1, 3, 3),
                velocity=velocity.reshape(-1, 3, 3),
                joint_force_N={name: multipliers[:, rows] for name, rows in JOINTS.items()},
                guide_force_N={"guide": multipliers[:, GUIDE]},
                guide_moment_N_m={"guide": multipliers[:, GUIDE + 1]},
                driver_torque_N_m=None if free else torque,
                driver_work_J=None if free else work,
                step_s=step,
                steps=settings.samples * per_sample,
                solve_time_s=solve_time,
            )
        )


class Motion:
    """A crank-slider at one time: its rows, its state, and the step to the next time."""

    def __init__(self, scene: Scene) -> None:
        crank, rod, _ = bodies = scene.crank_slider()
        self.linear, self.cosine, self.sine = np.zeros((9, 9)), np.zeros((9, 3)), np.zeros((9, 3))
        self._enter(joint=0, body=0, arm_m=-crank.centre_of_mass_m, sign=1)
        self._enter(joint=1, body=0, arm_m=crank.length_m - crank.centre_of_mass_m, sign=-1)
        self._enter(joint=1, body=1, arm_m=-rod.centre_of_mass_m, sign=1)
        self._enter(joint=2, body=1, arm_m=rod.length_m - rod.centre_of_mass_m, sign=-1)
        self._enter(joint=2, body=2, arm_m=0.0, sign=1)
        self.linear[GUIDE, 7] = self.linear[GUIDE + 1, 8] = self.linear[DRIVE, 2] = 1.0
        rows = slice(9 if scene.speed_is_prescribed else DRIVE)
        self.linear, self.cosine, self.sine = self.linear[rows], self.cosine[rows], self.sine[rows]
        self.mobility = 1 / np.array([m for b in bodies for m in (b.mass_kg, b.mass_kg, b.inertia_kg_m2)])
        self.torque = getattr(scene.drive, "torque_N_m", 0.0)
        self.force = np.zeros(9)
        self.force[1::3] = [-body.mass_kg * scene.weight_m_s2 for body in bodies]
        self.force[2] = self.torque
        self.q, self.v = map(np.ravel, start_state(scene))
        self.target, self.rate = np.zeros(len(self.linear)), np.zeros(len(self.linear))
        self.target[DRIVE:], self.rate[DRIVE:] = self.q[2], self.v[2]
        self.multipliers, self.work_J = np.zeros(len(self.linear)), 0.0
        self._look()

    def _enter(self, joint: int, body: int, arm_m: float, sign: int) -> None:
        """Enter the pin of a body, at ``arm_m`` along its axis, into the two rows of a joint."""
        x, y = 2 * joint, 2 * joint + 1
        self.linear[x, 3 * body] = self.linear[y, 3 * body + 1] = sign
        self.cosine[x, body] = self.sine[y, body] = sign * arm_m

    def _look(self) -> None:
        """Compute G and (G M^-1 G^T)^-1 at the present positions."""
        turned = self.q[2::3]
        self.gradient = self.linear.copy()
        self.gradient[:, 2::3] += self.sine * np.cos(turned) - self.cosine * np.sin(turned)
        try:
            self.inverse = np.linalg.inv(self.gradient * self.mobility @ self.gradient.T)
        except np.linalg.LinAlgError:
            raise SimulationFailed(f"singular position, crank at {self.q[2]:.6g} rad") from None

    def advance(self, step: float) -> None:
        """Take a step: half a step of velocity that closes the joints, a step of position, the other half."""
        before, gradient, half = self.q, self.gradient, step / 2
        self.target = self.target + step * self.rate
        pull = self.multipliers
        for _ in range(MOST_CORRECTIONS):
            kicked = self.v + half * self.mobility * (self.force + pull @ gradient)
            self.q = before + step * kicked
            gap = self._gap()
            if np.abs(gap).max() < CLOSED:
                break
            pull = pull - self.inverse @ gap / (half * step)
        else:
            raise SimulationFailed(f"joints open by {np.abs(gap).max():.3g} m, crank at {self.q[2]:.6g} rad")
        self._look()
        kicked = kicked + half * self.mobility * self.force
        self.multipliers = self.inverse @ (self.rate - self.gradient @ kicked) / half
        self.v = kicked + half * self.mobility * (self.multipliers @ self.gradient)
        driving = (pull + self.multipliers)[DRIVE:] @ self.rate[DRIVE:]
        self.work_J += half * driving + self.torque * (self.q[2] - before[2])

    def _gap(self) -> FloatArray:
        turned = self.q[2::3]
        return self.linear @ self.q + self.cosine @ np.cos(turned) + self.sine @ np.sin(turned) - self.target

    def sample(self) -> tuple[FloatArray, FloatArray, FloatArray, float, float]:
        """Return q, q', the multipliers that keep the rows closed, the driver torque and its work."""
        turned = self.q[2::3]
        bend = (self.cosine * np.cos(turned) + self.sine * np.sin(turned)) @ self.v[2::3] ** 2
        multipliers = self.inverse @ (bend - self.gradient @ (self.mobility * self.force))
        return self.q, self.v, multipliers, self.torque + sum(multipliers[DRIVE:]), self.work_J
