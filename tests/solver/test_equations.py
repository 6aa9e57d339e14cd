"""Every operation of the equations matters: one that is wrong, dropped or late is seen.

The equations of small mechanisms are written down on a tape, and every node that results need is altered in
turn. What comes out is held against accelerations in one coordinate, Newton's and Euler's laws body by body,
and the contact's law in the engines' own words, none of which know of the tape.
"""

import math
import operator
from collections.abc import Callable, Iterator
from functools import cache

import numpy as np
import pytest

from engine_models.engine import FloatArray
from engine_models.mechanics.forces import load_forces
from engine_models.reference.run import mechanism_of
from engine_models.scene.library import SCENES, ideal_free
from engine_models.scene.scene import Scene
from engine_models.scene.short import CrankLoad, assembled
from reference_solver.equations import Equations
from reference_solver.mechanism.contacts import CONTACT, exponent_of, stiffness_of
from reference_solver.tape import Node, Scalar, Tape, Value
from tests.helpers.crank_sliders import crank_slider
from tests.helpers.ideal_crank_slider import configuration, crank_acceleration

#: Parts of the largest: what the tape and the independent numbers differ by, since a depth of a micrometre is
#: the difference of lengths near a tenth of a metre, and what an alteration has to differ by at least.
ROUND_OFF, SEEN = 1e-10, 1e-8
#: A value that is altered by less, in parts of it or of one, is not.
SAME = 1e-12

FUNCTIONS: dict[str, Callable[..., float]] = {
    **{name: getattr(math, name) for name in ("cos", "sin", "sqrt", "tanh", "copysign")},
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
    ">": operator.gt,
    "&": operator.and_,
    "abs": abs,
    "max": max,
    "min": min,
    "if": lambda condition, x, y: x if condition else y,
}
#: No operations, but what is given, or asked.
GIVEN = ("input", "branch", ">", "&")
#: What a node's value may become, and the same of another state where a step is late.
ALTERED: dict[str, Callable[[float, float], float]] = {
    "sign flipped": lambda x, _: -x,
    "dropped": lambda _, __: 0.0,
    "times 1.001": lambda x, _: 1.001 * x,
    "times 0.999": lambda x, _: 0.999 * x,
    "late": lambda _, before: before,
}


def number(x: Scalar, values: dict[Node, float]) -> float:
    if not isinstance(x, Value):
        return float(x)
    return -values[x.node] if x.minus else values[x.node]


def flat(operands: object) -> Iterator[object]:
    if isinstance(operands, tuple):
        for operand in operands:
            yield from flat(operand)
    else:
        yield operands


class Written:
    """The equations of a scene's mechanism on a tape, and how far they are from what others say.

    On the tape are accelerations, multipliers and powers by name; ``states`` are each {q} and {q'}, and
    ``distance`` takes the number of one and the results there, and returns a part of the largest.
    """

    def __init__(
        self,
        scene: Scene,
        powers: tuple[str, ...],
        states: list[FloatArray],
        distance: Callable[[int, FloatArray], float],
        phases: FloatArray | None = None,
    ) -> None:
        mechanism, self.tape, self.states, self.distance = mechanism_of(scene), Tape(), states, distance
        n = 3 * len(mechanism.bodies)
        q, v = self.tape.inputs("y", 0, n), self.tape.inputs("y", n, n)
        answer = Equations(mechanism, np.zeros(n)).answer(0.0, q, v, phases)
        self.results = [*answer.accelerations, *answer.multipliers, *(answer.powers[name] for name in powers)]
        waiting, needed = [x.node for x in self.results if isinstance(x, Value)], dict[Node, None]()
        while waiting:
            node = waiting.pop()
            if node not in needed:
                needed[node] = None
                operands = node.operands[0].operands[:2] if node.operation == "result" else node.operands
                waiting += [x.node for x in flat(operands) if isinstance(x, Value)]
        self.needed = [*needed]

    def values(self, state: FloatArray, altered: Node | None = None, by: float = 0.0) -> dict[Node, float]:
        """Return the values of all nodes, one of which may be altered to a number."""
        found: dict[Node, float] = {}
        for node in self.tape.nodes:
            if node.operation == "input":
                found[node] = float(state[node.operands[1]])
            elif node.operation == "branch":
                found[node] = bool(number(node.operands[0], found))
            elif node.operation == "result":
                branch, place = node.operands
                found[node] = number(branch.operands[1][place], found) if found[branch] else 0.0
            else:
                found[node] = FUNCTIONS[node.operation](*(number(x, found) for x in node.operands))
            if node is altered:
                found[node] = by
        return found

    def off(self, altered: Node | None = None, how: str = "") -> float | None:
        """Return the distance at the worst state, None where an alteration alters no value."""
        found = list[float]()
        for k, state in enumerate(self.states):
            by = 0.0
            if altered is not None:
                own, other = (self.values(of)[altered] for of in (state, self.states[k - 1]))
                by = ALTERED[how](own, other)
                if abs(by - own) <= SAME * max(abs(own), 1.0):
                    continue
            try:
                values = self.values(state, altered, by)
                found.append(self.distance(k, np.array([number(x, values) for x in self.results])))
            except (ZeroDivisionError, ValueError, OverflowError):
                found.append(math.inf)
        return max((x if x == x else math.inf for x in found), default=None)


