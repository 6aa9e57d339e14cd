"""Exudyn on any mechanism: against an independent integration, and the reference's sharp solution."""

from functools import lru_cache
from itertools import combinations
from typing import Any

import numpy as np
import pytest

from engine_models.engine import RunSettings, Trajectory, UnsupportedScene
from engine_models.exudyn.engine import ExudynEngine
from engine_models.exudyn.model import build_model
from engine_models.mechanics.energy import energy_balance_residual_J
from engine_models.reference.engine import ReferenceEngine
from engine_models.scene.parts import AnyScene
from tests.engines.mechanism_texts import (
    ENDS,
    FOUR_BAR,
    FOUR_BAR_CLEARANCE,
    QUICK_RETURN,
    SCOTCH_YOKE,
    TEXTS,
    V_TWIN,
    WALL,
    scene,
)

SHARP = ReferenceEngine(method="dop853", step_tolerance=1e-12)
SAMPLES = 20
ORDER, ORDER_TOLERANCE = 2.0, 0.1
#: Largest error of places in m and angles in rad at the end, in so many steps of the trapezoidal rule, when
#: such runs were first made by another program. The offset crank-slider was not among them.
MEASURED = {
    "crank-slider": (32_000, 9.2e-5),
    "offset-crank-slider": (32_000, 2.0e-5),
    "four-bar": (8_000, 4.0e-6),
    "andrews": (8_000, 5.5e-6),
    "scotch-yoke": (8_000, 5.9e-7),
    "quick-return": (8_000, 2.5e-7),
    "v-twin": (8_000, 3.6e-8),
}


def run(of: AnyScene, step_s: float, **settings: Any) -> Trajectory:
    return ExudynEngine(**settings).simulate(of, RunSettings(step_s, SAMPLES))


@lru_cache
def sharp(of: AnyScene) -> Trajectory:
    """Return the reference's solution of Exudyn's twin of a scene."""
    return SHARP.simulate(ExudynEngine().twin(of), RunSettings(of.end_time_s, SAMPLES))


def largest_errors(of: AnyScene, found: Trajectory) -> dict[str, float]:
    """Return the largest error of every kind of signal, as a part of the largest value of the kind."""
    true, errors = sharp(of), dict[str, float]()
    pairs = {"position": (found.position, true.position), "velocity": (found.velocity, true.velocity)}
    for kind in ("joint_force_N", "guide_force_N", "guide_moment_N_m", "load_work_J"):
        own, other = getattr(found, kind), getattr(true, kind)
        assert own.keys() == other.keys(), kind
        for name in other:
            pairs[f"{kind} {name}"] = own[name], other[name]
    for kind in ("driver_torque_N_m", "driver_work_J"):
        own, other = getattr(found, kind), getattr(true, kind)
        assert (own is None) == (other is None), kind
        if own is not None:
            pairs[kind] = own, other
    for name, (own, other) in pairs.items():
        kind = name.split()[0]
        of_kind = [np.abs(value).max() for each, (_, value) in pairs.items() if each.split()[0] == kind]
        errors[kind] = max(errors.get(kind, 0.0), float(np.abs(own - other).max() / (max(of_kind) + 1e-3)))
    errors["ledger"] = float(np.abs(energy_balance_residual_J(of, found)).max())
    return errors


#: Errors of so small a part of the largest value are round-off, and what Newton's method leaves: no order.
ROUND_OFF = 1e-7


def assert_order_two(of: AnyScene, steps: tuple[int, ...] = (1000, 2000, 4000)) -> None:
    """Assert that every signal converges with order two, and the motion does at all."""
    errors = [largest_errors(of, run(of, of.end_time_s / count)) for count in steps]
    for kind in errors[0]:
        values = [each[kind] for each in errors]
        if values[-1] > ROUND_OFF:
            order = -np.polyfit(np.log(steps), np.log(values), 1)[0]
            assert abs(order - ORDER) < ORDER_TOLERANCE, f"{kind}: order {order:.3f}, {values}"
    assert errors[-1]["position"] < 1e-5, f"{errors[-1]['position']:.1e}"
    assert errors[0]["position"] > 3.6 * errors[1]["position"] > 13 * errors[2]["position"]


def assert_near(of: AnyScene, **settings: Any) -> None:
    """Assert that a run at a tolerance of 1e-12 is the reference's in all signals."""
    found = run(of, of.end_time_s / SAMPLES, step_tolerance=1e-12, **settings)
    # Measured up to 9e-11 of motions, 2e-6 of forces, 1e-9 of works and 4e-11 J.
    bounds = {"position": 1e-9, "velocity": 1e-7, "load_work_J": 1e-8, "driver_work_J": 1e-7, "ledger": 1e-9}
    for kind, error in largest_errors(of, found).items():
        assert error < bounds.get(kind, 2e-5), f"{kind}: {error:.1e}"


