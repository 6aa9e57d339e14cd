"""Crank-sliders with rigid joint clearance in minimal coordinates, event by event, apart from the solver.

In flight a joint has d = (d_x, d_y), and on its wall d = c (cos(psi), sin(psi)): no multiplier, no row, no
projection. The wall's force is what the equation along the normal leaves over. SciPy's DOP853 locates the
events: a pin reaches its wall, or the wall's force on it vanishes. The crank's prescribed speeds are
integrated from their accelerations, and works beside the motion.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from engine_models.scene.scene import Friction, Scene
from tests.independent.rigid_impact import Paradox, State, impact
from tests.independent.rigid_kinematics import PLACES, Dynamics, Pins, across, along
from tests.independent.slider_load import PARTS, torque_on_crank

FloatArray = NDArray[np.float64]

#: A flight shorter than this has no rebound: bounces that converge end here.
SHORTEST_FLIGHT_S = 2e-9
#: A part of the crank's speed: a pin that moves no faster along the normal has not left its wall.
RESTING = 1e-12
#: More impacts than any run here has: two joints may throw each other off in turns, ever shorter.
ENDLESS = 2000
#: Works of the drive and of the load's parts, behind the motion in what is integrated.
WORKS = 1 + len(PARTS)
#: The absolute tolerances of the motion in m, rad and per second, and of works in J.
MOTION, WORK = 1e-17, 1e-13


@dataclass(frozen=True)
class Answer:
    """z'' and w'', the walls' normal forces by joint, the drive's torque, and the works' powers (5,)."""

    z: FloatArray
    w: FloatArray
    walls_N: dict[str, float]
    torque_N_m: float
    powers_W: FloatArray


