"""Mechanisms of parts at random, and what the functions of a kernel make of them by both back ends."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from types import ModuleType
from typing import Any, get_args

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from reference_solver.compiled.faces import ReadableFace, phases_of, with_fields
from reference_solver.kernel import Topology, source_of
from reference_solver.compiled.store import load_kernel
from reference_solver.contact import adaptive_loop
from reference_solver.contact.types import CLIPPED, CONTACT, CONTACT_RECORD, START, Run, new_run
from reference_solver.equations import Baumgarte, Equations
from reference_solver.mechanism.contact_laws import ContactLaw, FrictionLaw, RigidWall
from reference_solver.mechanism.mechanism import GROUND, Body, ClearanceJoint, Constraint, Load, Mechanism
from reference_solver.mechanism.motions import Course, Fluctuation, Ramp, Steady
from reference_solver.mechanism.tables import PiecewiseCubic
from reference_solver.methods import RK4, dop853
from reference_solver.rigid.walls import Walls, new_walls, rigid_joints

FloatArray = NDArray[np.float64]
CONSTRAINTS: tuple[type, ...] = get_args(Constraint)
LOADS: tuple[type, ...] = get_args(Load)
MOTIONS = (Steady(1.3), Ramp(0.4, -2.0, 0.9), Fluctuation(0.5, 1.1, 7.0, 0.3))
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


#: Beyond this rounding is magnified, and nothing compared.
WELL_CONDITIONED = 1e4


@dataclass(frozen=True)
class Recipe:
    """The kinds of parts of a mechanism, whose numbers come of a seed, and what its kernel is for.

    Another seed is that of a ``state``. A wall has the numbers of its law and its friction in ``LAWS`` and
    ``FRICTIONS``, and whether its pin follows it if it is rigid.
    """

    bodies: int
    constraints: Sequence[type] = ()
    loads: Sequence[type] = ()
    walls: Sequence[tuple[int, int, bool]] = ()
    stabilisation: str = "none"
    controlled: bool = False
    seed: int = 0
    state: int = 0

    def topology(self) -> Topology:
        """Return the mechanism with what its kernel is written for."""
        random = np.random.default_rng(self.seed)
        kinds = [Body] * self.bodies, self.constraints, self.loads
        bodies, constraints, loads = (tuple(part(of, random, self.bodies) for of in each) for each in kinds)
        contacts = tuple(
            part(ClearanceJoint, random, self.bodies, law=LAWS[law], friction=FRICTIONS[friction])
            for law, friction, _ in self.walls
        )
        mechanism = Mechanism(bodies, constraints, loads, 9.81, contacts, -1.5)
        following = tuple(k for k, (law, _, stays) in enumerate(self.walls) if contacts[k].rigid and stays)
        method = dop853() if self.controlled else RK4
        return Topology(mechanism, following=following, method=method, **STABILISATIONS[self.stabilisation])


def part(kind: type, random: Generator, bodies: int, **given: Any) -> Any:
    """Return a part of a mechanism with numbers and bodies at random; a point may be a centre of mass."""
    i, j = random.permutation(np.arange(GROUND, bodies))[:2].tolist()
    body = int(random.integers(bodies))
    given |= {"body_i": i, "body_j": j, "body": body, "crank": body}
    given |= {"radial_clearance_m": random.uniform(0.1, 0.3), "bearing_radius_m": random.uniform(0.4, 0.6)}

    def value(of: Any) -> Any:
        if of.name in given:
            return given[of.name]
        if of.name.startswith("point"):
            return tuple(random.choice([0.0, 1.0]) * random.uniform(-1.0, 1.0, 2))
        if of.name == "motion":
            return [*MOTIONS, Course(table(random))][random.integers(4)]
        return table(random) if of.type is PiecewiseCubic else float(random.uniform(0.5, 2.0))

    return kind(**{of.name: value(of) for of in fields(kind)})


def table(random: Generator) -> PiecewiseCubic:
    """Return a function of three pieces, that jumps."""
    return PiecewiseCubic(
        tuple(x for start in (0.0, 0.3, 0.7) for x in (start, *random.uniform(-1.0, 1.0, 4)))
    )


def as_python(source: str) -> ModuleType:
    """Return a kernel's module as Python, nothing compiled."""
    plain = "straight_line = lambda f: f\nnjit = called = lambda **_: lambda f: f\n"
    plain += "zeros = lambda size: [0.0]*size\n\ndef parameters"
    return load_kernel(source.replace("def parameters", plain, 1))


