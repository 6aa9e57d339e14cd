"""What files of mechanisms may say, and how it is read."""

import math
import re
from pathlib import Path
from typing import Any

import jsonschema
import pytest

import crankslider as cs
from engine_models.scene.file import from_toml, load
from engine_models.scene.general import GeneralScene
from engine_models.scene.library import SCENES, ideal_free
from engine_models.scene.scene import Scene
from engine_models.scene.schema import scene_schema
from reference_solver.mechanism.data import GROUND, Guide, Table, Torque
from tests.engine_models.scene.mechanism_texts import FOUR_BAR, QUICK_RETURN, ROOM, TWIN
from tests.engines.mechanism_texts import ANDREWS, SCOTCH_YOKE
from tests.helpers.command import crankslider
from tests.helpers.refusals import require_refusal

LOOSE = FOUR_BAR + "[clearance.B]\n" + ROOM
TEXTS = {
    "four-bar": FOUR_BAR,
    "loose": LOOSE,
    "quick return": QUICK_RETURN,
    "twin": TWIN,
    "Andrews": ANDREWS,
    "yoke": SCOTCH_YOKE,
}
#: A bar whose ends slide on two lines.
TRAMMEL = """
name = "trammel"
end_time_s = 1.0
observe = "P.x"
[body.bar]
pins_m = { P = -0.5, Q = 0.5 }
mass_kg = 1.0
inertia_kg_m2 = 0.1
[guide.across]
body = "bar"
pin = "P"
turns = true
[guide.up]
body = "bar"
pin = "Q"
angle_rad = "90 deg"
turns = true
[load.bar]
force_N = 1.0
guide = "up"
[start]
angle_rad = { bar = 0.5 }
"""
FREE, STEADY = 'kind = "free"', 'kind = "constant-speed"'
SHORT = ideal_free().to_toml()


def general(text: str, folder: Path = Path()) -> GeneralScene:
    """Return the scene of a text in the general form."""
    scene = from_toml(text, folder)
    assert isinstance(scene, GeneralScene)
    return scene


def changed(text: str, *changes: tuple[str, str]) -> str:
    """Return a text with other pieces in it."""
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    return text


# Joints and guides


def test_joints_come_from_the_ground_first_then_in_the_order_of_the_file() -> None:
    assert general(FOUR_BAR).joints == ("O", "C", "A", "B")
    pins = {pin.name: (pin.body_i, pin.body_j) for pin in general(FOUR_BAR).mechanism.pins}
    assert pins == {"O": (GROUND, 0), "C": (GROUND, 2), "A": (0, 1), "B": (1, 2)}


def test_a_pin_of_three_bodies_is_a_joint_of_the_first_with_each_other() -> None:
    assert general(TWIN).joints == ("O", "A.rod1", "A.rod2", "B", "D")
    pins = {pin.name: (pin.body_i, pin.body_j) for pin in general(TWIN).mechanism.pins}
    assert (pins["A.rod1"], pins["A.rod2"]) == ((0, 1), (0, 2))


def test_places_are_numbers_or_pairs_and_count_from_the_centre_of_mass() -> None:
    text = changed(FOUR_BAR, ("C = 0.0, B = 0.2", "C = 0, B = [0.2, 0.05]"), ("= 0.09", "= [0.09, 0.01]"))
    pins = {pin.name: pin for pin in general(text).mechanism.pins}
    assert pins["C"].point_i == (0.28, 0.0)
    assert pins["C"].point_j == (-0.09, -0.01)
    assert pins["B"].point_j == pytest.approx((0.11, 0.04))
    assert pins["A"].point_i == pytest.approx((0.06, 0.0))


def test_a_bearing_is_on_the_body_named_first_unless_it_is_named() -> None:
    for bearing, last_has_it in (("", False), ('bearing = "coupler"', False), ('bearing = "rocker"', True)):
        pin = general(LOOSE + bearing).mechanism.pins[-1]
        assert (pin.name, pin.body_i, pin.body_j) == ("B", 1, 2)
        assert pin.clearance is not None
        assert pin.bearing_on_j is last_has_it
    assert general(LOOSE).joints_with_clearance == ("B",)