@pytest.mark.parametrize("name", MEASURED)
def test_a_mechanism_ends_where_an_independent_integration_does(name: str) -> None:
    of, (steps, measured) = scene(TEXTS[name]), MEASURED[name]
    ends = [ENDS[name][body] for body in of.mechanism.names]
    off = float(np.abs(run(of, of.end_time_s / steps).position[-1] - ends).max())
    assert off == pytest.approx(measured, rel=0.05), f"{off:.2e}"


@pytest.mark.parametrize("name", ["four-bar", "andrews", "scotch-yoke", "quick-return", "v-twin"])
def test_every_signal_converges_with_order_two(name: str) -> None:
    assert_order_two(scene(TEXTS[name], end_time_s=0.02 if name == "andrews" else 0.1))


FORCES = "force_N = [0.0, 20.0, 5.0, -6.0, 3.0, 0.0]"
ONE_TURN = f"[0.1, 1.0, 2.0, 3.0, 4.5, {0.1 + 2 * np.pi}], {FORCES}"
#: Angles near 0 are in the second turn.
TWO_TURNS = f"[-9.0, -8.0, -6.0, -3.0, 1.0, {-9.0 + 4 * np.pi}], {FORCES}"
TIMES = "time_s = [0.0, 0.03, 0.06, 0.1, 0.5]"
#: Every kind of load, on a rotor, on a free body and on one that is both, and springs of both kinds.
LOADS = f"""
[load.crank]
torque_N_m = 0.5
viscous_N_m_s = 0.01
by_time = {{ {TIMES}, torque_N_m = [0.0, 0.4, -0.3, 0.2, 0.0] }}
force_N = 3.0
along_rad = 0.4
[load.coupler]
force_N = 5.0
viscous_N_s_m = 2.0
spring_N_m = 300.0
free_position_m = 0.05
along_rad = 0.7
gas = {{ angle_rad = {ONE_TURN}, body = "crank" }}
[load.rocker]
torque_N_m = -0.2
viscous_N_m_s = 0.02
viscous_N_s_m = 1.0
along_rad = 2.0
gas = {{ angle_rad = {TWO_TURNS}, body = "coupler" }}
by_time = {{ {TIMES}, force_N = [0.0, 40.0, -30.0, 20.0, 0.0] }}
[spring.damped]
between = ["ground.C", "coupler.A"]
stiffness_N_m = 400.0
free_length_m = 0.2
damping_N_s_m = 3.0
[spring.closed]
between = ["ground.O", "rocker.B"]
stiffness_N_m = 100.0
free_length_m = 0.0
"""
DRIVE_TIMES = "time_s = [0.0, 0.02, 0.05, 0.08, 0.2]"
DRIVES = {
    "constant-speed": "",
    "ramp": "final_speed_rad_s = 40.0\nramp_time_s = 0.03",
    "fluctuating": "amplitude_rad_s = 4.0\nfrequency_Hz = 20.0\nphase_rad = 0.3",
    "table": f"{DRIVE_TIMES}\nangle_rad = [0.0, 0.4, 1.2, 1.5, 4.0]",
    "torque": f"{DRIVE_TIMES}\ntorque_N_m = [0.0, 2.0, -1.0, 1.0, 0.0]",
    "motor": "speed_rad_s = [0.0, 10.0, 19.0, 25.0, 40.0]\ntorque_N_m = [2.0, 2.2, 1.0, 0.1, -1.0]",
}
WALLS = f"[clearance.{{}}]{WALL}"


def driven(kind: str) -> str:
    """Return a four-bar under all loads, whose drive's clock is not 0 at the start."""
    speed = "10.37" if kind == "table" else "20.0"
    clock = "" if kind == "table" else "\ntime_s = 0.01"
    start = FOUR_BAR.replace("= 20.0 }", f"= {speed} }}{clock}").replace("9.81", "[1.0, -9.81]")
    return f'{start}{LOADS}[drive]\nkind = "{kind}"\nbody = "crank"\n{DRIVES[kind]}\n'


@pytest.mark.parametrize("kind", DRIVES)
def test_every_drive_and_load_converges_with_order_two_and_is_sharp_in_a_tree(kind: str) -> None:
    assert_order_two(scene(driven(kind), end_time_s=0.1))
    assert_near(scene(driven(kind) + WALLS.format("B"), end_time_s=0.015))


