"""The hand-written C loop for the driven crank-slider, compiled on the spot and called through ctypes."""

import ctypes
import shutil
import subprocess
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from reference_solver.equations import PIVOT_TOLERANCE_PER_ROW
from reference_solver.mechanism import Mechanism, PrescribedSpeed, RevoluteJoint

FloatArray = NDArray[np.float64]
SOURCE = Path(__file__).with_name("crank_slider.c")
FLAGS = ["-O3", "-march=native", "-ffp-contract=fast", "-shared", "-fPIC"]
ROWS = 9


class CLoop:
    """RK4 on the ideal driven crank-slider without stabilisation, in C."""

    def __init__(self, mechanism: Mechanism, h: float, folder: Path) -> None:
        library, gcc = folder / "crank_slider.so", compiler()
        assert gcc is not None, "no C compiler"
        subprocess.run([gcc, *FLAGS, str(SOURCE), "-o", str(library), "-lm"], check=True)
        self._loop = ctypes.CDLL(str(library)).advance
        self._loop.restype = ctypes.c_long
        self._h = h
        crank, rod, slider = mechanism.bodies
        O, A, B, _, drive = mechanism.constraints  # noqa: E741  the joint's name in the field
        assert isinstance(O, RevoluteJoint)
        assert isinstance(A, RevoluteJoint)
        assert isinstance(B, RevoluteJoint)
        assert isinstance(drive, PrescribedSpeed)
        self._parameters = np.array(
            [
                *(O.point_j[0], A.point_i[0], A.point_j[0], B.point_i[0]),
                *(1 / body.mass_kg for body in (crank, rod, slider)),
                *(1 / body.inertia_kg_m2 for body in (crank, rod)),
                *(mechanism.gravity_m_s2, drive.speed_rad_s),
                ROWS * PIVOT_TOLERANCE_PER_ROW,
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


def compiler() -> str | None:
    """Return the C compiler, if there is one."""
    return shutil.which("gcc") or shutil.which("cc")


def _pointer(array: FloatArray) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)
