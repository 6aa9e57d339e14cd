"""What the rivals solve, in plain numbers: a crank-slider, free, driven, and with clearance at its slider."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

#: Lengths and centres of mass from each link's first pin in m, masses in kg, gravity in m/s^2.
CRANK_M, ROD_M, CRANK_CENTRE_M, ROD_CENTRE_M = 0.05, 0.12, 0.025, 0.06
CRANK_KG, ROD_KG, SLIDER_KG, GRAVITY = 0.30, 0.21, 0.14, 9.81
#: Inertias of crank and rod about their centres of mass in kg m^2, free and driven.
FREE_INERTIAS, DRIVEN_INERTIAS = (1e-5, 2.5e-5), (1e-4, 2.5e-4)
#: Both links begin along the guide; the crank's speed in rad/s, and how long the motion is followed in s.
FREE_SPEED, DRIVEN_SPEED = 20 * math.pi, 2 * math.pi * 5000 / 60
FREE_END_S, DRIVEN_END_S, CLEARANCE_END_S, CLEARANCE_DRIVEN_END_S = 1.0, 0.024, 0.071, 0.029
#: The slider's pin of steel in its bearing; Hertz's stiffness in N/m^1.5, as the scene has it.
CLEARANCE_M, BEARING_M, RESTITUTION = 5e-4, 0.01, 0.9
STIFFNESS = 2 / 3 * 207e9 / (1 - 0.3**2) * math.sqrt(BEARING_M * (BEARING_M - CLEARANCE_M) / CLEARANCE_M)

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Answer:
    """The solve's own time, its steps, and what was asked for at equally spaced times, (samples + 1,)."""

    seconds: float
    steps: int
    signal: FloatArray


def ideal_acceleration(m: ModuleType) -> Callable[..., object]:
    """Return the crank's acceleration by its angle and speed, free, with sin, cos and sqrt of a module."""
    crank, rod = FREE_INERTIAS
    own = crank + CRANK_KG * CRANK_CENTRE_M**2 + ROD_KG * CRANK_M**2
    swung, coupled = rod + ROD_KG * ROD_CENTRE_M**2, ROD_KG * CRANK_M * ROD_CENTRE_M
    lifted = CRANK_KG * CRANK_CENTRE_M + ROD_KG * CRANK_M

    def acceleration(angle, speed):  # type: ignore[no-untyped-def]  # floats, or a package's expressions
        s, c = m.sin(angle), m.cos(angle)
        rod_s = -CRANK_M / ROD_M * s
        rod_c = m.sqrt(1.0 - rod_s * rod_s)
        turn = -CRANK_M * c / (ROD_M * rod_c)
        bend = CRANK_M * s / (ROD_M * rod_c) + turn * turn * rod_s / rod_c
        slide = -CRANK_M * s - ROD_M * rod_s * turn
        curve = -CRANK_M * c - ROD_M * (rod_c * turn * turn + rod_s * bend)
        along, across = c * rod_c + s * rod_s, s * rod_c - c * rod_s
        inertia = own + swung * turn * turn + 2.0 * coupled * along * turn + SLIDER_KG * slide * slide
        change = swung * turn * bend + SLIDER_KG * slide * curve
        change = change + coupled * (along * bend - across * (1.0 - turn) * turn)
        weight = GRAVITY * (lifted * c + ROD_KG * ROD_CENTRE_M * rod_c * turn)
        return -(change * speed * speed + weight) / inertia

    return acceleration


def slider_at(angle: FloatArray) -> FloatArray:
    """Return the slider's position on its guide by the crank's angle."""
    return np.asarray(CRANK_M * np.cos(angle) + np.sqrt(ROD_M**2 - (CRANK_M * np.sin(angle)) ** 2))


def open_accelerations(m: ModuleType) -> Callable[..., object]:
    """Return the accelerations of crank, rod and slider, free, where a force pulls at the rod's end.

    Its arguments are both angles and speeds and the force's components; minus the force is on the slider.
    """
    crank, rod = FREE_INERTIAS
    own = crank + CRANK_KG * CRANK_CENTRE_M**2 + ROD_KG * CRANK_M**2
    swung, coupled = rod + ROD_KG * ROD_CENTRE_M**2, ROD_KG * CRANK_M * ROD_CENTRE_M
    lifted = CRANK_KG * CRANK_CENTRE_M + ROD_KG * CRANK_M

    def accelerations(angle, rod_angle, speed, rod_speed, x, y):  # type: ignore[no-untyped-def]
        s, c, rod_s, rod_c = m.sin(angle), m.cos(angle), m.sin(rod_angle), m.cos(rod_angle)
        both, across = coupled * (c * rod_c + s * rod_s), coupled * (s * rod_c - c * rod_s)
        at_crank = CRANK_M * (y * c - x * s) - GRAVITY * lifted * c - across * rod_speed * rod_speed
        at_rod = ROD_M * (y * rod_c - x * rod_s) - GRAVITY * ROD_KG * ROD_CENTRE_M * rod_c
        at_rod = at_rod + across * speed * speed
        whole = own * swung - both * both
        return (
            (swung * at_crank - both * at_rod) / whole,
            (own * at_rod - both * at_crank) / whole,
            -x / SLIDER_KG,
        )

    return accelerations


def driven_accelerations(m: ModuleType) -> Callable[..., object]:
    """Return the accelerations of rod and slider at the driven crank's angle, with a force as above."""
    swung = DRIVEN_INERTIAS[1] + ROD_KG * ROD_CENTRE_M**2
    carried = ROD_KG * ROD_CENTRE_M * CRANK_M * DRIVEN_SPEED**2

    def accelerations(angle, rod_angle, x, y):  # type: ignore[no-untyped-def]
        s, c, rod_s, rod_c = m.sin(angle), m.cos(angle), m.sin(rod_angle), m.cos(rod_angle)
        at_rod = ROD_M * (y * rod_c - x * rod_s) - GRAVITY * ROD_KG * ROD_CENTRE_M * rod_c
        return (at_rod + carried * (s * rod_c - c * rod_s)) / swung, -x / SLIDER_KG

    return accelerations
