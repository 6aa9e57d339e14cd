"""What a run gives: samples of the motion, forces and sums, and what its contacts did."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reference_solver.mechanism.contacts import FLIGHT
from reference_solver.mechanism.loads import apart_m
from reference_solver.mechanism.mechanism import Mechanism
from reference_solver.run import IMPACT, KINDS, RELEASE, Impact, ModeChange, Run
from reference_solver.tape import FloatArray, RecordArray

#: What a contact dissipates by (see ``contacts.rates_of``).
LOSSES = ("loss", "clip", "slide", "impact", "closing")
#: What an event that ends a contact tells of it.
ENDED = ["time_s", "contact", "what", "approach", "impulse", "tangential", "lost", "mass", "began_s"]
ENDED += ["force", "force_s", "deepest", "deepest_s"]


@dataclass(frozen=True)
class Solution:
    """The motion of a mechanism with n coordinates, m constraint rows and K contacts, at s times.

    ``time_s`` (s,), ``q`` and ``v`` (s, n), ``multipliers`` (s, m) by the rows of [B] (see ``row_slices``).
    ``phases`` (s, K, 2) are phase and memory of every contact (see ``run``). ``normal_force_N`` and
    ``friction_force_N`` (s, K) are without impulses: the one presses the pin inwards, the other is on the pin
    along t.

    ``sums`` are integrals since t = 0 (s,) by RK4's own quadrature: "drivers", their work in J, that of
    impulses included; "loadk", that of load k, if it is no function of where the bodies are; of contact k
    "normalk", the normal impulse in N s, and energies dissipated in J: "lossk" by a compliant wall, "clipk"
    where its force was clipped, "impactk" and "closingk" by a rigid one (friction's part included), and
    "slidek" by friction; "removed" is what the stabilisation has removed, negative where it has added some:
    by projection or by Baumgarte's feedback (see ``Equations``).

    ``events`` (E,) is the log of compliant contacts (see ``run.EVENT_RECORD``), ``impacts`` are in the order
    of the contacts' ends, ``mode_changes`` are those of pins on rigid walls; ``steps`` counts all steps,
    taken in ``solve_time_s``. ``condition`` is the constraints' worst at any stage of a step (see
    ``factorisation.Factors``): it may amplify round-off in {lambda}, by its square root in {q''}.
    """

    mechanism: Mechanism
    time_s: FloatArray
    q: FloatArray
    v: FloatArray
    multipliers: FloatArray
    phases: FloatArray
    normal_force_N: FloatArray
    friction_force_N: FloatArray
    sums: dict[str, FloatArray]
    events: RecordArray
    impacts: tuple[Impact, ...]
    mode_changes: tuple[ModeChange, ...]
    steps: int
    solve_time_s: float = 0.0
    condition: float = 1.0

    @property
    def closed(self) -> NDArray[np.bool_]:
        """Return which pins touch their walls, (s, K)."""
        return np.asarray(self.phases[..., 0] != FLIGHT)

    @property
    def gap_m(self) -> FloatArray:
        """Return d, from bearing centre to pin centre, (s, K, 2)."""
        gaps = np.empty((len(self.q), len(self.mechanism.contacts), 2))
        for k, joint in enumerate(self.mechanism.contacts):
            gaps[:, k] = apart_m(joint, self.q)
        return gaps

    def losses_J(self) -> FloatArray:
        """Return the energy that all contacts have dissipated, (s,)."""
        lost = [value for name, value in self.sums.items() if name.rstrip("0123456789") in LOSSES]
        return np.sum(lost, axis=0) if lost else np.zeros(len(self.time_s))


def solution_of(
    run: Run, of: Mechanism, names: list[str], events: RecordArray, changes: list[ModeChange], took_s: float
) -> Solution:
    """Return what a run of a mechanism with a log (E,) and changes of mode gives, its sums by their names."""
    samples, n, pairs, (state,) = run.samples, len(run.q), 2 * len(run.contacts), run.state
    sizes = n, n, len(names), samples.shape[1] - 2 * (n + pairs) - len(names), pairs, pairs
    ends = np.cumsum(sizes)[:-1].tolist()
    q, v, sums, multipliers, forces, phases = map(np.ascontiguousarray, np.split(samples, ends, axis=1))
    happened, nan = list[Impact](), np.nan
    ended = events[(events["what"] == RELEASE) | (events["what"] >= IMPACT)]
    for t, k, what, speed, impulse, rubbed, lost, mass, began, *largest in ended[ENDED].tolist():
        if what == RELEASE:
            happened.append(Impact(began, k, "contact", t - began, speed, impulse, nan, lost, nan, *largest))
        else:
            happened.append(Impact(t, k, KINDS[what], 0.0, speed, impulse, rubbed, lost, mass))
    motion = of, run.times, q, v, multipliers, phases.reshape(len(samples), -1, 2)
    return Solution(
        *motion,
        normal_force_N=forces[:, ::2],
        friction_force_N=forces[:, 1::2],
        sums=dict(zip(names, sums.T, strict=True)),
        events=events[events["what"] < IMPACT],
        impacts=tuple(happened),
        mode_changes=tuple(changes),
        steps=int(state["steps"]),
        solve_time_s=took_s,
        condition=float(state["condition"]),
    )
