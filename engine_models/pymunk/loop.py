"""The loop around ``space.step``: what is set before a step, and when steps are short."""

from collections.abc import Callable
from time import perf_counter
from typing import Any, cast

import numpy as np
import pymunk
from pymunk import batch

from engine_models.engine import FloatArray, RunSettings, SimulationFailed
from engine_models.minimal import equations as eq
from engine_models.pymunk import kicks
from engine_models.pymunk.model import Model, changes_speed, sweeps_of
from engine_models.pymunk.native_contact import NativeContact
from engine_models.scene.scene import Scene
from engine_models.watch import tell

FIELDS = batch.BodyFields
STATE = FIELDS.POSITION | FIELDS.ANGLE | FIELDS.VELOCITY | FIELDS.ANGULAR_VELOCITY
LOADS = FIELDS.FORCE | FIELDS.TORQUE
#: Takes the step's length, whether a pin touches in it, and whether it comes to a sample.
Take = Callable[[float, bool, bool], None]


class Loop:
    """A run of a model from t = 0, in steps of one length or some times shorter in contact.

    ``plan`` has the numbers of the present step (see ``kicks``), ``state`` (b, 6) the space's bodies, in
    which body k of the mechanism has the row ``rows[k]``, and ``before`` (b, 3) the velocities before the
    last kick. ``account`` fills the rest. ``solve_time_s`` is what the loop took, and ``engine_time_s`` how
    much of that was spent inside ``space.step``.
    """

    def __init__(
        self,
        scene: Scene,
        settings: RunSettings,
        model: Model,
        velocity: FloatArray,
        half_kick: bool,
        shorter: float,
        sweeps_vary: bool,
    ) -> None:
        """Begin with velocities (bodies, 3) of the centres of mass."""
        self.settings, self.model, self.half_kick, self._sweeps_vary = settings, model, half_kick, sweeps_vary
        self.end_s, self.steps, self.solve_time_s, self.engine_time_s = scene.end_time_s, 0, 0.0, 0.0
        self.forces = forces = model.forces
        step_s, size, m = settings.step_used_s(self.end_s), forces.size, forces.rows
        self.plan = np.zeros(9)
        self.plan[[kicks.IN_FLIGHT, kicks.NEXT, kicks.IN_CONTACT]] = step_s, step_s, step_s / shorter
        self.told = np.zeros(eq.OF_CONTACT * len(forces.phases) + len(forces.parts))
        self.powers, self.multipliers = np.zeros(len(forces.sums) + 1), np.zeros(m)
        self._motion = np.zeros((3, size))
        self.q, self.v, self.a = self._motion
        rooms = [scene.clearances[pin.name] for pin in forces.of.loose]
        rigid = ((k, forces.of.loose[k], room) for k, room in enumerate(rooms) if room.law == "rigid")
        self.native = {k: NativeContact(model, k, pin, room) for k, pin, room in rigid}
        self._changes = changes_speed(forces.of)
        driven = model.bodies[forces.of.drive.body]
        self._driven, self._begin_at, self._begin_rad = driven, driven.position, driven.angle
        self._looks = model.loaded or bool(rooms)
        self._read, self._write, ids = batch.Buffer(), batch.Buffer(), batch.Buffer()
        self._loads, self.before = np.zeros((2, size // 3, 3))
        self._write.set_float_buf(self._loads)
        batch.get_space_bodies(model.space, FIELDS.BODY_ID, ids)
        order = [*memoryview(ids.int_buf()).cast("P")]
        self.rows = np.array([order.index(body.id) for body in model.bodies])
        self._look_ahead = cast(Any, kicks.look_ahead).compiled()
        self._account = cast(Any, kicks.account).compiled()
        model.set_velocities(velocity)
        self._get()

    def run(self, every_step: bool = False, take: Take | None = None) -> None:
        """Go through all steps, of which the start, the samples or every one are taken.

        Raises:
            SimulationFailed: a pin goes through a wall, or numbers are not finite.
        """
        settings, plan, step = self.settings, self.plan, self.model.space.step
        interval = self.end_s / settings.samples
        varies = self._looks and plan[kicks.IN_CONTACT] < plan[kicks.IN_FLIGHT]
        self._begin(interval, take)
        steps, step_s = settings.steps_per_sample(self.end_s), float(plan[kicks.NEXT])
        coasts = not (self._looks or self._changes or every_step)
        began = perf_counter()
        for n in range(1, settings.samples + 1):
            if n > 1 and self._sweeps_vary:
                self.account(kicks.KNOWN)
                self.model.space.iterations = sweeps_of(self.forces, self.q)
            left = int(plan[kicks.STEPS]) if varies else steps
            if coasts:  # nothing is to be set: a loop of steps alone
                started = perf_counter()
                for _ in range(left - 1):
                    step(step_s)
                self.engine_time_s += perf_counter() - started
                self.steps, left = self.steps + left - 1, 1
                self._get()
            while left:
                left -= 1
                touching = self._step(n * interval - left * step_s, step_s, left * step_s or interval)
                if take is not None and (every_step or not left):
                    take(step_s, touching, not left)
                if varies:
                    step_s, left = float(plan[kicks.NEXT]), left and int(plan[kicks.STEPS])
            if not np.isfinite(self.state).all():
                raise SimulationFailed(
                    f"non-finite state at t = {n * interval:.6g} s with step {step_s:.3g} s"
                )
            tell(n * interval)
        self.solve_time_s = perf_counter() - began

    def _begin(self, interval: float, take: Take | None) -> None:
        """Take the start, and begin with the half kick there."""
        plan = self.plan
        if self._looks:
            self._look(0.0, 0.0, interval)
        self.before[:] = self.state[self.rows, 3:]
        plan[kicks.KICK] = plan[kicks.NEXT] / 2.0
        if take is not None:
            take(0.0, False, True)
        if self.half_kick:
            # The space has to find paths straight: its first impulse bends them. The velocity after the first
            # step is the mean of that before and after it on paths that are bent from the start.
            halves = []
            for given in (kicks.CURVED, kicks.STRAIGHT):
                self.account(given)
                halves.append((self.v + plan[kicks.KICK] * self.a).reshape(-1, 3))
            for half in halves:
                self._bent = self.state[self.rows, 3:]
                self.model.set_velocities(half)
                self._get()
            plan[kicks.LAST_KICK] = plan[kicks.KICK]

    def account(self, given: int) -> None:
        """Find what a kick was, and its reactions."""
        bodies = self.before, self.state, self.rows, self.model.origin
        found = self._motion, self.told, self.powers, self.multipliers
        self._account(self.forces.p, self.plan, given, *bodies, *found)

    def _step(self, t: float, step_s: float, left_s: float) -> bool:
        """Take a step to a time, from which there is some left to the next sample; return whether pins touch.

        What is driven by another speed in every step is given that of half a step after t, and the place
        from which it comes to its own at t.
        """
        space, acts = self.model.space, self._look(t, step_s, left_s)
        if acts or self.model.loaded:
            batch.set_space_bodies(space, LOADS, self._write)
        if self._changes:
            motion = np.empty((2, 3))
            eq.drive(self.forces.p, np.array([t, t + step_s / 2]), motion)
            (way, *_), (_, speed, _) = motion.tolist()
            behind, driven, of = way - step_s * speed, self._driven, self.forces.of
            if of.drive.guide is None:
                driven.angle, driven.angular_velocity = self._begin_rad + behind, speed
            else:
                along = pymunk.Vec2d(1.0, 0.0).rotated(of.guides[of.drive.guide].angle_rad)
                driven.position, driven.velocity = self._begin_at + behind * along, speed * along
        started = perf_counter()
        space.step(step_s)
        self.engine_time_s += perf_counter() - started
        if self.half_kick and not self.steps:
            self.before[:] = self._bent
        self.steps += 1
        self._get()
        for k, contact in self.native.items():
            if contact.through:
                self._fail(k, t)
        if self.half_kick:
            self.plan[kicks.LAST_KICK] = self.plan[kicks.KICK]
        return acts == kicks.TOUCHING

    def _look(self, t: float, step_s: float, left_s: float) -> int:
        """Fill the loads of the kick at a time, and return what acts in it."""
        plan = self.plan
        plan[kicks.TIME], plan[kicks.STEP], plan[kicks.LEFT] = t, step_s, left_s
        if not self._looks:
            plan[kicks.KICK] = step_s
            self.before[:] = self.state[self.rows, 3:]
            return kicks.NOTHING
        model, p = self.model, self.forces.p
        bodies = self.state, self.before, self.rows, model.origin, model.lift_N
        acts = int(self._look_ahead(p, plan, *bodies, self.told, self.powers, self._loads))
        if acts >= kicks.THROUGH:
            self._fail(acts - kicks.THROUGH, t)
        return acts

    def _get(self) -> None:
        """Read the state of the space's bodies."""
        self._read.clear()
        batch.get_space_bodies(self.model.space, STATE, self._read)
        self.state = np.frombuffer(self._read.float_buf(), np.float64).reshape(-1, 6)

    def _fail(self, k: int, t: float) -> None:
        name = self.forces.of.loose[k].name
        raise SimulationFailed(f"pin through the wall of its bearing at joint {name} at t = {t:.6g} s")
