"""What files of mechanisms may say, and how it is read."""

import math
from pathlib import Path

import pytest

from engine_models.scene.file import SceneError, from_toml, load
from engine_models.scene.library import MECHANISMS, ideal_free
from engine_models.scene.scene import Scene
from reference_solver.mechanism.data import GROUND, Guide
from tests.input.scenes import base, changed

FOUR_BAR, QUICK_RETURN, TWIN, YOKE = map(base, ("four-bar", "quick-return", "v-twin", "scotch-yoke"))
LOOSE = FOUR_BAR + (
    '[clearance.B]\nradial_clearance_m = 5e-4\nbearing_radius_m = 0.01\nlaw = "linear"\nstiffness = 1e8\n'
)
#: A bar whose ends slide on two lines.
TRAMMEL = """
name = "trammel"
end_time_s = 1.0
observe = "P.x"
body.bar = { pins_m = { P = -0.5, Q = 0.5 }, mass_kg = 1.0, inertia_kg_m2 = 0.1 }
guide.across = { body = "bar", pin = "P", turns = true }
guide.up = { body = "bar", pin = "Q", angle_rad = "90 deg", turns = true }
load.bar = { force_N = 1.0, guide = "up" }
start.angle_rad = { bar = 0.5 }
"""
FREE, STEADY = 'kind = "free"', 'kind = "constant-speed"'


# Joints and guides


def test_joints_come_from_the_ground_first_then_in_the_order_of_the_file() -> None:
    pins = {pin.name: (pin.body_i, pin.body_j) for pin in from_toml(FOUR_BAR).mechanism.pins}
    assert [*pins.items()] == [("O", (GROUND, 0)), ("C", (GROUND, 2)), ("A", (0, 1)), ("B", (1, 2))]


def test_a_pin_of_three_bodies_is_a_joint_of_the_first_with_each_other() -> None:
    pins = {pin.name: (pin.body_i, pin.body_j) for pin in from_toml(TWIN).mechanism.pins}
    assert [*pins] == ["O", "A.rod1", "A.rod2", "B", "D"]
    assert (pins["A.rod1"], pins["A.rod2"]) == ((0, 1), (0, 2))


def test_places_are_numbers_or_pairs_and_count_from_the_centre_of_mass() -> None:
    text = changed(FOUR_BAR, ("C = 0.0, B = 0.2", "C = 0, B = [0.2, 0.05]"), ("= 0.09", "= [0.09, 0.01]"))
    pins = {pin.name: pin for pin in from_toml(text).mechanism.pins}
    assert (pins["C"].point_i, pins["C"].point_j) == ((0.28, 0.0), (-0.09, -0.01))
    assert pins["B"].point_j == pytest.approx((0.11, 0.04))
    assert pins["A"].point_i == pytest.approx((0.06, 0.0))


@pytest.mark.parametrize(
    ("bearing", "last_has_it"), [("", False), ('bearing = "coupler"', False), ('bearing = "rocker"', True)]
)
def test_a_bearing_is_on_the_body_named_first_unless_it_is_named(bearing: str, last_has_it: bool) -> None:
    pin = from_toml(LOOSE + bearing).mechanism.pins[-1]
    assert (pin.name, pin.body_i, pin.body_j, pin.bearing_on_j) == ("B", 1, 2, last_has_it)
    assert pin.clearance is not None
    assert [*from_toml(LOOSE).clearances] == ["B"]


def test_a_guide_is_a_line_of_what_it_is_on() -> None:
    through = 'on = "yoke", through_m = ["10 mm", 0]'
    text = changed(YOKE, ('on = "yoke"', through), ("1.5707963267948966", '"90 deg"'))
    frame, slot = from_toml(text).mechanism.guides
    assert frame == Guide(GROUND, (0.0, 0.0), 1, (0.0, 0.0), 0.0, "frame", False)
    assert slot == Guide(1, (0.01, 0.0), 0, (0.05 - 0.02, 0.0), math.pi / 2, "slot", True)
    assert from_toml(QUICK_RETURN).mechanism.guides[1].point_i == (0.0, 0.42)


# Springs, loads, drives, gravity


def test_a_spring_is_between_pins_of_bodies_and_ground() -> None:
    (spring,) = MECHANISMS["andrews-squeezer"]().mechanism.springs
    assert (spring.body_i, spring.point_i, spring.body_j) == (GROUND, (0.014, 0.072), 2)
    assert (spring.stiffness_N_m, spring.free_length_m, spring.damping_N_s_m) == (4530.0, 0.07785, 0.0)


def test_a_force_acts_at_the_guides_pin_or_along_a_direction_at_the_centre_of_mass() -> None:
    scene = from_toml(QUICK_RETURN + '[load.lever]\nforce_N = 3\nalong_rad = "90 deg"\ntorque_N_m = 1\n')
    ram, lever = scene.mechanism.loads
    assert ram.line == scene.mechanism.guides[1]
    assert lever.line is not None
    assert (lever.line.body_i, lever.line.angle_rad, lever.line.body_j) == (GROUND, math.pi / 2, 2)
    assert lever.line.point_j == (0.0, 0.0)
    assert from_toml(FOUR_BAR + "[load.rocker]\nviscous_N_m_s = 0.1\n").mechanism.loads[0].line is None
    of_two = from_toml(TRAMMEL).mechanism.loads[0].line
    assert isinstance(of_two, Guide)
    assert of_two.name == "up"


