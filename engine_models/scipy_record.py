"""What a run leaves behind: samples with the contacts' phases, and the contacts that have ended."""

from collections.abc import Sequence

import numpy as np

from engine_models.engine import FloatArray
from engine_models.reference_scipy import Derivative
from reference_solver.contact_types import EVENT_RECORD, Impact
from reference_solver.solution import Solution


class Record:
    """Samples and impacts of one run; ``y`` and ``phases`` list a row for every sample."""

    def __init__(self, derivative: Derivative) -> None:
        self._derivative = derivative
        self._touches: dict[int, tuple[float, FloatArray]] = {}
        self._impacts: list[Impact] = []
        self.y: list[FloatArray] = []
        self.phases: list[FloatArray] = []

    def sample(self, rows: Sequence[FloatArray]) -> None:
        """Record samples, each (size of y,), in the present phases."""
        self.y.extend(rows)
        self.phases.extend(self._derivative.phases() for _ in rows)

    def touch(self, contact: int, t: float, y: FloatArray) -> None:
        """Begin a contact."""
        self._touches[contact] = (t, y)

    def release(self, contact: int, t: float, y: FloatArray) -> None:
        """End a contact, if it has begun."""
        if contact not in self._touches:
            return
        begin, before = self._touches.pop(contact)
        speed = float(self._derivative.gaps(before)["rate"][contact])
        change = self._derivative.named_sums(y - before)
        impulse = float(change[f"normal{contact}"])
        lost = sum(float(change.get(f"{part}{contact}", 0.0)) for part in ("loss", "clip", "slide"))
        unknown = float("nan")
        self._impacts.append(
            Impact(begin, contact, "contact", t - begin, speed, impulse, unknown, lost, unknown)
        )

    def solution(self, end_time_s: float, steps: int) -> Solution:
        """Return the run as a solution of the reference's equations, with the forces at its samples."""
        derivative, y = self._derivative, np.array(self.y)
        time, forces = np.linspace(0.0, end_time_s, len(y)), []
        for t, at, phases in zip(time, y, self.phases, strict=True):
            derivative.set_phases(phases)
            forces.append(derivative.forces(t, at))
        multipliers, of_contacts = (np.array(column) for column in zip(*forces, strict=True))
        return Solution(
            mechanism=derivative.mechanism,
            time_s=time,
            q=y[:, : derivative.n],
            v=y[:, derivative.n : 2 * derivative.n],
            multipliers=multipliers,
            phases=np.reshape(self.phases, (len(y), -1, 2)),
            normal_force_N=of_contacts[:, ::2],
            friction_force_N=of_contacts[:, 1::2],
            sums=derivative.named_sums(y),
            events=np.zeros(0, EVENT_RECORD),
            impacts=tuple(self._impacts),
            mode_changes=(),
            steps=steps,
        )
