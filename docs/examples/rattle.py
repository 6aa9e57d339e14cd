"""RATTLE (Andersen 1983) on planar mechanisms of ideal joints: velocity Verlet that keeps its constraints.

The coordinates q are (x, y, phi) of every body. Pins, guides and drive are rows of

    g(q, t) = linear q + cosine cos(phi) + sine sin(phi) - target(t) = 0,  G = dg/dq.

The multiplier of a row is the force or torque on the body that is entered with a positive sign.
"""

import math
import time
from dataclasses import dataclass

import numpy as np

from engine_models.engine import (
    Engine,
    FloatArray,
    RunSettings,
    SimulationFailed,
    Trajectory,
    UnsupportedScene,
    require_finite,
)
from engine_models.mechanics.start import start_state
from engine_models.scene.scene import Scene
from engine_models.watch import tell
from reference_solver.mechanism.data import GROUND, ConstantSpeed, MechanismData, Point, Torque

#: Allowed error of the rows after a step in m and rad, and the largest number of corrections in a step.
CLOSED, MOST_CORRECTIONS = 1e-14, 50


@dataclass(frozen=True)
class Rattle(Engine):
    """RATTLE with equal steps, of order 2; it has no settings."""

    order = 2

    def check(self, scene: Scene) -> None:
        """Raise UnsupportedScene for a scene that the model does not cover."""
        of = scene.mechanism
        if of.loose or of.springs or of.torsions or of.loads:
            raise UnsupportedScene("rattle has no clearance, springs or loads")
        if any(guide.body_i != GROUND for guide in of.guides):
            raise UnsupportedScene("rattle has guides on the ground only")
        torque_N_m = of.drive.law.torque_N_m if isinstance(of.drive.law, Torque) else 0.0
        if not isinstance(of.drive.law, ConstantSpeed | Torque | None) or not isinstance(torque_N_m, float):
            raise UnsupportedScene(f"rattle has no drive like that of kind '{scene.drive.kind}'")
        if of.drive.guide is not None:
            raise UnsupportedScene("rattle drives angles only")

    def simulate(self, scene: Scene, settings: RunSettings) -> Trajectory:
        """Run the scene; raise SimulationFailed if the joints cannot be closed."""
        self.check(scene)
        per_sample, step = settings.steps_per_sample(scene.end_time_s), settings.step_used_s(scene.end_time_s)
        times = np.linspace(0.0, scene.end_time_s, settings.samples + 1)
        of, motion, started = scene.mechanism, Motion(scene), time.perf_counter()
        samples = [motion.sample()]
        for sampled in times[1:]:
            for _ in range(per_sample):
                motion.advance(step)
            samples.append(motion.sample())
            tell(float(sampled))
        solve_time = time.perf_counter() - started
        position, velocity, multipliers, torque, work = map(np.array, zip(*samples, strict=True))
        row, guides = iter(multipliers.T), [guide.name for guide in of.guides if not guide.turns]
        return require_finite(
            Trajectory(
                time_s=times,
                position=position.reshape(len(times), -1, 3),
                velocity=velocity.reshape(len(times), -1, 3),
                joint_force_N={pin.name: np.stack([next(row), next(row)], axis=-1) for pin in of.pins},
                guide_force_N={guide.name: next(row) for guide in of.guides},
                guide_moment_N_m={name: next(row) for name in guides},
                driver_torque_N_m=None if of.drive.law is None else torque,
                driver_work_J=None if of.drive.law is None else work,
                step_s=step,
                steps=settings.samples * per_sample,
                solve_time_s=solve_time,
            )
        )