def test_a_guide_is_a_line_of_what_it_is_on() -> None:
    through = 'on = "yoke", through_m = ["10 mm", 0]'
    text = changed(SCOTCH_YOKE, ('on = "yoke"', through), ("1.5707963267948966", '"90 deg"'))
    frame, slot = general(text).mechanism.guides
    assert frame == Guide(GROUND, (0.0, 0.0), 0.0, 1, (0.0, 0.0), "frame", False)
    assert slot == Guide(1, (0.01, 0.0), math.pi / 2, 0, (0.05 - 0.02, 0.0), "slot", True)
    assert general(QUICK_RETURN).mechanism.guides[1].point_i == (0.0, 0.42)


# Springs, loads, drives, gravity


def test_a_spring_is_between_pins_of_bodies_and_ground() -> None:
    (spring,) = general(ANDREWS).mechanism.springs
    assert (spring.body_i, spring.point_i, spring.body_j) == (GROUND, (0.014, 0.072), 2)
    assert (spring.stiffness_N_m, spring.free_length_m, spring.damping_N_s_m) == (4530.0, 0.07785, 0.0)


def test_a_force_acts_at_the_guides_pin_or_along_a_direction_at_the_centre_of_mass() -> None:
    scene = general(QUICK_RETURN + '[load.lever]\nforce_N = 3\nalong_rad = "90 deg"\ntorque_N_m = 1\n')
    ram, lever = scene.mechanism.loads
    assert ram.line == scene.mechanism.guides[1]
    assert lever.line is not None
    assert (lever.line.body_i, lever.line.angle_rad, lever.line.body_j) == (GROUND, math.pi / 2, 2)
    assert lever.line.point_j == (0.0, 0.0)
    turned = general(FOUR_BAR + "[load.rocker]\nviscous_N_m_s = 0.1\n").mechanism.loads[0]
    assert turned.line is None


def test_a_load_names_one_of_two_guides() -> None:
    line = general(TRAMMEL).mechanism.loads[0].line
    assert isinstance(line, Guide)
    assert line.name == "up"


def test_a_drive_is_on_the_first_body_unless_it_names_another_or_a_guide() -> None:
    assert general(QUICK_RETURN).mechanism.drive.body == 0
    text = changed(QUICK_RETURN, (STEADY, f'{STEADY}\nbody = "lever"'), ("{ crank = 12.0", "{ lever = 1.0"))
    assert general(text).mechanism.drive.body == 2
    text = changed(
        QUICK_RETURN,
        (STEADY, f'{STEADY}\nguide = "bed"'),
        ("speed_rad_s = { crank = 12.0 }", 'speed_m_s = { bed = "200 mm/s" }'),
        ('hold = ["crank"]\n', ""),
    )
    drive = general(text).mechanism.drive
    assert (drive.guide, drive.body) == (1, 4)


def test_gas_goes_by_the_driven_body_unless_it_names_one() -> None:
    text = changed(TWIN, ('body = "crank"\nangle_rad = [0.0', "angle_rad = [0.0"))
    first, second = (load.gas for load in general(text).mechanism.loads)
    assert first is not None
    assert second is not None
    assert (first.body, second.body) == (0, 0)
    assert (first.table.period, second.table.period) == (4 * math.pi, 2 * math.pi)


def test_gravity_is_a_number_along_minus_y_or_a_pair() -> None:
    assert general(FOUR_BAR).gravity == (0.0, -9.81)
    assert general(changed(FOUR_BAR, ("= 9.81", "= [0, -9.81]"))).gravity == (0.0, -9.81)
    assert general(changed(FOUR_BAR, ("= 9.81", '= ["-1 g_0", 0]'))).gravity == (-9.80665, 0.0)
    assert general(changed(FOUR_BAR, ("gravity_m_s2 = 9.81\n", ""))).gravity == (0.0, 0.0)


def test_what_is_observed_is_a_place_an_angle_or_a_way() -> None:
    for text, body, what, unit in (
        (FOUR_BAR, 2, "x", "m"),
        (FOUR_BAR.replace('"B.x"', '"A.y"'), 1, "y", "m"),
        (FOUR_BAR.replace('"B.x"', '"rocker.angle"'), 2, "angle", "rad"),
        (TWIN, 3, "along", "m"),
    ):
        observed = general(text).observed
        assert (observed.body, observed.what, observed.unit) == (body, what, unit)


