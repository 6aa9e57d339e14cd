"""One run of a mechanism in a Pymunk space: a loop around ``space.step``, and what its kicks tell."""

from dataclasses import dataclass, field
from time import perf_counter
from typing import Any

import numpy as np
import pymunk
from pymunk import batch

from engine_models.engine import FloatArray, RunSettings, SimulationFailed
from engine_models.mechanics.joints import gaps
from engine_models.mechanics.quality import open_by_m
from engine_models.mechanics.states import lever_m, way
from engine_models.minimal import equations as eq
from engine_models.minimal.forces import Forces
from engine_models.progress import tell
from engine_models.pymunk import kicks
from engine_models.pymunk.model import Model, build, is_kinematic
from engine_models.pymunk.native_contact import NativeContact
from engine_models.scene.parts import AnyScene
from reference_solver.mechanism.data import GROUND, ConstantSpeed

FIELDS = batch.BodyFields
STATE = FIELDS.POSITION | FIELDS.ANGLE | FIELDS.VELOCITY | FIELDS.ANGULAR_VELOCITY
LOADS = FIELDS.FORCE | FIELDS.TORQUE
#: With a joint this many levers apart the bodies are no mechanism any more, and the run has failed.
LOST_GAP = 0.1


@dataclass
class Touch:
    """A contact that is on: its begin, approach speed and sums before, and its kicks: (t, force, depth)."""

    time_s: float
    speed_m_s: float
    sums: FloatArray
    trace: list[tuple[float, float, float]] = field(default_factory=list)


@dataclass
class Kick:
    """What a kick tells, at its time: all that is a sample if it is one."""

    time_s: float
    y: FloatArray
    told: FloatArray


