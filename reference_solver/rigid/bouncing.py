"""What a run keeps of its events on rigid walls (see ``rigid.loop``)."""

import numpy as np

from reference_solver import failures
from reference_solver.contact import types
from reference_solver.equations import Equations
from reference_solver.rigid import settling
from reference_solver.rigid.impact import new_hit
from reference_solver.rigid.settling import CONTROL_RECORD, IMPACT_RECORD, Settling
from reference_solver.rigid.walls import new_walls
from reference_solver.solution import ModeChange
from reference_solver.tape import RecordArray

#: Impacts in the log, beside those of one event.
LOG_ROWS = 256


class Bouncing:
    """A run's events on rigid walls: those so far, and who follows.

    ``look`` is the address of ``walls`` of a kernel, ``p`` that of its numbers.
    """

    def __init__(
        self, equations: Equations, sums: list[str], look: int, p: int, shortest_s: float, lowest: float
    ) -> None:
        walls = new_walls(equations.mechanism, sums)
        (joints,), (rows, n) = walls.joints.shape, walls.rows.shape
        control = np.zeros(1, CONTROL_RECORD)
        control["shortest_s"], control["lowest"], control["stale"] = shortest_s, lowest, 1
        control["look"], control["p"] = look, p
        control["numbers"] = walls.numbers.ctypes.data
        log = np.zeros(LOG_ROWS + settling.ROWS_OF_EVENT * joints, IMPACT_RECORD)
        memory = np.zeros(rows, np.int64), np.zeros((settling.ROWS, n)), np.zeros((joints, joints))
        self.settling = Settling(walls, new_hit(joints, rows), control, log, *memory)
        self.following: tuple[int, ...] = ()
        self.impacts, self.changes = list[types.Impact](), list[ModeChange]()
        self._equations = equations

    @property
    def settled(self) -> int:
        """Return how many events have been settled."""
        return int(self.settling.control["settled"][0])

    def take(self, run: types.Run, status: int) -> None:
        """Take over what has been settled: the log, and which pins follow.

        Raises:
            SolverError: an event has no answer, as ``status`` says (see ``refuse``).
        """
        self.impacts += logged_impacts(self.settling)
        following = followers(run.contacts, self.settling)
        if following != self.following:
            self.following = following
            self.changes.append(ModeChange(float(run.clock["time"][0]), following))
        if status == types.REFUSED:
            self.refuse(run)

    def refuse(self, run: types.Run) -> None:
        """Say why an event has no answer.

        Raises:
            SingularConfiguration, BlockedImpact, PainleveParadox, UnsettledEvents: it says when.
        """
        t, joints = float(run.clock["time"][0]), self.settling.walls.joints
        match int(self.settling.control["fault"][0]):
            case settling.SINGULAR:
                self._equations.refuse_singular(t, run.old.q)
            case settling.BLOCKED:
                raise failures.BlockedImpact(t)
            case settling.PARADOX:
                rubbing = joints[(joints["chosen"] != 0) & (joints["share"] != 0)]
                raise failures.PainleveParadox(t, tuple(rubbing["contact"].tolist()))
        raise failures.UnsettledEvents(t, int(run.clock["rigid"][0]))


def logged_impacts(s: settling.Settling) -> list[types.Impact]:
    """Return the impacts in the log, in the order of time, and clear it."""
    (control,) = s.control
    rows = s.log[: control["logged"]].tolist()
    control["logged"] = 0
    return [types.Impact(t, contact, settling.KINDS[kind], 0.0, *rest) for t, *rest, contact, kind in rows]


def followers(contacts: RecordArray, s: settling.Settling) -> tuple[int, ...]:
    """Return the contacts whose pins follow rigid walls."""
    numbers = s.walls.joints["contact"]
    return tuple(numbers[contacts["phase"][numbers] != types.FLIGHT].tolist())
