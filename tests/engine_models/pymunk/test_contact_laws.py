"""The compliant laws of the Pymunk model: the reference's formulas, the restitution that each law gives."""

import math
from typing import Any

import numpy as np
import pytest
from scipy.special import lambertw

from engine_models.engine import RunSettings
from engine_models.mechanics.contact_law import friction_force, law_numbers, normal_force
from engine_models.pymunk.engine import PymunkEngine
from engine_models.scene.library import ideal_driven
from engine_models.scene.scene import Clearance, Clearances, ContactLaw, Friction, Scene
from reference_solver.mechanism import contact_laws
from reference_solver.mechanism.contact_laws import DAMPING_FACTORS

HERTZ = {"young_modulus_Pa": 207e9, "poisson_ratio": 0.3}
#: Loads act besides the contact, and it takes some 700 steps: what a law really gives is found to this.
RESTITUTION_ACCURACY = 0.01


def clearance(law: ContactLaw, **more: Any) -> Clearance:
    return Clearance(radial_clearance_m=5e-4, bearing_radius_m=1e-2, law=law, **more)


def first_contact(room: Clearance, end_time_s: float = 3.6e-4, step_s: float = 1e-7) -> tuple[float, float]:
    """Return the restitution of set R's first contact under a law, and its duration in s."""
    scene: Scene = ideal_driven().model_copy(
        update={"end_time_s": end_time_s, "gravity_m_s2": 0.0, "clearance": Clearances(B=room)}
    )
    impacts = PymunkEngine().simulate(scene, RunSettings(step_s, 10)).contacts["B"].impacts
    impulse, speed = impacts.normal_impulse_N_s[0], impacts.approach_speed_m_s[0]
    return 1 - 2 * impacts.energy_lost_J[0] / (impulse * speed), impacts.duration_s[0]


@pytest.mark.parametrize("kind", ["saturated-linear", "ambrosio", "tanh"])
def test_every_friction_law_is_the_references(kind: Any) -> None:
    dead = 0.002 if kind == "ambrosio" else None
    law = Friction(law=kind, coefficient=0.1, regularisation_speed_m_s=0.01, dead_band_speed_m_s=dead)
    numbers = law_numbers(clearance("linear", stiffness=5e8, friction=law))
    other = contact_laws.FrictionLaw(kind, 0.1, 0.01, dead or 0.0)
    for sliding in np.linspace(-0.02, 0.02, 81).tolist():
        share = contact_laws.FRICTION_LAWS[other.kind](other, sliding)
        assert friction_force(numbers, 50.0, sliding) == pytest.approx(-5.0 * share, abs=1e-14)
        assert friction_force(numbers, -50.0, sliding) == 0.0


@pytest.mark.parametrize("e", [0.5, 0.9])
@pytest.mark.parametrize("law", DAMPING_FACTORS)
def test_a_law_gives_the_restitution_of_its_closed_form(law: ContactLaw, e: float) -> None:
    restitution, _ = first_contact(clearance(law, restitution=e, stiffness=1e13), 2.4e-4, 1e-8)
    a = DAMPING_FACTORS[law](e)
    expected = (1 + lambertw(-(1 + a) * math.exp(-(1 + a))).real) / a
    assert restitution == pytest.approx(expected, abs=RESTITUTION_ACCURACY)


def test_conservative_laws_give_everything_back() -> None:
    for law, more in (("hertz", HERTZ), ("linear", {"stiffness": 5e8})):
        restitution, _ = first_contact(clearance(law, **more))  # type: ignore[arg-type]
        assert restitution == pytest.approx(1.0, abs=RESTITUTION_ACCURACY), law


def test_kelvin_voigt_gives_the_restitution_and_duration_of_a_damped_oscillator() -> None:
    stiffness = 5e8
    _, period = first_contact(clearance("linear", stiffness=stiffness))
    omega = math.pi / period
    zeta = 0.05
    damping = 2 * zeta * stiffness / omega  # 2 zeta sqrt(k m) with m = k/omega^2
    restitution, duration = first_contact(
        clearance("kelvin-voigt", stiffness=stiffness, damping_N_s_m=damping)
    )
    # Its force pulls at the end, so the loss is J (v - e v)/2 with what the spring gave and took.
    assert restitution == pytest.approx(math.exp(-math.pi * zeta / math.sqrt(1 - zeta**2)), abs=0.02)
    assert duration == pytest.approx(period / math.sqrt(1 - zeta**2), rel=0.02)


def test_the_force_is_clipped_where_the_law_would_pull_unless_it_may() -> None:
    room = clearance("lankarani-nikravesh", restitution=0.0, stiffness=1e8)
    clipped, pulling = (law_numbers(room.model_copy(update={"may_pull": may})) for may in (False, True))
    assert normal_force(clipped, 1e-6, -10.0, 1.0) == (0.0, 1e8 * 1e-6**1.5, True)
    force, spring, was_clipped = normal_force(pulling, 1e-6, -10.0, 1.0)
    assert not was_clipped
    assert force == pytest.approx(spring * (1 - 7.5))
    assert normal_force(clipped, 1e-6, -1.0, 1.0)[0] == pytest.approx(spring * 0.25)
    lossless = law_numbers(clearance("lankarani-nikravesh", restitution=1.0, stiffness=1e8))
    assert not lossless.clips


def test_the_approach_speed_has_the_scenes_floor() -> None:
    room = clearance("hunt-crossley", restitution=0.5, stiffness=1e8, minimum_impact_speed_m_s=0.1)
    law = law_numbers(room)
    assert normal_force(law, 1e-6, 0.01, 0.001) == normal_force(law, 1e-6, 0.01, 0.1)
