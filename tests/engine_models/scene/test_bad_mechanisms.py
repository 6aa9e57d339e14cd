"""Files of mechanisms that do not hang together: each is refused in one line that names what is wrong."""

from pathlib import Path

import pytest

from tests.engine_models.scene.mechanism_texts import FOUR_BAR, QUICK_RETURN, ROOM, TWIN
from tests.helpers.command import crankslider
from tests.helpers.refusals import require_refusal

SPRING = """
[spring.s]
between = ["ground.O", "rocker.B"]
stiffness_N_m = 100.0
free_length_m = 0.1
"""
BY_TIME = """
[load.rocker.by_time]
time_s = [0.0, 0.1, 0.2, 0.5]
torque_N_m = [0.0, 1.0, 2.0, 1.0]
"""
GAS = """
[load.rocker]
along_rad = 0.0
gas = { angle_rad = [0.0, 2.0, 4.0, "1 turn"], force_N = [1.0, 2.0, 3.0, 1.0] }
"""
STATE = """
[start.crank]
x_m = 0.0
y_m = 0.0
angle_rad = 0.0
velocity_x_m_s = 0.0
velocity_y_m_s = 0.0
angular_velocity_rad_s = 0.0
"""
FREE, HELD = '[drive]\nkind = "free"\n', 'kind = "constant-speed"'
MOTOR = """[drive]
kind = "motor"
speed_rad_s = [0.0, 10.0, 20.0, 30.0]
torque_N_m = [3.0, 2.0, 1.0, 0.0]
"""
TORQUE = """[drive]
kind = "torque"
time_s = [0.0, 0.1, 0.2, 0.5]
torque_N_m = [3.0, 2.0, 1.0, 0.0]
"""
TABLE = """[drive]
kind = "table"
time_s = [0.0, 0.1, 0.2, 0.5]
angle_rad = [0.0, 2.0, 4.0, 10.0]
"""
MOTOR_FILE, TORQUE_FILE, TABLE_FILE = (FOUR_BAR.replace(FREE, drive) for drive in (MOTOR, TORQUE, TABLE))
EVERY_KEY = (
    "the key name, end_time_s, gravity_m_s2, observe, turning, ground, body, guide, spring, load, drive, "
    "clearance or start"
)
NAME = "a name of letters, digits, _ and -, a letter first"
START_KEY = "a key of start or a body (angle_rad, position_m, hold, speed_rad_s, speed_m_s, time_s, crank, "

