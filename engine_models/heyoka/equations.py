"""A mechanism's equations of motion in minimal coordinates on a tape, by the phases of its contacts.

In flight the independent variable is the time. Where pins touch, K delta^n has no Taylor series at delta = 0,
at touch and release, unless n is whole. So there the roots w_k = sqrt(delta_k) of the penetrations are
variables, too, and the independent variable is s (after Sundman 1912) with

    dt/ds = W = the product of all w_k,  dw_k/ds = W/w_k delta_k'/2,  delta^n = w^(2n)

which are analytic from touch to release. Both are at a w that is not zero but for its rounding (see
``drafts``): pins that touch or leave together would wait there for ever. The time is a variable. What is
driven is a function of the time, and no variable.

A pin that follows a rigid wall is held by a force f along d: with G = d.d', N = dG/dz' and R the
accelerations per unit of f, G' = 0 asks of it that  N.R f = -(dG/du.u' + dG/dt + N.z''),  z'' those of no f.
The same N and R make the impact at a rigid wall,  z'+ = z' - (1 + e) (G/N.R) R.
"""

from functools import cached_property, reduce
from operator import mul

import numpy as np

from engine_models.heyoka.pieces import Knots, Polynomials, on_tape
from engine_models.mechanics.equations.frames import ByCoordinate
from engine_models.mechanics.equations.partition import Partition
from engine_models.mechanics.equations.posture import Posture
from engine_models.mechanics.equations.structure import Structure
from engine_models.mechanics.equations.tree import Tree
from reference_solver.contact.types import CONTACT, FLIGHT
from reference_solver.equations import Equations
from reference_solver.mechanism.contact_laws import FRICTION_LAWS
from reference_solver.mechanism.mechanism import GROUND, Mechanism
from reference_solver.tape import Array, FloatArray, Scalar, Tape, array

#: The phases of all contacts.
Phases = tuple[float, ...]


