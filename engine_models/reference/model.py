"""The scene as a mechanism of the reference solver: joints O, A, B, then the guide, then a driver."""

from engine_models.mechanics.contact_law import exponent_of, minimum_impact_speed_of, stiffness_of
from engine_models.mechanics.joints import CRANK, ROD, SLIDER
from engine_models.scene.scene import Clearance, Friction, Link, Scene
from reference_solver.mechanism import mechanism
from reference_solver.mechanism.contact_laws import DAMPING_FACTORS, ContactLaw, FrictionLaw, RigidWall


def mechanism_of(scene: Scene) -> mechanism.Mechanism:
    """Return the mechanism; a joint with clearance has no rows, and is a contact."""
    driven = scene.drive.kind == "constant-speed"
    return mechanism.Mechanism(
        bodies=tuple(mechanism.Body(part.mass_kg, part.inertia_kg_m2) for part in scene.bodies),
        constraints=(
            *(joint for joint, clearance in _joints(scene) if clearance is None),
            *([mechanism.StraightGuide(SLIDER, (0.0, 0.0), 0.0)] if scene.is_crank_slider else []),
            *([mechanism.PrescribedSpeed(CRANK, scene.start.crank_speed_rad_s)] if driven else []),
        ),
        loads=(mechanism.Torque(CRANK, scene.drive.torque_N_m),) if scene.drive.kind == "torque" else (),
        gravity_m_s2=scene.gravity_m_s2,
        contacts=tuple(
            _contact(joint, clearance) for joint, clearance in _joints(scene) if clearance is not None
        ),
    )


def _joints(scene: Scene) -> list[tuple[mechanism.RevoluteJoint, Clearance | None]]:
    """Return the joints O, A, B with their clearances; a bearing is on the body nearer the crank pivot."""

    def pins(link: Link) -> tuple[mechanism.Point, mechanism.Point]:
        return (-link.centre_of_mass_m, 0.0), (link.length_m - link.centre_of_mass_m, 0.0)

    crank_O, crank_A = pins(scene.crank)
    pivot = (mechanism.RevoluteJoint(mechanism.GROUND, (0.0, 0.0), CRANK, crank_O), scene.clearance.O)
    if scene.rod is None:
        return [pivot]
    rod_A, rod_B = pins(scene.rod)
    return [
        pivot,
        (mechanism.RevoluteJoint(CRANK, crank_A, ROD, rod_A), scene.clearance.A),
        (mechanism.RevoluteJoint(ROD, rod_B, SLIDER, (0.0, 0.0)), scene.clearance.B),
    ]


def _contact(joint: mechanism.RevoluteJoint, clearance: Clearance) -> mechanism.ClearanceJoint:
    return mechanism.ClearanceJoint(
        joint.body_i,
        joint.point_i,
        joint.body_j,
        joint.point_j,
        clearance.radial_clearance_m,
        clearance.bearing_radius_m,
        _law(clearance),
        _friction(clearance.friction),
    )


def _law(clearance: Clearance) -> ContactLaw | RigidWall:
    if clearance.law == "rigid":
        return RigidWall(clearance.restitution or 0.0, clearance.minimum_impact_speed_m_s or 0.0)
    factor = DAMPING_FACTORS.get(clearance.law)
    return ContactLaw(
        stiffness_of(clearance),
        exponent_of(clearance),
        0.0 if factor is None or clearance.restitution is None else factor(clearance.restitution),
        clearance.damping_N_s_m or 0.0,
        minimum_impact_speed_of(clearance),
        clearance.may_pull,
    )


def _friction(friction: Friction | None) -> FrictionLaw | None:
    if friction is None:
        return None
    dead_band = friction.dead_band_speed_m_s or 0.0
    return FrictionLaw(friction.law, friction.coefficient, friction.regularisation_speed_m_s, dead_band)
