"""The hand-written C loops for the driven crank-slider, compiled on the spot and called through ctypes."""

import ctypes
import shutil
import subprocess
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from reference_solver.equations import PIVOT_TOLERANCE_PER_ROW
from reference_solver.mechanism.mechanism import Mechanism, PrescribedSpeed, RevoluteJoint
from reference_solver.solver import StepChoice

FloatArray = NDArray[np.float64]
IDEAL, CLEARANCE = "crank_slider.c", "clearance_crank_slider.c"
FLAGS = ["-O3", "-march=native", "-ffp-contract=fast", "-shared", "-fPIC"]
#: Rows of the ideal mechanism; sums and events of runs of the one with clearance in joint B.
IDEAL_ROWS, SUMS, EVENTS = 9, 5, 10_000
LOG_ENTRY = np.dtype(
    [*((name, np.float64) for name in ("time_s", "what", "rate", "depth")), ("sums", np.float64, SUMS)]
)


class CLoop:
    """RK4 on the ideal driven crank-slider without stabilisation, in C."""

    def __init__(self, mechanism: Mechanism, h: float, folder: Path) -> None:
        self._loop = _compiled(IDEAL, folder).advance
        self._loop.restype = ctypes.c_long
        self._h = h
        crank, rod, slider = mechanism.bodies
        O, A, B, _, _, drive = mechanism.constraints  # noqa: E741  the joint's name in the field
        assert isinstance(O, RevoluteJoint)
        assert isinstance(A, RevoluteJoint)
        assert isinstance(B, RevoluteJoint)
        assert isinstance(drive, PrescribedSpeed)
        self._parameters = np.array(
            [
                *(O.point_j[0], A.point_i[0], A.point_j[0], B.point_i[0]),
                *(body.mass_kg for body in (crank, rod, slider)),
                rod.inertia_kg_m2,
                *(mechanism.gravity_m_s2, drive.speed_rad_s),
                IDEAL_ROWS * PIVOT_TOLERANCE_PER_ROW,
            ]
        )

    def advance(self, q: FloatArray, v: FloatArray, first: int, count: int) -> float:
        """Take steps in place; return the driver's work. The time of the first step does not matter."""
        del first
        work = ctypes.c_double()
        done = self._loop(
            _pointer(self._parameters),
            _pointer(q),
            _pointer(v),
            ctypes.c_double(self._h),
            ctypes.c_long(count),
            ctypes.byref(work),
        )
        assert done == count, f"the C loop stopped after {done} of {count} steps"
        return work.value


class ClearanceCLoop:
    """RK4 with projection on the driven crank-slider with clearance in joint B, in C.

    Its contact is Lankarani and Nikravesh's or of their kind, with Hertz's exponent, without friction. After
    a run ``sums`` has the integrals of ``Equations.power_names`` and the energy that the projection has
    removed, ``events`` the log and ``steps`` the number of steps.
    """

    def __init__(self, mechanism: Mechanism, q: FloatArray, choice: StepChoice, folder: Path) -> None:
        self._loop = _compiled(CLEARANCE, folder).run
        self._loop.restype = ctypes.c_long
        O, A, _, _, drive = mechanism.constraints  # noqa: E741  the joint's name in the field
        (B,) = mechanism.contacts
        assert isinstance(O, RevoluteJoint)
        assert isinstance(A, RevoluteJoint)
        assert isinstance(drive, PrescribedSpeed)
        law = B.compliance
        assert law.clipped
        assert (law.exponent, law.damping_N_s_m, B.friction) == (1.5, 0, None)
        masses = [body.mass_kg for body in mechanism.bodies]
        inertias = [body.inertia_kg_m2 for body in mechanism.bodies]
        self._parameters = np.array(
            [
                *(O.point_j[0], A.point_i[0], A.point_j[0], B.point_i[0]),
                *(*masses, *inertias),
                *(mechanism.gravity_m_s2, drive.speed_rad_s, q[2], q[8]),
                *(B.radial_clearance_m, law.stiffness, law.damping_factor, law.minimum_impact_speed_m_s),
                *(choice.longest_s, choice.steps_per_contact),
            ]
        )
        self.sums, self._log = np.zeros(SUMS), np.zeros(EVENTS, LOG_ENTRY)
        self.events, self.steps = self._log[:0], 0

    def run(self, q: FloatArray, v: FloatArray, end_time_s: float) -> None:
        """Run in place from q and v at t = 0, in flight, to the end."""
        events = ctypes.c_long()
        self.steps = self._loop(
            _pointer(self._parameters),
            _pointer(q),
            _pointer(v),
            ctypes.c_double(end_time_s),
            _pointer(self.sums),
            _pointer(self._log),
            ctypes.c_long(EVENTS),
            ctypes.byref(events),
        )
        assert self.steps >= 0, "a step of the C loop failed"
        assert events.value < EVENTS, "the log of the C loop is full"
        self.events = self._log[: events.value]


def compiler() -> str | None:
    """Return the C compiler, if there is one."""
    return shutil.which("gcc") or shutil.which("cc")


def _compiled(source: str, folder: Path) -> ctypes.CDLL:
    library, gcc = folder / f"{source}.so", compiler()
    assert gcc is not None, "no C compiler"
    command = [gcc, *FLAGS, str(Path(__file__).with_name(source)), "-o", str(library), "-lm"]
    subprocess.run(command, check=True)
    return ctypes.CDLL(str(library))


def _pointer(array: NDArray[np.generic]) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)