def test_numbers_may_be_text_with_a_unit_in_lists_and_mappings_too() -> None:
    text = changed(
        FOUR_BAR,
        ("C = [0.28, 0.0]", 'C = ["280 mm", "0 m"]'),
        ("A = 0.1 }", 'A = "10 cm" }'),
        ("crank = 0.7", 'crank = "30 deg"'),
        ("crank = 20.0", 'crank = "1500 rpm"'),
        ("end_time_s = 0.5", 'end_time_s = "500 ms"'),
        ("mass_kg = 0.4", 'mass_kg = "400 g"'),
    )
    scene, by_numbers = general(text), general(FOUR_BAR)
    assert scene.start.angle_rad["crank"] == pytest.approx(math.pi / 6, rel=1e-15)
    assert scene.start.speed_rad_s["crank"] == pytest.approx(50 * math.pi, rel=1e-15)
    assert (scene.ground, scene.body, scene.end_time_s) == (by_numbers.ground, by_numbers.body, 0.5)


# Tables in files


@pytest.mark.parametrize(
    ("text", "old", "lists", "files"),
    [
        (
            FOUR_BAR,
            FREE,
            'kind = "torque"\ntime_s = [0, 0.1, 0.3, 0.5]\ntorque_N_m = [1, 2, 3, 4]',
            'kind = "torque"',
        ),
        (
            FOUR_BAR,
            FREE,
            'kind = "motor"\nspeed_rad_s = [0, 1, 3, 5]\ntorque_N_m = [4, 3, 2, 1]',
            'kind = "motor"',
        ),
        (
            FOUR_BAR,
            FREE,
            'kind = "table"\ntime_s = [0, 0.1, 0.2, 0.5]\nangle_rad = [0, 2, 4, 10]',
            'kind = "table"',
        ),
        (
            changed(
                QUICK_RETURN,
                ("speed_rad_s = { crank = 12.0 }\n", ""),
                ('hold = ["crank"]\n', 'hold = ["bed"]\n'),
            ),
            STEADY,
            'kind = "table"\nguide = "bed"\ntime_s = [0, 0.1, 0.2, 0.5]\nposition_m = [0, 0.01, 0.02, 1]',
            'kind = "table"\nguide = "bed"',
        ),
        (
            TWIN,
            'angle_rad = [0.0, 2.0, 4.0, "1 turn"]\nforce_N = [-2.0, -10.0, -50.0, -2.0]',
            "angle_rad = [0, 2, 4, 6.283185307]\nforce_N = [-2, -10, -50, -2]",
            "",
        ),
        (
            QUICK_RETURN,
            "force_N = -40.0",
            "by_time.time_s = [0, 1, 2, 3]\nby_time.force_N = [1, 2, 3, 4]",
            "",
        ),
        (
            QUICK_RETURN,
            "force_N = -40.0",
            "by_time.time_s = [0, 1, 2, 3]\nby_time.force_N = [1, 2, 3, 4]\n"
            "by_time.torque_N_m = [4, 3, 2, 1]",
            "",
        ),
    ],
    ids=["torque", "motor", "angles", "positions", "gas", "force by time", "force and torque by time"],
)
def test_every_table_may_be_a_file(text: str, old: str, lists: str, files: str, tmp_path: Path) -> None:
    columns = dict(line.split(" = ") for line in lists.splitlines() if "[" in line)
    rows = zip(*(list(values.strip("[]").split(", ")) for values in columns.values()), strict=True)
    head = ",".join(name.rpartition(".")[2] for name in columns)
    (tmp_path / "a.csv").write_text("\n".join([head, *map(",".join, rows)]))
    key = "by_time.file" if "by_time" in lists else "file"
    by_file = general(changed(text, (old, f'{files}\n{key} = "a.csv"')), tmp_path)
    assert by_file == general(changed(text, (old, lists)))
    (tmp_path / "a.csv").write_text("other\n1\n")
    with pytest.raises(cs.BadInput, match=r"file: .*a\.csv: expected the columns .*, got \"other\""):
        from_toml(changed(text, (old, f'{files}\n{key} = "a.csv"')), tmp_path)