def test_a_loose_four_bar_is_the_references_within_a_tenth_of_a_nanometre() -> None:
    of = scene(FOUR_BAR_CLEARANCE, end_time_s=0.02)
    found, true = run(of, 1e-3, step_tolerance=1e-12), sharp(of)
    off = float(np.abs(found.position - true.position).max())
    assert off < 1e-10, f"{off:.1e}"  # measured 1.5e-12
    assert len(found.contacts["B"].impacts.time_s) == len(true.contacts["B"].impacts.time_s) == 16


@pytest.mark.parametrize("loose", ["A", "C", *map("".join, combinations("OABC", 2))])
def test_trees_of_all_sets_of_loose_pins_are_sharp(loose: str) -> None:
    """Some hang from one pin of the ground, some from both, some are afloat; bearings are on either body."""
    text = FOUR_BAR_CLEARANCE.split("[clearance")[0].replace("constant-speed", "free")
    bearing = {"A": 'bearing = "coupler"', "B": 'bearing = "rocker"', "C": 'bearing = "rocker"'}
    walls = "".join(f"{WALLS.format(pin)}{bearing.get(pin, '')}\n" for pin in loose)
    assert_near(scene(text + walls, end_time_s=0.006))


def test_a_turned_bearing_has_its_friction_at_both_arms() -> None:
    friction = 'law = "saturated-linear", coefficient = 0.1, regularisation_speed_m_s = 20.0'
    text = f'{FOUR_BAR_CLEARANCE}bearing = "rocker"\nfriction = {{ {friction} }}\n'
    assert_near(scene(text, end_time_s=0.006))


#: Loads along a guide of the ground and along one that moves, on a rotor and on a free body.
GUIDE_LOAD = f"""force_N = 20.0
viscous_N_s_m = 5.0
spring_N_m = 200.0
free_position_m = 0.1
gas = {{ angle_rad = {ONE_TURN}, body = "lever" }}
by_time = {{ {TIMES}, force_N = [0.0, 30.0, -10.0, 20.0, 0.0] }}
"""
SHAPER = (
    QUICK_RETURN.replace("9.81", "[3.0, -7.0]").replace("0.42]", "0.42], angle_rad = 0.05")
    + f"[load.ram]\n{GUIDE_LOAD}[load.block]\n{GUIDE_LOAD}"
).replace("[start]", "[start]\nposition_m = { slot = 0.2363 }")
YOKE = (
    SCOTCH_YOKE.replace("9.81", "[3.0, -7.0]")
    .replace('pin = "Y" }', 'pin = "Y", angle_rad = 0.3, through_m = [0.01, 0.02] }')
    .replace("[start]", "[start]\nposition_m = { slot = 0.0, frame = 0.01 }")
)
#: A lever with a slot that a crank's pin turns in, both with centres of mass beside their lines.
LEVER = f"""
name = "slotted lever"
end_time_s = 0.1
gravity_m_s2 = [1.0, -9.0]
observe = "lever.angle"
ground.pins_m = {{ O = 0.0, C = [-0.1, -0.2] }}
[body.crank]
pins_m = {{ O = 0.0, A = 0.06 }}
centre_of_mass_m = [0.03, 0.004]
mass_kg = 0.5
inertia_kg_m2 = 5e-4
[body.lever]
pins_m = {{ C = 0.0, T = [0.3, 0.01] }}
centre_of_mass_m = [0.15, 0.01]
mass_kg = 0.7
inertia_kg_m2 = 4e-3
[guide.slot]
body = "crank"
pin = "A"
on = "lever"
through_m = [0.0, 0.01]
angle_rad = 0.05
turns = true
[load.crank]
{GUIDE_LOAD}
[spring.tie]
between = ["ground.O", "lever.T"]
stiffness_N_m = 200.0
free_length_m = 0.1
damping_N_s_m = 2.0
[start]
angle_rad = {{ crank = 0.5, lever = 0.9 }}
speed_rad_s = {{ crank = 15.0 }}
"""
GUIDE_DRIVES = {
    "constant-speed": "",
    "ramp": "final_speed_m_s = -0.1\nramp_time_s = 0.05",
    "fluctuating": "amplitude_m_s = 0.05\nfrequency_Hz = 10.0",
}


def along(text: str, guide: str, kind: str) -> str:
    """Return a mechanism that is driven along one of its guides."""
    lines = [line for line in text.splitlines() if not line.startswith(("hold", "speed_rad_s"))]
    start = "\n".join(lines).replace("[start]", f"[start]\nspeed_m_s = {{ {guide} = 0.2 }}")
    return f'{start}\n[drive]\nkind = "{kind}"\nguide = "{guide}"\n{GUIDE_DRIVES[kind]}\n'


