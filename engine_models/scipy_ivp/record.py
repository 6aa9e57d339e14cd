"""What a run leaves behind: samples with the contacts' phases, and the contacts that have ended."""

from collections.abc import Sequence

from engine_models.engine import FloatArray
from engine_models.scipy_ivp.model import ContactEnd, Derivative


class Record:
    """One run: ``y`` and ``phases`` have a row for every sample, ``ends`` the contacts that are over."""

    def __init__(self, derivative: Derivative) -> None:
        self._derivative = derivative
        self._touches: dict[int, tuple[float, FloatArray]] = {}
        self.y: list[FloatArray] = []
        self.phases: list[FloatArray] = []
        self.ends: list[ContactEnd] = []

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
        self.ends.append((begin, contact, t - begin, speed, impulse, lost))