def test_a_drive_is_on_the_first_body_unless_it_names_another_or_a_guide() -> None:
    assert from_toml(QUICK_RETURN).mechanism.drive.body == 0
    text = changed(QUICK_RETURN, (STEADY, f'{STEADY}\nbody = "lever"'), ("{ crank = 12.0", "{ lever = 1.0"))
    assert from_toml(text).mechanism.drive.body == 2
    text = changed(
        QUICK_RETURN,
        (STEADY, f'{STEADY}\nguide = "bed"'),
        ("speed_rad_s = { crank = 12.0 }", 'speed_m_s = { bed = "200 mm/s" }'),
        ('hold = ["crank"]\n', ""),
    )
    drive = from_toml(text).mechanism.drive
    assert (drive.guide, drive.body) == (1, 4)


def test_gas_goes_by_the_driven_body_unless_it_names_one() -> None:
    text = changed(TWIN, ('body = "crank"\nangle_rad = [0.0', "angle_rad = [0.0"))
    gas = [load.gas for load in from_toml(text).mechanism.loads if load.gas is not None]
    assert [(each.body, each.table.period) for each in gas] == [(0, 4 * math.pi), (0, 2 * math.pi)]


@pytest.mark.parametrize(
    ("said", "gravity"),
    [
        ("gravity_m_s2 = 9.81\n", (0.0, -9.81)),
        ("gravity_m_s2 = [0, -9.81]\n", (0.0, -9.81)),
        ('gravity_m_s2 = ["-1 g_0", 0]\n', (-9.80665, 0.0)),
        ("", (0.0, 0.0)),
    ],
)
def test_gravity_is_a_number_along_minus_y_or_a_pair(said: str, gravity: tuple[float, float]) -> None:
    assert from_toml(changed(FOUR_BAR, ("gravity_m_s2 = 9.81\n", said))).mechanism.gravity_m_s2 == gravity


@pytest.mark.parametrize(
    ("text", "body", "what"),
    [
        (FOUR_BAR, 2, "x"),
        (FOUR_BAR.replace('"B.x"', '"A.y"'), 1, "y"),
        (FOUR_BAR.replace('"B.x"', '"rocker.angle"'), 2, "angle"),
        (TWIN, 3, "along"),
    ],
)
def test_what_is_observed_is_a_place_an_angle_or_a_way(text: str, body: int, what: str) -> None:
    observed = from_toml(text).observed
    assert (observed.body, observed.what) == (body, what)


# Starts by places

ARM = """
name = "arm"
end_time_s = 1.0
observe = "B.x"
ground.pins_m = { O = 0.0 }
body.upper = { pins_m = { O = 0.0, A = 1.0 }, mass_kg = 1.0, inertia_kg_m2 = 0.1 }
body.lower = { pins_m = { A = 0.0, B = 0.5 }, mass_kg = 1.0, inertia_kg_m2 = 0.1 }
start = { angle_rad = { upper = 0.5, lower = -0.5 }, place_m = { B = [0.9, "90 cm"] }, hold = ["B"] }
"""


def test_a_pin_that_is_held_is_where_the_law_of_cosines_has_the_angles_of_an_arm() -> None:
    reach = math.hypot(0.9, 0.9)
    q = from_toml(ARM).placed.q
    upper = math.pi / 4 + math.acos((1 + reach**2 - 0.25) / (2 * reach))
    assert q[2] == pytest.approx(upper, abs=1e-12)
    assert q[5] - q[2] == pytest.approx(-math.acos((reach**2 - 1.25) / 1.0), abs=1e-12)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_rough_place_of_a_pin_tells_on_which_side_a_four_bar_begins(side: float) -> None:
    placed = from_toml(FOUR_BAR).replace("start", {"place_m": {"B": [0.3, side * 0.2]}}).placed
    x, y = (placed.q[6 + k] + 0.11 * of(placed.q[8]) for k, of in enumerate((math.cos, math.sin)))
    assert (x - 0.28) ** 2 + y**2 == pytest.approx(0.04, rel=1e-12), "B is on the rocker"
    assert math.hypot(x - 0.3, y - side * 0.2) < 0.02
    assert placed.moved is not None
    assert "B moved by 0.0127 m" in placed.moved


def test_a_pin_that_is_held_off_its_path_is_refused() -> None:
    start = {"place_m": {"B": [0.28, 0.25]}, "hold": ["B"]}
    with pytest.raises(SceneError, match=r"^start\.hold: expected held values \(B\) that the joints allow"):
        from_toml(FOUR_BAR).replace("start", start)


# Tables in files

