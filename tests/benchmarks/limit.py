"""The limit of speed: heyoka beside the reference, ``python -m tests.benchmarks.limit``.

heyoka integrates by Taylor's method, compiled for one set of equations, here a mechanism's own in minimal
coordinates, with walls as terminal events. It is no engine of the study (``pip install heyoka``). Each stands
by its cheapest setting whose slider is within ``TARGET_M``.
"""

import math
import time
from functools import cache
from typing import Any, NamedTuple

import heyoka as hy
import numpy as np

from engine_models.engine import FloatArray
from engine_models.scene.library import SCENES
from reports.results import SLIDER
from studies.accuracy import SAMPLES, case_of
from studies.case import run_case
from studies.judges.converged_truth import converged
from studies.settings import END_S, ladder

#: Lengths and centres of mass from each link's first pin in m, masses in kg, gravity in m/s^2.
CRANK_M, ROD_M, CRANK_CENTRE_M, ROD_CENTRE_M = 0.05, 0.12, 0.025, 0.06
CRANK_KG, ROD_KG, SLIDER_KG, GRAVITY = 0.30, 0.21, 0.14, 9.81
#: Inertias of crank and rod about their centres of mass in kg m^2, free and driven.
FREE_INERTIAS, DRIVEN_INERTIAS = (1e-5, 2.5e-5), (1e-4, 2.5e-4)
#: Both links begin along the guide; the crank's speed in rad/s.
FREE_SPEED, DRIVEN_SPEED = 20 * math.pi, 2 * math.pi * 5000 / 60
#: The slider's pin of steel in its bearing: Hertz's stiffness in N/m^1.5, Lankarani and Nikravesh's damping.
CLEARANCE_M, BEARING_M = 5e-4, 0.01
STIFFNESS = 2 / 3 * 207e9 / (1 - 0.3**2) * math.sqrt(BEARING_M * (BEARING_M - CLEARANCE_M) / CLEARANCE_M)
DAMPING = 0.75 * (1 - 0.9**2)
#: A pin touches so far past the wall, in m, where a flight from the wall has surely begun on this side of it.
PAST_M = 1e-15
#: Of crank and rod about the crank's pivot, of the rod about its pin, and between them.
SWUNG_KG, COUPLED = ROD_KG * ROD_CENTRE_M**2, ROD_KG * CRANK_M * ROD_CENTRE_M
OWN_KG, LIFTED = (
    CRANK_KG * CRANK_CENTRE_M**2 + ROD_KG * CRANK_M**2,
    CRANK_KG * CRANK_CENTRE_M + ROD_KG * CRANK_M,
)
IDEAL, LOOSE, DRIVEN = "ideal-free", "clearance-free-0.5mm", "clearance-driven-0.5mm"
TOLERANCES, TARGET_M, ROUNDS = tuple(10.0**-k for k in range(4, 13)), 1e-6, 10


class Answer(NamedTuple):
    """The solve's own time in s, and the slider's position in m at equally spaced times, (samples + 1,)."""

    seconds: float
    slider_m: FloatArray


@cache
def ideal(tolerance: float) -> Any:
    """Return the integrator of the free crank's angle: M(a) a'' + M'(a)/2 a'^2 = Q."""
    angle, speed = hy.make_vars("angle", "speed")
    s, c = hy.sin(angle), hy.cos(angle)
    rod_s = -CRANK_M / ROD_M * s
    rod_c = hy.sqrt(1.0 - rod_s * rod_s)
    turn = -CRANK_M * c / (ROD_M * rod_c)
    bend = CRANK_M * s / (ROD_M * rod_c) + turn * turn * rod_s / rod_c
    slide = -CRANK_M * s - ROD_M * rod_s * turn
    curve = -CRANK_M * c - ROD_M * (rod_c * turn * turn + rod_s * bend)
    along, across = c * rod_c + s * rod_s, s * rod_c - c * rod_s
    swung = FREE_INERTIAS[1] + SWUNG_KG
    inertia = FREE_INERTIAS[0] + OWN_KG + swung * turn * turn + 2.0 * COUPLED * along * turn
    inertia = inertia + SLIDER_KG * slide * slide
    change = swung * turn * bend + SLIDER_KG * slide * curve
    change = change + COUPLED * (along * bend - across * (1.0 - turn) * turn)
    weight = GRAVITY * (LIFTED * c + ROD_KG * ROD_CENTRE_M * rod_c * turn)
    rates = [(angle, speed), (speed, -(change * speed * speed + weight) / inertia)]
    return hy.taylor_adaptive(rates, [0.0, FREE_SPEED], tol=tolerance, fast_math=True)