#: A file and what is changed in it, old and new, added where there is no old one; the refusal behind the
#: file's name.
Case = tuple[str, list[tuple[str, str]], str]
ASSEMBLY: dict[str, Case] = {
    "open loop": (
        FOUR_BAR,
        [("C = [0.28, 0.0]", "C = [0.8, 0.0]")],
        "line 27: start: expected joints that close, got B open by 0.107 m",
    ),
    "millimetres on the ground": (
        FOUR_BAR,
        [("C = [0.28, 0.0]", "C = [280, 0.0]")],
        "line 27: start: expected joints that close, got B open by 277 m",
    ),
    "millimetres in a guide": (
        QUICK_RETURN,
        [("[0.0, 0.42]", "[0.0, 420.0]")],
        "line 49: start: expected joints that close, got E open by 418 m",
    ),
    "third leg of a parallelogram": (
        FOUR_BAR,
        [
            ("C = [0.28, 0.0]", "C = [0.28, 0.0], D = [0.14, 0.0]"),
            ("C = 0.0, B = 0.2", "C = 0.0, B = 0.1"),
            ("A = 0.0, B = 0.25", "A = 0.0, B = 0.28, M = 0.14"),
            ("coupler = 0.5, rocker = 1.8", "rocker = 0.7, leg = 0.7"),
            ("", "[body.leg]\npins_m = { D = 0, M = 0.1 }\nmass_kg = 1\ninertia_kg_m2 = 1e-3\n"),
        ],
        "line 27: start: expected joints whose rows are independent, got 12 rows of rank 11, those of O, C, "
        "D, A, B, M depend on each other: take one of these away, give it clearance, or start elsewhere",
    ),
    "held values of a loop": (
        FOUR_BAR,
        [('hold = ["crank"]', 'hold = ["crank", "rocker"]')],
        # A and B are open by the same: rounding says which is told.
        "line 29: start.hold: expected held values (crank, rocker) that the joints allow, got ",
    ),
    "crank that the rocker cannot follow": (
        FOUR_BAR,
        [("C = [0.28, 0.0]", "C = [0.48, 0.0]"), ("crank = 0.7", "crank = 3.1"), ('hold = ["crank"]\n', "")],
        "line 27: start: expected held values (crank) that the joints allow, got B open by 0.086 m",
    ),
    "too many speeds": (
        FOUR_BAR,
        [("{ crank = 20.0 }", "{ crank = 20.0, rocker = 1.0 }")],
        "line 30: start.speed_rad_s: expected as many speeds as the joints leave, 1 degree of freedom, got 2",
    ),
    "too few speeds": (
        FOUR_BAR,
        [(", C = [0.28, 0.0]", ""), ("C = 0.0, B = 0.2", "B = 0.2")],
        "line 30: start.speed_rad_s: expected as many speeds as the joints leave, 3 degrees of freedom, "
        "got 1",
    ),
    "speed of the crank beside that of a driven guide": (
        QUICK_RETURN,
        [(HELD, f'{HELD}\nguide = "bed"')],
        "line 52: start.speed_rad_s: expected as many speeds as the joints leave, 1 degree of freedom, got 2 "
        "(that of bed, by the drive, among them)",
    ),
    "speed of what cannot turn": (
        QUICK_RETURN,
        [("{ crank = 12.0 }", "{ ram = 12.0 }"), (HELD, 'kind = "free"')],
        "line 52: start.speed_rad_s: expected speeds that the joints allow, got that of ram off by 6 rad/s",
    ),
}
PARTS: dict[str, Case] = {
    "pin alone": (
        FOUR_BAR,
        [("C = 0.0, B = 0.2", "C = 0.0, B = 0.2, E = 0.3")],
        "line 22: body.rocker.pins_m.E: expected a pin that another body or the ground has too (O, C, A, B), "
        "got it here alone",
    ),
    "pin of the ground alone": (
        FOUR_BAR,
        [("C = [0.28, 0.0]", "C = [0.28, 0.0], D = 1.0")],
        "line 7: ground.pins_m.D: expected a pin that another body or the ground has too (O, C, A, B), "
        "got it here alone",
    ),
    "no pins": (
        FOUR_BAR,
        [("{ C = 0.0, B = 0.2 }", "{}")],
        "line 22: body.rocker.pins_m: expected one pin at least, got none",
    ),
    "pins missing": (
        FOUR_BAR,
        [("pins_m = { C = 0.0, B = 0.2 }\n", "")],
        "line 21: body.rocker.pins_m: expected places by the names of pins, as { A = 0.1 }, got nothing",
    ),
    "no bodies": (
        'name = "none"\nend_time_s = 1.0\nobserve = "B.x"\nbody = {}\n',
        [],
        "line 4: body: expected one body at least, as [body.crank], got an empty section",
    ),
    "bodies forgotten": (
        'name = "none"\nend_time_s = 1.0\nobserve = "B.x"\n',
        [],
        "body: expected one body at least, as [body.crank], got nothing",
    ),
    "mass 0": (
        FOUR_BAR,
        [("mass_kg = 0.3\n", "mass_kg = 0\n")],
        "line 17: body.coupler.mass_kg: expected a finite number > 0, got 0",
    ),
    "negative inertia": (
        FOUR_BAR,
        [("= 2e-3", "= -2e-3")],
        "line 18: body.coupler.inertia_kg_m2: expected a finite number > 0, got -0.002",
    ),
    "two bodies of a name": (
        FOUR_BAR,
        [("[body.rocker]", "[body.crank]")],
        "TOML syntax: expected valid TOML, got 'Cannot declare ('body', 'crank') twice (at line 21, ",
    ),
    "body named ground": (
        FOUR_BAR,
        [("[body.rocker]", "[body.ground]")],
        'line 21: body.ground: expected a name other than the frame\'s, got "ground"',
    ),
    "body named as a key of start": (
        FOUR_BAR,
        [("[body.rocker]", "[body.hold]")],
        'line 21: body.hold: expected a name other than that of a key of start, got "hold"',
    ),
    "guide named as a pin": (
        QUICK_RETURN,
        [("[guide.slot]", "[guide.E]")],
        'line 36: guide.E: expected a name that no pin has, got "E"',
    ),
    "blank in a body's name": (
        FOUR_BAR,
        [("[body.rocker]", '[body."my rocker"]')],
        f'line 21: body.my rocker: expected {NAME}, got "my rocker"',
    ),
    "blank in a pin's name": (
        FOUR_BAR,
        [("{ C = 0.0,", '{ "C 1" = 0.0,')],
        f'line 22: body.rocker.pins_m.C 1: expected {NAME}, got "C 1"',
    ),
    "digit before a guide's name": (
        QUICK_RETURN,
        [("[guide.bed]", "[guide.1bed]")],
        f'line 41: guide.1bed: expected {NAME}, got "1bed"',
    ),
    "no name": (FOUR_BAR, [("[body.rocker]", '[body.""]')], f'body."": expected {NAME}, got ""'),
    "unknown pin of a guide": (
        QUICK_RETURN,
        [('pin = "E"', 'pin = "e"')],
        'line 43: guide.bed.pin: expected a pin of ram (E), got "e" (did you mean E?)',
    ),
    "pin of another body in a guide": (
        QUICK_RETURN,
        [('pin = "E"', 'pin = "D"')],
        'line 43: guide.bed.pin: expected a pin of ram (E), got "D"',
    ),
    "unknown body of a guide": (
        QUICK_RETURN,
        [('body = "ram"', 'body = "rma"')],
        "line 42: guide.bed.body: expected a body (crank, block, lever, rod, ram), "
        'got "rma" (did you mean ram?)',
    ),
    "guide on itself": (
        QUICK_RETURN,
        [('on = "lever"', 'on = "block"')],
        "line 39: guide.slot.on: expected ground or another body (ground, crank, lever, rod, ram), "
        'got "block"',
    ),
    "unknown pin of a spring": (
        FOUR_BAR + SPRING,
        [("rocker.B", "rocker.Q")],
        "line 36: spring.s.between.1: expected a pin with its body (ground.O, crank.O, ground.C, rocker.C, "
        'crank.A, coupler.A, coupler.B, rocker.B), got "rocker.Q" (did you mean rocker.C?)',
    ),
    "spring in a body": (
        FOUR_BAR + SPRING,
        [("ground.O", "rocker.C")],
        "line 36: spring.s.between: expected pins of two bodies, got both of rocker",
    ),
    "spring of three pins": (
        FOUR_BAR + SPRING,
        [('"rocker.B"', '"rocker.B", "crank.A"')],
        'line 36: spring.s.between: expected two pins, as ["ground.O", "body.A"], got a list',
    ),
    "number for a pin of a spring": (
        FOUR_BAR + SPRING,
        [('"rocker.B"', "3")],
        "line 36: spring.s.between.1: expected a string, got 3",
    ),
    "spring without a length": (
        FOUR_BAR + SPRING,
        [("free_length_m = 0.1\n", "")],
        "line 35: spring.s.free_length_m: expected a finite number >= 0, got nothing",
    ),
    "clearance of no pin": (
        FOUR_BAR + "[clearance.Z]\n" + ROOM,
        [],
        'line 34: clearance.Z: expected a pin of two bodies (O, C, A, B), got "Z"',
    ),
    "clearance of a pin of three bodies": (
        TWIN + "[clearance.A]\n" + ROOM,
        [],
        "line 66: clearance.A: expected a pin of two bodies, got one of crank, rod1, rod2: "
        "give the bodies two pins at one place",
    ),
    "clearance in millimetres": (
        FOUR_BAR + "[clearance.B]\n" + ROOM,
        [("= 5e-4", "= 0.5"), ("= 0.01", "= 10.0")],
        "line 35: clearance.B.radial_clearance_m: expected a number < 0.25, the largest distance between two "
        "joints of a body, got 0.5",
    ),
    "bearing elsewhere": (
        FOUR_BAR + "[clearance.B]\n" + ROOM + 'bearing = "crank"\n',
        [],
        'line 41: clearance.B.bearing: expected what has pin B (coupler, rocker), got "crank"',
    ),
    "unknown pin observed": (
        FOUR_BAR,
        [('"B.x"', '"b.x"')],
        'line 4: observe: expected a pin of a body (O.x, C.x, A.x, B.x), got "b.x" (did you mean B?)',
    ),
    "body's x observed": (
        FOUR_BAR,
        [('"B.x"', '"rocker.x"')],
        'line 4: observe: expected a pin of a body (O.x, C.x, A.x, B.x), got "rocker.x"',
    ),
    "pin of the ground observed": (
        FOUR_BAR + SPRING.replace("ground.O", "ground.D"),
        [("C = [0.28, 0.0]", "C = [0.28, 0.0], D = 0.1"), ('"B.x"', '"D.x"')],
        'line 4: observe: expected a pin of a body (O.x, C.x, A.x, B.x), got "D.x"',
    ),
    "unknown axis observed": (
        FOUR_BAR,
        [('"B.x"', '"B.z"')],
        'line 4: observe: expected a name and, after a dot, x, y, angle or along, got "B.z"',
    ),
    "no guide to observe": (
        FOUR_BAR,
        [('"B.x"', '"bed.along"')],
        'line 4: observe: expected a guide (none), got "bed.along"',
    ),
    "nothing observed": (
        FOUR_BAR,
        [('observe = "B.x"\n', "")],
        'observe: expected a name and what of it, as "B.x", "B.y", "body.angle" or "guide.along", '
        "got nothing",
    ),
    "unknown body that turns": (
        FOUR_BAR,
        [("observe", 'turning = "crnak"\nobserve')],
        'line 4: turning: expected a body (crank, coupler, rocker), got "crnak" (did you mean crank?)',
    ),
    "three numbers of a place": (
        FOUR_BAR,
        [("[0.28, 0.0]", "[0.28, 0.0, 0.0]")],
        "line 7: ground.pins_m.C: expected a finite number or a list of two, got a list",
    ),
    "film": (
        FOUR_BAR + "[film.B]\nviscosity_Pa_s = 0.1\nlength_m = 0.04\n",
        [],
        "line 34: film.B: expected nothing yet (a lubricated bearing: no engine runs it so far), "
        "got a section",
    ),
    "friction of a joint": (
        FOUR_BAR + '[friction.B]\nlaw = "tanh"\ncoefficient = 0.1\nregularisation_speed_m_s = 0.01\n',
        [],
        "line 34: friction.B: expected nothing yet (dry friction of an ideal joint: no engine runs it so "
        "far), got a section",
    ),
    "play in a guide": (
        QUICK_RETURN + "[clearance.bed]\nplay_m = 2e-4\nhalf_length_m = 0.02\nhalf_height_m = 0.01\n",
        [],
        "line 56: clearance.bed: expected nothing yet (play in a guide: no engine runs it so far), "
        "got a section",
    ),
}
DRIVES: dict[str, Case] = {
    "held by a guide": (
        QUICK_RETURN,
        [(HELD, f'{HELD}\nbody = "ram"')],
        'line 56: drive.body: expected a body that can turn, got "ram", which a guide holds',
    ),
    "of a structure": (
        FOUR_BAR,
        [
            ("A = 0.0, B = 0.25", "O = 0.0, B = 0.25"),
            ("A = 0.1", "P = 0.1"),
            ('"B.x"', '"P.x"'),
            ("speed_rad_s = { crank = 20.0 }\n", ""),
            ('"free"', '"torque"\ntorque_N_m = 1.0\nbody = "coupler"'),
        ],
        "line 34: drive.body: expected a body that can move at the start, "
        'got "coupler", which the joints hold',
    ),
    "unknown body": (
        FOUR_BAR,
        [('"free"', '"constant-speed"\nbody = "crnak"')],
        'line 34: drive.body: expected a body (crank, coupler, rocker), got "crnak" (did you mean crank?)',
    ),
    "unknown guide": (
        QUICK_RETURN,
        [(HELD, f'{HELD}\nguide = "beed"')],
        'line 56: drive.guide: expected a guide (slot, bed), got "beed" (did you mean bed?)',
    ),
    "no guide": (
        FOUR_BAR,
        [('"free"', '"constant-speed"\nguide = "bed"')],
        'line 34: drive.guide: expected a guide, of which there is none, got "bed"',
    ),
    "body and guide": (
        QUICK_RETURN,
        [(HELD, f'{HELD}\nbody = "crank"\nguide = "bed"')],
        'line 56: drive.body: expected nothing beside guide, got "crank"',
    ),
    "torque along a guide": (
        QUICK_RETURN,
        [(HELD, 'kind = "torque"\ntorque_N_m = 1.0\nguide = "bed"')],
        'line 57: drive.guide: expected nothing with a torque, which acts on a body, got "bed"',
    ),
    "ramp of a guide in rad/s": (
        QUICK_RETURN,
        [(HELD, 'kind = "ramp"\nfinal_speed_rad_s = 1.0\nramp_time_s = 0.1\nguide = "bed"')],
        "line 56: drive.final_speed_rad_s: expected nothing beside guide, got 1",
    ),
    "ramp of a body in m/s": (
        QUICK_RETURN,
        [(HELD, 'kind = "ramp"\nfinal_speed_m_s = 1.0\nramp_time_s = 0.1')],
        "line 56: drive.final_speed_m_s: expected nothing without guide, got 1",
    ),
    "motor of two points": (
        MOTOR_FILE,
        [("[0.0, 10.0, 20.0, 30.0]", "[0.0, 10.0]"), ("[3.0, 2.0, 1.0, 0.0]", "[3.0, 2.0]")],
        "line 34: drive.speed_rad_s: expected at least 4 numbers, got 2",
    ),
    "motor of a table and a line": (
        MOTOR_FILE + "stall_torque_N_m = 1.0\n",
        [],
        "line 36: drive.stall_torque_N_m: expected nothing beside a table, got 1",
    ),
    "motor without torques": (
        MOTOR_FILE,
        [("torque_N_m = [3.0, 2.0, 1.0, 0.0]\n", "")],
        "line 32: drive.torque_N_m: expected a list of numbers, got nothing",
    ),
    "torque by no time": (
        TORQUE_FILE,
        [("time_s = [0.0, 0.1, 0.2, 0.5]\n", "")],
        "line 32: drive.time_s: expected a list of numbers, got nothing",
    ),
    "torque that ends": (
        TORQUE_FILE,
        [("0.2, 0.5]", "0.2, 0.4]")],
        "line 34: drive.time_s.3: expected at least 0.5, when the scene ends, got 0.4",
    ),
    "slopes of straight lines": (
        TORQUE_FILE + 'interpolation = "linear"\nend_slopes = [0.0, 0.0]\n',
        [],
        "line 37: drive.end_slopes: expected nothing with interpolation = 'linear', got a list",
    ),
    "table at another speed": (
        TABLE_FILE,
        [("crank = 20.0", "crank = 40.0")],
        "line 30: start.speed_rad_s.crank: expected the speed of the drive's table when the scene begins, "
        "20 rad/s, got 40",
    ),
    "table of positions of a body": (
        TABLE_FILE,
        [("angle_rad = [0.0", "position_m = [0.0")],
        "line 35: drive.position_m: expected nothing without guide, got a list",
    ),
}
LOADS: dict[str, Case] = {
    "unknown body": (
        FOUR_BAR + "[load.crnak]\ntorque_N_m = 1.0\n",
        [],
        'line 34: load.crnak: expected a body (crank, coupler, rocker), got "crnak" (did you mean crank?)',
    ),
    "nothing": (
        QUICK_RETURN,
        [("force_N = -40.0", 'guide = "bed"')],
        "line 46: load.ram.force_N: expected it or viscous_N_s_m, spring_N_m, by_time, torque_N_m, "
        "viscous_N_m_s or gas, got nothing",
    ),
    "no direction": (
        FOUR_BAR + "[load.rocker]\nforce_N = 1.0\n",
        [],
        "line 34: load.rocker.along_rad: expected a number for a body without a guide, got nothing",
    ),
    "direction beside a guide": (
        QUICK_RETURN,
        [("force_N = -40.0", "force_N = -40.0\nalong_rad = 0.0")],
        "line 48: load.ram.along_rad: expected nothing for a body in a guide, got 0",
    ),
    "direction of a torque": (
        FOUR_BAR + "[load.rocker]\ntorque_N_m = 1.0\nalong_rad = 0.0\n",
        [],
        "line 36: load.rocker.along_rad: expected nothing without a force, got 0",
    ),
    "one of two guides": (
        QUICK_RETURN + '[guide.up]\nbody = "block"\npin = "A"\nturns = true\n[load.block]\nforce_N = 1.0\n',
        [],
        "line 60: load.block.guide: expected slot or up, got nothing",
    ),
    "guide of another body": (
        QUICK_RETURN,
        [("force_N = -40.0", 'force_N = -40.0\nguide = "slot"')],
        'line 48: load.ram.guide: expected a guide of ram (bed), got "slot"',
    ),
    "gas by no body": (
        FOUR_BAR + GAS,
        [],
        "line 37: load.rocker.gas.body: expected a body, or drive.body, got nothing",
    ),
    "gas by an unknown body": (
        TWIN,
        [('body = "crank"\nangle_rad = [0.0', 'body = "crnak"\nangle_rad = [0.0')],
        "line 52: load.piston2.gas.body: expected a body (crank, rod1, rod2, piston1, piston2), "
        'got "crnak" (did you mean crank?)',
    ),
    "gas of one turn and a half": (
        TWIN,
        [('4.0, "1 turn"]', '4.0, "1.5 turn"]')],
        "line 53: load.piston2.gas.angle_rad.3: expected one revolution or two after the first, 6.28319 or "
        "12.5664, got 9.42478",
    ),
    "gas by the short form's key": (
        TWIN,
        [("angle_rad = [0.0", "crank_angle_rad = [0.0")],
        "line 53: load.piston2.gas.crank_angle_rad: expected the key angle_rad, force_N, body or "
        "interpolation, got an unknown key (did you mean angle_rad?)",
    ),
    "table that ends": (
        FOUR_BAR + BY_TIME,
        [("0.2, 0.5]", "0.2, 0.4]")],
        "line 36: load.rocker.by_time.time_s.3: expected at least 0.5, when the scene ends, got 0.4",
    ),
    "table that begins late": (
        FOUR_BAR + BY_TIME,
        [("[0.0, 0.1, 0.2", "[0.05, 0.1, 0.2")],
        "line 36: load.rocker.by_time.time_s.0: expected a number <= 0, when the scene begins, got 0.05",
    ),
    "table of no columns": (
        FOUR_BAR + BY_TIME,
        [("torque_N_m = [0.0, 1.0, 2.0, 1.0]\n", "")],
        "line 35: load.rocker.by_time.force_N: expected it or torque_N_m, got nothing",
    ),
}
STARTS: dict[str, Case] = {
    "unknown body": (
        FOUR_BAR,
        [("{ crank = 0.7", "{ crnak = 0.7")],
        "line 28: start.angle_rad.crnak: expected a body (crank, coupler, rocker), "
        'got "crnak" (did you mean crank?)',
    ),
    "speed of an unknown body": (
        FOUR_BAR,
        [("{ crank = 20.0", "{ rod = 20.0")],
        'line 30: start.speed_rad_s.rod: expected a body (crank, coupler, rocker), got "rod"',
    ),
    "unknown guide": (
        QUICK_RETURN,
        [("[start]", "[start]\nposition_m = { bedd = 0.3 }")],
        'line 50: start.position_m.bedd: expected a guide (slot, bed), got "bedd" (did you mean bed?)',
    ),
    "hold of an unknown body": (
        FOUR_BAR,
        [('hold = ["crank"]', 'hold = ["crnak"]')],
        "line 29: start.hold.0: expected a body or a guide (crank, coupler, rocker), "
        'got "crnak" (did you mean crank?)',
    ),
    "hold of a text": (
        FOUR_BAR,
        [('hold = ["crank"]', 'hold = "crank"')],
        'line 29: start.hold: expected a list of strings, got "crank"',
    ),
    "unknown key": (
        FOUR_BAR,
        [("angle_rad = {", "angel_rad = {")],
        f"line 28: start.angel_rad: expected {START_KEY}",
    ),
    "states of some": (
        FOUR_BAR + STATE,
        [],
        "line 27: start.coupler: expected the state of every body or of none, got nothing",
    ),
    "state of an unknown body": (
        FOUR_BAR + STATE,
        [("[start.crank]", "[start.crnak]")],
        f"line 35: start.crnak: expected {START_KEY}",
    ),
    "angles beside states": (
        FOUR_BAR + STATE + STATE.replace("crank", "coupler") + STATE.replace("crank", "rocker"),
        [],
        "line 28: start.angle_rad: expected nothing beside the state of every body, got values",
    ),
}
UNITS: dict[str, Case] = {
    "length for an angle": (
        FOUR_BAR,
        [("crank = 0.7", 'crank = "50 mm"')],
        "line 28: start.angle_rad.crank: expected a finite number >= -1000000.0 and <= 1000000.0, or text "
        "with a unit such as '1 rad', got \"50 mm\"",
    ),
    "time for a place": (
        FOUR_BAR,
        [("A = 0.1 }", 'A = "50 s" }')],
        "line 10: body.crank.pins_m.A: expected a finite number or a list of two, or text with a unit "
        "such as '1 m', got \"50 s\"",
    ),
    "time in a pair": (
        FOUR_BAR,
        [("[0.28, 0.0]", '["50 s", 0.0]')],
        "line 7: ground.pins_m.C: expected a finite number or a list of two, or text with a unit such as "
        "'1 m', got \"50 s\"",
    ),
    "frequency for a speed": (
        FOUR_BAR,
        [("crank = 20.0", 'crank = "20 Hz"')],
        "line 30: start.speed_rad_s.crank: expected a finite number, or text with a unit such as '1 rad/s', "
        'got "20 Hz"',
    ),
}
KEYS: dict[str, Case] = {
    "top": (
        FOUR_BAR,
        [("name =", "colour = 3\nname =")],
        f"line 1: colour: expected {EVERY_KEY}, got an unknown",
    ),
    "top, like another": (
        FOUR_BAR,
        [("gravity_m_s2", "gravity")],
        f"line 3: gravity: expected {EVERY_KEY}, got an unknown key (did you mean gravity_m_s2?)",
    ),
    "section": (
        QUICK_RETURN,
        [("[load.ram]", "[loads.ram]")],
        f"line 46: loads: expected {EVERY_KEY}, got an unknown key (did you mean load?)",
    ),
    "ground": (
        FOUR_BAR,
        [("pins_m = { O = [", "pin_m = { O = [")],
        "line 7: ground.pin_m: expected the key pins_m, got an unknown key (did you mean pins_m?)",
    ),
    "body": (
        FOUR_BAR,
        [("inertia_kg_m2 = 4e-4", "inertia = 4e-4")],
        "line 12: body.crank.inertia: expected the key pins_m, mass_kg, inertia_kg_m2 or centre_of_mass_m, "
        "got an unknown key (did you mean inertia_kg_m2?)",
    ),
    "guide": (
        QUICK_RETURN,
        [("through_m", "thru_m")],
        "line 44: guide.bed.thru_m: expected the key body, pin, on, through_m, angle_rad or turns, "
        "got an unknown key (did you mean through_m?)",
    ),
    "spring": (
        FOUR_BAR + SPRING + "damping = 3.0\n",
        [],
        "line 39: spring.s.damping: expected the key between, stiffness_N_m, free_length_m or damping_N_s_m, "
        "got an unknown key (did you mean damping_N_s_m?)",
    ),
    "load": (
        QUICK_RETURN,
        [("force_N =", "forc_N =")],
        "line 47: load.ram.forc_N: expected the key force_N, ",
    ),
    "clearance": (
        FOUR_BAR + "[clearance.B]\n" + ROOM + 'bering = "rocker"\n',
        [],
        "line 41: clearance.B.bering: expected the key radial_clearance_m, ",
    ),
    "drive": (
        QUICK_RETURN,
        [(HELD, f"{HELD}\nspeed = 3.0")],
        "line 56: drive.speed: expected the key body, guide or kind, got an unknown key",
    ),
    "crank of the short form": (
        FOUR_BAR + "[crank]\nlength_m = 0.1\n",
        [],
        "line 9: body: expected nothing beside crank (the short form), got a section",
    ),
}
CASES = {
    f"{group}: {name}": case
    for group, cases in {
        "assembly": ASSEMBLY,
        "parts": PARTS,
        "drive": DRIVES,
        "load": LOADS,
        "start": STARTS,
        "unit": UNITS,
        "key": KEYS,
    }.items()
    for name, case in cases.items()
}


def changed(case: str) -> str:
    """Return the bad text of a case."""
    text, changes, _ = CASES[case]
    for old, new in changes:
        assert old == "" or text.count(old) > 0
        text = text.replace(old, new, 1) if old else text + new
    return text


@pytest.mark.parametrize("case", CASES)
def test_a_bad_mechanism_is_refused_in_one_line(case: str, tmp_path: Path) -> None:
    file, out = tmp_path / "bad.toml", tmp_path / "out.csv"
    file.write_text(changed(case), encoding="utf-8")
    done = crankslider("simulate", file, "--out", out)
    require_refusal(done.stdout, done.stderr, done.code, CASES[case][-1])
    assert done.stderr.startswith(f"error: {file}: ")
    assert sorted(tmp_path.iterdir()) == [file]


@pytest.mark.parametrize("text", [FOUR_BAR, QUICK_RETURN, TWIN, MOTOR_FILE, TORQUE_FILE, TABLE_FILE])
def test_what_bad_files_are_made_of_is_good(text: str, tmp_path: Path) -> None:
    file = tmp_path / "good.toml"
    file.write_text(text + (SPRING + BY_TIME) * ("rocker" in text), encoding="utf-8")
    assert crankslider("show", file).code == 0
