"""What rigid walls have to know of a mechanism at a state: the answer to impulses and forces of its pins.

They push along rows D of {q'}: of every joint with a rigid wall the inward normal speed, then of those with
friction the tangential one (see ``contact.walls``). The ideal joints hold; no pin follows its wall.
"""

from typing import Any, NamedTuple

import numpy as np

from reference_solver.contact.types import record
from reference_solver.contact.walls import separation
from reference_solver.equations import Answer, Equations
from reference_solver.mechanism.contact_laws import FRICTION_LAWS, RigidWall
from reference_solver.mechanism.mechanism import ClearanceJoint, Mechanism
from reference_solver.mechanism.points import State
from reference_solver.tape import Array, FloatArray, RecordArray, Scalar, array

#: A joint: its restitution, minimum impact speed and coefficient of friction, its number among the contacts,
#: of its tangent in D, or -1, and of its normal impulse in the sums, behind which are its losses. At a state:
#: its ``Separation``, the mobility along the normal that free bodies would have, in 1/kg, and friction as a
#: part of the normal force. While pins settle (see ``settling``): the largest round-off of its rate, its
#: approach, the speed at which it would have left in a bounce that is left out, the restitution wanted, its
#: impulses, what they lose, the force that presses it inwards; and whether it touches, follows its wall,
#: hits, takes part in an impact, closes, would fly too short, and is chosen.
WALL_RECORD = record(
    "restitution slowest coefficient distance rate turning noise rate_noise bare share "
    "fastest_noise approach leaving wanted normal tangential lost force",
    "contact tangent column touches follows hits takes_part closes short chosen",
)
#: What of it belongs to a state: the fields of a ``Separation``, and those of its wall.
OF_STATE = ("distance", "rate", "turning", "noise", "rate_noise")
OF_WALL = (*OF_STATE, "bare", "share")


class Walls(NamedTuple):
    """R joints with rigid walls at a state of n coordinates: ``WALL_RECORD`` (R,), and S rows D.

    ``rows`` are D (S, n); ``motion`` (S, n) are {q'} per unit of each impulse, ``mobility`` (S, S) speeds
    along all rows, ``drivers`` (S,) the work of the drivers. ``free`` (n,) are the accelerations. All that
    belongs to a state is in ``numbers``: of every joint ``OF_WALL`` (R, 7), then the arrays, which are views.
    """

    numbers: FloatArray
    of_joints: FloatArray

    rows: FloatArray
    motion: FloatArray
    mobility: FloatArray
    drivers: FloatArray
    free: FloatArray
    joints: RecordArray


def rigid_joints(mechanism: Mechanism) -> list[tuple[int, ClearanceJoint, RigidWall]]:
    """Return number, joint and wall of the contacts that are rigid."""
    contacts = enumerate(mechanism.contacts)
    return [(k, joint, joint.law) for k, joint in contacts if isinstance(joint.law, RigidWall)]


def new_walls(mechanism: Mechanism, sums: list[str]) -> Walls:
    """Return the walls of a mechanism, at no state yet; sums are named as in ``Equations.power_names``."""
    rigid, n = rigid_joints(mechanism), 3 * len(mechanism.bodies)
    joints, row = np.zeros(len(rigid), WALL_RECORD), len(rigid)
    for of, (k, joint, wall) in zip(joints, rigid, strict=True):
        of["restitution"], of["slowest"] = wall.restitution, wall.minimum_impact_speed_m_s
        of["contact"], of["column"], of["tangent"] = k, sums.index(f"normal{k}"), -1
        if joint.friction is not None:
            of["coefficient"], of["tangent"], row = joint.friction.coefficient, row, row + 1
    shapes = (len(rigid), len(OF_WALL)), (row, n), (row, n), (row, row), (row,), (n,)
    ends = np.cumsum([np.prod(shape, dtype=int) for shape in shapes])
    numbers = np.zeros(ends[-1])
    parts: list[Any] = [
        part.reshape(shape) for part, shape in zip(np.split(numbers, ends[:-1]), shapes, strict=True)
    ]
    return Walls._make([numbers, *parts, joints])


def walls_at(
    equations: Equations, answer: Answer, t: Scalar, q: Array, v: Array
) -> tuple[list[dict[str, Scalar]], dict[str, Array]]:
    """Return what ``Walls`` has at a state: fields of the joints, and the arrays.

    ``answer`` is that of the equations there, no pin following.
    """
    state, system = State(q, v), equations.system(t, q, v)
    joints = [joint for _, joint, _ in rigid_joints(equations.mechanism)]
    at = [separation(joint, state) for joint in joints]
    tangents = [each.tangent for each, joint in zip(at, joints, strict=True) if joint.friction is not None]
    D = array([*(-each.normal for each in at), *tangents])
    motion, reactions = equations.factors(system.B).solve(D.T, np.zeros((len(system.C), len(D))))
    W = D @ motion
    fields = [
        {name: getattr(each, name) for name in OF_STATE}
        | {"bare": (row * row) @ equations.inverse_mass, "share": _share(joint, each.tangent @ v)}
        for each, joint, row in zip(at, joints, D, strict=False)
    ]
    arrays = {
        "rows": D,
        "motion": motion.T,
        "mobility": 0.5 * (W + W.T),
        "drivers": reactions.T @ system.C,
        "free": answer.accelerations,
    }
    return fields, arrays


def _share(joint: ClearanceJoint, sliding: Scalar) -> Scalar:
    """Return friction as a part of the normal force, at a sliding speed."""
    law: Any = joint.friction
    return 0.0 if law is None else law.coefficient * FRICTION_LAWS[law.kind](law, sliding)
