"""The crank-slider with compliant joint clearance in minimal coordinates, event-located by SciPy.

Derived apart from the solver under test: no multipliers. Cutting the joints with clearance leaves a tree;
every body's centre is a sum of translations and link vectors l e(alpha), so that M(u) u'' = Q - J^T M J' u'
is written down link by link. Touch and release are DOP853 events. At least one joint must have clearance.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from engine_models.mechanics.contact_law import exponent_of, stiffness_of
from engine_models.scene.scene import Clearance, Scene
from tests.independent.prescribed_speed import PrescribedSpeed, prescribed_speed, speed_at_start
from tests.independent.slider_load import slider_load, torque_on_crank

FloatArray = NDArray[np.float64]

#: a(e) of the laws used here, from their papers.
DAMPING: dict[str, Callable[[float], float]] = {
    "hertz": lambda _: 0.0,
    "lankarani-nikravesh": lambda e: 0.75 * (1 - e * e),
    "hu-guo": lambda e: 1.5 * (1 - e) / e,
}


@dataclass(frozen=True)
class Place:
    """A point as constant times coordinates: translations {axis: coordinate} and links (length, angle)."""

    moves: dict[int, int]
    links: tuple[tuple[float, int], ...] = ()

    def plus(self, length: float, angle: int) -> "Place":
        """Return the point at the end of one more link."""
        return Place(self.moves, (*self.links, (length, angle)))

    def at(self, u: FloatArray) -> FloatArray:
        """Return the position (2,)."""
        p = np.zeros(2)
        for axis, k in self.moves.items():
            p[axis] += u[k]
        for length, k in self.links:
            p += length * np.array([np.cos(u[k]), np.sin(u[k])])
        return p

    def slopes(self, u: FloatArray, rate: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the Jacobian (2, n) and its rate times u' (2,)."""
        J, bias = np.zeros((2, len(u))), np.zeros(2)
        for axis, k in self.moves.items():
            J[axis, k] += 1
        for length, k in self.links:
            J[:, k] += length * np.array([-np.sin(u[k]), np.cos(u[k])])
            bias -= length * rate[k] ** 2 * np.array([np.cos(u[k]), np.sin(u[k])])
        return J, bias


