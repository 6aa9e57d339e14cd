"""Every operation of the equations matters: one that is wrong, dropped or late is seen.

The equations of small mechanisms are written down on a tape, and every node that results need is altered in
turn. What comes out is held against accelerations in one coordinate, Newton's and Euler's laws body by body,
and the contact's law in the engines' own words, none of which know of the tape.
"""

import math
import operator
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest

from engine_models.engine import FloatArray
from engine_models.minimal.forces import Forces
from engine_models.reference.solution import mechanism_of
from engine_models.scene.library import SCENES, ideal_free
from engine_models.scene.scene import Scene
from engine_models.scene.short import CrankLoad
from engine_models.scene.start import assembled
from reference_solver.equations import Equations
from reference_solver.mechanism.contacts import CONTACT, exponent_of, stiffness_of
from reference_solver.tape import Node, Scalar, Tape, Value
from tests.studies.truth.closed_forms.crank_slider import configuration, crank_acceleration

#: Parts of the largest: what the tape and the independent numbers differ by, since a depth of a micrometre is
#: the difference of lengths near a tenth of a metre, and what an alteration has to differ by at least.
ROUND_OFF, SEEN = 1e-10, 1e-8
#: A value that is altered by less, in parts of it or of one, is not.
SAME = 1e-12

FUNCTIONS: dict[str, Callable[..., float]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
    ">": operator.gt,
    "==": operator.eq,
    "&": operator.and_,
    "cos": math.cos,
    "sin": math.sin,
    "sqrt": math.sqrt,
    "tanh": math.tanh,
    "abs": abs,
    "copysign": math.copysign,
    "max": max,
    "min": min,
    "if": lambda x, condition, y: x if condition else y,
}
#: No operations, but what is given, or asked.
GIVEN = ("input", "branch", ">", "==", "&")
#: What a node's value may become, and the same of another state where a step is late.
ALTERED: dict[str, Callable[[float, float], float]] = {
    "sign flipped": lambda x, _: -x,
    "dropped": lambda _, __: 0.0,
    "times 1.001": lambda x, _: 1.001 * x,
    "times 0.999": lambda x, _: 0.999 * x,
    "late": lambda _, before: before,
}