def solve_ideal(tolerance: float, end_s: float, samples: int) -> Answer:
    """Solve the free crank-slider with ideal joints."""
    ta = ideal(tolerance)
    ta.time, ta.state[:] = 0.0, [0.0, FREE_SPEED]
    began = time.perf_counter()
    states = ta.propagate_grid(np.linspace(0.0, end_s, samples + 1))[5]
    seconds, angle = time.perf_counter() - began, states[:, 0]
    return Answer(seconds, CRANK_M * np.cos(angle) + np.sqrt(ROD_M**2 - (CRANK_M * np.sin(angle)) ** 2))


def accelerations(driven: bool, angle: Any, rod: Any, turn: Any, rod_turn: Any, x: Any, y: Any) -> list[Any]:
    """Return those of a free crank, of rod and slider, where a force (x, y) pulls at the rod's end."""
    s, c, rod_s, rod_c = hy.sin(angle), hy.cos(angle), hy.sin(rod), hy.cos(rod)
    both, across = COUPLED * (c * rod_c + s * rod_s), COUPLED * (s * rod_c - c * rod_s)
    at_rod = ROD_M * (y * rod_c - x * rod_s) - GRAVITY * ROD_KG * ROD_CENTRE_M * rod_c
    at_rod = at_rod + across * turn * turn
    if driven:
        return [at_rod / (DRIVEN_INERTIAS[1] + SWUNG_KG), -x / SLIDER_KG]
    at_crank = CRANK_M * (y * c - x * s) - GRAVITY * LIFTED * c - across * rod_turn * rod_turn
    own, swung = FREE_INERTIAS[0] + OWN_KG, FREE_INERTIAS[1] + SWUNG_KG
    whole = own * swung - both * both
    return [
        (swung * at_crank - both * at_rod) / whole,
        (own * at_rod - both * at_crank) / whole,
        -x / SLIDER_KG,
    ]


@cache
def loose(driven: bool, tolerance: float) -> tuple[Any, Any, Any]:
    """Return who integrates flight and contact, and what makes the one's state the other's at a touch.

    In contact the root w of the penetration is a variable, and the independent one s with dt = w ds.
    """
    rod, x, rod_turn, rate, t = hy.make_vars("rod", "x", "rod_turn", "rate", "t")
    angle, turn = hy.make_vars("angle", "turn")
    free, speeds = ([], []) if driven else ([angle], [turn])
    y = [*free, rod, x, *speeds, rod_turn, rate, t]
    if driven:
        angle, turn = DRIVEN_SPEED * t, DRIVEN_SPEED
    across = x - CRANK_M * hy.cos(angle) - ROD_M * hy.cos(rod)
    up = -CRANK_M * hy.sin(angle) - ROD_M * hy.sin(rod)
    distance = hy.sqrt(across * across + up * up)
    nx, ny = across / distance, up / distance
    closing = nx * (rate + CRANK_M * hy.sin(angle) * turn + ROD_M * hy.sin(rod) * rod_turn)
    closing = closing - ny * (CRANK_M * hy.cos(angle) * turn + ROD_M * hy.cos(rod) * rod_turn)

    def rates(fx: Any, fy: Any) -> list[Any]:
        bent = accelerations(driven, angle, rod, turn, rod_turn, fx, fy)
        return [*speeds, rod_turn, rate, *bent, hy.expression(1.0)]

    def integrator(variables: list[Any], derivatives: list[Any], event: Any) -> Any:
        ends = [hy.t_event(each, direction=hy.event_direction.positive) for each in (event, t - hy.par[0])]
        pairs = list(zip(variables, derivatives, strict=True))
        return hy.taylor_adaptive(pairs, [0.0] * len(pairs), tol=tolerance, t_events=ends, fast_math=True)

    zero, (w, speed), wall = hy.expression(0.0), hy.make_vars("w", "speed"), CLEARANCE_M + PAST_M
    flight = integrator(y, rates(zero, zero), across * across + up * up - wall * wall)
    force = STIFFNESS * (w * w * w) * (1.0 + DAMPING * closing / speed)
    pressed = [0.5 * closing, zero, *(w * part for part in rates(force * nx, force * ny))]
    contact = integrator([w, speed, *y], pressed, -w)
    return flight, contact, hy.cfunc([hy.expression(PAST_M**0.5), closing, *y], vars=y)


