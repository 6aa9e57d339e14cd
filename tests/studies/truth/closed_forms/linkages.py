"""A triple pendulum and a four-bar linkage in minimal coordinates, derived apart from the solver."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

FloatArray = NDArray[np.float64]
GRAVITY = 9.81


@dataclass(frozen=True)
class Rod:
    """A link with its centre of mass at ``s`` from its first pin."""

    length: float
    mass: float
    inertia: float
    s: float


def integrate(derivative: object, state: FloatArray, times: FloatArray) -> FloatArray:
    """Return the states (n, k) at the times, each the end of a DOP853 run near round-off."""
    states = [state]
    for span in pairwise(times):
        run = solve_ivp(derivative, span, states[-1], "DOP853", rtol=1e-13, atol=1e-14)
        states.append(run.y[:, -1])
    return np.array(states)


@dataclass(frozen=True)
class TriplePendulum:
    """Three rods in a row below the frame; coordinates are the rods' absolute angles from +x."""

    rods: tuple[Rod, Rod, Rod]

    def _reach(self) -> FloatArray:
        """Return a[k, i]: how far rod i carries the centre of mass of rod k along its own direction."""
        lengths = np.array([rod.length for rod in self.rods])
        return np.tril(np.tile(lengths, (3, 1)), -1) + np.diag([rod.s for rod in self.rods])

    def angular_acceleration(self, theta: FloatArray, rate: FloatArray) -> FloatArray:
        """Return theta'' (3,) from Lagrange's equations of the second kind."""
        a = self._reach()
        m = np.array([rod.mass for rod in self.rods])
        coupling = np.einsum("k,ki,kj->ij", m, a, a)
        difference = theta[:, None] - theta[None, :]
        mass = coupling * np.cos(difference) + np.diag([rod.inertia for rod in self.rods])
        force = -(coupling * np.sin(difference)) @ rate**2 - GRAVITY * (m @ a) * np.cos(theta)
        return np.asarray(np.linalg.solve(mass, force))

    def centres(self, theta: FloatArray) -> FloatArray:
        """Return the centres of mass (3, 2)."""
        return np.asarray(self._reach() @ np.column_stack([np.cos(theta), np.sin(theta)]))

    def centre_rates(self, theta: FloatArray, rate: FloatArray) -> FloatArray:
        """Return the velocities of the centres of mass (3, 2)."""
        return np.asarray(self._reach() @ (rate[:, None] * np.column_stack([-np.sin(theta), np.cos(theta)])))

    def hanging_force(self, theta: FloatArray, rate: FloatArray) -> FloatArray:
        """Return the force (2,) of the frame on the first rod: all the momentum's rate, less gravity."""
        along = np.column_stack([np.cos(theta), np.sin(theta)])
        across = np.column_stack([-np.sin(theta), np.cos(theta)])
        directions = self.angular_acceleration(theta, rate)[:, None] * across - rate[:, None] ** 2 * along
        acceleration = self._reach() @ directions
        masses = np.array([rod.mass for rod in self.rods])
        return np.asarray(masses @ (acceleration + np.array([0.0, GRAVITY])))

    def motion(self, theta: FloatArray, rate: FloatArray, times: FloatArray) -> FloatArray:
        """Return (n, 6): angles and their rates."""

        def derivative(_: float, y: FloatArray) -> FloatArray:
            return np.concatenate([y[3:], self.angular_acceleration(y[:3], y[3:])])

        return integrate(derivative, np.concatenate([theta, rate]), times)


@dataclass(frozen=True)
class FourBar:
    """Crank at the origin, rocker at (base, 0), coupler between; the coordinate is the crank's angle."""

    crank: Rod
    coupler: Rod
    rocker: Rod
    base: float

    def angles(self, theta: float) -> FloatArray:
        """Return the angles (3,) of crank, coupler, rocker by intersecting two circles (coupler above)."""
        pin = self.crank.length * np.array([np.cos(theta), np.sin(theta)])
        gap = np.array([self.base, 0.0]) - pin
        distance = np.hypot(*gap)
        b, c = self.coupler.length, self.rocker.length
        opening = np.arccos((b**2 + distance**2 - c**2) / (2 * b * distance))
        coupler = np.arctan2(gap[1], gap[0]) + opening
        end = pin + b * np.array([np.cos(coupler), np.sin(coupler)])
        return np.array([theta, coupler, np.arctan2(end[1], end[0] - self.base)])

    def slopes(self, theta: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the angles and their first and second derivatives by theta, (3,) each, from loop closure."""
        angles = self.angles(theta)
        lengths = np.array([self.crank.length, self.coupler.length, -self.rocker.length])
        cos, sin = lengths * np.cos(angles), lengths * np.sin(angles)
        matrix = np.array([[-sin[1], -sin[2]], [cos[1], cos[2]]])
        first = np.array([1.0, *np.linalg.solve(matrix, [sin[0], -cos[0]])])
        second = np.array([0.0, *np.linalg.solve(matrix, [cos @ first**2, sin @ first**2])])
        return angles, first, second

    def bodies(self, theta: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return X, dX/dtheta, d2X/dtheta2, each (3, 3): crank, coupler, rocker by (x, y, phi)."""
        angles, first, second = self.slopes(theta)
        along, across = (
            np.column_stack([np.cos(angles), np.sin(angles)]),
            np.column_stack([-np.sin(angles), np.cos(angles)]),
        )
        velocity, bend = first[:, None] * across, second[:, None] * across - first[:, None] ** 2 * along
        reach = np.diag([self.crank.s, self.coupler.s, self.rocker.s])
        reach[1, 0] = self.crank.length
        origin = np.array([[0.0, 0.0], [0.0, 0.0], [self.base, 0.0]])
        return (
            np.column_stack([origin + reach @ along, angles]),
            np.column_stack([reach @ velocity, first]),
            np.column_stack([reach @ bend, second]),
        )

    def motion(self, theta: float, rate: float, times: FloatArray) -> FloatArray:
        """Return (n, 2): crank angle and speed, from Eksergian's equation under gravity."""
        masses = np.array(
            [[rod.mass, rod.mass, rod.inertia] for rod in (self.crank, self.coupler, self.rocker)]
        )

        def derivative(_: float, y: FloatArray) -> list[float]:
            X_1, X_2 = self.bodies(y[0])[1:]
            J, half_slope = np.sum(masses * X_1**2), np.sum(masses * X_1 * X_2)
            return [float(y[1]), -(half_slope * y[1] ** 2 + GRAVITY * masses[:, 0] @ X_1[:, 1]) / J]

        return integrate(derivative, np.array([theta, rate]), times)
