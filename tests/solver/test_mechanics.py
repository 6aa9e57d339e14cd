"""Laws, forces and scenes that all engines' models share, against numbers put down here."""

from types import SimpleNamespace

import numpy as np
import pytest

from engine_models import arms
from engine_models.engine import RunSettings
from engine_models.exudyn.contact import native_law
from engine_models.exudyn.motion import integral
from engine_models.mechanics.energy import elastic_energy_J
from engine_models.mechanics.loads import load_forces
from engine_models.pymunk.native_contact import rigid_twin
from engine_models.scene.format import Clearance
from engine_models.scene.library import SCENES, ideal_driven
from engine_models.scene.short import CrankLoad
from reference_solver.mechanism.contacts import stiffness_of

STEEL = Clearance(
    radial_clearance_m=5e-4,
    bearing_radius_m=0.01,
    law="lankarani-nikravesh",
    young_modulus_Pa=207e9,
    poisson_ratio=0.3,
    restitution=0.9,
)
BOUNCING = SCENES["clearance-driven-0.5mm"]


def test_a_steel_pin_is_as_stiff_as_hertz_has_it() -> None:
    """s = 0.91/207e9 = 4.396135e-12 1/Pa, 4/(6 s) = 1.516484e11, times sqrt(0.01 0.0095/5e-4) = 0.4358899."""
    assert stiffness_of(STEEL) == pytest.approx(6.6102e10, rel=1e-4)


def test_a_contact_stores_what_its_force_integrates_to() -> None:
    unset = {"young_modulus_Pa": None, "poisson_ratio": None}
    law = STEEL.model_copy(update={**unset, "stiffness": 1e9, "exponent": 1.5})
    stored = elastic_energy_J(law, np.array([-1e-5, 1e-5]))
    assert stored.tolist() == pytest.approx([0.0, 1e9 * 1e-5**2.5 / 2.5])


# Forces


def test_a_spring_pulls_from_its_free_position() -> None:
    load = {"slider": CrankLoad(spring_N_m=2000.0, free_position_m=0.12)}
    position = np.zeros((1, 3, 3))
    position[0, 2, 0] = 0.15
    scene = ideal_driven().model_copy(update={"load": load})
    forces = load_forces(scene.mechanism, np.zeros(1), position, position)
    assert forces["slider.spring"] == pytest.approx(-60.0)


# Engines


def test_a_step_is_never_longer_than_asked_for_nor_halved_for_round_off() -> None:
    """2.1 over 0.7 is 3.0000000000000004 in floating point."""
    settings = RunSettings(0.3, 1)
    assert (settings.steps_per_sample(1.0), settings.step_used_s(1.0)) == (4, 0.25)
    assert [RunSettings(step, 1).steps_per_sample(2.1) for step in (0.7, 0.6999)] == [3, 4]


def test_arms_set_what_their_names_say() -> None:
    settings = {arm.label: dict(arm.settings) for arm in vars(arms).values() if isinstance(arm, arms.Arm)}
    paper = {"locate_events": False, "stabilisation": "none"}
    assert settings["reference (plain RK4)"] == paper
    assert settings["reference (none)"] == {"stabilisation": "none"}
    assert settings["exudyn (generalized-alpha)"]["spectral_radius"] == 0.5
    assert settings["exudyn (generalized-alpha 0.9)"]["spectral_radius"] == 0.9
    assert settings["pymunk (native contact)"] == {"contact": "rigid"}


def test_exudyn_has_its_law_by_another_restitution() -> None:
    law = native_law(STEEL.model_copy(update={"restitution": 0.8}))
    assert law.impact_model == 1
    assert law.restitution == pytest.approx(0.82), "3 (1 - 0.82)/2 is 0.27"


def test_exudyns_sums_are_exact_of_powers_up_to_the_fifth() -> None:
    grid = np.array([0.0, 0.5, 2.0])
    sums = integral(grid, lambda t: np.stack([t**k for k in range(6)]))
    np.testing.assert_allclose(sums, [[t ** (k + 1) / (k + 1) for t in grid] for k in range(6)], rtol=1e-13)


def test_rigid_walls_in_a_laws_place_have_its_restitution() -> None:
    twin = rigid_twin(BOUNCING()).clearance["B"]
    assert twin is not None
    assert (twin.law, twin.restitution) == ("rigid", 0.9)
    hertz = BOUNCING().clearance["B"]
    assert hertz is not None
    loose = hertz.model_copy(update={"law": "hertz", "restitution": None})
    scene = BOUNCING().replace("clearance.B", loose)
    elastic = rigid_twin(scene).clearance["B"]
    assert elastic is not None
    assert elastic.restitution == 1.0, "what is lossless stays so"


def test_the_standard_case_is_the_literatures() -> None:
    """Set R: crank of 0.05 m and 0.30 kg, rod of 0.12 m and 0.21 kg, slider of 0.14 kg, 5000 rev/min."""
    scene = BOUNCING()
    crank, rod, slider = scene.crank_slider()
    parts = [SimpleNamespace(**part.model_dump()) for part in (crank, rod)]
    numbers = [(p.length_m, p.mass_kg, p.inertia_kg_m2, p.centre_of_mass_m) for p in parts]
    assert numbers == [(0.05, 0.30, 1e-4, 0.025), (0.12, 0.21, 2.5e-4, 0.06)]
    assert slider.mass_kg == 0.14
    assert scene.short.start.crank_speed_rad_s == pytest.approx(523.599, rel=1e-6)
    assert scene.clearance["B"] is not None
    assert scene.clearance["B"].radial_clearance_m == 5e-4
    assert scene.clearance["B"].restitution == 0.9
