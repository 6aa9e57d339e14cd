"""What scenes are turned into: guides, loads and a drive against equations of their own.

A crank-slider of ideal joints has one freedom, its crank's angle: M(a) a'' + M'(a)/2 a'^2 = Q, with M and M'
from places of centres of mass by complex numbers in axes along and across the guide.
"""

import cmath
import math
from collections.abc import Callable, Mapping
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from engine_models.engine import FloatArray, RunSettings, Trajectory
from engine_models.mechanics.energy import energy_balance_residual_J, energy_in_play_J
from engine_models.mechanics.states import observed
from engine_models.reference.engine import ReferenceEngine
from engine_models.scene.library import ideal_free
from engine_models.scene.scene import Scene
from tests.helpers.crank_sliders import crank_slider

SHARP = ReferenceEngine(method="dop853", step_tolerance=1e-12)
#: What runs by DOP853 at 1e-12 leave of the energy in play.
LEDGER = 1e-9
ALPHA, OFFSET = 0.3, 0.02
#: Gravity's own direction is neither along nor across the guide.
GENERAL: dict[str, object] = {
    "slider.guide_angle_rad": ALPHA,
    "slider.guide_offset_m": OFFSET,
    "gravity_m_s2": [1.5, -9.0],
    "end_time_s": 0.3,
    "start.crank_angle_rad": 0.7,
    "start.crank_speed_rad_s": 50.0,
}


def base(changes: Mapping[str, object]) -> Scene:
    """Return the crank-slider in a guide of its own, with changes."""
    return ideal_free().replace({**GENERAL, **changes})


def ran(of: Scene, samples: int = 30) -> Trajectory:
    """Return a sharp run, whose ledger closes."""
    run = SHARP.simulate(of, RunSettings(of.end_time_s, samples))
    assert np.abs(energy_balance_residual_J(of, run)).max() < LEDGER * energy_in_play_J(of, run)
    return run


class Path(NamedTuple):
    """Places of crank, rod and slider as complex numbers in the guide's axes, angles, and derivatives."""

    place: tuple[complex, ...]
    first: tuple[complex, ...]
    second: tuple[complex, ...]
    turn: tuple[float, ...]
    bend: tuple[float, ...]


def path(of: Scene, angle: float) -> Path:
    """Return where bodies are by the crank's angle from the guide, with derivatives by it."""
    crank, rod, slider = crank_slider(of)
    r, length, h = crank.length_m, rod.length_m, slider.guide_offset_m or 0.0
    sine = (h - r * math.sin(angle)) / length
    phi = math.asin(sine)
    phi1 = -r * math.cos(angle) / (length * math.cos(phi))
    phi2 = (r * math.sin(angle) + length * sine * phi1**2) / (length * math.cos(phi))
    u, w = cmath.exp(1j * angle), cmath.exp(1j * phi)
    arms = ((crank.centre_of_mass_m, 0.0), (r, rod.centre_of_mass_m), (r, length))
    return Path(
        tuple(a * u + b * w for a, b in arms),
        tuple(a * 1j * u + b * 1j * phi1 * w for a, b in arms),
        tuple(-a * u + b * (1j * phi2 - phi1**2) * w for a, b in arms),
        (1.0, phi1, 0.0),
        (0.0, phi2, 0.0),
    )


#: A generalised force beside gravity's, by time on the clock, the crank's angle and speed, and the path.
Extra = Callable[[float, float, float, Path], float]


def balance(of: Scene, at: Path) -> tuple[float, float, float]:
    """Return M, M'/2 and gravity's force on the crank's angle."""
    (tilt, _), (gx, gy) = of.short.guide, of.mechanism.gravity_m_s2
    weight = complex(gx, gy) * cmath.exp(-1j * tilt)
    inertia = half = force = 0.0
    for body, p1, p2, a1, a2 in zip(of.mechanism.bodies, at.first, at.second, at.turn, at.bend, strict=True):
        inertia += body.mass_kg * abs(p1) ** 2 + body.inertia_kg_m2 * a1**2
        half += body.mass_kg * (p1.conjugate() * p2).real + body.inertia_kg_m2 * a1 * a2
        force += body.mass_kg * (weight.conjugate() * p1).real
    return inertia, half, force