@cache
def ideal() -> Written:
    """Set F with centres of mass out of the middle, against a spring and the friction of its guide.

    Accelerations are those of one coordinate. Forces are held to Newton's and Euler's laws body by body.
    """
    crank, rod, _ = crank_slider(ideal_free())
    load = {"slider": CrankLoad(spring_N_m=300.0, free_position_m=0.12, viscous_N_s_m=2.0)}
    shifted = {"crank.centre_of_mass_m": 0.02, "rod.centre_of_mass_m": 0.05}
    scene = ideal_free().replace(shifted).model_copy(update={"load": load})
    (s, d), bodies = (0.02, 0.05), scene.mechanism.bodies
    # Number of the joint's force, body, the way along it to the joint from its centre of mass, and a sign.
    to_rod, to_slider = (1, 0, crank.length_m - s, -1), (2, 1, rod.length_m - d, -1)
    ends = (0, 0, -s, 1), (1, 1, -d, 1), to_rod, (2, 2, 0.0, 1), to_slider
    states, expected = [], []
    for angle, speed in ((0.7, 31.0), (2.1, -12.0)):
        theta = np.array([angle])
        _, slope, bend = configuration(scene, theta)
        acceleration = slope * crank_acceleration(scene)(theta, np.array([speed])) + bend * speed**2
        states.append(np.concatenate([part.ravel() for part in assembled(scene.short, angle, speed)]))
        expected.append((acceleration.ravel(), -2.0 * (slope[0, 2, 0] * speed) ** 2))

    def distance(k: int, answers: FloatArray) -> float:
        (true, true_power), (position, velocity) = expected[k], states[k].reshape(2, 3, 3)
        acceleration, forces, (guide, moment, power) = np.split(answers, [9, 15])
        load = load_forces(scene.mechanism, np.zeros(1), position[None], velocity[None])
        inertia = np.array([[body.mass_kg, body.mass_kg, body.inertia_kg_m2] for body in bodies])
        lack = inertia * acceleration.reshape(3, 3)
        lack[:, 1] += [body.mass_kg * -scene.mechanism.gravity_m_s2[1] for body in bodies]
        lack[2] -= [sum(force[0] for force in load.values()), guide, moment]
        for joint, body, reach, sign in ends:
            (x, y), angle = sign * forces[2 * joint : 2 * joint + 2], position[body, 2]
            lack[body] -= [x, y, reach * (math.cos(angle) * y - math.sin(angle) * x)]
        off = (acceleration - true) / np.abs(true).max(), lack.ravel() / np.abs(forces).max()
        return float(np.abs([*off[0], *off[1], power / true_power - 1]).max())

    return Written(scene, ("load0",), states, distance)


@cache
def loose() -> Written:
    """The pendulum with friction in its bearing, and its contact with a memory of 2 s/m."""
    scene, other = SCENES["clearance-pendulum"](), SCENES["clearance-driven-damped"]()
    rubbing = other.clearances["B"].friction
    assert rubbing is not None
    bearing = scene.clearances["O"].model_copy(update={"friction": rubbing})
    scene, crank = scene.model_copy(update={"clearance": {"O": bearing}}), scene.short.crank
    states, expected = [], []
    for turn, depth, x_rate, y_rate, spin in (
        (-1.2, 2e-6, 0.004, -0.006, 0.3),
        (0.4, 5e-6, -0.002, 0.008, -0.5),
    ):
        reach = bearing.radial_clearance_m + depth
        along = np.array([math.cos(turn), math.sin(turn)])  # from the pin to the centre of mass
        n, s = np.array([math.cos(turn + 0.5), math.sin(turn + 0.5)]), crank.centre_of_mass_m
        pin_rate = np.array([x_rate, y_rate]) - s * spin * np.array([-along[1], along[0]])
        rate, arm = float(n @ pin_rate), bearing.bearing_radius_m - bearing.radial_clearance_m - depth / 2
        spring = stiffness_of(bearing) * depth ** exponent_of(bearing)
        normal = spring * (1 + rate / 0.5)
        sliding = float(n[0] * pin_rate[1] - n[1] * pin_rate[0] + spin * arm)
        friction = -rubbing.coefficient * normal * np.tanh(sliding / rubbing.regularisation_speed_m_s)
        force = -normal * n + friction * np.array([-n[1], n[0]])
        torque = arm * friction - s * (along[0] * force[1] - along[1] * force[0])
        weight = np.array([0.0, scene.mechanism.gravity_m_s2[1]])
        states.append(np.array([*(reach * n + s * along), turn, x_rate, y_rate, spin]))
        rates = normal, (normal - spring) * rate, -friction * sliding
        expected.append(np.array([*(force / crank.mass_kg + weight), torque / crank.inertia_kg_m2, *rates]))

    def distance(k: int, answers: FloatArray) -> float:
        return float(np.max(np.abs(answers / expected[k] - 1)))

    # A contact adds up its normal force, and what that and friction lose.
    return Written(scene, ("normal0", "loss0", "slide0"), states, distance, np.array([[CONTACT, 2.0]]))


@pytest.mark.parametrize("written", [ideal, loose])
def test_what_the_tape_says_is_what_independent_numbers_say(written: Callable[[], Written]) -> None:
    assert len(written().needed) > 30
    off = written().off()
    assert off is not None
    assert off < ROUND_OFF, f"{off:.1e}"


@pytest.mark.parametrize("how", ALTERED)
@pytest.mark.parametrize("written", [ideal, loose])
def test_no_operation_can_be_altered_unseen(written: Callable[[], Written], how: str) -> None:
    altered = {node: written().off(node, how) for node in written().needed if node.operation not in GIVEN}
    seen = [off for off in altered.values() if off is not None]
    assert len(seen) > len(altered) / 2, "most alterations alter something"
    unseen = {node: off for node, off in altered.items() if off is not None and off < SEEN}
    assert not unseen, [(node.operation, off) for node, off in unseen.items()]
