"""The driver: consistent start, steps by the readable or the compiled face, recording."""

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from reference_solver.chunks import Tell, longest_chunk, nobody
from reference_solver.equations import Baumgarte, Equations
from reference_solver.errors import InconsistentStart
from reference_solver.mechanism import Mechanism
from reference_solver.readable import ReadableStepper

FloatArray = NDArray[np.float64]

#: The paper's own algorithm, Baumgarte's feedback, or a projection of q and q' after every step.
Stabilisation = Literal["none", "projection"] | Baumgarte

#: Largest violation of the constraints accepted at t = 0 in m and rad, and, per unit of speed, in velocity.
START_TOLERANCE = 1e-9

#: Bodies up to which straight-line code is compiled, for ten seconds; beyond them the readable face runs.
LARGEST_COMPILED = 16

#: Fewer steps do not follow a contact.
FEWEST_STEPS_PER_CONTACT = 10.0


@dataclass(frozen=True)
class Solution:
    """The sampled motion of a mechanism with n coordinates and m constraint rows, at s equally spaced times.

    ``time_s`` (s,), ``q`` and ``v`` (s, n), ``multipliers`` (s, m) by the rows of [B] (see ``row_slices``),
    and ``constraint_work_J`` (s,), the work of the drivers: the integral of {lambda}^T{C} by RK4's own
    quadrature. ``stabilisation_loss_J`` (s,) is the energy that the stabilisation has removed since t = 0,
    negative where it has added some: by projection (see ``readable.project_with_loss``) or by Baumgarte's
    feedback (see ``Equations.feedback_power``). It is zero without one, and None where it is not counted.
    """

    time_s: FloatArray
    q: FloatArray
    v: FloatArray
    multipliers: FloatArray
    constraint_work_J: FloatArray
    stabilisation_loss_J: FloatArray | None = None


@dataclass(frozen=True)
class StepChoice:
    """The two rates: ``longest_s`` in flight, and a number of steps per contact's duration.

    Without ``locate_events`` every step has the length ``longest_s`` and a contact begins and ends with a
    step: the plain algorithm, for comparison.
    """

    longest_s: float
    steps_per_contact: float = 100.0
    locate_events: bool = True

    def at(self, longest_s: float) -> "StepChoice":
        """Return both rates in proportion, at another longest step."""
        per_contact = self.steps_per_contact * self.longest_s / longest_s
        return StepChoice(longest_s, max(FEWEST_STEPS_PER_CONTACT, per_contact), self.locate_events)


class Stepper(Protocol):
    """One of the two faces of the algorithm, at a fixed step."""

    @property
    def stabilisation_loss_J(self) -> float:
        """Energy that the stabilisation has removed in all steps so far."""
        ...

    def advance(self, q: FloatArray, v: FloatArray, first: int, count: int) -> float:
        """Take steps number first to first + count - 1 in place; return the drivers' work."""
        ...

    def multipliers(self, t: float, q: FloatArray, v: FloatArray) -> FloatArray:
        """Return {lambda} at a state."""
        ...


def make_stepper(
    mechanism: Mechanism, q_start: FloatArray, h: float, stabilisation: Stabilisation, compiled: bool
) -> Stepper:
    """Return the readable face, or the compiled one of a mechanism that is not too large for it."""
    if mechanism.contacts:
        raise ValueError("contacts: expected none (see contact_stepper.solve_with_contacts)")
    baumgarte = stabilisation if isinstance(stabilisation, Baumgarte) else None
    projected = stabilisation == "projection"
    # Numba takes a moment to import.
    if compiled and len(mechanism.bodies) <= LARGEST_COMPILED:
        from reference_solver.compiled import CompiledStepper

        return CompiledStepper(mechanism, q_start, h, baumgarte, projected)
    return ReadableStepper(Equations(mechanism, q_start, baumgarte), h, projected)


def check_start(equations: Equations, q: FloatArray, v: FloatArray) -> None:
    """Check that positions and velocities meet the constraints.

    Raises:
        InconsistentStart: they do not, by more than ``START_TOLERANCE``.
    """
    gap = np.abs(equations.violation(0.0, q)).max(initial=0)
    if not gap <= START_TOLERANCE:
        raise InconsistentStart(f"initial positions: expected g = 0, got a violation of {gap:.3g}")
    rate = np.abs(equations.constraint_matrix(q) @ v - equations.C).max(initial=0)
    if not rate <= START_TOLERANCE * (1 + np.abs(v).max()):
        raise InconsistentStart(f"initial velocities: expected [B]q' = C, got a violation of {rate:.3g}")


def record(
    stepper: Stepper,
    q: FloatArray,
    v: FloatArray,
    *,
    end_time_s: float,
    samples: int,
    steps_per_sample: int,
    tell: Tell = nobody,
) -> Solution:
    """Run a stepper from q and v, which it overwrites, and return ``samples + 1`` states.

    ``tell`` is called with the time reached, at every sample and within those of very many steps.
    """
    time, work, before = np.linspace(0.0, end_time_s, samples + 1), 0.0, stepper.stabilisation_loss_J
    records = [(q.copy(), v.copy(), stepper.multipliers(0.0, q, v), work, 0.0)]
    for sample in range(samples):
        first, last, added = sample * steps_per_sample, (sample + 1) * steps_per_sample, 0.0
        while first < last:
            count = min(longest_chunk(q), last - first)
            added += stepper.advance(q, v, first, count)
            first += count
            tell(first * end_time_s / (samples * steps_per_sample))
        work += added
        multipliers = stepper.multipliers(time[sample + 1], q, v)
        records.append((q.copy(), v.copy(), multipliers, work, stepper.stabilisation_loss_J - before))
    return Solution(time, *(np.array(column) for column in zip(*records, strict=True)))


def solve(
    mechanism: Mechanism,
    q: FloatArray,
    v: FloatArray,
    *,
    end_time_s: float,
    samples: int,
    steps_per_sample: int,
    stabilisation: Stabilisation = "projection",
    compiled: bool = True,
) -> Solution:
    """Integrate from coordinates q and velocities v, each (3 x bodies,), and record ``samples + 1`` states.

    The step is ``end_time_s / (samples * steps_per_sample)``.

    Raises:
        InconsistentStart: q or v violate the constraints.
        SingularConfiguration: the constraint matrix loses full row rank.
        NonFiniteState: the state overflows.
    """
    q, v = np.array(q, dtype=float), np.array(v, dtype=float)
    check_start(Equations(mechanism, q), q, v)
    h = end_time_s / (samples * steps_per_sample)
    stepper = make_stepper(mechanism, q, h, stabilisation, compiled)
    return record(stepper, q, v, end_time_s=end_time_s, samples=samples, steps_per_sample=steps_per_sample)
