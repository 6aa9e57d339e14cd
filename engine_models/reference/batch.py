"""Batches of runs of the reference solver: members of one topology in rows of arrays, run without Python."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from engine_models.engine import FloatArray
from engine_models.kernels import callback, compiled
from engine_models.reference import observer
from reference_solver.compiled.faces import CompiledFace, loop_of
from reference_solver.compiled.kernel import Topology, parameters_of
from reference_solver.compiled.store import callee
from reference_solver.contact import members, types
from reference_solver.contact.companion import GROWTH_RECORD, Companion
from reference_solver.contact.controlled_step import WEIGHT
from reference_solver.contact.loop import AT_STATE
from reference_solver.energy import ledger_J
from reference_solver.equations import Equations
from reference_solver.guard import WITH_CONTACTS, Guard
from reference_solver.mechanism.mechanism import Mechanism
from reference_solver.mechanism.scales import Scales
from reference_solver.solution import Solution, columns_of
from reference_solver.solver import LOG_ROWS, ErrorControl, StepChoice, contact_record, set_out
from reference_solver.tape import RecordArray

#: Steps after which a batch comes back to whoever may want to end it: some tenths of a second.
STEPS_PER_CALL = 100_000
#: Room for touches between two calls.
TOUCHES = 4096

#: Is told now and then the number of the present member, the time in s that it has reached and its steps;
#: answers whether to go on with it. What it raises ends the batch.
Judge = Callable[[int, float, int], bool]


@dataclass(frozen=True)
class Begin:
    """How a member begins: its mechanism, coordinates and velocities, its steps, and times.

    ``marked`` is the mechanism's topology, and ``numbers`` what that leaves out (see ``Topology``).
    ``times_s`` (s,) are those of its samples, from 0 on to its end; notes are taken from ``from_s`` on.
    ``lengths_m`` are those of crank and rod.
    """

    mechanism: Mechanism
    marked: Topology
    numbers: tuple[list[float], list[float]]
    q: FloatArray
    v: FloatArray
    choice: StepChoice | ErrorControl
    times_s: FloatArray
    from_s: float
    lengths_m: tuple[float, float]

    @property
    def ends_s(self) -> list[float]:
        """Times on which steps land: where prescribed motions are not smooth, and the end."""
        end, longest = float(self.times_s[-1]), self.choice.longest_s
        return [*(t for t in self.mechanism.knots_s(longest) if 0 < t < end), end]


@dataclass(frozen=True)
class Done:
    """What is left of a batch of m members: ``touches_rad`` of each are the crank angles of its touches."""

    begins: Sequence[Begin]
    members: members.Members
    touches_rad: list[FloatArray]
    sum_names: list[str]

    def solution(self, k: int) -> Solution:
        """Return the samples of a member as the solver's own runs have them, without its events.

        Raises:
            EnergyNotConserved: they are off their ledger by more than the steps explain.
        """
        begin, clock, control = self.begins[k], self.members.clock[k], self.members.control[k]
        contacts = len(begin.mechanism.contacts)
        columns = columns_of(self.members.samples[k], len(begin.q), self.sum_names, contacts)
        columns |= {"events": np.zeros(0, types.EVENT_RECORD), "impacts": (), "mode_changes": ()}
        run = Solution(begin.mechanism, begin.times_s, **columns, steps=int(clock["steps"]))
        tolerance = begin.choice.tolerance if isinstance(begin.choice, ErrorControl) else None
        scales = Scales(float(control["length"]), float(control["rate"]))
        ledger = ledger_J(run)
        if not np.abs(ledger.sum(axis=0)).max() <= WITH_CONTACTS * np.abs(ledger).max():
            Guard(run, scales, float(clock["longest"]), tolerance).check_energy()
        return run

    @cached_property
    def failed(self) -> NDArray[np.bool_]:
        """Whose run did not come to its end, or not in finite numbers, (m,)."""
        finite = np.isfinite(self.members.samples).all(axis=(1, 2))
        return np.asarray((self.members.status != types.DONE) | ~finite)


class Group:
    """Runs members of one topology: its kernel, and the compiled loops."""

    def __init__(self, topology: Topology, q_start: FloatArray) -> None:
        self._topology, self._face, loop = topology, CompiledFace(topology, q_start), loop_of(topology)
        equations = Equations(topology.mechanism, q_start, topology.baumgarte)
        self.sum_names = [*equations.power_names, "removed"]
        self._sizes = topology.n, len(self.sum_names), len(equations.C)
        notes = observer.NOTES_RECORD
        self._observe = callback(observer.observe, members.observer_type(notes).signature)
        self._advance_one = callback(loop.advance, loop.ADVANCE)
        self._set_gaps = callee(self._face.kernel.gaps, AT_STATE)
        self._advance = compiled(members.advance, members.advance_type(loop, notes))

    def run(self, begins: Sequence[Begin], judge: Judge, beside: bool = False) -> Done:
        """Run members to their ends, or as far as ``judge`` lets them; with companions ``beside`` them."""
        shared, rows = self._shared(begins[0]), self._rows(begins)
        sums = [self.sum_names.index(f"normal{k}") for k in range(len(shared.contacts))]
        past = np.array([(0.0, 0.0, 0.0, 0.0, sum_) for sum_ in sums], members.PAST_RECORD)
        watching = members.Watching(self._observe, past, np.zeros(TOUCHES))
        place = np.array([(0.0, 0, members.NEW, members.NEW, 0, 0, self._chunk)], members.PLACE_RECORD)
        own = shared._replace(kernel=self._face.functions, p=rows.p[0], method=self._face.tableau)
        companion, touches = self._companion(shared, beside), []
        while place["member"][0] < len(begins):
            fixed = self._advance_one, self._set_gaps, own, rows, watching, companion
            self._advance(*fixed, place, STEPS_PER_CALL)
            touches.append(watching.touches[: place["touches"][0]].copy())
            place["touches"] = 0
            k = int(place["member"][0])
            if k < len(begins) and not judge(k, float(rows.clock["time"][k]), int(rows.clock["steps"][k])):
                place["member"], place["status"] = k + 1, members.NEW
        each = np.split(np.concatenate(touches), np.cumsum(rows.notes["touches"])[:-1])
        return Done(begins, rows, each, self.sum_names)

    @property
    def _chunk(self) -> int:
        return 1 + self._face.chunk // (self._topology.n * len(self._topology.method.weights))

    def _shared(self, begin: Begin) -> types.Run:
        contacts = _contacts(begin.mechanism)
        knots = begin.mechanism.knots_by_angle
        return types.new_run(contacts, self._sizes, np.zeros(1), self._face.rows, LOG_ROWS, knots)

    def _companion(self, shared: types.Run, wanted: bool) -> Companion:
        contacts = np.zeros_like(shared.contacts)
        return Companion(
            wanted=int(wanted),
            contacts=contacts,
            of_contacts=contacts.view(float),
            gaps=np.zeros_like(shared.old.gaps),
            y=np.zeros_like(shared.old.y),
            control=np.zeros(1, types.CONTROL_RECORD),
            clock=np.zeros(1, types.CLOCK_RECORD),
            slopes=np.zeros_like(shared.slopes),
            events=np.zeros_like(shared.records.events),
            event_sums=np.zeros_like(shared.records.event_sums),
            times=np.zeros(0),
            samples=np.zeros((0, shared.records.samples.shape[1])),
        )

    def _rows(self, begins: Sequence[Begin]) -> members.Members:
        m, shared = len(begins), self._shared(begins[0])
        K, width, s = len(shared.contacts), len(shared.old.y), len(begins[0].times_s)
        n, ends = self._sizes[0], [begin.ends_s for begin in begins]
        weights = 2 * n if isinstance(begins[0].choice, ErrorControl) else 0
        contacts = np.empty((m, K), types.CONTACT_RECORD)
        rows = members.Members(
            p=np.empty((m, len(self._face.parameters))),
            contacts=contacts,
            gaps=np.zeros((m, K), types.GAP_RECORD),
            y=np.zeros((m, width)),
            control=np.zeros(m, types.CONTROL_RECORD),
            clock=np.zeros(m, types.CLOCK_RECORD),
            times=np.array([begin.times_s for begin in begins]),
            samples=np.zeros((m, s, shared.records.samples.shape[1])),
            knots=np.array([[*begin.mechanism.knots_by_angle] for begin in begins], types.KNOT_RECORD),
            weights=np.zeros((m, weights)),
            ends=np.array([[*own, *[own[-1]] * (max(map(len, ends)) - len(own))] for own in ends]),
            notes=np.zeros(m, observer.NOTES_RECORD),
            growth=np.zeros(m, GROWTH_RECORD),
            of_contacts=contacts.view(float),
            status=np.full(m, types.FAILED),
        )
        for k, begin in enumerate(begins):
            self._set_row(rows, k, begin, shared)
        return rows

    def _set_row(self, rows: members.Members, k: int, begin: Begin, shared: types.Run) -> None:
        """Set a member's row to its start."""
        n, notes = self._sizes[0], rows.notes[k]
        rows.p[k] = parameters_of(self._face.kernel, begin.numbers, begin.q)
        rows.contacts[k] = _contacts(begin.mechanism)
        rows.y[k, :n], rows.y[k, n : 2 * n] = begin.q, begin.v
        records = shared.records._replace(time=begin.times_s, samples=rows.samples[k])
        run = shared._replace(
            old=types.Motion(n, rows.y[k], rows.gaps[k]),
            contacts=rows.contacts[k],
            control=rows.control[k : k + 1],
            clock=rows.clock[k : k + 1],
            records=records,
        )
        times_s, kernel = begin.times_s.tolist(), self._face.kernel
        interval_s = times_s[1] if len(times_s) > 1 else times_s[-1]
        set_out(run, begin.mechanism, begin.choice, kernel, rows.p[k], times_s[-1], interval_s)
        run.clock["end"] = rows.ends[k, 0]
        if rows.weights.size:
            rows.weights[k] = run.slopes[WEIGHT, : 2 * n]
        rows.growth["from_s"][k] = begin.from_s
        notes["from_s"], (notes["crank_m"], notes["rod_m"]) = begin.from_s, begin.lengths_m


def _contacts(mechanism: Mechanism) -> RecordArray:
    return np.array([contact_record(joint) for joint in mechanism.contacts], types.CONTACT_RECORD)