def turned(of: Scene, times: FloatArray, extra: Extra | None = None) -> FloatArray:
    """Return the crank's angles from +x at times; what is extra has kinks at ``TIMES`` of the clock."""
    (tilt, _), clock = of.short.guide, of.start.time_s

    def rates(t: float, y: FloatArray) -> list[float]:
        angle, speed = float(y[0]), float(y[1])
        at = path(of, angle - tilt)
        inertia, half, force = balance(of, at)
        force += extra(clock + t, angle, speed, at) if extra else 0.0
        return [speed, (force - half * speed**2) / inertia]

    y = np.array([of.short.start.crank_angle_rad, of.short.start.crank_speed_rad_s])
    found = {0.0: y[0]}
    for begin, end in pairwise(np.union1d(times, [k - clock for k in TIMES if 0 < k - clock < times[-1]])):
        y = solve_ivp(rates, (begin, end), y, "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
        found[end] = y[0]
    return np.array([found[t] for t in times])


@pytest.mark.parametrize(("offset", "angle"), [(OFFSET, 0.0), (0.0, -2.0), (-0.03, 2.5)])
def test_a_guide_may_be_anywhere(offset: float, angle: float) -> None:
    changes = {"slider.guide_offset_m": offset, "slider.guide_angle_rad": angle}
    of = base({**changes, "start.crank_angle_rad": angle + 0.4})
    run = ran(of)
    expected = turned(of, run.time_s)
    assert np.abs(run.position[:, 0, 2] - expected).max() < 1e-9
    place = np.array([path(of, each - angle).place[2] for each in expected])
    along, _ = observed(of, run)
    assert np.abs(along - place.real).max() < 1e-10
    in_frame = place * np.exp(1j * angle)
    assert np.abs(run.position[:, 2, 0] - in_frame.real).max() < 1e-10
    assert np.abs(run.position[:, 2, 1] - in_frame.imag).max() < 1e-10
    assert np.abs(place.imag - offset).max() < 1e-12, "to the left of the guide's direction"


TIMES = (0.0, 0.12, 0.2, 0.31, 0.4)
FORCES, TORQUES, LINES = (0.0, 4.0, -5.0, 3.0, 8.0), (0.1, 0.3, -0.2, 0.15, 0.15), (0.2, -0.1, 0.3, 0.1, 0.0)
QUARTERS = tuple(0.2 + math.pi / 2 * k for k in range(9))
GAS = (0.0, -40.0, -150.0, -60.0, -10.0, 5.0, -20.0, -8.0, 0.0)
#: A spline whose last two values are equal ends at rest there, and is not-a-knot at its other end.
OF_FORCE = CubicSpline(TIMES, FORCES)
OF_TORQUE = CubicSpline(TIMES, TORQUES, bc_type=("not-a-knot", (1, 0.0)))
OF_GAS = CubicSpline(QUARTERS, GAS, bc_type="periodic")
LOADED: dict[str, object] = {
    "drive": {"kind": "torque", "time_s": TIMES, "torque_N_m": LINES, "interpolation": "linear"},
    "load.slider": {
        "force_N": 1.5,
        "viscous_N_s_m": 2.0,
        "spring_N_m": 60.0,
        "free_position_m": 0.13,
        "by_time": {"time_s": TIMES, "force_N": FORCES},
        "gas": {"crank_angle_rad": QUARTERS, "force_N": GAS},
    },
    "load.rod": {"force_N": 2.0, "along_rad": 1.1, "torque_N_m": 0.05, "viscous_N_m_s": 1e-3},
    "load.crank": {"viscous_N_m_s": 2e-3, "by_time": {"time_s": TIMES, "torque_N_m": TORQUES}},
    "spring.S": {
        "between": ["ground.O", "slider.B"],
        "stiffness_N_m": 400.0,
        "free_length_m": 0.1,
        "damping_N_s_m": 3.0,
    },
    "start.time_s": 0.05,
}


def by_loads(t: float, angle: float, speed: float, at: Path) -> float:
    """Return what drive and loads do, gas over two turns and a spring to the slider among them."""
    way, rate = at.place[2].real, at.first[2].real
    gas = OF_GAS(0.2 + (angle - 0.2) % (4 * math.pi))
    along = 1.5 - 2.0 * rate * speed - 60.0 * (way - 0.13) + OF_FORCE(t) + gas
    force = 2.0 * cmath.exp(1j * (1.1 - ALPHA))
    rod = 0.05 * at.turn[1] - 1e-3 * at.turn[1] ** 2 * speed + (force.conjugate() * at.first[1]).real
    length = abs(at.place[2])
    stretch = (at.place[2].conjugate() * at.first[2]).real / length
    sprung = -(400.0 * (length - 0.1) + 3.0 * stretch * speed) * stretch
    crank = np.interp(t, TIMES, LINES) + OF_TORQUE(t) - 2e-3 * speed
    return float(along * rate + rod + crank + sprung)


def test_loads_and_drive_do_what_their_equations_say() -> None:
    of = base(LOADED)
    run = ran(of)
    expected = turned(of, run.time_s, by_loads)
    assert np.abs(run.position[:, 0, 2] - expected).max() < 1e-8
    assert np.abs(turned(of, run.time_s) - expected).max() > 1e-2, "there is something to see"