@pytest.mark.parametrize("text", [SHAPER, YOKE, LEVER], ids=["shaper", "yoke", "lever"])
def test_loads_along_guides_that_move_or_turn_converge_with_order_two(text: str) -> None:
    assert_order_two(scene(text, end_time_s=0.1))


@pytest.mark.parametrize(
    ("text", "guide", "kind"),
    [
        (SHAPER, "bed", "fluctuating"),
        (SHAPER, "slot", "ramp"),
        (YOKE, "frame", "ramp"),
        (YOKE, "slot", "fluctuating"),
    ],
)
def test_a_driven_guide_converges_with_order_two_be_it_on_the_ground_or_not(
    text: str, guide: str, kind: str
) -> None:
    assert_order_two(scene(along(text, guide, kind), end_time_s=0.05))


@pytest.mark.parametrize(
    ("text", "loose"),
    [
        (along(SHAPER, "bed", "constant-speed"), "CD"),  # the driven ram carries the rod
        (along(SHAPER, "bed", "ramp"), "CE"),  # it is alone, and the lever hangs on its block
        (along(YOKE, "frame", "fluctuating"), "O"),
        (LEVER, "C"),  # the lever hangs on the crank's pin in its slot
        (LEVER, "O"),
        (LEVER, "OC"),
        (V_TWIN, "BD"),
    ],
)
def test_trees_with_guides_are_sharp(text: str, loose: str) -> None:
    assert_near(scene(text + "".join(map(WALLS.format, loose)), end_time_s=0.02))


CHAIN = """
name = "chain"
end_time_s = 1.0
gravity_m_s2 = [1.0, -9.81]
observe = "tip.angle"
ground.pins_m = { O = 0.0 }
[body]
arm = { pins_m = { O = 0.0, A = 1.0 }, centre_of_mass_m = [1.0, 0.1], mass_kg = 1.0, inertia_kg_m2 = 0.1 }
tip = { pins_m = { A = 0.0 }, centre_of_mass_m = 0.4, mass_kg = 0.2, inertia_kg_m2 = 0.01 }
[load.tip]
viscous_N_m_s = 0.05
[start]
speed_rad_s = { arm = 1.0, tip = 2.0 }
"""
TURNED = '[drive]\nkind = "constant-speed"\nbody = "{}"\n'


@pytest.mark.parametrize("drive", ["", TURNED.format("arm")])
def test_ideal_joints_that_close_no_loop_are_run_by_explicit_solvers(drive: str) -> None:
    of = scene(CHAIN + drive)
    assert ExudynEngine().solver_of(of) == "TrapezoidalIndex2"
    assert_near(of, solver="DOPRI5")
    errors = [largest_errors(of, run(of, 1 / n, solver="RK44"))["position"] for n in (200, 400)]
    assert 12 < errors[0] / errors[1] < 20, f"{errors}, of order 4"


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (FOUR_BAR, "ideal joints alone form a closed loop"),
        (CHAIN + TURNED.format("tip"), "no coordinate is the angle of tip"),
        (along(SHAPER, "slot", "ramp") + WALLS.format("C") + WALLS.format("E"), "slot is driven"),
    ],
)
def test_a_tree_that_there_is_not_is_refused_to_explicit_solvers_alone(text: str, reason: str) -> None:
    of = scene(text, end_time_s=2e-3)
    with pytest.raises(UnsupportedScene, match=reason):
        ExudynEngine(solver="RK44").check(of)
    run(of, 1e-5)


@pytest.mark.parametrize(
    ("name", "objects"),
    [
        (
            "andrews",
            {"RotationalMass1D": 4, "RigidBody2D": 3, "JointRevolute2D": 6, "ConnectorSpringDamper": 1},
        ),
        ("scotch-yoke", {"RotationalMass1D": 1, "Mass1D": 1, "JointPrismatic2D": 1}),
        ("v-twin", {"RotationalMass1D": 1, "Mass1D": 2, "RigidBody2D": 2, "JointRevolute2D": 4}),
    ],
)
def test_what_the_ground_carries_needs_no_constraint(name: str, objects: dict[str, int]) -> None:
    system = build_model(scene(TEXTS[name])).mbs
    kinds = [system.GetObject(k)["objectType"] for k in range(system.systemData.NumberOfObjects())]
    assert {kind: kinds.count(kind) for kind in kinds if kind != "Ground"} == objects
