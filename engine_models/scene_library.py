"""The scenes of the study, by name. Set R is the literature's standard case, set F its free companion."""

import math
from collections.abc import Callable

from engine_models.scene import ConstantSpeedDrive, FreeDrive, Link, Scene, Slider, Start, TorqueDrive

SLIDER = Slider(mass_kg=0.14, inertia_kg_m2=1e-4)


def crank(inertia_kg_m2: float) -> Link:
    """Return the crank both sets share, with the set's own inertia."""
    return Link(length_m=0.05, mass_kg=0.30, inertia_kg_m2=inertia_kg_m2, centre_of_mass_m=0.025)


def rod(inertia_kg_m2: float) -> Link:
    """Return the rod both sets share, with the set's own inertia."""
    return Link(length_m=0.12, mass_kg=0.21, inertia_kg_m2=inertia_kg_m2, centre_of_mass_m=0.06)


def ideal_free() -> Scene:
    """Set F: ten turns a second to start with, then on its own under gravity."""
    return Scene(
        name="ideal-free",
        end_time_s=1.0,
        gravity_m_s2=9.81,
        crank=crank(1e-5),
        rod=rod(2.5e-5),
        slider=SLIDER,
        start=Start(crank_angle_rad=0.0, crank_speed_rad_s=2 * math.pi * 10),
        drive=FreeDrive(kind="free"),
    )


def ideal_driven() -> Scene:
    """Set R: two revolutions at constant 5000 rpm."""
    return Scene(
        name="ideal-driven",
        end_time_s=0.024,
        gravity_m_s2=9.81,
        crank=crank(1e-4),
        rod=rod(2.5e-4),
        slider=SLIDER,
        start=Start(crank_angle_rad=0.0, crank_speed_rad_s=2 * math.pi * 5000 / 60),
        drive=ConstantSpeedDrive(kind="constant-speed"),
    )


def ideal_torque() -> Scene:
    """Set F's bodies, started from rest by a constant torque that lifts them over the top."""
    return Scene(
        name="ideal-torque",
        end_time_s=0.3,
        gravity_m_s2=9.81,
        crank=crank(1e-5),
        rod=rod(2.5e-5),
        slider=SLIDER,
        start=Start(crank_angle_rad=0.5, crank_speed_rad_s=0.0),
        drive=TorqueDrive(kind="torque", torque_N_m=0.3),
    )


SCENES: dict[str, Callable[[], Scene]] = {
    "ideal-free": ideal_free,
    "ideal-driven": ideal_driven,
    "ideal-torque": ideal_torque,
}