BED = [("speed_rad_s = { crank = 12.0 }\n", ""), ('hold = ["crank"]\n', 'hold = ["bed"]\n')]
BY_TIME = "by_time.time_s = [0, 1, 2, 3]\nby_time.force_N = [1, 2, 3, 4]\nby_time.torque_N_m = [4, 3, 2, 1]"


@pytest.mark.parametrize(
    ("text", "old", "kind", "lists"),
    [
        (FOUR_BAR, FREE, 'kind = "torque"', "time_s = [0, 0.1, 0.3, 0.5]\ntorque_N_m = [1, 2, 3, 4]"),
        (FOUR_BAR, FREE, 'kind = "table"', "time_s = [0, 0.1, 0.2, 0.5]\nangle_rad = [0, 2, 4, 10]"),
        (
            changed(QUICK_RETURN, *BED),
            STEADY,
            'kind = "table"\nguide = "bed"',
            "time_s = [0, 0.1, 0.2, 0.5]\nposition_m = [0, 0.01, 0.02, 1]",
        ),
        (
            TWIN,
            'angle_rad = [0.0, 2.0, 4.0, "1 turn"]\nforce_N = [-2.0, -10.0, -50.0, -2.0]',
            "",
            "angle_rad = [0, 2, 4, 6.283185307]\nforce_N = [-2, -10, -50, -2]",
        ),
        (QUICK_RETURN, "force_N = -40.0", "", BY_TIME),
    ],
    ids=["torque", "angles", "positions", "gas", "force and torque by time"],
)
def test_every_table_may_be_a_file(text: str, old: str, kind: str, lists: str, tmp_path: Path) -> None:
    columns = dict(line.split(" = ") for line in lists.splitlines())
    rows = zip(*(values.strip("[]").split(", ") for values in columns.values()), strict=True)
    head = ",".join(name.rpartition(".")[2] for name in columns)
    (tmp_path / "a.csv").write_text("\n".join([head, *map(",".join, rows)]))
    key = "by_time.file" if "by_time" in lists else "file"
    by_file = from_toml(changed(text, (old, f'{kind}\n{key} = "a.csv"')), tmp_path)
    assert by_file == from_toml(changed(text, (old, f"{kind}\n{lists}")))


@pytest.mark.parametrize("separator", [(",", "."), (";", "."), (";", ",")], ids=" and ".join)
def test_columns_are_found_by_their_names_and_numbers_may_have_decimal_commas(
    separator: tuple[str, str], tmp_path: Path
) -> None:
    comma, point = separator
    rows = [
        ("\ufeffangle_rad", "time_s", "remark"),
        ("0.0", "0", "note"),
        ("0.25", "2.5e-3", ""),
        ("1", "0.01", ""),
    ]
    lines = [f" {comma} ".join(row).replace(".", point) for row in [*rows, ("2.0", "0.02", "end")]]
    (tmp_path / "turn.csv").write_text("\r\n".join([*lines, "", ""]), encoding="utf-8")
    lists = "time_s = [0, 2.5e-3, 0.01, 0.02]\nangle_rad = [0, 0.25, 1, 2]"
    by_list, by_file = (
        from_toml(changed(base("free"), ('"free"', f'"table"\n{columns}')), tmp_path)
        for columns in (lists, 'file = "turn.csv"')
    )
    assert by_file == by_list
    assert "csv" not in by_file.to_toml(), "what is shown needs no other file"


# Files and fields


def test_a_field_deep_in_a_body_is_replaced_by_its_path(tmp_path: Path) -> None:
    (tmp_path / "four-bar.toml").write_text(FOUR_BAR)
    longer = from_toml(FOUR_BAR).replace("body.crank.pins_m.A", 0.11)
    assert longer == from_toml(changed(FOUR_BAR, ("A = 0.1 }", "A = 0.11 }")))
    assert longer.placed != from_toml(FOUR_BAR).placed
    assert load(tmp_path / "four-bar.toml", {"body.crank.pins_m.A": "110 mm"}, "--with") == longer


# The short form

SPRING = '[spring]\ns = { between = ["ground.O", "slider.B"], stiffness_N_m = 1, free_length_m = 0 }\n'


@pytest.mark.parametrize(
    ("piece", "by"),
    [
        ('[slider]\nguide_offset_m = "20 mm"\nguide_angle_rad = "90 deg"', "slider.guide_angle_rad"),
        ('[load.crank]\ntorque_N_m = "1 Nm"\n[slider]', "load.crank"),
        ("[load.rod]\nforce_N = 1\nalong_rad = 0\n[slider]", "load.rod"),
        (f"{SPRING}[slider]", "spring"),
        ("gravity_m_s2 = [-9.81, 0.0]", "gravity_m_s2"),
    ],
)
def test_parts_of_the_general_form_stand_beside_a_crank(piece: str, by: str) -> None:
    old = "gravity_m_s2 = 9.81" if by == "gravity_m_s2" else "[slider]"
    scene = from_toml(changed(ideal_free().to_toml(), (old, piece)))
    assert from_toml(scene.to_toml()) == scene
    assert Scene.model_validate(scene.model_dump(exclude_none=True)).mechanism == scene.mechanism
