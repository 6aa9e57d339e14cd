"""The scenes of the study, by name. Set R is the literature's standard case, set F its free counterpart.

Scenes of other mechanisms are files beside this one: see ``mechanisms``.
"""

import math
from collections.abc import Callable

from engine_models.scene.drives import (
    ConstantSpeedDrive,
    Drive,
    FluctuatingDrive,
    FreeDrive,
    MotorDrive,
    RampDrive,
    TorqueDrive,
)
from engine_models.scene.loads import Gas, Loads, SliderLoad
from engine_models.scene.scene import Clearance, Clearances, ContactLaw, Friction, Link, Scene, Slider, Start

SLIDER = Slider(mass_kg=0.14, inertia_kg_m2=1e-4)
#: The sets' inertias of crank and rod about their centres of mass, in kg m^2.
SET_F, SET_R = (1e-5, 2.5e-5), (1e-4, 2.5e-4)


def _crank_slider(
    name: str, end_time_s: float, inertias_kg_m2: tuple[float, float], start: Start, drive: Drive
) -> Scene:
    """Return a crank-slider of the bodies that both sets share, with inertias of its own."""
    crank, rod = inertias_kg_m2
    return Scene(
        name=name,
        end_time_s=end_time_s,
        gravity_m_s2=9.81,
        crank=Link(length_m=0.05, mass_kg=0.30, inertia_kg_m2=crank, centre_of_mass_m=0.025),
        rod=Link(length_m=0.12, mass_kg=0.21, inertia_kg_m2=rod, centre_of_mass_m=0.06),
        slider=SLIDER,
        start=start,
        drive=drive,
    )


def ideal_free() -> Scene:
    """Set F: ten turns a second to start with, then on its own under gravity."""
    start = Start(crank_angle_rad=0.0, crank_speed_rad_s=2 * math.pi * 10)
    return _crank_slider("ideal-free", 1.0, SET_F, start, FreeDrive(kind="free"))


def ideal_driven() -> Scene:
    """Set R: two revolutions at constant 5000 rpm."""
    start = Start(crank_angle_rad=0.0, crank_speed_rad_s=2 * math.pi * 5000 / 60)
    return _crank_slider("ideal-driven", 0.024, SET_R, start, ConstantSpeedDrive(kind="constant-speed"))


def ideal_torque() -> Scene:
    """Set F's bodies, started from rest by a constant torque that lifts them over the top."""
    start = Start(crank_angle_rad=0.5, crank_speed_rad_s=0.0)
    return _crank_slider("ideal-torque", 0.3, SET_F, start, TorqueDrive(kind="torque", torque_N_m=0.3))


def ideal_fluctuating() -> Scene:
    """Set R, its speed fluctuating by a tenth twice a revolution."""
    driven = ideal_driven()
    tenth = driven.start.crank_speed_rad_s / 10
    drive = FluctuatingDrive(kind="fluctuating", amplitude_rad_s=tenth, frequency_Hz=2 * 5000 / 60)
    return driven.model_copy(update={"name": "ideal-fluctuating", "drive": drive})


#: Bore in m; absolute pressures of suction and discharge in Pa, that of the air behind the piston being the
#: first; the volume left at the outer dead centre as a part of the swept one; the polytropic exponent.
BORE_M, SUCTION_PA, DISCHARGE_PA, DEAD_PART, POLYTROPIC = 0.03, 1e5, 6e5, 0.08, 1.3
#: Entries of the table: one every ten degrees, and the first again.
ENTRIES = 37


