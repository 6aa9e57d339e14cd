"""Starts with a pin in its wall, whose touch nobody has seen, and with whole turns of the crank."""

import numpy as np
import pytest

from engine_models.engine import FloatArray, ImpossibleStart, RunSettings
from engine_models.engines import make_engine
from engine_models.reference.engine import ReferenceEngine
from engine_models.scene.format import BodyState
from engine_models.scene.library import SCENES
from engine_models.scene.scene import Scene
from tests.helpers.engines import supporting

CLEARANCE_M, SPEED_RAD_S = 1e-4, 371.43
#: A pin 0.0266 clearances in its wall, or before it, as a part of the clearance.
INSIDE, BEFORE = (0.950, 0.389), (0.925, 0.378)
#: Its rate out of the wall and into it, in clearances times crank speed.
LEAVING, ENTERING = (-2.81, 5.80), (2.81, 5.80)
#: Two turns of a pin that touches and leaves take a thousand steps.
END_S, STEPS = 4 * np.pi / SPEED_RAD_S, 10_000


def apart(scene: Scene, gap: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return positions and velocities of a crank-slider at angle 0, with a gap and its rate, (2, 2), at B."""
    (crank, rod, _), w = scene.crank_slider(), SPEED_RAD_S
    state = np.zeros((2, 3, 3))
    (x, y), (vx, vy) = gap
    phi = -np.arcsin(y / rod.length_m)
    rate = -(w * crank.length_m + vy) / (rod.length_m * np.cos(phi))
    state[:, 0] = (crank.centre_of_mass_m, 0.0, 0.0), (0.0, w * crank.centre_of_mass_m, w)

    def along(part: float) -> tuple[FloatArray, FloatArray]:
        at, turned = part * np.array([np.cos(phi), np.sin(phi)]), part * np.array([-np.sin(phi), np.cos(phi)])
        return np.array([crank.length_m, 0.0]) + at, rate * turned + [0.0, w * crank.length_m]

    for row, at in enumerate(along(rod.centre_of_mass_m)):
        state[row, 1, :2] = at
    state[:, 1, 2] = phi, rate
    pin, speed = along(rod.length_m)
    state[:, 2, 0] = pin[0] + x, speed[0] + vx
    return state[0], state[1]


def beginning(place: tuple[float, float], rate: tuple[float, float]) -> Scene:
    """Return set R with its pin B there."""
    gap = CLEARANCE_M * np.array([place, np.multiply(rate, SPEED_RAD_S)])
    scene = SCENES["clearance-driven-0.5mm"]()
    state = np.hstack(apart(scene, gap))
    fields = {
        f"start.{body}.{name}": value
        for body, numbers in zip(scene.mechanism.names, state.tolist(), strict=True)
        for name, value in zip(BodyState.model_fields, numbers, strict=True)
    }
    new = {"clearance.B.radial_clearance_m": CLEARANCE_M, "start.crank_speed_rad_s": SPEED_RAD_S}
    return scene.replace({**new, **fields, "end_time_s": END_S})


def steps(scene: Scene) -> int:
    """Return how many steps a run takes."""
    engine = ReferenceEngine(method="dop853", step_tolerance=1e-6)
    return engine.simulate(scene, RunSettings(scene.end_time_s, 1)).steps


def test_a_pin_that_leaves_a_wall_at_the_start_is_refused_as_its_touch_is_not_known() -> None:
    with pytest.raises(ImpossibleStart, match=r"pin B .* 2\.66e-06 m in the wall and leaving at 0\.015 m/s"):
        steps(beginning(INSIDE, LEAVING))


@pytest.mark.parametrize(
    ("place", "rate", "changes"),
    [
        (INSIDE, ENTERING, {}),
        (BEFORE, LEAVING, {}),
        (INSIDE, LEAVING, {"clearance.B.law": "hertz", "clearance.B.restitution": None}),
        (INSIDE, LEAVING, {"clearance.B.minimum_impact_speed_m_s": 0.01}),
    ],
    ids=["entering", "before the wall", "law without damping", "floor of the impact speed as stated"],
)
def test_a_pin_whose_touch_is_known_or_has_no_part_in_the_force_starts_and_bounces(
    place: tuple[float, float], rate: tuple[float, float], changes: dict[str, object]
) -> None:
    assert steps(beginning(place, rate).replace(changes)) < STEPS


#: The turns as a double are off by 2.4e-16 rad each, their sum by half its spacing; the crank is 0.15 m long.
TURNS, TOLERANCE_RAD = 100_000, 2e-10


@pytest.mark.parametrize(
    ("engine", "name"),
    [(e, name) for name in ("ideal-driven", "ideal-free") for e in supporting(SCENES[name]())],
)
def test_whole_turns_of_the_crank_change_only_its_angle(engine: str, name: str) -> None:
    of = SCENES[name]().replace("end_time_s", 2e-3)
    turned = of.short.start.crank_angle_rad + TURNS * 2 * np.pi
    plain, wound = (
        make_engine(engine).simulate(each, RunSettings(1e-5, 10))
        for each in (of, of.replace("start.crank_angle_rad", turned))
    )
    rise = wound.position[:, 0, 2] - plain.position[:, 0, 2]
    assert np.abs(rise - TURNS * 2 * np.pi).max() <= TOLERANCE_RAD
    off = np.abs(wound.position[:, -1, 0] - plain.position[:, -1, 0]).max()
    assert off <= TOLERANCE_RAD, f"slider off by {off:.3g} m"
