"""The gallery's mechanisms: a wheel dropped in its bearing, or turning on a dry one, and crank-sliders."""

import math
from collections.abc import Mapping

from pydantic import BaseModel

from engine_models.scene.data import Kind
from engine_models.scene.drives import FreeDrive
from engine_models.scene.library import BEARING_RADIUS_M, clearance, ideal_driven, ideal_free
from engine_models.scene.scene import (
    BodyState,
    Clearance,
    Clearances,
    ContactLaw,
    Friction,
    Link,
    Scene,
    Start,
)

#: A wheel about its own centre of mass: dropped in a bearing at the pin, it moves up and down alone, and
#: turning on a dry bearing it has a place where it stays.
WHEEL = Link(length_m=0.12, mass_kg=0.21, inertia_kg_m2=2.5e-4, centre_of_mass_m=0.0)
GRAVITY_M_S2 = 9.81
#: It falls through its clearance in 10 ms, a thousand steps.
CLEARANCE_M, WHEEL_STEP_S = 5e-4, 1e-5
#: A turn of set R's crank, and the everyday steps in it.
TURN_S, STEPS_A_TURN = 60 / 5000, 2000


def wheel(
    name: str,
    end_time_s: float,
    *,
    law: ContactLaw = "hertz",
    stiffness: float | None = 1e9,
    radial_clearance_m: float = CLEARANCE_M,
    restitution: float | None = None,
    friction: Friction | None = None,
    gravity_m_s2: float = GRAVITY_M_S2,
    place_m: tuple[float, float] = (0.0, 0.0),
    spin_rad_s: float = 0.0,
) -> Scene:
    """Return a wheel in its bearing, begun at a place from the bearing's centre with a spin alone."""
    zeros = dict.fromkeys(BodyState.model_fields, 0.0)
    x, y = place_m
    state = BodyState(**zeros | {"x_m": x, "y_m": y, "angular_velocity_rad_s": spin_rad_s})
    return Scene(
        name=name,
        end_time_s=end_time_s,
        gravity_m_s2=gravity_m_s2,
        crank=WHEEL,
        start=Start(crank_angle_rad=0.0, crank_speed_rad_s=spin_rad_s, crank=state),
        drive=FreeDrive(kind="free"),
        clearance=Clearances(
            O=Clearance(
                radial_clearance_m=radial_clearance_m,
                bearing_radius_m=BEARING_RADIUS_M,
                law=law,
                stiffness=stiffness,
                restitution=restitution,
                friction=friction,
            )
        ),
    )


def turning_wheel(
    name: str,
    end_time_s: float,
    coefficient: float,
    *,
    regularisation_speed_m_s: float = 1e-3,
    radial_clearance_m: float = CLEARANCE_M,
    stiffness_N_m: float = 1e7,
    spin_rad_s: float = 100.0,
) -> Scene:
    """Return a wheel that turns on a dry bearing, begun where it stays: atan(mu) up the wall.

    It stays there as long as it swings along the wall, sqrt(g/c), slower than into it, sqrt(K/m): friction
    couples the two, and makes them flutter where they come near each other.
    """
    climb = math.atan(coefficient)
    depth = WHEEL.mass_kg * GRAVITY_M_S2 * math.cos(climb) / stiffness_N_m
    distance = radial_clearance_m + depth
    return wheel(
        name,
        end_time_s,
        law="linear",
        stiffness=stiffness_N_m,
        radial_clearance_m=radial_clearance_m,
        friction=Friction(
            law="saturated-linear",
            coefficient=coefficient,
            regularisation_speed_m_s=regularisation_speed_m_s,
        ),
        place_m=(-distance * math.sin(climb), -distance * math.cos(climb)),
        spin_rad_s=spin_rad_s,
    )


def hanging(name: str, end_time_s: float, coefficient: float) -> Scene:
    """Return a pendulum on a dry bearing of a spring and a damper, let go 10 degrees off the vertical.

    Friction holds it where its lever is below mu/sqrt(1 + mu^2) of the pin's radius: 2.7 degrees off. While
    it sticks, the pin rolls up its wall.
    """
    radial, stiffness, angle = 1e-4, 1e6, math.radians(10) - math.pi / 2
    link = WHEEL.model_copy(update={"centre_of_mass_m": WHEEL.length_m / 2})
    distance = radial + link.mass_kg * GRAVITY_M_S2 / stiffness
    zeros = dict.fromkeys(BodyState.model_fields, 0.0)
    x, y = link.centre_of_mass_m * math.cos(angle), link.centre_of_mass_m * math.sin(angle) - distance
    state = BodyState(**zeros | {"x_m": x, "y_m": y, "angle_rad": angle})
    joint = Clearance(
        radial_clearance_m=radial,
        bearing_radius_m=BEARING_RADIUS_M,
        law="kelvin-voigt",
        stiffness=stiffness,
        damping_N_s_m=200.0,
        friction=Friction(law="saturated-linear", coefficient=coefficient, regularisation_speed_m_s=1e-4),
    )
    return Scene(
        name=name,
        end_time_s=end_time_s,
        gravity_m_s2=GRAVITY_M_S2,
        crank=link,
        start=Start(crank_angle_rad=angle, crank_speed_rad_s=0.0, crank=state),
        drive=FreeDrive(kind="free"),
        clearance=Clearances(O=joint),
    )


def unchecked(part: Kind, changes: Mapping[str, object]) -> Kind:
    """Return a scene, or a part of one, with changes that nothing checks: a case may be what no scene is.

    No engine gets to see it (see ``studies.extremes.study``).
    """
    return BaseModel.model_copy(part, update=changes)


def _changed(scene: Scene, name: str, end_time_s: float, **changes: object) -> Scene:
    """Return a scene with changes."""
    return unchecked(scene, {"name": name, "end_time_s": end_time_s, **changes})


def driven(
    name: str, end_time_s: float, *, rpm: float = 5000.0, angle_rad: float = 0.0, **changes: object
) -> Scene:
    """Return set R at a speed, from a crank angle."""
    start = Start(crank_angle_rad=angle_rad, crank_speed_rad_s=2 * math.pi * rpm / 60)
    return _changed(ideal_driven(), name, end_time_s, start=start, **changes)


def driven_loose(name: str, end_time_s: float, radial_clearance_m: float, rpm: float = 5000.0) -> Scene:
    """Return set R at a speed with clearance at the rod-slider pin and Lankarani-Nikravesh's law."""
    return driven(name, end_time_s, rpm=rpm, clearance=Clearances(B=clearance(radial_clearance_m)))


def free(name: str, end_time_s: float, **changes: object) -> Scene:
    """Return set F with changes."""
    return _changed(ideal_free(), name, end_time_s, **changes)


def rod(scene: Scene, **changes: float) -> Link:
    """Return a scene's rod with changes; one of another length has its centre of mass in the middle."""
    _, link, _ = scene.crank_slider()
    if "length_m" in changes:
        changes["centre_of_mass_m"] = changes["length_m"] / 2
    return unchecked(link, changes)