@dataclass
class Tree:
    """The cut mechanism: coordinates theta, phi, x, then translations of bodies that hang on nothing."""

    scene: Scene
    places: list[Place] = field(init=False)
    joints: dict[str, tuple[Place, Place, int | None, int]] = field(init=False)
    size: int = field(init=False)
    motion: PrescribedSpeed | None = field(init=False)

    def __post_init__(self) -> None:
        self.motion, self.load_at = prescribed_speed(self.scene), slider_load(self.scene)
        prescribed = self.motion is not None
        self.free = [0, 1, 2][prescribed:]
        if not self.scene.is_crank_slider:  # a pendulum: theta, then its centre's y and x
            place = Place({0: 2, 1: 1})
            self.size, self.places = 3, [place]
            self.joints = {"O": (Place({}), place.plus(-self.scene.crank.centre_of_mass_m, 0), None, 0)}
            return
        crank, rod, _ = self.scene.crank_slider()
        s, r, d, length = crank.centre_of_mass_m, crank.length_m, rod.centre_of_mass_m, rod.length_m
        theta, phi, x = 0, 1, 2
        loose = set(self.scene.joints_with_clearance)
        slider, count = Place({0: x}), 3
        crank_place = None if "O" in loose else Place({}).plus(s, theta)
        if "B" not in loose:
            rod_place = slider.plus(d - length, phi)
        elif "A" not in loose and crank_place is not None:
            rod_place = crank_place.plus(r - s, theta).plus(d, phi)
        else:
            rod_place, count = Place({0: count, 1: count + 1}), count + 2
        if crank_place is None:
            if "A" not in loose:
                crank_place = rod_place.plus(-d, phi).plus(s - r, theta)
            else:
                crank_place, count = Place({0: count, 1: count + 1}), count + 2
        self.size, self.places = count, [crank_place, rod_place, slider]
        self.joints = {
            "O": (Place({}), crank_place.plus(-s, theta), None, theta),
            "A": (crank_place.plus(r - s, theta), rod_place.plus(-d, phi), theta, phi),
            "B": (rod_place.plus(length - d, phi), slider, phi, -1),
        }
        self.joints = {name: self.joints[name] for name in self.scene.joints_with_clearance}
        self.free = list(range(prescribed, count))

    def accelerations(
        self, t: float, u: FloatArray, rate: FloatArray, contacts: dict[str, float]
    ) -> tuple[FloatArray, float]:
        """Return u'' (n,) with the contacts named in force, each with its a/v0, and the drive's torque."""
        M, Q = np.zeros((self.size, self.size)), np.zeros(self.size)
        for part, place in zip(self.scene.bodies, self.places, strict=True):
            J, bias = place.slopes(u, rate)
            M += part.mass_kg * J.T @ J
            Q -= part.mass_kg * J.T @ (bias + np.array([0, self.scene.gravity_m_s2]))
        M[0, 0] += self.scene.crank.inertia_kg_m2
        if self.scene.rod is not None:
            M[1, 1] += self.scene.rod.inertia_kg_m2
        if self.scene.is_crank_slider:
            Q[2] += sum(self.load_at(u[0], u[2], rate[2]).values())
        for name, damping in contacts.items():
            Q += self.contact_force(name, u, rate, damping)[0]
        acceleration, torque = np.zeros(self.size), 0.0
        if self.motion is None:
            torque = torque_on_crank(self.scene, rate[0])
            Q[0] += torque
        else:
            acceleration[0] = self.motion.acceleration(t)
        free = np.ix_(self.free, self.free)
        acceleration[self.free] = np.linalg.solve(M[free], (Q - M @ acceleration)[self.free])
        if self.motion is not None:
            torque = float(M[0] @ acceleration - Q[0])
        return acceleration, torque

    def gap(self, name: str, u: FloatArray) -> FloatArray:
        """Return pin centre less bearing centre, (2,)."""
        bearing, pin, *_ = self.joints[name]
        return pin.at(u) - bearing.at(u)

    def contact_force(
        self, name: str, u: FloatArray, rate: FloatArray, damping: float
    ) -> tuple[FloatArray, float]:
        """Return the generalised force (n,) of one contact, and its normal force."""
        bearing, pin, turn_i, turn_j = self.joints[name]
        clearance: Clearance = getattr(self.scene.clearance, name)
        J = pin.slopes(u, rate)[0] - bearing.slopes(u, rate)[0]
        d = self.gap(name, u)
        distance = np.hypot(*d)
        n = d / distance
        t = np.array([-n[1], n[0]])
        depth, d_rate = max(distance - clearance.radial_clearance_m, 0.0), J @ rate
        force = stiffness_of(clearance) * depth ** exponent_of(clearance) * (1 + damping * n @ d_rate)
        if not clearance.may_pull:
            force = max(force, 0.0)
        Q = -force * J.T @ n
        if clearance.friction is not None:
            arms = {turn_i: clearance.bearing_radius_m + depth / 2}
            pin_arm = clearance.bearing_radius_m - clearance.radial_clearance_m - depth / 2
            slide = J.T @ t  # the sliding speed is slide . u'
            for turn, arm in ((turn_i, -arms[turn_i]), (turn_j, pin_arm)):
                if turn is not None and turn >= 0:
                    slide[turn] += arm
            speed = slide @ rate
            share = np.tanh(speed / clearance.friction.regularisation_speed_m_s)
            Q = Q - clearance.friction.coefficient * force * share * slide
        return np.asarray(Q), float(force)


@dataclass(frozen=True)
class Run:
    """Slider positions at the times, and touches (time, joint, approach speed).

    At the times too, (n,) each: the slider's velocity, the torque on the crank and each contact's normal
    force.
    """

    slider_position_m: FloatArray
    touches: list[tuple[float, str, float]]
    slider_velocity_m_s: FloatArray
    driver_torque_N_m: FloatArray
    normal_force_N: dict[str, FloatArray]


