"""Starts of mechanisms: put together, held, with whole turns, by every body's state; what check tells."""

import math
import re

import numpy as np
import pytest

from engine_models.engine import FloatArray, RunSettings
from engine_models.mechanics.assembly import assembled, start_state
from engine_models.reference.engine import ReferenceEngine
from engine_models.reference.inspection import inspect
from engine_models.scene.general import GeneralScene
from engine_models.scene.library import IDEAL_SCENES
from engine_models.scene.parts import BodyState, Place
from engine_models.scene.scene import Scene
from tests.engines.mechanism_texts import (
    CRANK_SLIDER,
    FOUR_BAR,
    OFFSET_CRANK_SLIDER,
    PARALLELOGRAM,
    QUICK_RETURN,
    TEXTS,
    scene,
)

GENERAL = [name for name, text in TEXTS.items() if "[body]" in text]
SHARP = ReferenceEngine(method="dop853", step_tolerance=1e-12)


def pair(place: Place) -> FloatArray:
    return np.array(place if isinstance(place, tuple) else (place, 0.0))


def general(text: str, **changes: object) -> GeneralScene:
    of = scene(text, **changes)
    assert isinstance(of, GeneralScene)
    return of


def gaps(of: GeneralScene, q: FloatArray) -> list[float]:
    """Return how far pins of one name are apart, from the file's own places."""
    places = {pin: [pair(place)] for pin, place in of.ground.pins_m.items()}
    for (x, y, angle), body in zip(q, of.body.values(), strict=True):
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        for pin, place in body.pins_m.items():
            there = [x, y] + turn @ (pair(place) - pair(body.centre_of_mass_m))
            places.setdefault(pin, []).append(there)
    return [float(np.hypot(*(own - first))) for first, *rest in places.values() for own in rest]


@pytest.mark.parametrize("name", GENERAL)
def test_a_start_is_closed_and_what_is_held_is_exact_whatever_else_is_told(name: str) -> None:
    of = general(TEXTS[name])
    q, v = start_state(of)
    assert max(gaps(of, q)) < 1e-12
    assert max(gaps(of, q + 1e-7 * v)) < 1e-7 * 1e-4 * (1 + np.abs(v).max()), "speeds keep them closed"
    (held,) = of.start.hold
    number = [*of.body].index(held)
    assert q[number, 2] == of.start.angle_rad[held]
    assert v[number, 2] == pytest.approx(of.start.speed_rad_s[held], rel=1e-14, abs=1e-14)
    others = {body: angle + 0.02 for body, angle in of.start.angle_rad.items() if body != held}
    again, _ = start_state(of.replace({f"start.angle_rad.{body}": angle for body, angle in others.items()}))
    assert np.abs(again - q).max() < 1e-13


def test_a_way_along_a_turning_guide_is_held() -> None:
    way = 0.26  # from pin C, 0.2 below the crank's pivot, to its pin A: the law of cosines
    of = general(QUICK_RETURN, start__hold=["slot"], start__position_m={"slot": way})
    q, _ = start_state(of)
    assert np.sin(q[0, 2]) == pytest.approx((way**2 - 0.2**2 - 0.08**2) / (2 * 0.2 * 0.08), abs=1e-13)
    assert max(gaps(of, q)) < 1e-12


def test_speeds_are_those_of_the_closed_form() -> None:
    q, v = start_state(scene(FOUR_BAR))
    crank, coupler, rocker = q[:, 2]
    speeds = (
        20.0,
        -20.0 * 0.1 * np.sin(crank - rocker) / (0.25 * np.sin(coupler - rocker)),
        20.0 * 0.1 * np.sin(crank - coupler) / (0.2 * np.sin(rocker - coupler)),
    )
    np.testing.assert_allclose(v[:, 2], speeds, rtol=1e-13)
    np.testing.assert_allclose(v[0, :2], 20.0 * 0.04 * np.array([-np.sin(crank), np.cos(crank)]), rtol=1e-13)


@pytest.mark.parametrize("name", IDEAL_SCENES)
def test_a_plain_crank_slider_starts_by_the_closed_formulas(name: str) -> None:
    of = IDEAL_SCENES[name]()
    start = of.start
    for found, expected in zip(
        start_state(of), assembled(of, start.crank_angle_rad, start.crank_speed_rad_s), strict=True
    ):
        np.testing.assert_array_equal(found, expected)
    put = of.general  # the same start put together: one last place off it
    q, v = start_state(GeneralScene.checked(put.model_dump(exclude_none=True)))
    assert np.abs(q - start_state(of)[0]).max() < 1e-15
    np.testing.assert_allclose(v, start_state(of)[1], rtol=1e-12, atol=1e-12)


