"""The crank-slider in the places of its pins in their bearings: coordinates apart from the solver's.

w = (theta, d_O, d_A, d_B): the crank's angle, and pin centre less bearing centre of every joint; those of
ideal joints are zero. The rod's angle and the slider follow: its pin B lies on the guide, y = 0. A pendulum
has w = (theta, d_O).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from engine_models.scene.scene import Clearance, Scene
from tests.independent.prescribed_speed import prescribed_speed, speed_at_start
from tests.independent.slider_load import PARTS, slider_load, torque_on_crank

FloatArray = NDArray[np.float64]
PLACES = {"O": slice(1, 3), "A": slice(3, 5), "B": slice(5, 7)}


def along(angle: float) -> FloatArray:
    return np.array([np.cos(angle), np.sin(angle)])


def across(angle: float) -> FloatArray:
    return np.array([-np.sin(angle), np.cos(angle)])


@dataclass(frozen=True)
class Dynamics:
    """M w'' = Q of no contact force; the rows of the angular velocities; the slider's place, or a pendulum's.

    That of a pendulum is its centre's along x. ``Q`` is without the torque of a prescribed speed.
    ``load_W`` are the powers (4,) of the slider's load by ``PARTS``.
    """

    M: FloatArray
    Q: FloatArray
    crank: FloatArray
    rod: FloatArray
    place_m: float
    load_W: FloatArray


class Pins:
    """One scene in the coordinates w."""

    def __init__(self, scene: Scene) -> None:
        self.scene, self.size = scene, 7 if scene.is_crank_slider else 3
        self.loose = scene.joints_with_clearance
        self.motion, self.load_at = prescribed_speed(scene), slider_load(scene)
        #: The coordinates that move on their own: a driven crank does not, nor do ideal joints.
        crank = [0] if self.motion is None else []
        self.free = crank + [k for name in self.loose for k in range(7)[PLACES[name]]]

    def clearance(self, name: str) -> Clearance:
        clearance = getattr(self.scene.clearance, name)
        assert isinstance(clearance, Clearance)
        return clearance

    def dynamics(self, w: FloatArray, rate: FloatArray) -> Dynamics:
        """Return the equations of motion, from the bodies' velocities J w' and accelerations J w'' + bias."""
        unit, crank = np.eye(self.size), self.scene.crank
        s, r = crank.centre_of_mass_m, crank.length_m
        theta, omega = w[0], rate[0]
        centre = unit[1:3] + s * np.outer(across(theta), unit[0])
        J, bias = [*centre, unit[0]], [*(-s * omega**2 * along(theta)), 0.0]
        masses = [crank.mass_kg, crank.mass_kg, crank.inertia_kg_m2]
        slope, load_W = np.zeros(self.size), np.zeros(len(PARTS))
        place = w[1] + s * np.cos(theta)
        if self.scene.is_crank_slider:
            _, rod, block = self.scene.crank_slider()
            length, d = rod.length_m, rod.centre_of_mass_m
            pin = w[1:3] + r * along(theta) + w[3:5]
            J_pin = unit[1:3] + r * np.outer(across(theta), unit[0]) + unit[3:5]
            bias_pin = -r * omega**2 * along(theta)
            # sin(phi) = -(A_y + d_By)/L, differentiated twice.
            phi = float(np.arcsin(-(pin[1] + w[6]) / length))
            slope = -(J_pin[1] + unit[6]) / (length * np.cos(phi))
            turn = slope @ rate
            phi_bias = (np.sin(phi) * turn**2 - bias_pin[1] / length) / np.cos(phi)
            for reach, axes in ((d, (0, 1)), (length, (0,))):
                for k in axes:
                    J.append(J_pin[k] + reach * across(phi)[k] * slope)
                    bias.append(bias_pin[k] + reach * (across(phi)[k] * phi_bias - along(phi)[k] * turn**2))
            J[-1] = J[-1] + unit[5]
            J.append(slope)
            bias.append(phi_bias)
            masses += [rod.mass_kg, rod.mass_kg, block.mass_kg, rod.inertia_kg_m2]
            place = pin[0] + length * np.cos(phi) + w[5]
        rows, m = np.array(J), np.array(masses)
        force = np.zeros(len(m))
        force[[1, 4][: len(m) // 3]] = -self.scene.gravity_m_s2 * m[[1, 4][: len(m) // 3]]
        force[2] = torque_on_crank(self.scene, omega)
        if self.scene.is_crank_slider:
            speed = float(rows[5] @ rate)
            load = self.load_at(theta, float(place), speed)
            force[5] = sum(load.values())
            load_W = speed * np.array([load[part] for part in PARTS])
        Q = rows.T @ (force - m * bias)
        return Dynamics((rows.T * m) @ rows, Q, unit[0], slope, float(place), load_W)

    def normal(self, name: str, w: FloatArray) -> FloatArray:
        """Return the row (size,) of a joint's speed outwards."""
        row = np.zeros(self.size)
        d = w[PLACES[name]]
        row[PLACES[name]] = d / np.hypot(*d)
        return row

    def sliding(self, name: str, w: FloatArray, dynamics: Dynamics) -> FloatArray:
        """Return the row (size,) of the pin surface's speed against the bearing's, counter-clockwise."""
        row, n = np.zeros(self.size), self.normal(name, w)[PLACES[name]]
        row[PLACES[name]] = -n[1], n[0]
        bearing = self.clearance(name).bearing_radius_m
        pin = bearing - self.clearance(name).radial_clearance_m
        none = np.zeros(self.size)
        inner, outer = {
            "O": (dynamics.crank, none),
            "A": (dynamics.rod, dynamics.crank),
            "B": (none, dynamics.rod),
        }[name]
        return np.asarray(row + pin * inner - bearing * outer)

    def start(self) -> tuple[FloatArray, FloatArray]:
        """Return w and its rate with all pins in the middle at rest there: the ideal joints' motion."""
        w, rate = np.zeros(self.size), np.zeros(self.size)
        w[0], rate[0] = self.scene.start.crank_angle_rad, speed_at_start(self.scene)
        return w, rate
