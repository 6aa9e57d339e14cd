import math
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from engine_models.scene.drives import ConstantSpeedDrive, FreeDrive, TorqueDrive
from engine_models.scene.file import SceneError, from_toml, load
from engine_models.scene.library import SCENES
from engine_models.scene.scene import (
    LAWS_DIVIDING_BY_RESTITUTION,
    LAWS_WITHOUT_RESTITUTION,
    Clearance,
    Clearances,
    ContactLaw,
    Friction,
    Link,
    Scene,
    Slider,
    Start,
)

positive = st.floats(1e-6, 1e6)
number = st.floats(-1e6, 1e6)
LAWS: list[ContactLaw] = [
    "linear",
    "kelvin-voigt",
    "hertz",
    "lankarani-nikravesh",
    "hu-guo",
    "flores",
    "rigid",
]


@st.composite
def frictions(draw: st.DrawFn) -> Friction:
    limit = draw(positive)
    if draw(st.booleans()):
        return Friction(
            law="ambrosio",
            coefficient=draw(positive),
            regularisation_speed_m_s=limit,
            dead_band_speed_m_s=limit * draw(st.floats(0.01, 0.99)),
        )
    return Friction(law="tanh", coefficient=draw(positive), regularisation_speed_m_s=limit)


@st.composite
def clearances(draw: st.DrawFn) -> Clearance:
    law, radius = draw(st.sampled_from(LAWS)), draw(positive)
    by_material = draw(st.booleans())
    contact: dict[str, Any] = {"young_modulus_Pa": draw(positive), "poisson_ratio": draw(st.floats(0, 0.5))}
    smallest_restitution = 0.01 if law in LAWS_DIVIDING_BY_RESTITUTION else 0.0
    return Clearance(
        radial_clearance_m=radius * draw(st.floats(0.001, 0.999)),
        bearing_radius_m=radius,
        law=law,
        **({} if law == "rigid" else contact if by_material else {"stiffness": draw(positive)}),
        damping_N_s_m=draw(positive) if law == "kelvin-voigt" else None,
        restitution=None if law in LAWS_WITHOUT_RESTITUTION else draw(st.floats(smallest_restitution, 1.0)),
        minimum_impact_speed_m_s=draw(st.none() | positive),
        friction=draw(st.none() | frictions()),
    )


@st.composite
def links(draw: st.DrawFn, length: float) -> Link:
    return Link(
        length_m=length, mass_kg=draw(positive), inertia_kg_m2=draw(positive), centre_of_mass_m=draw(number)
    )


@st.composite
def scenes(draw: st.DrawFn) -> Scene:
    crank = draw(positive)
    drives = st.one_of(
        st.just(FreeDrive(kind="free")),
        st.just(ConstantSpeedDrive(kind="constant-speed")),
        st.builds(TorqueDrive, kind=st.just("torque"), torque_N_m=number),
    )
    return Scene(
        name="n" + draw(st.text(st.characters(codec="utf-8"))),
        end_time_s=draw(positive),
        gravity_m_s2=draw(st.just(0.0) | positive),
        crank=draw(links(crank)),
        rod=draw(links(crank * draw(st.floats(1.001, 100.0)))),
        slider=Slider(mass_kg=draw(positive), inertia_kg_m2=draw(positive)),
        start=Start(crank_angle_rad=draw(number), crank_speed_rad_s=draw(number)),
        drive=draw(drives),
        clearance=Clearances(**{joint: draw(st.none() | clearances()) for joint in "OAB"}),
    )


@pytest.mark.parametrize("name", SCENES)
def test_a_library_scene_has_its_own_name_and_survives_a_file(name: str, tmp_path: Path) -> None:
    scene = SCENES[name]()
    file = tmp_path / "scene.toml"
    file.write_text(scene.to_toml(), encoding="utf-8")
    assert scene.name == name
    assert load(file) == scene


@given(scenes())
@settings(max_examples=200, deadline=None)
def test_every_valid_scene_survives_a_file(scene: Scene) -> None:
    assert from_toml(scene.to_toml()) == scene


@given(scenes())
@settings(max_examples=50, deadline=None)
def test_a_file_names_nothing_that_the_scene_lacks(scene: Scene) -> None:
    lines = scene.to_toml().splitlines()
    for joint in "OAB":
        assert (f"[clearance.{joint}]" in lines) == (joint in scene.joints_with_clearance)
    assert any(line.startswith("[clearance") for line in lines) == bool(scene.joints_with_clearance)


def test_integers_stand_for_numbers() -> None:
    text = SCENES["ideal-torque"]().to_toml().replace("torque_N_m = 0.3", "torque_N_m = 3")
    assert from_toml(text).drive == TorqueDrive(kind="torque", torque_N_m=3.0)


def test_windows_line_ends_are_read() -> None:
    scene = SCENES["ideal-free"]()
    assert from_toml(scene.to_toml().replace("\n", "\r\n")) == scene


def test_a_scene_cannot_be_changed() -> None:
    with pytest.raises(ValidationError, match="frozen"):
        SCENES["ideal-free"]().name = "other"


