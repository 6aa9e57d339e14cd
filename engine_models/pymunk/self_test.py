"""Whether the installed Pymunk is what compiled code has been written for, found out before its first use."""

from functools import cache

import numba
import numpy as np
import pymunk
from pymunk._chipmunk_cffi import ffi, lib

from engine_models.engine import UnsupportedScene
from engine_models.pymunk.compiled import loop
from engine_models.pymunk.compiled.chipmunk import FUNCTIONS, POINTS_AT, POINTS_SIZE
from engine_models.pymunk.inputs import Inputs
from engine_models.pymunk.joints.plan import Plan, Seat
from engine_models.pymunk.workspace import Workspace
from reference_solver.mechanism.data import BodyData, ConstantSpeed, DriveData, Load, MechanismData

#: The same fields as cffi names them.
POINTS_FIELDS = (
    ("count",),
    *(("normal", axis) for axis in "xy"),
    *(("points", 0, point, axis) for point in ("pointA", "pointB") for axis in "xy"),
)


def require_usable() -> None:
    """Check that compiled code can step a space.

    Raises:
        UnsupportedScene: it cannot; the message says what is missing or different.
    """
    reason = _unusable()
    if reason:
        raise UnsupportedScene(f"pymunk {pymunk.version} cannot be stepped by compiled code: {reason}")


@cache
def _unusable() -> str | None:
    """Return what is not as it has to be: a function or its type, a layout, or what a step does."""
    if numba.njit(loop.stay) is loop.stay:
        return "NUMBA_DISABLE_JIT is set"
    for name, kind in FUNCTIONS.items():
        found = ffi.typeof(getattr(lib, name)).cname if hasattr(lib, name) else "nothing"
        if found != kind:
            return f"{name}: expected {kind}, got {found}"
    layout = [ffi.offsetof("cpContactPointSet", *field) for field in POINTS_FIELDS]
    if layout != POINTS_AT or ffi.sizeof("cpContactPointSet") != POINTS_SIZE:
        return f"cpContactPointSet: expected its fields at {POINTS_AT}, got {layout}"
    return _misstep()


def _misstep() -> str | None:
    """Return what one body that is turned, twisted and stepped does otherwise than its equations say."""
    space, body = pymunk.Space(), pymunk.Body(2.0, 4.0)
    space.gravity, body.position, body.velocity = (0.0, -7.0), (1.5, -2.5), (3.5, 4.5)
    space.add(body)
    driven = DriveData(0, law=ConstantSpeed(0.0))
    turning = MechanismData((BodyData("body", 2.0, 4.0),), (), loads=(Load(0, torque_N_m=9.0),), drive=driven)
    work = Workspace(space, (body,), Inputs(turning, Plan((Seat(2.0, 4.0, 2.0),), (), 1.0)), {}, 1)
    state = work.run[0]
    state["end"], state["kick"], state["per_sample"] = 1, 0, 1
    state["step_s"] = state["flight_s"] = 0.5
    work.advance(1, np.array([[0.25, -5.5]]))
    expected = [3.25, -0.25, -2.5, 3.5, 4.5, 0.0, 3.5, 1.0, -4.375]
    got = work.out[0, 0].tolist()
    return None if got == expected else f"a step: expected {expected}, got {got}"