def outcomes(recipe: Recipe, compiled: bool) -> tuple[dict[str, FloatArray], dict[str, FloatArray]]:
    """Return all numbers that functions of a kernel make at a state off the constraints, by both back ends.

    The first ones are of the text that the tape wrote, as machine code or as Python; the others of the
    equations in numbers. There are none where these are badly conditioned.
    """
    topology, random = recipe.topology(), np.random.default_rng([recipe.seed, recipe.state])
    q_start, q, v = random.uniform(-1.0, 1.0, (3, topology.n))
    t, h = random.uniform(0.0, 1.0), 1e-2
    readable = ReadableFace(topology, q_start)
    contacts = np.zeros(len(topology.mechanism.contacts), CONTACT_RECORD)
    contacts["phase"] = random.integers(0, 3, len(contacts))
    contacts["memory"] = random.uniform(0.1, 0.5, len(contacts))
    for k, joint in enumerate(topology.mechanism.contacts):
        if joint.rigid:
            contacts["phase"][k] = CONTACT if k in topology.following else 0.0
        elif not joint.compliance.clipped and contacts["phase"][k] == CLIPPED:
            contacts["phase"][k] = CONTACT
    source = source_of(topology.marked())
    module = load_kernel(source) if compiled else as_python(source)
    found = [dict[str, FloatArray](), dict[str, FloatArray]()]
    sizes = topology.n, len(readable.equations.power_names) + 1, len(readable.equations.C)
    if not readable.equations.answer(t, q, v, phases_of(contacts)).condition < WELL_CONDITIONED:
        return found[0], found[1]
    for into, kernel in zip(found, (module, readable), strict=True):
        run = new_run(contacts.copy(), sizes, np.zeros(1), adaptive_loop.ROWS, 0)
        run.old.q[:], run.old.v[:] = q, v
        walls = new_walls(topology.mechanism, readable.equations.power_names)
        if not compiled or kernel is readable:
            run, walls = with_fields(run), with_fields(walls)
        p = topology.parameters(module, q_start) if kernel is module else None
        for name, call in calls(kernel, run, walls, p, t, h).items():
            if hasattr(module, name) and not (name == "advance" and kernel is readable):
                into[name] = call()
        if rigid_joints(topology.mechanism) and hasattr(module, "walls"):
            for name in ("rows", "motion", "mobility", "drivers", "free"):
                into[f"walls' {name}"] = getattr(walls, name)
            for name in ("distance", "rate", "turning", "noise", "rate_noise", "bare", "share"):
                into[f"walls' {name}"] = np.array(walls.joints[name])
    if "advance" in found[0]:  # two steps from t = 0, which the readable back end takes one by one
        run = with_fields(new_run(contacts, sizes, np.zeros(1), adaptive_loop.ROWS, 0))
        run.old.q[:], run.old.v[:] = q, v
        for k in range(2):
            after = readable.stepped(contacts, k * h, h, run.old)
            added = np.array([*after.sums.values(), after.removed])
            run.old.y[:] = [*after.q, *after.v, *(run.old.sums + added)]
        found[1]["advance"] = run.old.y.copy()
    return found[0], found[1]


def solved(recipe: Recipe) -> tuple[FloatArray, FloatArray]:
    """Return accelerations and multipliers by the equations' factors, and by the whole matrix."""
    topology, random = recipe.topology(), np.random.default_rng([recipe.seed, recipe.state])
    q_start, q, v = random.uniform(-1.0, 1.0, (3, topology.n))
    equations = Equations(topology.mechanism, q_start)
    answer = equations.answer(0.3, q, v)
    if not answer.condition < WELL_CONDITIONED:
        return np.zeros(0), np.zeros(0)
    system, F, zeros = equations.system(0.3, q, v), equations.applied_force(0.3, q, v), np.zeros
    B, rows = np.asarray(system.B, dtype=float), len(system.B)
    whole = np.block([[np.diag(equations.mass.astype(float)), -B.T], [B, zeros((rows, rows))]])
    dense = np.linalg.solve(whole, np.array([*F, *(system.C_dot - system.B_dot_v)], dtype=float))
    return np.array([*answer.accelerations, *answer.multipliers], dtype=float), dense


def calls(kernel: Any, run: Run, walls: Walls, p: FloatArray | None, t: float, h: float) -> dict[str, Any]:
    """Return by name what calls a kernel's functions, and returns what they have made."""
    contacts, y = run.contacts, run.old.y

    def step() -> FloatArray:
        condition = kernel.step(p, contacts, t, h, run.old, run.new)
        return np.array([*run.new.y, *run.new.gaps.view(np.float64), condition])

    def gaps() -> FloatArray:
        kernel.gaps(p, contacts, t, run.old)
        return np.array(run.old.gaps.view(np.float64))

    def slopes() -> FloatArray:
        condition = kernel.slopes(p, contacts, t, START, 0.7, y, run.slopes)
        return np.array([*run.slopes[START], condition])

    def forces() -> FloatArray:
        condition = kernel.forces(p, contacts, t, y, 0, run.records.samples)
        return np.array([*run.records.samples[0], condition])

    def mobilities() -> FloatArray:
        kernel.mobilities(p, y, 1, run.slopes)
        return np.array(run.slopes[1])

    def look() -> FloatArray:
        return np.array([kernel.walls(p, contacts, t, y, walls)])

    def arrive() -> FloatArray:
        run.at.y[:] = y
        condition = kernel.arrive(p, contacts, t, 2, run.at, run.slopes)
        return np.array([*run.at.y, *run.slopes[2], condition])

    def advance() -> FloatArray:
        after = y.copy()
        done, _ = kernel.advance(p, after, h, 0.0, 2)
        assert done == 2
        return np.array(after)

    made = {"gaps": gaps, "slopes": slopes, "forces": forces, "mobilities": mobilities, "walls": look}
    return {**made, "arrive": arrive, "step": step, "advance": advance}