class Run:
    """A run from t = 0 to its end; with ``records`` it has states and what is told of them at the samples.

    ``solve_time_s`` is the time of the loop, of which ``engine_time_s`` is spent inside ``space.step``.
    """

    def __init__(
        self, scene: AnyScene, settings: RunSettings, model: Model, forces: Forces, half_kick: bool,
        shorter: float, records: bool, q: FloatArray, v: FloatArray,
    ) -> None:  # fmt: skip
        self.scene, self.settings, self.model, self.forces = scene, settings, model, forces
        self.half_kick, self.records = half_kick, records
        self.times_s = settings.times_s(scene)
        self.steps, self.solve_time_s, self.engine_time_s = 0, 0.0, 0.0
        self.impacts: list[list[list[float]]] = [[] for _ in forces.phases]
        self.rows_y, self.rows_told = list[FloatArray](), list[FloatArray]()
        self._touches = dict[int, Touch]()
        self._plan = np.zeros(9)
        step_s = settings.step_used_s(scene.end_time_s)
        self._plan[[kicks.IN_FLIGHT, kicks.IN_CONTACT]] = step_s, step_s / shorter
        size, m, contacts = forces.size, forces.rows, len(forces.phases)
        self._told = np.zeros(eq.OF_CONTACT * contacts + len(forces.parts))
        self._powers, self._sums = np.zeros((2, len(forces.sums)))
        self.start = q
        self._q, self._v, self._a = q.ravel().copy(), v.ravel().copy(), np.zeros(size)
        self._multipliers, self._right, self._matrix = np.zeros(m), np.zeros(m), np.zeros((m, m))
        self._loads = np.zeros((size // 3, 3))
        self._read, self._write = batch.Buffer(), batch.Buffer()
        self._write.set_float_buf(self._loads)
        ids = batch.Buffer()
        batch.get_space_bodies(model.space, FIELDS.BODY_ID, ids)
        order = [*memoryview(ids.int_buf()).cast("P")]
        self._row = np.array([order.index(body.id) for body in model.bodies])
        self._native = {
            k: self._native_contact(k)
            for k, pin in enumerate(forces.of.loose)
            if pin.clearance is not None and pin.clearance.law == "rigid"
        }
        drive = forces.of.drive
        self._changes = drive.prescribes and not isinstance(drive.law, ConstantSpeed)
        self._looks = bool(contacts or forces.parts) or any(
            model.origin[k].any() and body.body_type == pymunk.Body.DYNAMIC
            for k, body in enumerate(model.bodies)
        )
        self._last: Kick | None = None

    def _native_contact(self, k: int) -> NativeContact:
        pin, model = self.forces.of.loose[k], self.model
        ends = [(pin.body_i, pin.point_i), (pin.body_j, pin.point_j)][:: -1 if pin.bearing_on_j else 1]
        placed = [
            (
                model.space.static_body if body == GROUND else model.bodies[body],
                pymunk.Vec2d(*point) - (tuple(model.origin[body]) if body != GROUND else (0.0, 0.0)),
            )
            for body, point in ends
        ]
        return NativeContact(model.space, k, self.scene.clearances[pin.name], *placed)

    def _get(self) -> None:
        """Read the state of the space's bodies, (b, 6)."""
        self._read.clear()
        batch.get_space_bodies(self.model.space, STATE, self._read)
        self._state = np.frombuffer(self._read.float_buf(), float).reshape(-1, 6)

    def _look(self, t: float, step_s: float, left_s: float) -> int:
        self._plan[[kicks.TIME, kicks.STEP, kicks.LEFT]] = t, step_s, left_s
        if not self._looks:
            self._plan[kicks.KICK] = step_s
            self._before[:] = self._state[self._row, 3:]
            return kicks.NOTHING
        acts = kicks.look_ahead(
            self.forces.p, self._plan, self._state, self._before, self._row, self.model.origin, self.model.lift_N,
            self._told, self._powers, self._loads,
        )  # fmt: skip
        if acts >= kicks.THROUGH:
            self._through(acts - kicks.THROUGH, t)
        return acts

    def _through(self, k: int, t: float) -> None:
        name = self.forces.of.loose[k].name
        raise SimulationFailed(f"pin through the wall of its bearing at joint {name} at t = {t:.6g} s")

    def _step(self, t: float, step_s: float, left_s: float) -> int:
        acts = self._look(t, step_s, left_s)
        if acts:
            batch.set_space_bodies(self.model.space, LOADS, self._write)
        if self._changes:
            self._drive(t, step_s)
        began = perf_counter()
        self.model.space.step(step_s)
        self.engine_time_s += perf_counter() - began
        self._get()
        self.steps += 1
        for k, contact in self._native.items():
            if contact.through:
                self._through(k, t)
        if self.half_kick:
            self._plan[kicks.LAST_KICK] = self._plan[kicks.KICK]
        return acts

    def _drive(self, t: float, step_s: float) -> None:
        """Give what is driven the speed of half a step after t, and the place that leads it to its own at t."""
        drive = self.forces.of.drive
        (way, _), (_, speed), _ = self.forces.motion(np.array([t, t + step_s / 2])).tolist()
        body, (x, y, phi) = self.model.bodies[drive.body], self._start_origin
        if drive.guide is None:
            body.angle, body.angular_velocity = phi + way - step_s * speed, speed
        else:
            along = pymunk.Vec2d(1.0, 0.0).rotated(self.forces.of.guides[drive.guide].angle_rad)
            body.position = (x, y) + (way - step_s * speed) * along
            body.velocity = speed * along

    def run(self) -> None:
        """Go through all steps.

        Raises:
            SimulationFailed: a pin goes through a wall, or numbers are not finite.
        """
        end_s, samples, plan, model = self.scene.end_time_s, self.settings.samples, self._plan, self.model
        interval, step_s = end_s / samples, float(plan[kicks.IN_FLIGHT])
        per, varies = self.settings.steps_per_sample(end_s), plan[kicks.IN_CONTACT] < step_s
        self._begin(interval)
        observes = self.records and bool(self.forces.sums or self.settings.at_s)
        coasts = not (self._looks or self._changes or observes or self._native)
        steps, step_s = (int(plan[kicks.STEPS]), float(plan[kicks.NEXT])) if varies else (per, step_s)
        began = perf_counter()
        for n in range(1, samples + 1):
            left = steps
            if coasts:
                started = perf_counter()
                for _ in range(left - 1):
                    model.space.step(step_s)
                self.engine_time_s += perf_counter() - started
                self.steps += left - 1
                left = 1
                if self.records:
                    self._get()
            while left:
                left -= 1
                t = n * interval - left * step_s
                acts = self._step(t, step_s, left * step_s or interval)
                if observes or (self.records and not left):
                    self._account(acts == kicks.TOUCHING, step_s, sample=not left)
                if varies:
                    steps, step_s = int(plan[kicks.STEPS]), float(plan[kicks.NEXT])
                    left = left and steps
            if not np.isfinite(self._state).all():
                raise SimulationFailed(
                    f"non-finite state at t = {n * interval:.6g} s with step {step_s:.3g} s"
                )
            tell(n * interval)
        self.solve_time_s = perf_counter() - began

    def end(self) -> FloatArray:
        """Return the positions (bodies, 3) of the centres of mass."""
        self._get()
        out = self._state[self._row, :3].copy()
        for place, origin in zip(out, self.model.origin, strict=True):
            place[:2] -= pymunk.Vec2d(*origin).rotated(float(place[2]))
        return out

    def _begin(self, interval: float) -> None:
        """Set the bodies' velocities: the start's, or those half a step later."""
        model, q, v, plan = self.model, self._q.copy(), self._v.copy(), self._plan
        self._before = np.zeros((len(model.bodies), 3))
        self._start_origin = [
            *model.bodies[self.forces.of.drive.body].position,
            model.bodies[self.forces.of.drive.body].angle,
        ]
        self._set_velocities(v)
        self._get()
        if self._looks:
            self._look(0.0, 0.0, interval)
        else:
            plan[kicks.NEXT] = plan[kicks.IN_FLIGHT]
        plan[kicks.KICK] = plan[kicks.NEXT] / 2
        if self.half_kick:
            self._react(kicks.STRAIGHT)
            self._before[:] = self._state[self._row, 3:]
            self._set_velocities(v + plan[kicks.KICK] * self._a)
            self._get()
        if self.records:
            self._q[:], self._v[:] = q, v
            self._react(kicks.CURVED)
            if self.half_kick:
                self._sums += plan[kicks.KICK] * self._powers
            self._keep(Kick(0.0, np.concatenate([q, v, 0 * self._sums]), self._told_row(v)))
        plan[kicks.LAST_KICK] = plan[kicks.KICK] if self.half_kick else 0.0

    def _react(self, given: int) -> None:
        kicks.react(
            self.forces.p,
            0.0,
            given,
            self._q,
            self._v,
            self._a,
            self._told,
            self._powers,
            self._multipliers,
            self._matrix,
            self._right,
        )

    def _set_velocities(self, v: FloatArray) -> None:
        for body, (x, y, spin), origin in zip(
            self.model.bodies, v.reshape(-1, 3).tolist(), self.model.origin, strict=True
        ):
            arm = pymunk.Vec2d(*origin).rotated(body.angle)
            body.angular_velocity = spin
            body.velocity = (0.0, 0.0) if origin.any() else (x, y)

    def _account(self, touching: bool, step_s: float, sample: bool) -> None:
        plan, forces, kick_s = self._plan, self.forces, float(self._plan[kicks.KICK])
        t, half = float(plan[kicks.TIME]), self.half_kick
        struck = False
        rates = self._told.copy()
        for k, contact in self._native.items():
            self._told[eq.OF_CONTACT * k + eq.NORMAL] = contact.normal_N_s / kick_s
            self._told[eq.OF_CONTACT * k + eq.FRICTION] = contact.friction_N_s / kick_s
            struck = struck or (contact.normal_N_s > 0 and k not in self._touches)
        kicks.account(
            forces.p, plan, kicks.CURVED if half and self.steps <= 2 else kicks.KNOWN, self._before,
            self._state, self._row, self.model.origin, self._q, self._v, self._a,
            self._told, self._powers, self._multipliers, self._matrix, self._right,
        )  # fmt: skip
        gain = kick_s * self._powers
        if touching or self._touches or struck:
            self._follow(t, rates, gain)
        self._sums += gain
        if not (sample or self.settings.at_s):
            return
        if not np.isfinite(self._multipliers).all():
            self._multipliers[:] = np.linalg.pinv(self._matrix, 1e-15, hermitian=True) @ self._right
        v, share = self._v + self._a * kick_s / 2, 0.5
        if half:
            v = self._v - self._a * kick_s / 2
            if struck:
                share = 1.0
            else:
                v = v + self._a * step_s / 2
        elif struck:
            share = 0.0
        self._keep(Kick(t, np.concatenate([self._q, v, self._sums - share * gain]), self._told_row(v)))

    def _told_row(self, v: FloatArray) -> FloatArray:
        pad = np.zeros(len(self.forces.phases))
        return np.concatenate([v, self._a, self._multipliers, pad, self._told, [0.0, 0.0]])

    def _follow(self, t: float, looked: FloatArray, gain: FloatArray) -> None:
        """Follow the contacts through a kick: those that touch, and those that no longer do."""
        for k in range(len(self.forces.phases)):
            own = self._told[eq.OF_CONTACT * k :]
            native = self._native.get(k)
            on = native.normal_N_s > 0 if native else self.forces.phases[k, 0] != eq.FLIGHT
            touch, sums = self._touches.get(k), slice(eq.OF_SUMS * k, eq.OF_SUMS * (k + 1))
            c = self.forces.contacts[k, eq.C]
            depth = float(2 * c * own[eq.ROOM] / (c + np.sqrt(c * c + 2 * c * own[eq.ROOM])))
            if on and touch is None:
                rate = native.rate_m_s if native else looked[eq.OF_CONTACT * k + eq.RATE] * c / (c + depth)
                touch = self._touches[k] = Touch(t, rate, self._sums[sums].copy())
            if on and touch is not None:
                touch.trace.append((t, own[eq.NORMAL], depth))
            elif touch is not None:
                del self._touches[k]
                impulse, *lost = (self._sums[sums] - touch.sums).tolist()
                trace = np.array(touch.trace)
                largest = [np.nan] * 4
                if native is None:
                    largest = [
                        x for of in (1, 2) for x in (trace[:, of].max(), trace[trace[:, of].argmax(), 0])
                    ]
                self.impacts[k].append(
                    [touch.time_s, trace[-1, 0] - touch.time_s, touch.speed_m_s, impulse, sum(lost), *largest]
                )

    def _keep(self, kick: Kick) -> None:
        """Keep a sample, and those since the last kick, which are interpolated: places by cubics."""
        size, last = self.forces.size, self._last
        self._last = kick
        tiny = 1e-9 * self.times_s[-1] / self.settings.samples
        while len(self.rows_y) < len(self.times_s) and self.times_s[len(self.rows_y)] <= kick.time_s + tiny:
            at = self.times_s[len(self.rows_y)]
            if last is None or at >= kick.time_s - tiny:
                self.rows_y.append(kick.y)
                self.rows_told.append(kick.told)
                continue
            h = kick.time_s - last.time_s
            x = (at - last.time_s) / h
            y, told = ((1 - x) * a + x * b for a, b in ((last.y, kick.y), (last.told, kick.told)))
            change = kick.y[:size] - last.y[:size]
            begin, stop = h * last.told[:size] - change, change - h * kick.told[:size]
            y[:size] += x * (1 - x) * ((1 - x) * begin + x * stop)
            self.rows_y.append(y)
            self.rows_told.append(told)


def require_the_mechanism(
    scene: AnyScene, groove_m: float, position: FloatArray, start: FloatArray, time_s: FloatArray
) -> None:
    """Check that positions (n, bodies, 3) at times (n,) are the scene's still, which began at the ``start``.

    Raises:
        SimulationFailed: at the first time when an ideal joint or guide is too far open or not finite, a body
            is beyond the end of its groove, or a pin is through the wall of its bearing.
    """
    still, gap_m = np.zeros_like(position), gaps(scene, position)
    checks = [
        (
            np.hypot(*gap_m[name].T) <= room.bearing_radius_m,
            f"pin through the wall of its bearing at joint {name}",
        )
        for name, room in scene.clearances.items()
    ]
    for guide in scene.mechanism.guides:
        checks.append(
            (np.abs(way(guide, position, still)[0]) <= groove_m, f"body beyond the end of guide {guide.name}")
        )
    worst = open_by_m(scene, position, start)
    checks.append((worst <= LOST_GAP * lever_m(scene), "constraints lost, a joint is {gap:.3g} m apart,"))
    failures = [(int(np.argmin(holds)), what) for holds, what in checks if not holds.all()]
    if failures:
        first, what = min(failures)
        raise SimulationFailed(f"{what.format(gap=worst[first])} at t = {time_s[first]:.6g} s")