def gas(crank: Link, rod: Link) -> Gas:
    """Return the gas of a cylinder beyond the slider's outer dead centre, at crank angle 0.

    Going inwards the gas left expands to the suction pressure, and the cylinder fills; going outwards it is
    compressed to the discharge pressure, and let out. Forces are in whole newtons.
    """
    r, length, area = crank.length_m, rod.length_m, math.pi / 4 * BORE_M**2
    dead = DEAD_PART * 2 * r

    def height(angle: float) -> float:
        """Return the height of the gas in m."""
        x = r * math.cos(angle) + math.sqrt(length**2 - (r * math.sin(angle)) ** 2)
        return dead + r + length - x

    def pressure(angle: float) -> float:
        if angle <= math.pi:
            return max(SUCTION_PA, DISCHARGE_PA * math.pow(dead / height(angle), POLYTROPIC))
        return min(DISCHARGE_PA, SUCTION_PA * math.pow(height(math.pi) / height(angle), POLYTROPIC))

    angles = [2 * math.pi * k / (ENTRIES - 1) for k in range(ENTRIES)]
    forces = [float(round(-area * (pressure(angle) - SUCTION_PA))) for angle in angles]
    return Gas(crank_angle_rad=tuple(angles), force_N=tuple(forces))


def ideal_compressor() -> Scene:
    """A compressor: set R's links and a flywheel, turned by a motor against gas and a guide's friction."""
    crank, rod, _ = ideal_driven().crank_slider()
    return Scene(
        name="ideal-compressor",
        end_time_s=0.08,
        gravity_m_s2=9.81,
        crank=crank.model_copy(update={"inertia_kg_m2": 0.01}),
        rod=rod,
        slider=SLIDER,
        start=Start(crank_angle_rad=0.0, crank_speed_rad_s=157.0),
        drive=MotorDrive(kind="motor", stall_torque_N_m=60.0, no_load_speed_rad_s=165.0),
        load=Loads(slider=SliderLoad(viscous_N_s_m=3.0, gas=gas(crank, rod))),
    )


#: The literature's bearing: steel on steel, 10 mm, restitution 0.9.
BEARING_RADIUS_M, STEEL_PA, STEEL_POISSON = 0.01, 207e9, 0.3


def clearance(
    radial_clearance_m: float,
    law: ContactLaw = "lankarani-nikravesh",
    restitution: float = 0.9,
    friction: Friction | None = None,
) -> Clearance:
    """Return a joint's clearance with Hertz's stiffness of steel."""
    return Clearance(
        radial_clearance_m=radial_clearance_m,
        bearing_radius_m=BEARING_RADIUS_M,
        law=law,
        young_modulus_Pa=STEEL_PA,
        poisson_ratio=STEEL_POISSON,
        restitution=restitution,
        friction=friction,
    )


def _named(name: str, scene: Scene, **clearances: Clearance) -> Scene:
    return scene.model_copy(update={"name": name, "clearance": Clearances(**clearances)})


def clearance_driven_05() -> Scene:
    """Set R with 0.5 mm of clearance at the rod-slider pin: chaotic, the literature's standard case."""
    return _named("clearance-driven-0.5mm", ideal_driven(), B=clearance(5e-4))


def clearance_driven_01() -> Scene:
    """Set R with 0.1 mm of clearance at the rod-slider pin."""
    return _named("clearance-driven-0.1mm", ideal_driven(), B=clearance(1e-4))


def clearance_driven_002() -> Scene:
    """Set R with 0.02 mm of clearance at the rod-slider pin: settles to continuous contact."""
    return _named("clearance-driven-0.02mm", ideal_driven(), B=clearance(2e-5))


def clearance_driven_damped() -> Scene:
    """Set R, 0.1 mm at the rod-slider pin, well damped: Hu-Guo with e = 0.5 and friction 0.1."""
    friction = Friction(law="tanh", coefficient=0.1, regularisation_speed_m_s=0.01)
    return _named("clearance-driven-damped", ideal_driven(), B=clearance(1e-4, "hu-guo", 0.5, friction))


def clearance_free() -> Scene:
    """Set F with 0.5 mm of clearance at the rod-slider pin."""
    short = ideal_free().model_copy(update={"end_time_s": 0.1})
    return _named("clearance-free-0.5mm", short, B=clearance(5e-4))