@dataclass
class Chart:
    """The coordinates z while some joints follow their walls: the crank's angle, then the joints' own."""

    pins: Pins
    following: tuple[str, ...]

    def z_of(self, w: FloatArray, rate: FloatArray) -> FloatArray:
        """Return z and its rate, one behind the other."""
        z, z_rate = [w[0]], [rate[0]]
        for name in self.pins.loose:
            d, d_rate = w[PLACES[name]], rate[PLACES[name]]
            if name in self.following:
                psi = float(np.arctan2(d[1], d[0]))
                z.append(psi)
                z_rate.append(float(across(psi) @ d_rate) / self.pins.clearance(name).radial_clearance_m)
            else:
                z.extend(d)
                z_rate.extend(d_rate)
        return np.array(z + z_rate)

    def w_of(self, y: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return w, its rate, P, and the bias in w'' = P z'' + bias."""
        size, n = self.pins.size, len(y) // 2
        w, bias, P = np.zeros(size), np.zeros(size), np.zeros((size, n))
        w[0], P[0, 0], k = y[0], 1.0, 1
        for name in self.pins.loose:
            place = PLACES[name]
            if name in self.following:
                c, psi = self.pins.clearance(name).radial_clearance_m, y[k]
                w[place], P[place, k] = c * along(psi), c * across(psi)
                bias[place] = -c * y[n + k] ** 2 * along(psi)
                k += 1
            else:
                w[place], P[place, k : k + 2] = y[k : k + 2], np.eye(2)
                k += 2
        return w, P @ y[n:], P, bias

    def answer(self, t: float, y: FloatArray) -> Answer:
        """Return what follows from the state z, z'.

        The forces -F_n (n + mu f t) of every wall stand in one system with z'', of which a prescribed
        speed gives the first.
        """
        w, rate, P, bias = self.w_of(y)
        motion, given = self.pins.dynamics(w, rate), np.zeros(0)
        if self.pins.motion is not None:
            given = np.array([self.pins.motion.acceleration(t)])
            bias, P = bias + P[:, 0] * given, P[:, 1:]
        normals, forces = [], []
        for name in self.following:
            normals.append(self.pins.normal(name, w))
            forces.append(normals[-1] + self._friction(name, w, rate, motion))
        rows = np.vstack([P.T, *normals])
        pushed = np.array(forces).reshape(-1, self.pins.size).T
        solved = np.linalg.solve(
            np.hstack([rows @ motion.M @ P, rows @ pushed]), rows @ (motion.Q - motion.M @ bias)
        )
        n = P.shape[1]
        walls, w_dot_dot = solved[n:], P @ solved[:n] + bias
        torque = torque_on_crank(self.pins.scene, rate[0])
        if self.pins.motion is not None:
            torque = float(motion.M[0] @ w_dot_dot + pushed[0] @ walls - motion.Q[0])
        return Answer(
            np.concatenate([given, solved[:n]]),
            w_dot_dot,
            dict(zip(self.following, walls.tolist(), strict=True)),
            torque,
            np.array([torque * rate[0], *motion.load_W]),
        )

    def _friction(self, name: str, w: FloatArray, rate: FloatArray, motion: Dynamics) -> FloatArray:
        law = self.pins.clearance(name).friction
        if law is None:
            return np.zeros(self.pins.size)
        row = self.pins.sliding(name, w, motion)
        return np.asarray(law.coefficient * _share(law, float(row @ rate)) * row)


def _share(law: Friction, sliding: float) -> float:
    """Return the part of mu F_n that rubs at a sliding speed, with its sign."""
    full, dead = law.regularisation_speed_m_s, law.dead_band_speed_m_s or 0.0
    if law.law == "tanh":
        return math.tanh(sliding / full)
    return math.copysign(min(max((abs(sliding) - dead) / (full - dead), 0.0), 1.0), sliding)


@dataclass
class Run:
    """What a run leaves.

    At the times asked for: places of slider or pendulum, the walls' normal forces by joint, the drive's
    torque, and works since the start, that of the drive and those of the load by ``PARTS``. Impacts as
    (time, joint, approach speed), and from when on which joints follow.
    """

    place_m: list[float] = field(default_factory=list)
    forces_N: list[dict[str, float]] = field(default_factory=list)
    torque_N_m: list[float] = field(default_factory=list)
    works_J: list[FloatArray] = field(default_factory=list)
    impacts: list[tuple[float, str, float]] = field(default_factory=list)
    following: list[tuple[float, tuple[str, ...]]] = field(default_factory=list)


def integrate(scene: Scene, times: FloatArray, rtol: float, longest_s: float, moved_m: float = 0.0) -> Run:
    """Integrate from the ideal joints' motion; the first joint's pin starts ``moved_m`` out of the middle."""
    pins, run, t = Pins(scene), Run(), float(times[0])
    state = pins.start()
    state[0][PLACES[pins.loose[0]].start] += moved_m
    chart, blind, works = Chart(pins, ()), dict[str, float](), np.zeros(WORKS)
    _sample(run, chart, t, np.concatenate([chart.z_of(*state), works]))
    while t < times[-1]:
        end = min([times[-1], *(until for until in blind.values() if until > t)])
        watched = [name for name in pins.loose if blind.get(name, t) <= t]
        z = chart.z_of(*state)

        def derivative(t: float, y: FloatArray, chart: Chart = chart, n: int = len(z)) -> FloatArray:
            answer = chart.answer(t, y[:n])
            return np.concatenate([y[n // 2 : n], answer.z, answer.powers_W])

        solved = solve_ivp(
            derivative,
            (t, end),
            np.concatenate([z, works]),
            "DOP853",
            events=[_event(chart, name) for name in watched],
            rtol=rtol,
            atol=np.repeat([MOTION, WORK], [len(z), WORKS]),
            max_step=longest_s,
            dense_output=True,
        )
        for at in times[(times > t) & (times <= solved.t[-1])]:
            _sample(run, chart, at, solved.sol(at))
        t, works = float(solved.t[-1]), solved.y[-WORKS:, -1]
        w, rate, *_ = chart.w_of(solved.y[:-WORKS, -1])
        state = w, rate
        met = [name for name, hits in zip(watched, solved.t_events, strict=True) if len(hits)]
        if not met:
            continue
        assert len(met) == 1, f"{met} at once"
        assert len(run.impacts) < ENDLESS, f"impacts without end at t = {t}"
        state, driver, chart, blind = _switch(chart, met[0], t, state, run, longest_s)
        works[0] += driver * rate[0]
    return run


def _sample(run: Run, chart: Chart, t: float, y: FloatArray) -> None:
    """Add what is at a time, of motion and works."""
    w, rate, *_ = chart.w_of(y[:-WORKS])
    answer = chart.answer(t, y[:-WORKS])
    run.place_m.append(chart.pins.dynamics(w, rate).place_m)
    run.forces_N.append(answer.walls_N)
    run.torque_N_m.append(answer.torque_N_m)
    run.works_J.append(y[-WORKS:])


def _event(chart: Chart, name: str) -> Callable[[float, FloatArray], float]:
    c = chart.pins.clearance(name).radial_clearance_m

    def wall(t: float, y: FloatArray) -> float:  # noqa: ARG001
        d = chart.w_of(y[:-WORKS])[0][PLACES[name]]
        return float(d @ d / c**2 - 1)

    def force(t: float, y: FloatArray) -> float:
        return chart.answer(t, y[:-WORKS]).walls_N[name]

    event = force if name in chart.following else wall
    event.terminal, event.direction = True, -1.0 if name in chart.following else 1.0  # type: ignore[attr-defined]
    return event


def _switch(
    chart: Chart, name: str, t: float, state: State, run: Run, longest_s: float
) -> tuple[State, float, Chart, dict[str, float]]:
    """Return state and chart after an event, and until when its joints' walls are not watched.

    Second is the driver's angular impulse in it, in N m s.

    A pin that has just left its wall stands on it to round-off, which is no new touch.
    """
    pins = chart.pins
    state, driver, following, speed = settled(pins, t, state, name, chart.following)
    if speed is not None:
        run.impacts.append((t, name, speed))
    if following != chart.following:
        run.following.append((t, following))
    blind = {}
    for k in {name, *chart.following} - set(following):
        outward = _outward(pins, t, state, k, following)
        apex = _inward(pins, state, k) / outward if outward > 0 else longest_s
        blind[k] = t + (min(apex, longest_s) if apex > 0 else longest_s / 20)
    return state, driver, Chart(pins, following), blind


def settled(
    pins: Pins,
    t: float,
    state: State,
    name: str,
    following: tuple[str, ...],
    shortest_s: float = SHORTEST_FLIGHT_S,
    lowest: float = 0.0,
) -> tuple[State, float, tuple[str, ...], float | None]:
    """Return the state after a pin has hit, or is no more pressed to the wall that it follows.

    Beside it: the driver's angular impulse in N m s, which pins follow now, and the speed of the impact. A
    flight shorter than ``shortest_s``, or lower than the part ``lowest`` of the clearance, is none: its pin
    hits without rebound, or stays where another's impact would throw it off.
    """
    closed, driver, speed = list(following), 0.0, None

    def flies(hit: State, k: str) -> bool:
        leaving, pushed = _inward(pins, hit, k), _outward(pins, t, hit, k, following)
        height = lowest * pins.clearance(k).radial_clearance_m
        return 2 * leaving >= shortest_s * pushed and leaving * abs(leaving) >= 2 * height * pushed

    if name in closed:
        closed.remove(name)
    else:
        speed = float(pins.normal(name, state[0]) @ state[1])
        closed.append(name)
        hit, driver = impact(pins, state, name, following, pins.clearance(name).restitution or 0.0)
        if not flies(hit, name):
            hit, driver = impact(pins, state, name, following, 0.0)
        # A pin has left where more than round-off of its speeds is left along the normal.
        rest = max(1e-9 * abs(speed), RESTING * pins.scene.crank.length_m * abs(state[1][0]))
        left = [k for k in closed if _inward(pins, hit, k) >= rest and (not lowest or flies(hit, k))]
        closed = [k for k in closed if k not in left]
        state = _kept(pins, hit, closed) if lowest else hit
    return state, driver, _pressed(pins, t, state, closed), speed


def _kept(pins: Pins, state: State, closed: Sequence[str]) -> State:
    """Return the state without the normal speeds of pins that stay on their walls."""
    w, rate = state
    if not closed:
        return state
    inverse = np.zeros((pins.size, pins.size))
    free = np.ix_(pins.free, pins.free)
    inverse[free] = np.linalg.inv(pins.dynamics(w, rate).M[free])
    rows = np.array([pins.normal(k, w) for k in closed])
    return w, rate - inverse @ rows.T @ np.linalg.solve(rows @ inverse @ rows.T, rows @ rate)


def _inward(pins: Pins, state: State, name: str) -> float:
    return -float(pins.normal(name, state[0]) @ state[1])


def _outward(pins: Pins, t: float, state: State, name: str, following: Sequence[str]) -> float:
    """Return the acceleration of a pin on its wall, outwards, while the others follow."""
    chart = Chart(pins, tuple(k for k in following if k != name))
    acceleration = chart.answer(t, chart.z_of(*state)).w
    c = pins.clearance(name).radial_clearance_m
    place = PLACES[name]
    return float(pins.normal(name, state[0]) @ acceleration + state[1][place] @ state[1][place] / c)


def _pressed(pins: Pins, t: float, state: State, closed: Sequence[str]) -> tuple[str, ...]:
    """Return which pins without normal speed follow: those pressed, while all others move inwards."""
    ordered, fits = [name for name in pins.loose if name in closed], []
    for count in range(len(ordered) + 1):
        for some in combinations(ordered, count):
            chart = Chart(pins, some)
            forces = chart.answer(t, chart.z_of(*state)).walls_N
            leaving = [name for name in ordered if name not in some]
            if all(force > 0 for force in forces.values()) and all(
                _outward(pins, t, state, name, some) <= 0 for name in leaving
            ):
                fits.append(some)
    if len(fits) != 1:
        raise Paradox(f"{len(fits)} sets of {ordered} fit at t = {t}")
    return fits[0]
