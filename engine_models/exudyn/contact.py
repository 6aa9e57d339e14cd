"""A joint with clearance as Exudyn's contact of a sphere, the pin, in a hollow sphere, the bearing."""

from typing import Any

import exudyn as exu
import numpy as np
from exudyn import itemInterface

from engine_models.exudyn.laws import minimum_impact_speed_m_s, native_law
from engine_models.mechanics.contact_law import exponent_of, stiffness_of
from engine_models.mechanics.joints import JointGap
from engine_models.scene.scene import Clearance

items: Any = itemInterface  # its constructors carry no types


def add_contact(mbs: exu.MainSystem, pin: Any, bearing: Any, clearance: Clearance, start: JointGap) -> Any:
    """Add the contact of two markers, from one state of its gap; return the node of its history.

    The history is gap (negative in contact), tangential speed (of the centres, which the first step
    corrects), approach speed of the latest touch, and a plastic depth that no law here uses. A contact that
    is closed at the start touches there.
    """
    c, bearing_radius, law = clearance.radial_clearance_m, clearance.bearing_radius_m, native_law(clearance)
    friction = clearance.friction
    (gap,), (rate,) = start.gap_m, start.rate_m_s
    distance = float(np.hypot(*gap))
    normal = gap / distance if distance > 0 else np.zeros(2)
    approach, across = normal @ rate, normal[0] * rate[1] - normal[1] * rate[0]
    begin = [c - distance, abs(across), max(approach, 0.0) if distance > c else 0.0, 0.0]
    history = mbs.AddNode(items.NodeGenericData(initialCoordinates=begin, numberOfDataCoordinates=len(begin)))
    contact = items.ObjectContactSphereSphere(
        markerNumbers=[pin, bearing],
        nodeNumber=history,
        spheresRadii=[bearing_radius - c, bearing_radius],
        isHollowSphere1=True,
        contactStiffness=stiffness_of(clearance),
        contactStiffnessExponent=exponent_of(clearance),
        contactDamping=law.damping_N_s_m,
        impactModel=law.impact_model,
        restitutionCoefficient=law.restitution,
        minimumImpactVelocity=minimum_impact_speed_m_s(clearance),
        dynamicFriction=0.0 if friction is None else friction.coefficient,
        frictionProportionalZone=1.0 if friction is None else friction.regularisation_speed_m_s,
    )
    mbs.AddObject(contact)
    return history
