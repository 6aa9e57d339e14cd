"""Mechanisms of parts at random, and what the functions of a kernel make of them by both back ends."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from itertools import product
from typing import Any, get_args

import numpy as np
from hypothesis import strategies as st
from numpy.random import Generator
from numpy.typing import NDArray

from reference_solver.equations import Baumgarte, Equations
from reference_solver.kernel import FUNCTIONS, Given, Kernel, Topology
from reference_solver.mechanism.constraints import Constraint, PrescribedSlide
from reference_solver.mechanism.contacts import CLIPPED, CONTACT, ClearanceJoint, ContactLaw, RigidWall
from reference_solver.mechanism.data import (
    GROUND,
    Body,
    ConstantSpeed,
    Course,
    Fluctuation,
    FrictionLaw,
    Guide,
    Pin,
    Ramp,
    Spring,
)
from reference_solver.mechanism.loads import Force, Law, Torque
from reference_solver.mechanism.mechanism import Mechanism
from reference_solver.mechanism.motions import PiecewiseCubic
from reference_solver.methods import RK4, dop853
from reference_solver.run import CONTACT_RECORD, GAP_FIELDS

FloatArray = NDArray[np.float64]
CONSTRAINTS: tuple[type, ...] = get_args(Constraint)
#: Loads by where they act, and by their laws; of a spring there is none.
LOADS = (Spring, *product((Torque, Force), get_args(Law)))
MOTIONS = (ConstantSpeed(1.3), Ramp(0.4, -2.0, 0.9), Fluctuation(0.5, 1.1, 7.0, 0.3))
#: Depths and speeds are of order one, so that contacts do not magnify rounding.
LAWS: tuple[ContactLaw | RigidWall, ...] = (
    ContactLaw(30.0, 1.5, 0.6),
    ContactLaw(20.0, 1.0, damping_N_s_m=3.0),
    ContactLaw(40.0, 2.2, 0.4, may_pull=True),
    ContactLaw(25.0, damping_N_s_m=2.0, kind="kuwabara-kono"),
    RigidWall(0.5),
)
FRICTIONS = (
    None,
    FrictionLaw("saturated-linear", 0.2, 0.7),
    FrictionLaw("ambrosio", 0.3, 0.8, 0.2),
    FrictionLaw("tanh", 0.2, 0.5),
)
STABILISATIONS: dict[str, dict[str, Any]] = {
    "none": {},
    "projection": {"projected": True},
    "baumgarte": {"baumgarte": Baumgarte(3.0, 2.0)},
}
#: Beyond this rounding is magnified, by a projection many times over, and nothing compared.
WELL_CONDITIONED = 1e2
#: By which part of them a state's numbers are moved, several hundred roundings.
MOVED = 1e-13


@dataclass(frozen=True)
class Recipe:
    """The kinds of parts of a mechanism, whose numbers come of a seed, and what its kernel is for.

    A wall has the numbers of its law and its friction in ``LAWS`` and ``FRICTIONS``, and whether its pin
    follows it if it is rigid.
    """

    bodies: int
    constraints: Sequence[type] = ()
    loads: Sequence[Any] = ()
    walls: Sequence[tuple[int, int, bool]] = ()
    stabilisation: str = "none"
    controlled: bool = False
    seed: int = 0

    def topology(self) -> Topology:
        """Return the mechanism with what its kernel is written for."""
        random = np.random.default_rng(self.seed)
        kinds = [Body] * self.bodies, self.constraints
        bodies, constraints = (tuple(part(of, random, self.bodies) for of in each) for each in kinds)
        loads = tuple(load(of, random, self.bodies) for of in self.loads)
        contacts = tuple(
            part(ClearanceJoint, random, self.bodies, law=LAWS[law], friction=FRICTIONS[friction])
            for law, friction, _ in self.walls
        )
        mechanism = Mechanism(bodies, constraints, loads, 9.81, contacts, -1.5)
        following = tuple(k for k, (law, _, stays) in enumerate(self.walls) if contacts[k].rigid and stays)
        method = dop853() if self.controlled else RK4
        return Topology(mechanism, following=following, method=method, **STABILISATIONS[self.stabilisation])


#: Recipes at random, and those with all loads, all laws, rigid walls, and pins that follow them.
RECIPES = st.builds(
    Recipe,
    st.integers(1, 3),
    st.lists(st.sampled_from(CONSTRAINTS), max_size=5),
    st.lists(st.sampled_from(LOADS), max_size=4),
    st.lists(st.tuples(st.integers(0, len(LAWS) - 1), st.integers(0, 3), st.booleans()), max_size=2),
    st.sampled_from([*STABILISATIONS]),
    st.booleans(),
    st.integers(0, 2**32 - 1),
)
LOADED = Recipe(3, (Pin, Guide, PrescribedSlide), LOADS, (), "projection")
BY_LAWS = Recipe(2, (), (), ((0, 1, False), (1, 2, False), (2, 3, False), (3, 0, False)), "projection")
BESIDE_WALLS = Recipe(2, (Pin,), (), ((4, 3, False), (4, 0, False), (0, 0, False)), "baumgarte")
ON_WALLS = Recipe(2, (ClearanceJoint,), (), ((4, 1, True), (4, 2, False)), "projection", controlled=True)


def part(kind: type, random: Generator, bodies: int, **given: Any) -> Any:
    """Return a part of a mechanism with numbers and bodies at random; a point may be a centre of mass."""
    i, j = random.permutation(np.arange(GROUND, bodies))[:2].tolist()
    body = int(random.integers(bodies))
    given |= {"body_i": i, "body_j": j, "body": body, "crank": body, "against": i if i != body else j}
    given |= {"name": "", "clearance": None, "bearing_on_j": False, "turns": bool(random.integers(2))}
    given = {
        "radial_clearance_m": random.uniform(0.1, 0.3),
        "bearing_radius_m": random.uniform(0.4, 0.6),
    } | given

    def value(of: Any) -> Any:
        if of.name in given:
            return given[of.name]
        if of.name.startswith("point"):
            return tuple(random.choice([0.0, 1.0]) * random.uniform(-1.0, 1.0, 2))
        if of.name == "motion":
            return [*MOTIONS, Course(table(random))][random.integers(4)]
        return table(random) if of.type is PiecewiseCubic else float(random.uniform(0.5, 2.0))

    return kind(**{of.name: value(of) for of in fields(kind)})


def load(kind: Any, random: Generator, bodies: int) -> Any:
    """Return a spring, or a load by where it acts and its law."""
    if kind is Spring:
        return part(Spring, random, bodies)
    where, law = kind
    return part(where, random, bodies, law=part(law, random, bodies))


def table(random: Generator) -> PiecewiseCubic:
    """Return a function of three pieces, that jumps."""
    return PiecewiseCubic(
        tuple(x for start in (0.0, 0.3, 0.7) for x in (start, *random.uniform(-1.0, 1.0, 4)))
    )


def outcomes(recipe: Recipe) -> list[dict[str, FloatArray]]:
    """Return what functions of a kernel store and return at a state off the constraints.

    The first ones are machine code's, the others the equations' in numbers: at the same state, and at one
    with all numbers ``MOVED`` by a part. There are none where these are badly conditioned.
    """
    topology, random = recipe.topology(), np.random.default_rng([recipe.seed])
    n, joints = topology.n, topology.mechanism.contacts
    q_start, q, v = random.uniform(-1.0, 1.0, (3, n))
    t, h, lost = random.uniform(0.0, 1.0), 1e-2, 1e-9 * random.uniform(-1.0, 1.0, 2 * n)
    contacts = np.zeros(len(joints), CONTACT_RECORD)
    contacts["phase"] = random.integers(0, 3, len(contacts))
    contacts["memory"] = random.uniform(0.1, 0.5, len(contacts))
    for k, joint in enumerate(joints):
        if joint.rigid:
            contacts["phase"][k] = CONTACT if k in topology.following else 0.0
        elif not joint.law.clipped and contacts["phase"][k] == CLIPPED:
            contacts["phase"][k] = CONTACT
    phases = np.column_stack([contacts["phase"], contacts["memory"]])
    equations = Equations(topology.mechanism, q_start, topology.baumgarte, topology.following)
    if not equations.answer(t, q, v, phases).condition < WELL_CONDITIONED:
        return [{}, {}, {}]
    sums = random.uniform(-1.0, 1.0, len(equations.power_names) + 1)
    given, kernel = Given(topology, equations, t, q, v, phases, h, lost, sums), Kernel(topology, q_start)
    y = np.concatenate([q, v, sums, np.zeros(GAP_FIELDS * len(joints)), [h], lost])
    away = 1 + random.uniform(-MOVED, MOVED, (2, n))
    moved = replace(given, q=q * away[0], v=v * away[1])
    compiled, numbers, beside = dict[str, FloatArray](), dict[str, FloatArray](), dict[str, FloatArray]()
    for name in FUNCTIONS.keys() & kernel.functions.keys():
        numbers[name], beside[name] = (np.array(FUNCTIONS[name](of), dtype=float) for of in (given, moved))
        out = np.full(len(numbers[name]) - 1, np.nan)
        condition = kernel.functions[name](kernel.p, contacts.ctypes.data, t, y, out)
        compiled[name] = np.array([*out, condition])
    return [compiled, numbers, beside]