@dataclass(frozen=True)
class Written:
    """The equations of a mechanism on a tape, and what they are to give at a state of inputs."""

    tape: Tape
    results: list[Scalar]
    states: tuple[FloatArray, ...]
    expected: tuple[FloatArray, ...]

    def values(self, state: FloatArray, altered: Node | None = None, by: float = 0.0) -> dict[Node, float]:
        """Return the values of all nodes, one of which may be altered to a number."""
        found: dict[Node, float] = {}

        def of(x: Scalar) -> float:
            return _number(x, found)

        for node in self.tape.nodes:
            if node.operation == "input":
                found[node] = float(
                    state[int(node.operands[0][1:]) + (len(state) // 2) * (node.operands[0][0] == "v")]
                )
            elif node.operation == "branch":
                found[node] = bool(of(node.operands[0]))
            elif node.operation == "result":
                branch, place = node.operands
                found[node] = of(branch.operands[1][place]) if found[branch] else 0.0
            else:
                found[node] = FUNCTIONS[node.operation](*map(of, node.operands))
            if node is altered:
                found[node] = by
        return found

    def answers(self, state: FloatArray, altered: Node | None = None, by: float = 0.0) -> FloatArray:
        """Return the results at a state."""
        found = self.values(state, altered, by)
        return np.array([_number(x, found) for x in self.results])

    @property
    def needed(self) -> list[Node]:
        """The nodes that the results need."""
        waiting = [x.node for x in self.results if isinstance(x, Value)]
        seen = dict[Node, None]()
        while waiting:
            node = waiting.pop()
            if node not in seen:
                seen[node] = None
                operands = node.operands[0].operands[:2] if node.operation == "result" else node.operands
                waiting += [x.node for x in _flat(operands) if isinstance(x, Value)]
        return list(seen)


def _number(x: Scalar, found: dict[Node, float]) -> float:
    if not isinstance(x, Value):
        return float(x)
    return -found[x.node] if x.minus else found[x.node]


def _flat(operands: object) -> Iterator[object]:
    if isinstance(operands, tuple):
        for operand in operands:
            yield from _flat(operand)
    else:
        yield operands


def on_tape(scene: Scene, powers: tuple[str, ...], phases: FloatArray | None) -> tuple[Tape, list[Scalar]]:
    """Return accelerations, multipliers and powers by name of a scene's equations, written on a tape."""
    mechanism = mechanism_of(scene)
    n, tape = 3 * len(mechanism.bodies), Tape()
    answer = Equations(mechanism, np.zeros(n)).answer(0.0, tape.inputs("q", n), tape.inputs("v", n), phases)
    told = [answer.powers[name] for name in powers]
    return tape, [*answer.accelerations, *answer.multipliers, *told]


# The ideal crank-slider


def loaded() -> Scene:
    """Set F with centres of mass out of the middle, against a spring and the friction of its guide."""
    crank, rod, _ = ideal_free().crank_slider()
    return ideal_free().model_copy(
        update={
            "crank": crank.model_copy(update={"centre_of_mass_m": 0.02}),
            "rod": rod.model_copy(update={"centre_of_mass_m": 0.05}),
            "load": {"slider": CrankLoad(spring_N_m=300.0, free_position_m=0.12, viscous_N_s_m=2.0)},
        }
    )


def motion(scene: Scene, angle: float, speed: float) -> tuple[FloatArray, FloatArray]:
    """Return a state, and its accelerations (9,) with the guide's damper's power."""
    theta = np.array([angle])
    _, slope, bend = configuration(scene, theta)
    acceleration = slope * crank_acceleration(scene)(theta, np.array([speed])) + bend * speed**2
    power = -2.0 * (slope[0, 2, 0] * speed) ** 2
    state = np.concatenate([part.ravel() for part in assembled(scene.short, angle, speed)])
    return state, np.append(acceleration.ravel(), power)


@cache
def ideal() -> Written:
    scene = loaded()
    states, expected = zip(*(motion(scene, *at) for at in ((0.7, 31.0), (2.1, -12.0))), strict=True)
    return Written(*on_tape(scene, ("load0",), None), states, expected)


def missing(scene: Scene, state: FloatArray, answers: FloatArray) -> FloatArray:
    """Return what the joints' forces lack of each body's rates of momentum, (9,), by Newton and Euler."""
    crank, rod, _ = scene.crank_slider()
    position, velocity = state.reshape(2, 3, 3)
    acceleration, forces, (guide, moment) = (
        answers[:9].reshape(3, 3),
        answers[9:15].reshape(3, 2),
        answers[15:17],
    )
    now = np.zeros(1), position[None], velocity[None]
    load = sum(f[0] for f in Forces(scene).act(*now).parts.values())
    s, d = crank.centre_of_mass_m, rod.centre_of_mass_m
    at = [
        (0, 0, -s, 1),
        (1, 1, -d, 1),
        (1, 0, crank.length_m - s, -1),
        (2, 2, 0.0, 1),
        (2, 1, rod.length_m - d, -1),
    ]
    lack = np.array([[b.mass_kg, b.mass_kg, b.inertia_kg_m2] for b in scene.mechanism.bodies]) * acceleration
    lack[:, 1] += [body.mass_kg * -scene.gravity[1] for body in scene.mechanism.bodies]
    lack[2] -= [load, guide, moment]
    for joint, body, reach, sign in at:
        (x, y), angle = sign * forces[joint], position[body, 2]
        lack[body] -= [x, y, reach * (math.cos(angle) * y - math.sin(angle) * x)]
    return lack.ravel()


def distance(written: Written, state: FloatArray, expected: FloatArray, answers: FloatArray) -> float:
    """Return how far results are from the independent numbers, in parts of the largest."""
    if written is loose():
        return float(np.max(np.abs(answers - expected) / np.abs(expected)))
    accelerations, forces, power = answers[:9], answers[9:15], answers[17:]
    parts = (
        (accelerations - expected[:9]) / np.abs(expected[:9]).max(),
        missing(loaded(), state, answers) / np.abs(forces).max(),
        power / expected[9:] - 1,
    )
    return float(np.max(np.abs(np.concatenate(parts))))


def off(written: Written, altered: Node | None = None, how: str = "") -> float | None:
    """Return the distance at the worst state, None where an alteration alters no value."""
    found = list[float]()
    for k, (state, expected) in enumerate(zip(written.states, written.expected, strict=True)):
        by = 0.0
        if altered is not None:
            own, other = (written.values(of)[altered] for of in (state, written.states[k - 1]))
            by = ALTERED[how](own, other)
            if abs(by - own) <= SAME * max(abs(own), 1.0):
                continue
        try:
            found.append(distance(written, state, expected, written.answers(state, altered, by)))
        except (ZeroDivisionError, ValueError, OverflowError):
            found.append(math.inf)
    return max((x if x == x else math.inf for x in found), default=None)


# A pin in its bearing


#: What a contact adds up: its normal force, and what that and friction lose.
POWERS = ("normal0", "loss0", "slide0")


def touching() -> tuple[Scene, FloatArray]:
    """Return the pendulum with friction in its bearing, and its contact with a memory of 2 s/m."""
    scene, rubbing = SCENES["clearance-pendulum"](), SCENES["clearance-driven-damped"]().clearance["B"]
    assert scene.clearance["O"] is not None
    assert rubbing is not None
    bearing = scene.clearance["O"].model_copy(update={"friction": rubbing.friction})
    return scene.model_copy(update={"clearance": {"O": bearing}}), np.array([[CONTACT, 2.0]])


@cache
def loose() -> Written:
    scene, phases = touching()
    clearance = scene.clearance["O"]
    assert clearance is not None
    K, power, rubbing = stiffness_of(clearance), exponent_of(clearance), clearance.friction
    crank = scene.short.crank
    assert rubbing is not None
    states, expected = [], []
    for turn, depth, x_rate, y_rate, spin in (
        (-1.2, 2e-6, 0.004, -0.006, 0.3),
        (0.4, 5e-6, -0.002, 0.008, -0.5),
    ):
        reach = clearance.radial_clearance_m + depth
        along = np.array([math.cos(turn), math.sin(turn)])  # from the pin to the centre of mass
        n, s = np.array([math.cos(turn + 0.5), math.sin(turn + 0.5)]), crank.centre_of_mass_m
        centre = reach * n + s * along
        state = np.array([*centre, turn, x_rate, y_rate, spin])
        pin_rate = np.array([x_rate, y_rate]) - s * spin * np.array([-along[1], along[0]])
        rate, arm = float(n @ pin_rate), clearance.bearing_radius_m - clearance.radial_clearance_m - depth / 2
        spring = K * depth**power
        normal = spring * (1 + rate / 0.5)
        sliding = float(n[0] * pin_rate[1] - n[1] * pin_rate[0] + spin * arm)
        share = np.tanh(sliding / rubbing.regularisation_speed_m_s)
        friction = -rubbing.coefficient * normal * share
        force = -normal * n + friction * np.array([-n[1], n[0]])
        torque = arm * friction - s * (along[0] * force[1] - along[1] * force[0])
        rates = (normal, (normal - spring) * rate, -friction * sliding)
        weight = np.array([0.0, scene.gravity[1]])
        states.append(state)
        expected.append(np.array([*(force / crank.mass_kg + weight), torque / crank.inertia_kg_m2, *rates]))
    return Written(*on_tape(scene, POWERS, phases), tuple(states), tuple(expected))


@pytest.mark.parametrize("of", [ideal, loose])
def test_what_the_tape_says_is_what_independent_numbers_say(of: Callable[[], Written]) -> None:
    assert len(of().needed) > 30
    found = off(of())
    assert found is not None
    assert found < ROUND_OFF, f"{found:.1e}"


@pytest.mark.parametrize("how", ALTERED)
@pytest.mark.parametrize("of", [ideal, loose])
def test_no_operation_can_be_altered_unseen(of: Callable[[], Written], how: str) -> None:
    altered = {node: off(of(), node, how) for node in of().needed if node.operation not in GIVEN}
    seen = [found for found in altered.values() if found is not None]
    assert len(seen) > len(altered) / 2, "most alterations alter something"
    unseen = {node: found for node, found in altered.items() if found is not None and found < SEEN}
    assert not unseen, [(node.operation, found) for node, found in unseen.items()]