class Motion:
    """A mechanism at one time: its rows, its state, and the step to the next time."""

    def __init__(self, scene: Scene) -> None:
        of = scene.mechanism
        n, count = len(of.bodies), 2 * len(of.pins) + 2 * len(of.guides) + 1
        self.linear, self.cosine, self.sine = (np.zeros((count, size)) for size in (3 * n, n, n))
        rows = self._enter_all(of)
        self.linear, self.cosine, self.sine = self.linear[:rows], self.cosine[:rows], self.sine[:rows]
        self.mobility = 1 / np.array([m for b in of.bodies for m in (b.mass_kg, b.mass_kg, b.inertia_kg_m2)])
        self.drive = slice(rows - of.drive.prescribes, rows)
        self.torque = of.drive.law.torque_N_m if isinstance(of.drive.law, Torque) else 0.0
        self.force = np.tile([*of.gravity_m_s2, 0.0], n) / self.mobility
        self.driven = 3 * of.drive.body + 2
        self.force[self.driven] += self.torque
        self.q, self.v = map(np.ravel, start_state(scene))
        self.target, self.rate = np.zeros(rows), np.zeros(rows)
        self.target, self.rate[self.drive] = self._gap(), self.v[self.driven]
        self.multipliers, self.work_J = np.zeros(rows), 0.0
        self._look()

    def _enter_all(self, of: MechanismData) -> int:
        """Enter rows: two a pin, one a guide, one of each that keeps an angle, the drive; return how many."""
        row = 0
        for pin in of.pins:
            for direction in ((1.0, 0.0), (0.0, 1.0)):
                self._enter(row, pin.body_i, pin.point_i, direction, -1)
                self._enter(row, pin.body_j, pin.point_j, direction, 1)
                row += 1
        for guide in of.guides:
            left = -math.sin(guide.angle_rad), math.cos(guide.angle_rad)
            self._enter(row, guide.body_j, guide.point_j, left, 1)
            row += 1
        keeping = [guide.body_j for guide in of.guides if not guide.turns]
        for body in [*keeping, *([of.drive.body] if of.drive.prescribes else [])]:
            self.linear[row, 3 * body + 2] = 1.0
            row += 1
        return row

    def _enter(self, row: int, body: int, point: Point, direction: Point, sign: int) -> None:
        """Enter where a point of a body is along a direction; that of the ground is in the target."""
        if body == GROUND:
            return
        (a, b), (x, y) = point, direction
        self.linear[row, 3 * body : 3 * body + 2] += sign * x, sign * y
        self.cosine[row, body] += sign * (x * a + y * b)
        self.sine[row, body] += sign * (y * a - x * b)

    def _look(self) -> None:
        """Compute G and (G M^-1 G^T)^-1 at the present positions."""
        turned = self.q[2::3]
        self.gradient = self.linear.copy()
        self.gradient[:, 2::3] += self.sine * np.cos(turned) - self.cosine * np.sin(turned)
        try:
            self.inverse = np.linalg.inv(self.gradient * self.mobility @ self.gradient.T)
        except np.linalg.LinAlgError:
            raise SimulationFailed(
                f"singular position, driven body at {self.q[self.driven]:.6g} rad"
            ) from None

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
            raise SimulationFailed(f"joints stay open by {np.abs(gap).max():.3g} m")
        self._look()
        kicked = kicked + half * self.mobility * self.force
        self.multipliers = self.inverse @ (self.rate - self.gradient @ kicked) / half
        self.v = kicked + half * self.mobility * (self.multipliers @ self.gradient)
        driving = (pull + self.multipliers) @ self.rate
        self.work_J += half * driving + self.torque * (self.q - before)[self.driven]

    def _gap(self) -> FloatArray:
        turned = self.q[2::3]
        return self.linear @ self.q + self.cosine @ np.cos(turned) + self.sine @ np.sin(turned) - self.target

    def sample(self) -> tuple[FloatArray, FloatArray, FloatArray, float, float]:
        """Return q, q', the multipliers that keep the rows closed, the driver torque and its work."""
        turned = self.q[2::3]
        bend = (self.cosine * np.cos(turned) + self.sine * np.sin(turned)) @ self.v[2::3] ** 2
        multipliers = self.inverse @ (bend - self.gradient @ (self.mobility * self.force))
        return self.q, self.v, multipliers, self.torque + sum(multipliers[self.drive]), self.work_J