def test_every_refusal_of_a_file_is_reported_at_once() -> None:
    text = SCENES["ideal-free"]().to_toml().replace("length_m = 0.05", "lenght_m = 0.05")
    with pytest.raises(SceneError) as refused:
        from_toml(text)
    assert str(refused.value) == (
        "crank.length_m: expected a finite number > 0, got nothing; "
        "crank.lenght_m: expected the key length_m, mass_kg, inertia_kg_m2 or centre_of_mass_m, "
        "got an unknown key (did you mean length_m?)"
    )


CONTACT = "[clearance.B]\nradial_clearance_m = 5e-4\nbearing_radius_m = 0.01\n"
FRICTION = "[clearance.B.friction]\ncoefficient = 0.1\nregularisation_speed_m_s = 0.1\n"


@pytest.mark.parametrize(
    ("section", "message"),
    [
        ("law = 'hertz'", "young_modulus_Pa: expected a number without stiffness, got nothing"),
        ("law = 'hertz'\nyoung_modulus_Pa = 2e11", "poisson_ratio: expected a number without stiffness"),
        (
            "law = 'hertz'\nstiffness = 1e9\npoisson_ratio = 0.3",
            "poisson_ratio: expected nothing beside stiff",
        ),
        (
            "law = 'rigid'\nrestitution = 0.5\nstiffness = 1e9",
            "stiffness: expected nothing with law = 'rigid'",
        ),
        (
            "law = 'rigid'\nrestitution = 0.5\nyoung_modulus_Pa = 1.0",
            "young_modulus_Pa: expected nothing with",
        ),
        (
            "law = 'hertz'\nstiffness = 1e9\nrestitution = 0.9",
            "restitution: expected nothing with law = 'hertz'",
        ),
        (
            "law = 'hu-guo'\nstiffness = 1e9\nrestitution = 0",
            "restitution: expected a number > 0 with law = 'hu",
        ),
        (
            "law = 'hunt-crossley'\nstiffness = 1e9",
            "restitution: expected a number with law = 'hunt-crossley'",
        ),
        (
            "law = 'kelvin-voigt'\nstiffness = 1e9",
            "damping_N_s_m: expected a number with law = 'kelvin-voigt'",
        ),
        (
            "law = 'hertz'\nstiffness = 1e9\ndamping_N_s_m = 1",
            "damping_N_s_m: expected nothing with law = 'h",
        ),
        (
            "law = 'linear'\nstiffness = 1e9\nexponent = 1.5",
            "exponent: expected 1 or nothing with law = 'linear'",
        ),
        (
            "law = 'hertz'\nstiffness = 1e9\nexponent = 0.5",
            "exponent: expected a finite number >= 1, got 0.5",
        ),
        ("law = 'coulomb'", 'or "rigid", got "coulomb"'),
    ],
)
def test_a_contact_law_takes_its_own_parameters_alone(section: str, message: str) -> None:
    with pytest.raises(SceneError) as refused:
        from_toml(SCENES["ideal-free"]().to_toml() + CONTACT + section)
    assert message in str(refused.value)
    assert str(refused.value).startswith("clearance.B.")


@pytest.mark.parametrize(
    ("section", "message"),
    [
        ("law = 'ambrosio'", "dead_band_speed_m_s: expected a number with law = 'ambrosio', got nothing"),
        ("law = 'tanh'\ndead_band_speed_m_s = 0.01", "expected nothing with law = 'tanh', got 0.01"),
        ("law = 'ambrosio'\ndead_band_speed_m_s = 0.1", "a number < regularisation_speed_m_s = 0.1, got 0.1"),
    ],
)
def test_the_dead_band_belongs_to_ambrosio(section: str, message: str) -> None:
    contact = CONTACT + "law = 'hertz'\nstiffness = 1e9\n" + FRICTION
    with pytest.raises(SceneError) as refused:
        from_toml(SCENES["ideal-free"]().to_toml() + contact + section)
    assert message in str(refused.value)
    assert str(refused.value).startswith("clearance.B.friction.dead_band_speed_m_s: ")


def test_the_rod_must_reach_the_guide_at_the_start() -> None:
    scene = SCENES["ideal-free"]().model_dump()
    scene["rod"]["length_m"] = 0.04
    scene["start"]["crank_angle_rad"] = math.pi / 6
    assert Scene.model_validate(scene).crank_slider()[1].length_m == 0.04
    scene["start"]["crank_angle_rad"] = math.pi / 2
    with pytest.raises(ValidationError, match=r"rod.length_m: expected more than .* = 0.05 .* got 0.04"):
        Scene.model_validate(scene)


def test_the_compressors_gas_is_that_of_a_polytrope_between_suction_and_discharge() -> None:
    """A bore of 30 mm, 0.7069 cm2 a bar: 353 N at 6 bar against 1. Heights are 8 mm and 108 at dead centres.

    At 20 degrees 12.24 mm: 6 bar (8/12.24)^1.3 = 3.452 bar; at 270, 68.91 mm: (108/68.91)^1.3 = 1.793 bar.
    """
    load = SCENES["ideal-compressor"]().load.slider
    assert load is not None
    assert load.gas is not None
    force = load.gas.force_N
    assert (force[0], force[2], force[18], force[27], force[-1]) == (-353, -173, 0, -56, -353)