class Motion:
    """A mechanism in minimal coordinates on a tape, with its contacts in phases.

    Variables are the coordinates u that are integrated, as z0, z1, ..., and the independent rates z', as u0,
    u1, ..., by their numbers (see ``equations.posture``); of a contact in flight ``reach``, the square of the
    distance at which it touches, of one that has touched w and its approach ``speed``, if the law asks for
    it; the ``time`` if it has events. Parameters are those of ``Knots``, and for every step of the partition
    that is watched a ``level``, down to which its determinant may fall.
    """

    def __init__(
        self,
        structure: Structure,
        partition: Partition,
        mechanism: Mechanism,
        tables: list[Polynomials],
        q_start: FloatArray,
        phases: Phases,
        knots: Knots,
    ) -> None:
        self.phases, self.joints, self.partition, tape = phases, mechanism.contacts, partition, Tape()
        self.carried, self.independent = structure.carried, partition.independent
        mechanism, time = on_tape(mechanism, tables, tape), tape.input("time")
        tree, driven = Tree(structure, mechanism, q_start), None
        u = {k: tape.input(f"z{k}") for k in self.carried}
        self.z = {k: tape.input(f"u{k}") for k in self.independent}
        if structure.driven is not None:
            u[structure.driven], speed, acceleration = tree.driven(time)
            driven = speed, acceleration
        self.posture = Posture(tree, partition, u, self.z, driven, subtracted=True)
        self.q, self.v = array(self.posture.q), array(self.posture.v)
        self.driver_speed = 0.0 if structure.driven is None else self.posture.rates[structure.driven]
        equations = Equations(mechanism, np.zeros(len(self.q)))
        self._applied, self.powers, _ = equations.forces(time, self.q, self.v, None)
        self._gaps = [tree.gap(joint) for joint in self.joints]
        self.arguments = {k: table.argument(self.q, self.v) for k, table in knots.others.items()}
        self.touching = [k for k, phase in enumerate(phases) if phase != FLIGHT and not self.joints[k].rigid]
        self.held = [k for k, phase in enumerate(phases) if phase != FLIGHT and self.joints[k].rigid]
        self.names = [f"z{k}" for k in self.carried] + [f"u{k}" for k in self.independent]
        for k, phase in enumerate(phases):
            if phase == FLIGHT:
                self.names.append(f"reach{k}")
            elif k in self.touching:
                self.names += [f"w{k}"] + [f"speed{k}"] * bool(self.joints[k].compliance.damping_factor)
        self.names += ["time"] * ("until" in knots.names)
        self.parameters = [*knots.names, *(f"level{k}" for k in partition.watched)]
        self.inputs = {name: tape.input(name) for name in [*self.names, *self.parameters]}

    @property
    def determinants(self) -> dict[int, Scalar]:
        """Those of the steps that are watched, positive where the partition was chosen."""
        own, steps = self.posture.loops.determinants, self.partition.steps
        return {k: steps[k].sign * own[k] for k in self.partition.watched}

    @cached_property
    def accelerations(self) -> tuple[ByCoordinate, Scalar]:
        """z'' by coordinate, and a driver's torque or force, of no pin held; contacts enter ``powers``."""
        pulls = ByCoordinate()
        for k in self.touching:
            for place, pull in self._pulls(k).items():
                pulls[place] += pull
        return self.posture.accelerations(self._applied, pulls)

    def gap(self, k: int) -> Array:
        """Return d (2,) of a contact."""
        return array(self.posture.frames.vector(self._gaps[k]))

    def row(self, k: int, direction: Array, twist: tuple[Scalar, Scalar] = (0.0, 0.0)) -> ByCoordinate:
        """Return by coordinate what each rate makes of a pin's speed from its bearing along a direction.

        ``twist`` adds parts of the angular velocities of bearing and pin.
        """
        columns = self.posture.frames.columns(self._gaps[k])
        joint, tree = self.joints[k], self.posture.tree
        row = ByCoordinate({i: direction[0] * x + direction[1] * y for i, (x, y) in columns.items()})
        for body, part in zip((joint.body_i, joint.body_j), twist, strict=True):
            if (frame := tree.frame(body)) != GROUND:
                row[frame] += part
        return row

    def speed(self, row: ByCoordinate) -> Scalar:
        """Return the speed that a row gives."""
        return sum((part * self.posture.rates[k] for k, part in row.items()), start=0.0)

    def rate(self, k: int) -> Scalar:
        """Return the rate of a penetration that is w^2."""
        return self.speed(self.row(k, self._normal(k)))

    def _normal(self, k: int) -> Array:
        """Return d/|d| of a penetration that is w^2."""
        d, w = self.gap(k), self.inputs[f"w{k}"]
        distance = self.joints[k].radial_clearance_m + w * w
        return array([d[0] / distance, d[1] / distance])

    def push(self, k: int) -> Scalar:
        """Return the first factor of the dissipative law, which is negative where it would pull."""
        law = self.joints[k].compliance
        if not law.damping_factor:
            return 1.0
        return 1.0 + law.damping_factor * self.rate(k) / self.inputs[f"speed{k}"]

    def slowness(self) -> tuple[Scalar, dict[int, Scalar]]:
        """Return W, and W/w_k of every contact that touches."""
        roots = {k: self.inputs[f"w{k}"] for k in self.touching}
        others = {k: reduce(mul, [w for j, w in roots.items() if j != k], 1.0) for k in roots}
        return reduce(mul, roots.values(), 1.0), others

    def _pulls(self, k: int) -> ByCoordinate:
        """Return a contact's generalised forces (see ``contact.force``); powers get what it adds up."""
        joint, w, n = self.joints[k], self.inputs[f"w{k}"], self._normal(k)
        law, row = joint.compliance, self.row(k, n)
        rate, elastic = self.speed(row), law.stiffness * reduce(mul, [w] * round(2 * law.exponent))
        if self.phases[k] != CONTACT:
            self.powers[f"clip{k}"] = -elastic * rate
            return ByCoordinate()
        normal = elastic * self.push(k) + law.damping_N_s_m * rate
        self.powers |= {f"normal{k}": normal, f"loss{k}": (normal - elastic) * rate}
        pulls = ByCoordinate({place: -normal * part for place, part in row.items()})
        if joint.friction is None:
            return pulls
        arm_i = joint.bearing_radius_m + 0.5 * w * w
        arm_j = joint.bearing_radius_m - joint.radial_clearance_m - 0.5 * w * w
        row = self.row(k, array([-n[1], n[0]]), (-arm_i, arm_j))
        sliding = self.speed(row)
        share = FRICTION_LAWS[joint.friction.kind](joint.friction, sliding)
        tangential = -(joint.friction.coefficient * normal * share)
        self.powers[f"slide{k}"] = -tangential * sliding
        return ByCoordinate({place: pulls[place] + tangential * part for place, part in row.items()})