def clearance_start_up() -> Scene:
    """Set R brought from rest to its speed in a turn, with 0.1 mm of clearance at the rod-slider pin."""
    driven = ideal_driven()
    drive = RampDrive(kind="ramp", final_speed_rad_s=driven.start.crank_speed_rad_s, ramp_time_s=0.024)
    start = Start(crank_angle_rad=0.0, crank_speed_rad_s=0.0)
    update = {"drive": drive, "start": start, "end_time_s": 0.036}
    return _named("clearance-start-up", driven.model_copy(update=update), B=clearance(1e-4))


def clearance_compressor() -> Scene:
    """The compressor with 0.1 mm of clearance at the rod-slider pin."""
    return _named("clearance-compressor", ideal_compressor(), B=clearance(1e-4))


def clearance_driven_crank_pin() -> Scene:
    """Set R with 0.5 mm of clearance at the crank-rod pin."""
    return _named("clearance-driven-A", ideal_driven(), A=clearance(5e-4))


def clearance_driven_two() -> Scene:
    """Set R with 0.5 mm of clearance at both ends of the rod."""
    return _named("clearance-driven-AB", ideal_driven(), A=clearance(5e-4), B=clearance(5e-4))


def clearance_free_three() -> Scene:
    """Set F with 0.5 mm of clearance in all three joints."""
    short = ideal_free().model_copy(update={"end_time_s": 0.1})
    everywhere = {name: clearance(5e-4) for name in ("O", "A", "B")}
    return _named("clearance-free-OAB", short, **everywhere)


def clearance_pendulum() -> Scene:
    """A physical pendulum let go at the height of its joint, which has 0.5 mm of clearance."""
    return Scene(
        name="clearance-pendulum",
        end_time_s=0.3,
        gravity_m_s2=9.81,
        crank=ideal_driven().crank_slider()[1],
        start=Start(crank_angle_rad=0.0, crank_speed_rad_s=0.0),
        drive=FreeDrive(kind="free"),
        clearance=Clearances(O=clearance(5e-4)),
    )


IDEAL_SCENES: dict[str, Callable[[], Scene]] = {
    "ideal-free": ideal_free,
    "ideal-driven": ideal_driven,
    "ideal-torque": ideal_torque,
    "ideal-fluctuating": ideal_fluctuating,
    "ideal-compressor": ideal_compressor,
}
CLEARANCE_SCENES: dict[str, Callable[[], Scene]] = {
    "clearance-driven-0.5mm": clearance_driven_05,
    "clearance-driven-0.1mm": clearance_driven_01,
    "clearance-driven-0.02mm": clearance_driven_002,
    "clearance-driven-damped": clearance_driven_damped,
    "clearance-driven-A": clearance_driven_crank_pin,
    "clearance-driven-AB": clearance_driven_two,
    "clearance-free-0.5mm": clearance_free,
    "clearance-free-OAB": clearance_free_three,
    "clearance-pendulum": clearance_pendulum,
    "clearance-start-up": clearance_start_up,
    "clearance-compressor": clearance_compressor,
}


def _rigid(make: Callable[[], Scene]) -> Callable[[], Scene]:
    """Return what makes the same scene with rigid contact of the same nominal restitution and friction."""

    def rigid_scene() -> Scene:
        scene = make()
        unset = {"law": "rigid", "young_modulus_Pa": None, "poisson_ratio": None}
        joints = {name: getattr(scene.clearance, name) for name in scene.joints_with_clearance}
        rigid = {name: joint.model_copy(update=unset) for name, joint in joints.items()}
        return _named(scene.name.replace("clearance", "rigid"), scene, **rigid)

    rigid_scene.__doc__ = f"{(make.__doc__ or '').rstrip('.')}; rigid contact."
    return rigid_scene


RIGID_SCENES: dict[str, Callable[[], Scene]] = {
    name.replace("clearance", "rigid"): _rigid(make) for name, make in CLEARANCE_SCENES.items()
}

SCENES = {**IDEAL_SCENES, **CLEARANCE_SCENES, **RIGID_SCENES}
