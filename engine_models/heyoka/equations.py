"""A mechanism's equations of motion in minimal coordinates on a tape, by the phases of its contacts.

In flight the independent variable is the time. Where pins touch, K delta^n has no Taylor series at delta = 0,
at touch and release, unless n is whole. So there the roots w_k = sqrt(delta_k) of the penetrations are
variables, too, and the independent variable is s (after Sundman 1912) with

    dt/ds = W = the product of all w_k,  dw_k/ds = W/w_k delta_k'/2,  delta^n = w^(2n)

which are analytic from touch to release. Both are at a w that is not zero but for its rounding (see
``drafts``): pins that touch or leave together would wait there for ever. The time is a variable. A crank
whose motion is prescribed is a function of the time, and no variable.

A pin that follows a rigid wall is held by a force f along d: with G = d.d', N = dG/du and R the accelerations
per unit of f, G' = 0 asks of it that  N.R f = -(dG/dz.u + dG/dt + N.u'),  u' those of no f. The same N and R
make the impact at a rigid wall,  u+ = u - (1 + e) (G/N.R) R.
"""

from dataclasses import replace
from functools import reduce
from operator import mul

import numpy as np

from engine_models.heyoka.pieces import Piece, turn_of
from engine_models.mechanics.minimal.tree import THETA, Posture, Tree
from reference_solver.contact.types import CONTACT, FLIGHT
from reference_solver.equations import Equations
from reference_solver.mechanism.contact_laws import FRICTION_LAWS
from reference_solver.mechanism.mechanism import GasForce, Mechanism, PrescribedMotion, PrescribedSpeed
from reference_solver.mechanism.points import State, ends_of
from reference_solver.tape import Array, Scalar, Tape, array

#: The phases of all contacts.
Phases = tuple[float, ...]


