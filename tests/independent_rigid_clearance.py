"""The driven crank-slider with a rigid clearance joint at B, in minimal coordinates, apart from the solver.

Coordinates are the rod's angle and the slider's position; the crank's angle is speed times t. In flight the
rod is a pendulum on a pivot that is carried around, and the slider moves freely.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class ClearanceCrankSlider:
    """Set R: lengths in m, masses in kg, the rod's central inertia in kg m^2, the speed in rad/s."""

    clearance: float
    restitution: float
    crank_length: float = 0.05
    rod_length: float = 0.12
    rod_mass: float = 0.21
    rod_inertia: float = 2.5e-4
    slider_mass: float = 0.14
    speed: float = 2 * np.pi * 5000 / 60
    gravity: float = 9.81

    @property
    def masses(self) -> FloatArray:
        """Return the diagonal mass matrix of rod angle (about the crank pin) and slider position."""
        return np.array([self.rod_inertia + self.rod_mass * (self.rod_length / 2) ** 2, self.slider_mass])

    def crank_pin(self, t: float) -> tuple[FloatArray, FloatArray]:
        """Return the crank pin's position and velocity."""
        along = np.array([np.cos(self.speed * t), np.sin(self.speed * t)])
        return self.crank_length * along, self.crank_length * self.speed * np.array([-along[1], along[0]])

    def derivative(self, t: float, y: FloatArray) -> list[float]:
        """Return the rates of y = (angle, position, and both rates) in flight."""
        across = np.array([-np.sin(y[0]), np.cos(y[0])])
        pull = -(self.speed**2) * self.crank_pin(t)[0] + np.array([0.0, self.gravity])
        angular = -self.rod_mass * self.rod_length / 2 * (across @ pull) / self.masses[0]
        return [float(y[2]), float(y[3]), float(angular), 0.0]

    def separation(self, t: float, y: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return d from bearing (rod) to pin (slider), its rate, and the direction across the rod."""
        pin, rate = self.crank_pin(t)
        along = np.array([np.cos(y[0]), np.sin(y[0])])
        across = np.array([-along[1], along[0]])
        d = np.array([y[1], 0.0]) - pin - self.rod_length * along
        return d, np.array([y[3], 0.0]) - rate - self.rod_length * y[2] * across, across

    def impacts(self, count: int, start: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return time, approach speed and slider position (count, 3) of impacts from t = 0, and m_eff."""

        def wall(t: float, y: FloatArray) -> float:
            d = self.separation(t, y)[0]
            return float(d @ d - self.clearance**2) / self.clearance

        wall.terminal, wall.direction = True, 1.0  # type: ignore[attr-defined]
        t, y, out, masses = 0.0, start, [], []
        for _ in range(count):
            run = solve_ivp(
                self.derivative, (t, 1.0), y, "DOP853", rtol=1e-13, atol=1e-15, events=wall, max_step=2e-6
            )
            t, y = float(run.t[-1]), run.y[:, -1].copy()
            d, rate, across = self.separation(t, y)
            n = d / np.linalg.norm(d)
            row = np.array([-self.rod_length * (n @ across), n[0]])
            mass = 1 / (row @ (row / self.masses))
            out.append((t, n @ rate, y[1]))
            masses.append(mass)
            y[2:] -= (1 + self.restitution) * (n @ rate) * mass * row / self.masses
        return np.array(out), np.array(masses)
