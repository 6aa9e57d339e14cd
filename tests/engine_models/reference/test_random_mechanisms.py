"""Random mechanisms by DOP853 and by RK4 at a small step: they agree, keep their energy and stay closed."""

import numpy as np
import pytest

from engine_models.engine import FloatArray, RunSettings
from engine_models.mechanics.energy import energy_balance_residual_J, energy_in_play_J
from engine_models.mechanics.quality import constraint_violation_m
from engine_models.reference.engine import ReferenceEngine
from engine_models.scene.file import from_toml
from engine_models.scene.parts import AnyScene

SEEDS = range(30)


def body(draw: np.random.Generator, pins: dict[str, float]) -> str:
    """Return a body with pins on its x axis, and a centre of mass beside it."""
    longest = max(pins.values())
    places = ", ".join(f"{pin} = {place!r}" for pin, place in pins.items())
    x, y, mass = draw.uniform(0.2, 0.8) * longest, draw.uniform(-0.2, 0.2) * longest, draw.uniform(0.2, 1.0)
    inertia = mass * longest**2 * draw.uniform(0.1, 0.3)
    return (
        f"pins_m = {{ {places} }}\ncentre_of_mass_m = [{x!r}, {y!r}]\n"
        f"mass_kg = {mass!r}\ninertia_kg_m2 = {inertia!r}\n"
    )


def four_bar(draw: np.random.Generator) -> tuple[str, str]:
    """Return a four-bar whose crank can turn: shortest and longest are less than the other two (Grashof)."""
    crank, ground = draw.uniform(0.05, 0.08), draw.uniform(0.18, 0.22)
    coupler, rocker = draw.uniform(0.2, 0.25), draw.uniform(0.2, 0.25)
    text = f"observe = 'B.x'\nground.pins_m = {{ O = 0.0, C = {ground!r} }}\n"
    for name, pins in {"crank": {"O": 0.0, "A": crank}, "coupler": {"A": 0.0, "B": coupler}}.items():
        text += f"[body.{name}]\n{body(draw, pins)}"
    text += f"[body.rocker]\n{body(draw, {'C': 0.0, 'B': rocker})}"
    return text, f"angle_rad = {{ crank = {draw.uniform(-3, 3)!r}, coupler = 0.7, rocker = 1.5 }}\n"


def chain(draw: np.random.Generator) -> tuple[str, str]:
    """Return two to four links that hang on the ground."""
    count = int(draw.integers(2, 5))
    text, angles = "observe = 'crank.angle'\nground.pins_m = { P0 = 0.0 }\n", []
    names = ["crank", *(f"link{k}" for k in range(1, count))]
    for k, name in enumerate(names):
        pins = {f"P{k}": 0.0} | ({f"P{k + 1}": draw.uniform(0.1, 0.3)} if k < count - 1 else {})
        text += f"[body.{name}]\n{body(draw, pins)}" if len(pins) == 2 else tip(draw, name, f"P{k}")
        angles.append(f"{name} = {draw.uniform(-1, 1)!r}")
    return text, f"angle_rad = {{ {', '.join(angles)} }}\n"


def tip(draw: np.random.Generator, name: str, pin: str) -> str:
    mass = draw.uniform(0.2, 1.0)
    return (
        f"[body.{name}]\npins_m = {{ {pin} = 0.0 }}\ncentre_of_mass_m = {draw.uniform(0.05, 0.15)!r}\n"
        f"mass_kg = {mass!r}\ninertia_kg_m2 = {0.003 * mass!r}\n"
    )


def crank_slider(draw: np.random.Generator) -> tuple[str, str]:
    """Return a crank-slider in a guide at a random place."""
    tilt, offset = draw.uniform(-3, 3), draw.uniform(-0.03, 0.03)
    through = [-offset * np.sin(tilt), offset * np.cos(tilt)]
    text = "observe = 'guide.along'\nground.pins_m = { O = 0.0 }\n"
    text += f"[body.crank]\n{body(draw, {'O': 0.0, 'A': draw.uniform(0.04, 0.08)})}"
    text += f"[body.rod]\n{body(draw, {'A': 0.0, 'B': draw.uniform(0.15, 0.25)})}"
    text += "[body.slider]\npins_m = { B = 0.0 }\nmass_kg = 0.4\ninertia_kg_m2 = 1e-4\n"
    text += f"[guide.guide]\nbody = 'slider'\npin = 'B'\nangle_rad = {tilt!r}\n"
    text += f"through_m = [{float(through[0])!r}, {float(through[1])!r}]\n"
    return text, f"angle_rad = {{ crank = {draw.uniform(-3, 3)!r}, rod = {tilt!r} }}\n"


def drawn(seed: int) -> AnyScene:
    """Return a random mechanism, every second one of each kind driven."""
    draw = np.random.default_rng(seed)
    kind = (four_bar, chain, crank_slider)[seed % 3]
    text, start = kind(draw)
    head = f"name = 'random {seed}'\nend_time_s = 0.3\ngravity_m_s2 = [1.0, -9.81]\n"
    if kind is not chain:
        start += f"speed_rad_s = {{ crank = {draw.uniform(5, 15)!r} }}\n"
    drive = ""
    if seed % 2 and kind is not chain:
        drive = "[drive]\nkind = 'constant-speed'\n"
    elif seed % 2:
        drive = "[drive]\nkind = 'torque'\ntorque_N_m = 0.5\n"
    return from_toml(f"{head}{text}{drive}[start]\n{start}")


def largest(values: FloatArray) -> float:
    return float(np.abs(values).max())


@pytest.mark.accuracy
@pytest.mark.parametrize("seed", SEEDS)
def test_two_methods_agree_on_a_random_mechanism(seed: int) -> None:
    of = drawn(seed)
    sharp = ReferenceEngine(method="dop853", step_tolerance=1e-10).simulate(of, RunSettings(0.3, 10))
    plain = ReferenceEngine().simulate(of, RunSettings(0.3 / 8000, 10))
    # DOP853's errors are some hundred times its tolerance in what swings freely; RK4's are less here.
    assert largest(sharp.position - plain.position) < 1e-7
    for run in (sharp, plain):
        assert largest(energy_balance_residual_J(of, run)) < 1e-8 * energy_in_play_J(of, run)
        assert constraint_violation_m(of, run).max() < 1e-9