class Motion:
    """A mechanism in minimal coordinates on a tape, with its contacts in phases.

    Variables are z and u = dz/dt without those of a driven crank; of a contact in flight ``reach``, the
    square of the distance at which it touches, of one that has touched w and its approach ``speed``, if the
    law asks for it; with contacts the ``time``. Parameters are ``until``, where the run is to stop, in s,
    and the pieces of drive and gas (see ``pieces``), by the numbers of their coefficients.
    """

    def __init__(self, mechanism: Mechanism, angle: float, phases: Phases, terms: dict[str, int]) -> None:
        self.phases, self.joints, tape = phases, mechanism.contacts, Tape()
        tree, clock = Tree(mechanism), bool(phases)
        self.parameters = ["until"] * clock
        self.parameters += [name for of, n in terms.items() for name in _parameters_of(of, n)]
        pieces = {
            of: Piece(tape.input(f"{of}_begin"), array([tape.input(f"{of}{k}") for k in range(n)]))
            for of, n in terms.items()
        }
        drivers = [c for c in mechanism.constraints if isinstance(c, PrescribedSpeed | PrescribedMotion)]
        time = tape.input("time")
        turn = turn_of(drivers[0], time, pieces.get("drive")) if drivers else None
        self.places = [place for place in tree.coordinates if not (turn and place == THETA)]
        z, u = ({place: tape.input(f"{of}{place}") for place in self.places} for of in "zu")
        if turn:
            z[THETA], u[THETA] = angle + turn[0], turn[1]
        order, self._order, self.u = array([z[k] for k in tree.coordinates]), tree.coordinates, u
        self._driven = turn[2] if turn else None
        self._posture = Posture(tree, order, array([u[k] for k in tree.coordinates]))
        self._still = Posture(tree, order, np.zeros(len(order)))
        self.q, self.v = array(self._posture.q), array(self._posture.v)
        #: States in which one coordinate alone moves, at a rate of 1.
        self._moved = {
            place: State(self.q, array(Posture(tree, order, unit).v))
            for place, unit in zip(tree.coordinates, np.eye(len(order)), strict=True)
        }
        loads = [
            replace(load, force_N=pieces["gas"]) if isinstance(load, GasForce) else load  # type: ignore[arg-type]
            for load in mechanism.loads
        ]
        equations = Equations(replace(mechanism, loads=tuple(loads)), np.zeros(len(self.q)))
        self._applied, self.powers, _ = equations.forces(time, self.q, self.v, None)
        self.crank_angle, self.crank_speed = z[THETA], u[THETA]
        self.touching = [k for k, phase in enumerate(phases) if phase != FLIGHT and not self.joints[k].rigid]
        self.held = [k for k, phase in enumerate(phases) if phase != FLIGHT and self.joints[k].rigid]
        self.names = [f"{of}{place}" for of in "zu" for place in self.places]
        for k, phase in enumerate(phases):
            if phase == FLIGHT:
                self.names.append(f"reach{k}")
            elif k in self.touching:
                self.names += [f"w{k}"] + [f"speed{k}"] * bool(self.joints[k].compliance.damping_factor)
        self.names += ["time"] * clock
        self.inputs = {name: tape.input(name) for name in [*self.names, *self.parameters]}

    def accelerations(self) -> tuple[dict[int, Scalar], Scalar]:
        """Return du/dt by place, and a driver's torque, of no pin held; contacts enter ``powers``."""
        pulls: dict[int, Scalar] = dict.fromkeys(self._order, 0.0)
        for k in self.touching:
            for place, pull in self._pulls(k).items():
                pulls[place] = pulls[place] + pull
        found, torque = self._posture.accelerations(self._applied, self._driven, pulls)
        return dict(zip(self._order, found, strict=True)), torque

    def answer_to(self, row: dict[int, Scalar]) -> tuple[dict[int, Scalar], Scalar]:
        """Return du/dt by place, and the driver's torque, of generalised forces by place alone."""
        nothing, driven = np.zeros(len(self.q)), None if self._driven is None else 0.0
        found, torque = self._still.accelerations(nothing, driven, row)
        return dict(zip(self._order, found, strict=True)), torque

    def gap(self, k: int) -> Array:
        """Return d (2,) of a contact."""
        bearing, pin = ends_of(self.joints[k], self._moved[self._order[0]])
        return pin.place - bearing.place

    def row(self, k: int, direction: Array, twist: tuple[Scalar, Scalar] = (0.0, 0.0)) -> dict[int, Scalar]:
        """Return by place what each rate makes of a pin's speed from its bearing along a direction.

        ``twist`` adds parts of the angular velocities of bearing and pin.
        """
        row = dict[int, Scalar]()
        for place, state in self._moved.items():
            bearing, pin = ends_of(self.joints[k], state)
            row[place] = direction @ (pin.rate - bearing.rate)
            row[place] = row[place] + twist[0] * bearing.spin + twist[1] * pin.spin
        return row

    def speed(self, row: dict[int, Scalar]) -> Scalar:
        """Return the speed that a row gives."""
        return sum((part * self.u[place] for place, part in row.items()), start=0.0)

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

    def _pulls(self, k: int) -> dict[int, Scalar]:
        """Return a contact's generalised forces (see ``contact.force``); powers get what it adds up."""
        joint, w, n = self.joints[k], self.inputs[f"w{k}"], self._normal(k)
        law, row = joint.compliance, self.row(k, n)
        rate, elastic = self.speed(row), law.stiffness * reduce(mul, [w] * round(2 * law.exponent))
        if self.phases[k] != CONTACT:
            self.powers[f"clip{k}"] = -elastic * rate
            return {}
        normal = elastic * self.push(k) + law.damping_N_s_m * rate
        self.powers |= {f"normal{k}": normal, f"loss{k}": (normal - elastic) * rate}
        pulls = {place: -normal * part for place, part in row.items()}
        if joint.friction is None:
            return pulls
        arm_i = joint.bearing_radius_m + 0.5 * w * w
        arm_j = joint.bearing_radius_m - joint.radial_clearance_m - 0.5 * w * w
        row = self.row(k, array([-n[1], n[0]]), (-arm_i, arm_j))
        sliding = self.speed(row)
        share = FRICTION_LAWS[joint.friction.kind](joint.friction, sliding)
        tangential = -(joint.friction.coefficient * normal * share)
        self.powers[f"slide{k}"] = -tangential * sliding
        return {place: pull + tangential * row[place] for place, pull in pulls.items()}


def _parameters_of(of: str, terms: int) -> list[str]:
    """Return the parameters of a piece with so many coefficients; gas has angles at which it ends."""
    ends = ["gas_low", "gas_high"] if of == "gas" else []
    return [*ends, f"{of}_begin", *(f"{of}{k}" for k in range(terms))]
