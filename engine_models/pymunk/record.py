"""What the kicks of a run tell at its samples: motion, forces, works and impacts."""

import numpy as np

from engine_models.engine import FloatArray
from engine_models.minimal import equations as eq
from engine_models.minimal.run import Recording, depth_of
from engine_models.pymunk import kicks
from engine_models.pymunk.loop import Loop
from engine_models.scene.scene import Scene

#: Kicks of a half-kick start that are not those of their time.
ODD_KICKS = 2
#: A contact that is on: its begin, approach speed and sums before, and its kicks: (t, force, ``eq.ROOM``).
Touch = tuple[float, float, FloatArray, list[tuple[float, float, float]]]


class Record(Recording):
    """What is told of a run from its start on.

    A kick's forces act for its time, and half of its work is done at it, but for a native impact, which is
    all to come, or all over where velocities are those after a step.
    """

    def __init__(self, scene: Scene, loop: Loop) -> None:
        super().__init__(scene, loop.forces, loop.settings.times_s(scene))
        self._at_steps = bool(loop.settings.at_s)
        self.every_step = bool(loop.forces.sums) or self._at_steps
        self._loop, self._round_off = loop, 1e-9 * scene.end_time_s / loop.settings.samples
        self._sums, self._touches = np.zeros(len(loop.forces.sums)), dict[int, Touch]()
        self._last = 0.0, np.zeros(0), np.zeros(0)

    def take(self, step_s: float, touching: bool, sample: bool) -> None:
        """Take what a step has done: add up works, follow contacts, and keep a sample."""
        loop, plan = self._loop, self._loop.plan
        rates, struck, self.steps = loop.told[eq.RATE :: eq.OF_CONTACT].copy(), False, loop.steps
        for k, contact in loop.native.items():
            at = eq.OF_CONTACT * k
            loop.told[at + eq.NORMAL], loop.told[at + eq.FRICTION] = contact.impulse_N_s / plan[kicks.KICK]
            struck = struck or (contact.impulse_N_s[0] > 0 and k not in self._touches)
        loop.account(kicks.CURVED if loop.steps <= ODD_KICKS * loop.half_kick else kicks.KNOWN)
        gain = plan[kicks.KICK] * loop.powers[: len(self._sums)]
        if touching or struck or self._touches:
            self._follow(rates)
        to_come = float(loop.half_kick) if struck else 0.5
        if not loop.steps:
            to_come, gain = 1.0, gain * loop.half_kick
        self._sums += gain
        if sample or self._at_steps:
            half = loop.a * plan[kicks.KICK] / 2
            before, after = loop.v - half, loop.v + half
            if loop.half_kick and loop.steps:
                after = before if struck else before + loop.a * step_s / 2
            self._keep(after if loop.steps else loop.v, self._sums - to_come * gain)

    def _follow(self, rates: FloatArray) -> None:
        """Follow the contacts through a kick: those that touch, and those that no longer do."""
        loop, t = self._loop, float(self._loop.plan[kicks.TIME])
        for k, phase in enumerate(self.model.phases[:, 0].tolist()):
            at, native, touch = eq.OF_CONTACT * k, loop.native.get(k), self._touches.get(k)
            c, sums = self.model.contacts[k, eq.C], self._sums[eq.OF_SUMS * k : eq.OF_SUMS * (k + 1)]
            if native.impulse_N_s[0] > 0 if native else phase != eq.FLIGHT:
                room = loop.told.item(at + eq.ROOM)
                if touch is None:
                    speed = native.rate_m_s if native else float(rates[k] * c / (c + depth_of(c, room)))
                    touch = self._touches[k] = t, speed, sums.copy(), []
                touch[3].append((t, loop.told.item(at + eq.NORMAL), room))
            elif touch is not None:
                del self._touches[k]
                began_s, speed, before, trace = touch
                impulse, *lost = (sums - before).tolist()
                time_s, force, room = np.transpose(trace)
                deep = depth_of(c, room)
                largest = [np.nan] * 4
                if native is None:
                    tops = force.argmax(), deep.argmax()
                    largest = [force[tops[0]], time_s[tops[0]], deep[tops[1]], time_s[tops[1]]]
                lasted = time_s[-1] - began_s
                self.impacts[k].append([began_s, lasted, speed, impulse, sum(lost), *largest])

    def _keep(self, velocity: FloatArray, sums: FloatArray) -> None:
        """Keep a sample, and those since the last kick, which are interpolated: places by cubics."""
        loop, size, (before_s, y_0, told_0) = self._loop, self.model.size, self._last
        t, y = float(loop.plan[kicks.TIME]), np.concatenate([loop.q, velocity, sums])
        told = np.concatenate([velocity, loop.a, loop.multipliers, loop.told, [0.0, 0.0]])
        self._last = t, y, told
        while len(self.states) < len(self.times_s) and self.times_s[len(self.states)] <= t + self._round_off:
            at, of_y, of_told = self.times_s[len(self.states)], y, told
            if at < t - self._round_off:
                h, x = t - before_s, (at - before_s) / (t - before_s)
                of_y, of_told = y_0 + x * (y - y_0), told_0 + x * (told - told_0)
                change = y[:size] - y_0[:size]
                begin, stop = h * told_0[:size] - change, change - h * told[:size]
                of_y[:size] += x * (1 - x) * ((1 - x) * begin + x * stop)
            self.states.append(of_y)
            self.told.append(of_told)
