"""The equations of one system as heyoka's expressions: variables and rates, events, what follows them."""

from collections.abc import Sequence

import heyoka as hy
import numpy as np

from engine_models.engine import FloatArray
from engine_models.heyoka.equations import Motion
from engine_models.heyoka.expressions import Translation
from engine_models.mechanics.equations.frames import ByCoordinate
from reference_solver.contact.types import CONTACT, FLIGHT
from reference_solver.tape import Scalar, larger, sqrt

#: Events: a pin touches or leaves its wall; a force is clipped where it would pull, or resumes; an angle or a
#: speed passes the upper or the lower end of a piece of a function; the time is over, or that of a piece; a
#: determinant is small, so that the independent coordinates are to be chosen anew.
TOUCH, CLIP, HIGHER, LOWER, OVER, SMALL_STEP = range(6)
#: A flight begins at the wall but for the error of its release, and heyoka may lose all roots of an event
#: that begins at zero. So a touch is told past where the pin then is, by this part of the links' lengths: a
#: few units in the last place of a pin's position.
PAST = 1e-15
#: It leaves at this part of the root of the penetration that it has touched at.
LEAVING = 0.5

#: The kind of an event, and the number of its contact, function or step, 0 of the time.
Event = tuple[int, int]


class Draft:
    """The equations of one system as heyoka's expressions."""

    def __init__(self, motion: Motion, past_m: float) -> None:
        self._motion, self._past_m = motion, past_m
        self.phases, self.names, self.parameters = motion.phases, motion.names, motion.parameters
        self.variables = dict(zip(self.names, hy.make_vars(*self.names), strict=True))
        pars = {name: hy.par[k] for k, name in enumerate(self.parameters)}
        self._of = Translation({**self.variables, **pars})
        self.partition, self.stretched = motion.partition, bool(motion.touching)
        self.periods = [round(2 * motion.joints[k].compliance.exponent) + 2 for k in motion.touching]
        self.alarms = self._alarms()
        #: These and the others.
        self.events = self.alarms | self._stops()

    def flow(self) -> list[tuple[hy.expression, hy.expression]]:
        """Return the variables and their rates."""
        motion, (slow, shares) = self._motion, self._motion.slowness()
        rates = {name: hy.expression(0.0) for name in self.names}
        for k in motion.carried:
            rates[f"z{k}"] = self._of(slow * motion.posture.rates[k])
        for k, acceleration in self._accelerations().items():
            rates[f"u{k}"] = self._of(slow) * acceleration if shares else acceleration
        for k, share in shares.items():
            rates[f"w{k}"] = self._of(0.5 * share * motion.rate(k))
        if "time" in rates:
            rates["time"] = self._of(slow)
        return [(self.variables[name], rate) for name, rate in rates.items()]

    def _accelerations(self) -> dict[int, hy.expression]:
        """Return z'' by coordinate, of which pins that follow rigid walls take their part."""
        found, _ = self._motion.accelerations
        out = {k: self._of(found[k]) for k in self._motion.independent}
        for contact in self._motion.held:
            answer, force = self._answer(contact), self._holding(contact)
            out = {k: a + force * answer[k] for k, a in out.items()}
        return out

    def _answer(self, k: int) -> dict[int, hy.expression]:
        """Return R of a contact by coordinate."""
        answer, _ = self._motion.posture.answer_to(self._row(k))
        return {place: self._of(value) for place, value in answer.items()}

    def _row(self, k: int) -> ByCoordinate:
        """Return by coordinate what each rate makes of G = d.d'."""
        return self._motion.row(k, self._motion.gap(k))

    def _mobility(self, k: int) -> hy.expression:
        """Return N.R of a contact."""
        row, posture = self._row(k), self._motion.posture
        N, (R, _) = posture.reduced(row), posture.answer_to(row)
        return self._of(sum(N[place] * R[place] for place in self._motion.independent))

    def _holding(self, k: int) -> hy.expression:
        """Return the force on a pin along d, as a part of it, that keeps it on a rigid wall."""
        motion, row = self._motion, self._row(k)
        G, (found, _) = self._of(motion.speed(row)), motion.accelerations
        parts = [hy.diff(G, self.variables["time"])]
        for place in motion.carried:
            parts.append(hy.diff(G, self.variables[f"z{place}"]) * self._of(motion.posture.rates[place]))
        N = motion.posture.reduced(row)
        parts += [self._of(N[place] * found[place]) for place in motion.independent]
        return -hy.sum(parts) / self._mobility(k)

    def pressing(self, k: int) -> hy.expression:
        """Return the force in N that presses a pin which follows a rigid wall inwards."""
        d = self._motion.gap(k)
        return -self._holding(k) * self._of(sqrt(d @ d))

    def _alarms(self) -> dict[Event, hy.expression]:
        """Return values that rise through zero at contacts' events."""
        motion, alarms = self._motion, dict[Event, hy.expression]()
        for k, phase in enumerate(self.phases):
            if phase == FLIGHT:
                d = motion.gap(k)
                alarms[TOUCH, k] = self._of(d @ d - motion.inputs[f"reach{k}"])
            elif k in motion.held:
                alarms[TOUCH, k] = -self.pressing(k)
            else:
                alarms[TOUCH, k] = LEAVING * self._past_m**0.5 - self.variables[f"w{k}"]
                if motion.joints[k].compliance.clipped:
                    push = self._of(motion.push(k))
                    alarms[CLIP, k] = -push if phase == CONTACT else push
        return alarms

    def _stops(self) -> dict[Event, hy.expression]:
        """Return values that rise through zero where a piece ends, or the time, or a determinant is small."""
        stops, pars = dict[Event, hy.expression](), self.parameters.index
        for k, argument in self._motion.arguments.items():
            value = self._of(argument)
            stops[HIGHER, k] = value - hy.par[pars(f"high{k}")]
            stops[LOWER, k] = hy.par[pars(f"low{k}")] - value
        if "until" in self.parameters:
            stops[OVER, 0] = self.variables["time"] - hy.par[pars("until")]
        for k, determinant in self._motion.determinants.items():
            stops[SMALL_STEP, k] = hy.par[pars(f"level{k}")] - self._of(determinant)
        return stops

    @property
    def determinants(self) -> list[hy.expression]:
        """Return those of the steps that are watched."""
        return [self._of(value) for value in self._motion.determinants.values()]

    @property
    def coordinates(self) -> list[hy.expression]:
        """Return all coordinates, and their rates."""
        posture = self._motion.posture
        return [self._of(value) for value in (*posture.frames.u, *posture.rates)]

    def approaching(self, contacts: Sequence[int]) -> list[hy.expression]:
        """Return how far pins are past rigid walls that they approach, in m; of others -1."""
        depths = []
        for k in contacts:
            d, G = self._motion.gap(k), self._of(self._motion.speed(self._row(k)))
            depth = self._of(sqrt(d @ d) - self._motion.joints[k].radial_clearance_m)
            depths.append(hy.select(hy.gt(G, 0.0), depth, hy.expression(-1.0)))
        return depths

    def restart(self, to: "Draft", event: Event, restitution: float | None = None) -> list[hy.expression]:
        """Return the variables of the system to go on with after an event.

        With a ``restitution`` it is an impact at a rigid wall.
        """
        motion, (kind, k) = self._motion, event
        known = dict(self.variables)
        if kind == SMALL_STEP:
            known |= {f"u{place}": self._of(rate) for place, rate in enumerate(motion.posture.rates)}
            return [known[name] for name in to.names]
        joint, d = motion.joints[k], motion.gap(k)
        distance, G = sqrt(d @ d), motion.speed(self._row(k))
        if restitution is not None:
            slow = self._of(joint.wall.minimum_impact_speed_m_s * distance > G)
            factor = hy.select(slow, 1.0, 1.0 + restitution) if restitution else 1.0
            impulse = factor * self._of(G) / self._mobility(k)
            for place, part in self._answer(k).items():
                known[f"u{place}"] = known[f"u{place}"] - impulse * part
        if kind == TOUCH:
            depth = distance - joint.radial_clearance_m
            begun: dict[str, Scalar] = {}
            reach = joint.radial_clearance_m + larger(depth, 0.0) + self._past_m
            begun[f"reach{k}"] = reach * reach
            if not joint.rigid:
                begun[f"w{k}"] = sqrt(larger(depth, self._past_m))
                speed = larger(G / joint.radial_clearance_m, joint.compliance.minimum_impact_speed_m_s)
                begun[f"speed{k}"] = speed
            known |= {name: self._of(value) for name, value in begun.items() if name in to.names}
        return [known[name] for name in to.names]

    def told(self, names: Sequence[str]) -> list[hy.expression]:
        """Return q and v (3b,) each, powers by name, of what is no impact's, and dt/ds."""
        motion = self._motion
        _, torque = motion.accelerations
        driving, (slow, _) = self._of(torque), motion.slowness()
        powers = {name: self._of(value) for name, value in motion.powers.items()}
        for k in motion.held:
            powers[f"normal{k}"] = self.pressing(k)
            driving = driving + self._holding(k) * self._of(motion.posture.answer_to(self._row(k))[1])
        powers["drivers"] = driving * self._of(motion.driver_speed)
        of_bodies = [self._of(value) for value in (*motion.q, *motion.v)]
        return [*of_bodies, *(powers.get(name, hy.expression(0.0)) for name in names), self._of(slow)]

    def phases_and_memories(self, state: FloatArray) -> FloatArray:
        """Return the phase and the law's a/v0 of every contact in a state, (2K,)."""
        rows = np.zeros((len(self.phases), 2))
        rows[:, 0] = self.phases
        for k in self._motion.touching:
            factor = self._motion.joints[k].compliance.damping_factor
            rows[k, 1] = factor / state[self.names.index(f"speed{k}")] if factor else 0.0
        return rows.ravel()
