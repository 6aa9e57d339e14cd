"""Ideal positions nearest to those of a run: against closed forms, and where rows depend on each other."""

import numpy as np

from engine_models.engine import FloatArray
from engine_models.mechanics.assembly import start_state
from engine_models.mechanics.wrenches import inertias
from engine_models.scene.file import from_toml
from engine_models.scene.library import SCENES
from studies.predictability.sweeps.closing import AT_ONCE, closed
from tests.engine_models.reference.mechanism_texts import FOUR_BAR_CLEARANCE, QUICK_RETURN, WALL
from tests.studies.truth.closed_forms.crank_slider import configuration

#: How far bodies are off at random before they are put together, in m and rad, and round-off of places.
OFF, ROUND_OFF = 1e-3, 1e-14
CRANK = 0
GENERATOR = np.random.default_rng(1)
#: Three legs of equal length, the third with clearance: without it a row would be one too many.
PARALLELOGRAM = f"""
name = "parallelogram"
end_time_s = 0.1
observe = "E.x"
ground.pins_m = {{ O = 0.0, P = 0.1, Q = 0.2 }}
[body]
left = {{ pins_m = {{ O = 0.0, C = 0.1 }}, mass_kg = 0.3, inertia_kg_m2 = 1e-3 }}
right = {{ pins_m = {{ P = 0.0, D = 0.1 }}, mass_kg = 0.3, inertia_kg_m2 = 1e-3 }}
third = {{ pins_m = {{ Q = 0.0, E = 0.1 }}, mass_kg = 0.3, inertia_kg_m2 = 1e-3 }}
bar = {{ pins_m = {{ C = 0.0, D = 0.1, E = 0.2 }}, mass_kg = 0.5, inertia_kg_m2 = 2e-3 }}
[start]
angle_rad = {{ left = 1.0, right = 1.0, third = 1.0 }}
speed_rad_s = {{ left = 5.0 }}
[clearance.E]{WALL}"""


def off(position: FloatArray, kept: int = CRANK) -> FloatArray:
    """Return positions with all bodies off at random, but for an angle that is kept."""
    moves = OFF * GENERATOR.uniform(-1, 1, position.shape)
    moves[:, kept, 2] = 0.0
    return position + moves


def test_a_crank_slider_is_where_the_closed_form_has_it() -> None:
    scene = SCENES["clearance-driven-AB"]()
    angles = np.linspace(0.0, 20.0, AT_ONCE + 50)  # more than are closed at a time
    expected, *_ = configuration(scene, angles)
    rough = off(expected)
    rough[:, 2, 2] = 0.0  # the guide keeps the first angle
    found = closed(scene, rough, CRANK)
    assert np.abs(found - expected).max() < ROUND_OFF, np.abs(found - expected).max()


def test_a_four_bar_is_where_newtons_method_on_two_angles_has_it() -> None:
    scene = from_toml(FOUR_BAR_CLEARANCE)
    theta, links = np.linspace(0.7, 7.0, 200), (0.1, 0.25, 0.2, 0.28)
    coupler, rocker = _loop(theta, *links)
    angles = np.stack([theta, coupler, rocker], axis=1)
    unit = np.stack([np.cos(angles), np.sin(angles)], axis=2)
    position = np.zeros((len(theta), 3, 3))
    position[..., 2] = angles
    position[:, 0, :2] = 0.04 * unit[:, 0]
    position[:, 1, :2] = 0.1 * unit[:, 0] + 0.1 * unit[:, 1]
    position[:, 2, :2] = [0.28, 0.0] + 0.09 * unit[:, 2]
    error = np.abs(closed(scene, off(position), CRANK) - position).max()
    assert error < ROUND_OFF, error


def _loop(theta: FloatArray, a: float, b: float, c: float, ground: float) -> FloatArray:
    """Return angles x, y of coupler and rocker, (2, n): a e^i theta + b e^i x = ground + c e^i y."""
    found = np.stack([np.full_like(theta, 0.5), np.full_like(theta, 1.8)])
    for k in range(len(theta)):
        x, y = found[:, max(k - 1, 0)]  # from the angle before
        for _ in range(20):
            gap = a * np.exp(1j * theta[k]) + b * np.exp(1j * x) - ground - c * np.exp(1j * y)
            rows = np.array([1j * b * np.exp(1j * x), -1j * c * np.exp(1j * y)])
            step = np.linalg.solve(np.stack([rows.real, rows.imag]), [gap.real, gap.imag])
            x, y = x - step[0], y - step[1]
        found[:, k] = x, y
    return found


def test_guides_on_moving_bodies_close_with_the_angles_that_they_had() -> None:
    scene = from_toml(QUICK_RETURN)
    position = np.repeat(start_state(scene)[0][None], 20, axis=0)
    rough = np.concatenate([position[:1], off(position)])
    error = np.abs(closed(scene, rough, CRANK) - position[0]).max()
    assert error < ROUND_OFF, error


def test_without_a_turning_body_positions_are_the_nearest_in_the_norm_of_the_masses() -> None:
    scene = from_toml(FOUR_BAR_CLEARANCE)
    rough = off(np.repeat(start_state(scene)[0][None], 20, axis=0))
    free = closed(scene, rough, None)
    for by_rad in (-OFF, OFF):  # others that are closed are farther away
        turned = free.copy()
        turned[:, CRANK, 2] += by_rad
        other = closed(scene, turned, CRANK)
        near, far = (np.sum(inertias(scene.mechanism) * (q - rough) ** 2, axis=(1, 2)) for q in (free, other))
        assert (near < far).all()


def test_a_leg_too_many_that_has_clearance_closes() -> None:
    scene = from_toml(PARALLELOGRAM)
    position = np.repeat(start_state(scene)[0][None], 20, axis=0)
    error = np.abs(closed(scene, np.concatenate([position[:1], off(position)]), CRANK) - position[0])
    assert error.max() < ROUND_OFF, error.max()


def test_there_is_none_where_joints_do_not_close_at_the_angle() -> None:
    """A rocker 0.2 rad beyond the end of its swing: the joints do not reach."""
    scene = from_toml(FOUR_BAR_CLEARANCE)
    position = np.repeat(start_state(scene)[0][None], 2, axis=0)
    position[1, 2, 2] = -0.5
    found = closed(scene, position, 2)
    assert np.isfinite(found[0]).all()
    assert np.isnan(found[1]).all()