def test_a_torque_by_time_is_a_table_with_slopes() -> None:
    torque = (
        'kind = "torque"\ntime_s = [0, 0.1, 0.3, 0.5]\ntorque_N_m = ["1 Nm", 2, 3, 4]\nend_slopes = [0, 1]'
    )
    law = general(changed(FOUR_BAR, (FREE, torque))).mechanism.drive.law
    assert isinstance(law, Torque)
    assert law.torque_N_m == Table((0.0, 0.1, 0.3, 0.5), (1.0, 2.0, 3.0, 4.0), "spline", (0.0, 1.0))


# Files and fields


@pytest.mark.parametrize("name", TEXTS)
def test_a_scene_survives_a_file(name: str) -> None:
    scene = general(TEXTS[name])
    written = scene.to_toml()
    assert from_toml(written) == scene
    assert from_toml(written).mechanism == scene.mechanism
    assert "[start.speed_m_s]" not in written


def test_a_field_deep_in_a_body_is_replaced_by_its_path(tmp_path: Path) -> None:
    file = tmp_path / "four-bar.toml"
    file.write_text(FOUR_BAR)
    longer = general(FOUR_BAR).replace("body.crank.pins_m.A", 0.11)
    assert longer == general(changed(FOUR_BAR, ("A = 0.1 }", "A = 0.11 }")))
    assert longer.placed != general(FOUR_BAR).placed
    assert load(file, {"body.crank.pins_m.A": "110 mm"}, "--with") == longer
    done = crankslider("simulate", file, "--with", "body.crank.pins_m.A=0.11", "--end", "0.001")
    assert done.code == 0
    assert done.stdout.startswith("time_s,")
    done = crankslider("simulate", file, "--with", "body.crank.mass_kg=-1")
    expected = "--with body.crank.mass_kg: expected a finite number > 0, got -1"
    require_refusal(done.stdout, done.stderr, done.code, expected)


def errors(data: object) -> list[str]:
    """Return what a validator of JSON schemas finds wrong."""
    return [error.message for error in jsonschema.Draft202012Validator(scene_schema()).iter_errors(data)]


def data_of(text: str) -> dict[str, Any]:
    """Return what a text of TOML contains."""
    return from_toml(text).model_dump(mode="json", exclude_none=True)


@pytest.mark.parametrize("name", [*TEXTS, *SCENES])
def test_the_schema_takes_good_files(name: str) -> None:
    data = (
        data_of(TEXTS[name]) if name in TEXTS else SCENES[name]().model_dump(mode="json", exclude_none=True)
    )
    assert errors(data) == []


GOOD: dict[str, tuple[str, object]] = {
    "unit of a pin": ("body.crank.pins_m.A", "100 mm"),
    "units of a pair": ("body.crank.pins_m", {"O": ["0 mm", 0], "A": 0.1}),
    "unit of a start": ("start.angle_rad.crank", "40 deg"),
    "torque from a file": ("drive", {"kind": "torque", "file": "a.csv"}),
    "motor from a file": ("drive", {"kind": "motor", "file": "a.csv"}),
    "gravity as a pair": ("gravity_m_s2", [0, "-1 g_0"]),
}
WRONG: dict[str, tuple[str, object]] = {
    "text for a pin": ("body.crank.pins_m.A", "far"),
    "three numbers of a place": ("body.crank.pins_m.A", [0, 0, 0]),
    "mass 0": ("body.crank.mass_kg", 0),
    "no bodies": ("body", {}),
    "blank in a name": ("body", {"the crank": {"pins_m": {"O": 0}, "mass_kg": 1, "inertia_kg_m2": 1}}),
    "unknown key": ("body.crank.colour", 1),
    "unknown section": ("belt", {}),
    "no pins": ("body.crank", {"mass_kg": 1, "inertia_kg_m2": 1}),
    "spring of one pin": ("spring", {"s": {"between": ["ground.O"], "stiffness_N_m": 1, "free_length_m": 1}}),
    "guide that may turn": ("guide", {"g": {"body": "crank", "pin": "A", "turns": "yes"}}),
    "unknown drive": ("drive", {"kind": "belt"}),
    "torque of nothing": ("drive", {"kind": "torque"}),
    "observe": ("observe", 3),
    "negative time": ("end_time_s", -1),
    "text for an angle": ("start.angle_rad.crank", "steep"),
}