def integrate(scene: Scene, times: FloatArray, rtol: float) -> Run:
    """Integrate from the ideal joints' assembly, event by event, with DOP853 at a relative tolerance."""
    tree = Tree(scene)
    y, active, touches = _start(tree), dict[str, float](), list[tuple[float, str, float]]()
    n, t, states = tree.size, times[0], [(times[0], y, dict(active))]

    def make_event(name: str, sign: float, begin: float) -> Callable[[float, FloatArray], float]:
        c = getattr(scene.clearance, name).radial_clearance_m

        def event(t: float, y: FloatArray) -> float:
            # A leg may begin on the surface, inside or outside by rounding: its end is yet to come.
            return -sign if t == begin else float(np.hypot(*tree.gap(name, y[:n])) - c)

        event.terminal, event.direction = True, sign  # type: ignore[attr-defined]
        return event

    while t < times[-1]:
        now = dict(active)

        def derivative(t: float, y: FloatArray, now: dict[str, float] = now) -> FloatArray:
            return np.concatenate([y[n:], tree.accelerations(t, y[:n], y[n:], now)[0]])

        events = [make_event(name, -1.0 if name in active else 1.0, t) for name in tree.joints]
        longest = 2e-6 if active else 2e-5
        wanted = times[times > t]
        run = solve_ivp(
            derivative,
            (t, times[-1]),
            y,
            "DOP853",
            events=events,
            rtol=rtol,
            atol=1e-15,
            max_step=longest,
            dense_output=True,
        )
        states += [(at, run.sol(at), now) for at in wanted[wanted <= run.t[-1]]]
        t, y = run.t[-1], run.y[:, -1]
        for name, hits in zip(tree.joints, run.t_events, strict=True):
            if len(hits) and hits[-1] == t:
                _switch(tree, name, t, y, active, touches)
    return _run(tree, states, touches)


def _run(
    tree: Tree,
    states: list[tuple[float, FloatArray, dict[str, float]]],
    touches: list[tuple[float, str, float]],
) -> Run:
    """Return the run from its states at the times, each with the contacts then in force."""
    n = tree.size
    normal: dict[str, list[float]] = {name: [] for name in tree.joints}
    torque = []
    for at, y, active in states:
        torque.append(tree.accelerations(at, y[:n], y[n:], active)[1])
        for name, forces in normal.items():
            in_force = name in active
            forces.append(tree.contact_force(name, y[:n], y[n:], active[name])[1] if in_force else 0.0)
    sampled = np.array([y for _, y, _ in states])
    forces_N = {name: np.array(forces) for name, forces in normal.items()}
    return Run(sampled[:, 2], touches, sampled[:, n + 2], np.array(torque), forces_N)


def _start(tree: Tree) -> FloatArray:
    """Return coordinates and rates of the ideal assembly at the scene's start angle, which must be zero."""
    scene = tree.scene
    assert scene.start.crank_angle_rad == 0
    s, r, omega = scene.crank.centre_of_mass_m, scene.crank.length_m, speed_at_start(scene)
    u, rate = np.zeros((2, tree.size))
    if scene.rod is None:
        u[2], rate[0], rate[1] = s, omega, s * omega
        return np.concatenate([u, rate])
    length, d = scene.rod.length_m, scene.rod.centre_of_mass_m
    u[2], rate[0], rate[1] = r + length, omega, -r / length * omega
    centres = ((s, s * omega), (r + d, r * omega - d * r / length * omega))
    for place, (x, y_rate) in zip(tree.places, centres, strict=False):
        if len(place.moves) == 2:
            u[place.moves[0]], rate[place.moves[1]] = x, y_rate
    return np.concatenate([u, rate])


def _switch(
    tree: Tree,
    name: str,
    t: float,
    y: FloatArray,
    active: dict[str, float],
    touches: list[tuple[float, str, float]],
) -> None:
    if active.pop(name, None) is not None:
        return
    n, clearance = tree.size, getattr(tree.scene.clearance, name)
    bearing, pin, *_ = tree.joints[name]
    J = pin.slopes(y[:n], y[n:])[0] - bearing.slopes(y[:n], y[n:])[0]
    d = tree.gap(name, y[:n])
    speed = float(d @ J @ y[n:] / np.hypot(*d))
    active[name] = DAMPING[clearance.law](clearance.restitution) / max(speed, 1e-6)
    touches.append((t, name, speed))