def solve_loose(driven: bool, tolerance: float, end_s: float, samples: int) -> Answer:
    """Solve the crank-slider with clearance at the slider, from touch to release and to touch."""
    flight, contact, touch = loose(driven, tolerance)
    crank_speed = DRIVEN_SPEED if driven else FREE_SPEED
    free, speeds = ([], []) if driven else ([0.0], [crank_speed])
    start = [*free, 0.0, CRANK_M + ROD_M, *speeds, -crank_speed * CRANK_M / ROD_M, 0.0, 0.0]
    flying, held = flight.state, contact.state
    flying[:], now, values = start, flight, [CRANK_M + ROD_M]
    due = list(np.linspace(0.0, end_s, samples + 1)[1:])
    contact.pars[0] = flight.pars[0] = due[0]
    flight.reset_cooldowns()
    began = time.perf_counter()
    while True:
        ended = int(now.propagate_until(1e300)[0])
        if ended == -2:  # a sample
            values.append((flying if now is flight else held[2:])[len(free) + 1])
            del due[0]
            if not due:
                return Answer(time.perf_counter() - began, np.array(values))
            contact.pars[0] = flight.pars[0] = due[0]
        elif now is flight:
            held[:] = touch(flying)
            now = contact
        else:
            flying[:] = held[2:]
            now = flight
        now.time = 0.0
        now.reset_cooldowns()


def solve(name: str, tolerance: float, samples: int) -> Answer:
    """Solve a scene, to the time for which the study follows it."""
    end_s = END_S.get(name, SCENES[name]().end_time_s)
    if name == IDEAL:
        return solve_ideal(tolerance, end_s, samples)
    return solve_loose(name == DRIVEN, tolerance, end_s, samples)


def true_slider_m(name: str) -> FloatArray:
    """Return the slider's position in the reference solution at the study's samples."""
    scene = SCENES[name]()
    scene = scene.replace("end_time_s", END_S.get(name, scene.end_time_s))
    return converged(scene, SAMPLES)[0].position[:, -1, 0]


def main() -> None:
    """Measure and print the least times of both."""
    for name in (IDEAL, LOOSE, DRIVEN):
        true, heyoka_s, reference_s = true_slider_m(name), [], []
        for tolerance in TOLERANCES:
            if np.abs(solve(name, tolerance, SAMPLES).slider_m - true).max() <= TARGET_M:
                heyoka_s.append(min(solve(name, tolerance, 1).seconds for _ in range(ROUNDS)))
        scene = SCENES[name]().replace("end_time_s", END_S.get(name, SCENES[name]().end_time_s))
        for setting in (each for each in ladder(scene, full=True) if each.arm.engine == "reference"):
            row, _ = run_case(case_of("accuracy", scene, setting, SAMPLES))
            if row["status"] == "ok" and float(str(row[SLIDER])) <= TARGET_M:
                timed = case_of("cost", scene, setting, 1, timed=True)
                rounds = [run_case(timed)[0] for _ in range(ROUNDS)]
                reference_s += [float(str(each["solve_time_s"])) for each in rounds if each["repeats"]]
        ratio = min(reference_s) / min(heyoka_s)
        print(f"{name}: reference {1e3 * min(reference_s):.3g} ms, {ratio:.2f} times heyoka's")


if __name__ == "__main__":
    main()
