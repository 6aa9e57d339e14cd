"""What every engine tells of impacts: how their force begins, and what they add up to."""

import numpy as np
import pytest

from engine_models.engine import RunSettings
from engine_models.engines import make_engine
from engine_models.scene.library import SCENES
from tests.helpers.engines import supporting

SCENE, END_S, STEP_S, SAMPLES = "clearance-driven-damped", 0.0005, 1e-6, 50
#: Sums of the same terms, or of quadratures over parts of the same stretches.
ROUND_OFF = 1e-6


@pytest.mark.parametrize("engine", supporting(SCENES[SCENE]()))
def test_impulses_and_losses_of_impacts_add_up_to_those_of_the_contact(engine: str) -> None:
    scene = SCENES[SCENE]().model_copy(update={"end_time_s": END_S})
    run = make_engine(engine).simulate(scene, RunSettings(STEP_S, SAMPLES))
    contact = run.contacts["B"]
    over = contact.impacts.time_s + contact.impacts.duration_s
    assert len(over)
    # The first sample in flight after the last impact that ended.
    after = int(np.searchsorted(run.time_s, over[-1]))
    assert contact.penetration_m[after] < 0
    assert contact.friction_loss_J is not None
    assert contact.friction_loss_J[after] > 1e-3 * contact.dissipated_energy_J[after], "friction takes a part"
    lost, impulse = contact.impacts.energy_lost_J.sum(), contact.impacts.normal_impulse_N_s.sum()
    assert lost == pytest.approx(contact.dissipated_energy_J[after], rel=ROUND_OFF)
    assert impulse == pytest.approx(contact.normal_impulse_N_s[after], rel=ROUND_OFF)


#: Set R's joint is steel on steel: by Hertz and Ma 6.61e10 N/m^1.5, with a restitution of 0.9.
FREE_FLIGHT, STIFFNESS, RESTITUTION = "clearance-driven-0.5mm", 6.6102e10, 0.9
#: By how much the rate of penetration differs from that at touch half a microsecond later.
LATER = 1e-3


@pytest.mark.parametrize("engine", supporting(SCENES[FREE_FLIGHT]()))
def test_a_contact_begins_with_the_laws_force_at_the_speed_of_its_touch(engine: str) -> None:
    """Lankarani and Nikravesh: K depth^1.5 (1 + 3/4 (1 - e²) rate / speed at touch), where rate is that "
    "speed."""
    scene = SCENES[FREE_FLIGHT]().model_copy(update={"end_time_s": 0.00025})
    run = make_engine(engine).simulate(scene, RunSettings(5e-7, 500))
    contact = run.contacts["B"]
    first = int(np.argmax(contact.penetration_m > 0))
    spring = STIFFNESS * contact.penetration_m[first] ** 1.5
    damped = 1 + 0.75 * (1 - RESTITUTION**2)
    assert contact.normal_force_N[first] / spring == pytest.approx(damped, abs=LATER)
