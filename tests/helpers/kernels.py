"""Small mechanisms without contacts, and steps of theirs by either face."""

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from engine_models.mechanics.assembly import assembled
from engine_models.mechanics.equations import mechanism_of
from engine_models.scene.library import IDEAL_SCENES
from reference_solver.compiled.faces import CompiledFace, ReadableFace
from reference_solver.compiled.kernel import Topology
from reference_solver.contact.loop import ROWS
from reference_solver.contact.types import CONTACT_RECORD, DONE, Motion, new_run
from reference_solver.equations import Baumgarte, Equations
from reference_solver.mechanism.mechanism import (
    GROUND,
    Body,
    Mechanism,
    PrescribedSpeed,
    RevoluteJoint,
    SameAngle,
    Slot,
    SpringDamper,
    Torque,
)
from reference_solver.mechanism.mechanism import Point as Place
from reference_solver.solver import Stabilisation

FloatArray = NDArray[np.float64]
#: A mechanism, coordinates and velocities to start from, and a step in s.
Start = tuple[Mechanism, FloatArray, FloatArray, float]
#: The stabilisations by name.
VARIANTS: dict[str, Stabilisation] = {
    "none": "none",
    "projection": "projection",
    "baumgarte": Baumgarte(100.0, 70.0),
}


def straight_guide(body: int, point: Place, angle_rad: float) -> tuple[Slot, SameAngle]:
    """Return what keeps a body's centre on a fixed line through a point, and the body's angle."""
    return Slot(GROUND, point, body, (0.0, 0.0), angle_rad), SameAngle(GROUND, body)


def scene_case(name: str) -> Start:
    scene = IDEAL_SCENES[name]()
    q, v = assembled(scene, scene.start.crank_angle_rad + 0.7, scene.start.crank_speed_rad_s + 10)
    driven = mechanism_of(
        scene.model_copy(
            update={"start": scene.start.model_copy(update={"crank_speed_rad_s": float(v[0, 2])})}
        )
    )
    return driven, q.ravel(), v.ravel(), 1e-4


def everything_case() -> Start:
    """Return three bodies with all there is: inclined guide, driver, torque, springs to frame and between."""
    angle = 0.4
    mechanism = Mechanism(
        (Body(1.0, 0.3), Body(2.0, 0.5), Body(0.7, 0.2)),
        (
            *straight_guide(0, (0.1, 0.2), angle),
            RevoluteJoint(0, (0.05, -0.1), 1, (-0.3, 0.02)),
            PrescribedSpeed(2, 4.0),
            RevoluteJoint(2, (0.2, 0.1), GROUND, (1.0, 1.0)),
        ),
        (
            Torque(1, 3.0),
            SpringDamper(GROUND, (0.5, 0.7), 1, (0.1, 0.2), 300.0, 2.0, 0.3),
            SpringDamper(1, (0.2, 0.0), 2, (0.0, 0.0), 100.0, 1.0, 0.5),
        ),
        gravity_m_s2=9.81,
    )
    along = np.array([np.cos(angle), np.sin(angle)])
    turn = np.array([[np.cos(0.9), -np.sin(0.9)], [np.sin(0.9), np.cos(0.9)]])
    q = np.zeros(9)
    q[:2], q[5] = np.array([0.1, 0.2]) + 0.6 * along, 0.9
    q[3:5] = q[:2] + np.array([0.05, -0.1]) - turn @ [-0.3, 0.02]
    q[6:8] = [0.8, 0.9]
    v = np.zeros(9)
    v[:2], v[5] = 1.5 * along, -2.0
    arm = turn @ [-0.3, 0.02]
    v[3:5] = v[:2] + 2.0 * np.array([-arm[1], arm[0]])
    v[6:9] = [4.0 * 0.1, -4.0 * 0.2, 4.0]
    return mechanism, q, v, 1e-3


CASES: dict[str, Callable[[], Start]] = {name: partial(scene_case, name) for name in IDEAL_SCENES}
CASES["everything"] = everything_case


def topology_of(mechanism: Mechanism, stabilisation: Stabilisation) -> Topology:
    baumgarte = stabilisation if isinstance(stabilisation, Baumgarte) else None
    return Topology(mechanism, baumgarte, stabilisation == "projection")


def stepped(
    face: CompiledFace | ReadableFace,
    mechanism: Mechanism,
    q: FloatArray,
    v: FloatArray,
    h: float,
    count: int,
) -> tuple[Motion, FloatArray]:
    """Return the motion after steps from q and v at t = 0, off the constraints or not, and {lambda} there.

    The mechanism has no contacts.
    """
    times, contacts = np.array([0.0, count * h]), np.zeros(0, CONTACT_RECORD)
    equations = Equations(mechanism, q)
    sizes = len(q), len(equations.power_names) + 1, len(equations.C)
    run = face.bound(new_run(contacts, sizes, times, ROWS, 1))
    run.old.q[:], run.old.v[:] = q, v
    (now,) = run.clock
    now["longest"], now["end"], now["located"], now["budget"] = h, count * h, 1, count
    assert face.advance(run) == DONE
    assert now["steps"] == count
    size = len(run.old.y)
    assert (run.records.samples[1, :size] == run.old.y).all()
    return run.old, run.records.samples[0, size:]


def check_faces(
    mechanism: Mechanism,
    q: FloatArray,
    v: FloatArray,
    h: float,
    stabilisation: Stabilisation,
    round_off: float,
) -> FloatArray:
    """Compare a step of both faces, relative to the largest of each kind; return q after it."""
    ends = []
    for kind in (CompiledFace, ReadableFace):
        face = kind(topology_of(mechanism, stabilisation), q)
        motion, multipliers = stepped(face, mechanism, q, v, h, 1)
        ends.append((motion.q, motion.v, multipliers, motion.sums[:-1]))
    # A driver's torque may be small beside the other multipliers, but it is rounded as they are.
    most_work = h * np.abs(ends[1][2]).max() * np.abs(v).max()
    for name, one, other in zip(("q", "v", "multipliers", "work"), *ends, strict=True):
        scale = most_work if name == "work" else np.abs(other).max()
        difference = np.abs(one - other).max()
        assert difference <= round_off * scale, f"{name}: {difference:.2e} of {scale:.2e}"
    return np.asarray(ends[0][0])