def test_whole_turns_come_out_as_they_are_told() -> None:
    turns = 2000 * math.pi
    plain, told = general(FOUR_BAR), {"crank": 0.7 + turns, "coupler": 0.5 - turns, "rocker": 1.8 + turns}
    wound = general(FOUR_BAR, start__angle_rad=told)
    settings = RunSettings(0.5, 10)
    own, other = SHARP.simulate(plain, settings), SHARP.simulate(wound, settings)
    assert other.position[0, 0, 2] == told["crank"]
    expected = own.position.copy()
    expected[:, :, 2] += turns * np.array([1, -1, 1])
    # An angle of 1000 turns is told to 5e-13, and errors grow by some hundred times.
    assert np.abs(other.position - expected).max() < 1e-9


def test_a_start_by_every_body_s_state_goes_on_where_a_run_was() -> None:
    of = general(FOUR_BAR)
    whole = SHARP.simulate(of, RunSettings(0.5, 10))
    keys = [*BodyState.model_fields]
    states = {
        name: dict(zip(keys, [*q.tolist(), *v.tolist()], strict=True))
        for name, q, v in zip(of.body, whole.position[4], whole.velocity[4], strict=True)
    }
    data = of.model_dump(exclude_none=True) | {"start": states, "end_time_s": 0.3}
    rest = GeneralScene.checked(data)
    run = SHARP.simulate(rest, RunSettings(0.3, 6))
    assert np.abs(run.position - whole.position[4:]).max() < 1e-10
    assert "start: as the file gives it, the state of every body" in inspect(rest)


SIZES = {
    "four-bar": "3 bodies, 4 joints; 8 rows of rank 8, 1 degree of freedom",
    "andrews": "7 bodies, 10 joints, 1 spring; 20 rows of rank 20, 1 degree of freedom",
    "scotch-yoke": "2 bodies, 1 joint, 2 guides; 5 rows of rank 5, 1 degree of freedom",
    "quick-return": "5 bodies, 5 joints, 2 guides; 14 rows of rank 14, 1 degree of freedom",
    "four-bar-clearance": (
        "3 bodies, 4 joints; 8 rows of rank 8 (with B taken as ideal), 1 degree of freedom"
    ),
}


@pytest.mark.parametrize("name", SIZES)
def test_check_counts_rows_and_freedoms_and_tells_what_it_moved(name: str) -> None:
    of = general(TEXTS[name])
    size, start, least = inspect(of)
    assert size == f"{of.name}: {SIZES[name]}"
    if name == "scotch-yoke":
        assert start == "start: put together, nothing moved from what the file tells", "but for round-off"
    else:
        q, _ = start_state(of)
        told = [of.start.angle_rad.get(body, 0.0) for body in of.body]
        most = int(np.abs(q[:, 2] - told).argmax())
        by = abs(q[most, 2] - told[most])
        assert (
            start
            == f"start: put together, {[*of.body][most]} turned by {by:.3g} rad from what the file tells"
        )
    assert least.startswith("smallest singular value over 200 samples of the run: 0.")


def test_check_of_crank_sliders_tells_how_they_begin() -> None:
    assert inspect(scene(CRANK_SLIDER))[1] == "start: by the closed formulas of a crank-slider or a pendulum"
    offset = inspect(scene(OFFSET_CRANK_SLIDER))
    assert offset[0].endswith("slider: 3 bodies, 3 joints, 1 guide; 8 rows of rank 8, 1 degree of freedom")
    assert offset[1] == "start: put together, nothing moved from what the file tells", "but for round-off"


def test_check_finds_when_a_parallelogram_is_flat() -> None:
    def least(end_s: float) -> tuple[float, float]:
        line = inspect(scene(PARALLELOGRAM, end_time_s=end_s))[-1]
        found = re.search(r"run: (\S+) at t = (\S+) s", line)
        assert found is not None
        return float(found[1]), float(found[2])

    flat = (math.pi - 1.0) / 2.0  # its crank turns by 2 rad/s, and is along x at pi
    value, when = least(2.0)
    assert abs(when - flat) <= 2.0 / 200 / 2
    near, end = least(1.0)
    assert end == 1.0, "it only comes near"
    # Near the flat position the value is a multiple of the angle's distance from it.
    assert near / value == pytest.approx((flat - 1.0) / abs(when - flat), rel=0.1)
    assert isinstance(scene(CRANK_SLIDER), Scene)