@pytest.mark.parametrize("case", [*GOOD, *WRONG])
def test_the_schema_takes_what_a_file_may_say(case: str) -> None:
    data = data_of(FOUR_BAR)
    field, value = {**GOOD, **WRONG}[case]
    part = data
    *sections, name = field.split(".")
    for section in sections:
        part = part[section]
    part[name] = value
    assert (errors(data) == []) == (case in GOOD)


# The short form


def test_a_guide_beside_the_origin_is_on_the_left_of_its_direction() -> None:
    text = changed(SHORT, ("[slider]", '[slider]\nguide_offset_m = "20 mm"\nguide_angle_rad = "90 deg"'))
    scene = from_toml(text)
    assert isinstance(scene, Scene)
    assert scene.general_by == "slider.guide_angle_rad"
    (guide,) = scene.mechanism.guides
    assert guide.point_i == pytest.approx((-0.02, 0.0))
    assert guide.angle_rad == math.pi / 2
    assert scene.observed.name == "guide.along"
    assert from_toml(scene.to_toml()) == scene
    assert from_toml(scene.general.to_toml()).mechanism == scene.mechanism


@pytest.mark.parametrize(
    ("piece", "by"),
    [
        ('[load.crank]\ntorque_N_m = "1 Nm"\n', "load.crank"),
        ("[load.rod]\nforce_N = 1\nalong_rad = 0\n", "load.rod"),
        (
            '[spring.s]\nbetween = ["ground.O", "slider.B"]\nstiffness_N_m = 1\nfree_length_m = 0.1\n',
            "spring",
        ),
    ],
)
def test_parts_of_the_general_form_stand_beside_a_crank(piece: str, by: str) -> None:
    scene = from_toml(SHORT + piece)
    assert isinstance(scene, Scene)
    assert scene.general_by == by
    assert from_toml(scene.general.to_toml()).mechanism == scene.mechanism


def test_gravity_of_the_short_form_may_be_a_pair() -> None:
    scene = ideal_free().replace("gravity_m_s2", [-9.81, 0.0])
    assert (scene.gravity, scene.general_by) == ((-9.81, 0.0), "gravity_m_s2")
    assert ideal_free().general_by is None


# What takes them


def test_general_files_are_simulated_and_shown(tmp_path: Path) -> None:
    file = tmp_path / "four-bar.toml"
    file.write_text(FOUR_BAR)
    run = cs.simulate(file, end=0.002, samples=5)
    assert run.frame["observed_B_x_m"].notna().all()
    assert {"crank_angle_rad", "rocker_speed_rad_s", "joint_B_force_x_N"} <= {*run.frame.columns}
    assert from_toml(crankslider("show", file).stdout) == general(FOUR_BAR)
    assert crankslider("check", file).stdout.startswith("four-bar: 3 bodies, 4 joints; 8 rows of rank 8, 1 ")


def test_the_truth_of_a_general_file_says_of_what_it_is_certain(tmp_path: Path) -> None:
    file = tmp_path / "four-bar.toml"
    file.write_text(FOUR_BAR)
    told = crankslider("truth", file, "--end", 0.02, "--samples", 5, "--out", tmp_path / "true.csv")
    assert told.code == 0, told.stderr
    assert re.search(r"B\.x is certain to \d\.\de-1\d m until t = 0\.02 s, by independent eq", told.stderr)
    of_angle = cs.truth(from_toml(FOUR_BAR).replace("observe", "rocker.angle"), end=0.02, samples=5)
    assert re.match(r"rocker\.angle is certain to \d\.\de-1\d rad until", of_angle.notes()[0])
    assert of_angle.certain_m < 1e-14
    assert {"observed_rocker_angle_rad", "coupler_x_m"} < {*of_angle.frame.columns}
