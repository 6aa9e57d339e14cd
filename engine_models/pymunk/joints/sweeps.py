"""How many Gauss-Seidel sweeps over its joints a scene needs in a step: by how slowly they converge there.

A sweep goes from joint to joint and gives each the impulse that closes it. What it leaves open of all joints
is G times what was open before, with G = -(D + L)^-1 U of the joints' matrix J M^-1 J^T = L + D + U, and n
sweeps leave g = rho^n, rho the largest eigenvalue of G. Joints that share no body that they can move are
closed by one sweep. The order of the joints changes nothing: rho is the same in any where no joints form a
ring, and in all orders of Andrews' squeezer it is between 0.98188 and 0.98192.

Where all of a position error is taken back in a step, from the impulses of the step before, an open joint p
follows p_k+1 = 3g p_k - 3g p_k-1 + g p_k-2, that is (1 - 1/z)^3 = -(1 - g)/g for p_k = z^k: it closes if g is
below a half, by a factor of 0.986 in a step at 0.48. The errors of positions are then within a per cent of
those of a hundred sweeps, and those of forces in steps of a fiftieth of a turn up to seven times as large;
with a fifth left, up to twice. A contact, though, comes as a surprise to joints that begin with their last
impulses: with a third left positions are off by three times as much, and velocities after a rigid impact by
ten times; with a thirtieth, by some per cent more, and forces after a rigid impact are off by 2 % of the
largest, with a hundredth by 0.6 %.
"""

import math
from dataclasses import dataclass

import numpy as np

from engine_models.engine import FloatArray, SimulationFailed
from engine_models.mechanics.start import start_state
from engine_models.mechanics.states import point_motion
from engine_models.mechanics.wrenches import Wrenches
from engine_models.pace import Pace
from engine_models.pymunk.joints.plan import Plan
from engine_models.scene.scene import Scene
from reference_solver.failures import SolverError
from reference_solver.mechanism.building import mechanism_of
from reference_solver.solver import ErrorControl, Solver

#: What sweeps may leave, and with contacts.
LEFT_OVER, LEFT_OVER_WITH_CONTACTS = 1 / 5, 1 / 100
#: How many there are at most: a step of as many takes 30 us.
MOST = 1000
#: The path takes no more steps than these, of 5 us: with more it is the start alone.
MOST_STEPS, LOOK_UP_STEPS = 200_000, 20_000
#: Equal intervals of a run at whose ends joints are looked at; a prime, so as to meet a turn anywhere.
PLACES = 97
#: Every so manieth of them is enough to choose by.
THINNED = 4


@dataclass(frozen=True)
class Convergence:
    """The largest rate rho of sweeps over the joints of a plan along a path; NaN where it cannot be told."""

    rate: float

    def sweeps(self, left: float) -> int:
        """Return how many sweeps leave no more than a part of an open joint."""
        if self.rate == 0:
            return 1
        if not self.rate < 1:  # NaN among them
            return MOST
        return min(max(math.ceil(math.log(left) / math.log(self.rate)), 1), MOST)


def convergence_of(plan: Plan, path: FloatArray) -> Convergence:
    """Return how sweeps over a plan's joints converge in positions (n, bodies, 3)."""
    mobility = np.array([[1 / seat.mass_kg, 1 / seat.mass_kg, 1 / seat.inertia_kg_m2] for seat in plan.seats])
    of_row = np.repeat(np.arange(len(plan.joints)), [joint.rows for joint in plan.joints])
    done, rows = of_row[:, None] >= of_row, joint_rows(plan, path)
    with np.errstate(all="ignore"):
        matrix = rows * mobility.ravel() @ rows.swapaxes(1, 2)
        try:
            sweep = np.linalg.solve(np.where(done, matrix, 0.0), np.where(done, 0.0, matrix))
            return Convergence(float(np.abs(np.linalg.eigvals(sweep)).max()))
        except np.linalg.LinAlgError:
            return Convergence(math.nan)


def are_apart(plan: Plan) -> bool:
    """Return whether no two joints share a body that they can move."""
    moved = [body for joint in plan.joints for body in {joint.body_i, joint.body_j}]
    moved = [body for body in moved if not plan.seat(body).is_kinematic]
    return len(moved) == len(set(moved))


def path_of(scene: Scene) -> FloatArray:
    """Return positions (n, bodies, 3) along a coarse run of the scene with all joints ideal, or its start."""
    twin = scene.replace("clearance", {})
    start, velocity = start_state(twin)
    q, pace = start.ravel(), Pace(twin, LOOK_UP_STEPS, MOST_STEPS)
    with np.errstate(all="ignore"):
        try:
            solver = Solver(mechanism_of(twin.mechanism), q, ErrorControl(1e-4, scene.end_time_s))
            run = solver.run(
                q, velocity.ravel(), scene.end_time_s, PLACES, lambda t: pace.judge(t, solver.steps)
            )
        except (SimulationFailed, SolverError):
            return start[None]
    position = run.q.reshape(-1, *start.shape)
    return position if np.isfinite(position).all() else start[None]


def joint_rows(plan: Plan, position: FloatArray) -> FloatArray:
    """Return J (n, rows, 3 bodies) of the joints, in their order, in positions (n, bodies, 3).

    A pivot's rows are along and across its line, a groove's is across.
    """
    moved, one, rows = position.copy(), np.ones(len(position)), list[Wrenches]()
    for body, seat in enumerate(plan.seats):
        moved[:, body, :2] = point_motion(body, seat.origin, position, position).place_m
    for joint in plan.joints:
        for across in {"pivot": (False, True), "groove": (True,), "gear": ()}[joint.kind]:
            rows.append(Wrenches(moved))
            rows[-1].line(joint, one, across)
        if joint.kind == "gear":
            rows.append(Wrenches(moved))
            rows[-1].turn(joint.body_j, joint.body_i, one)
    on_bodies = [acting.total[:, :-1].reshape(len(moved), -1) for acting in rows]
    return np.stack(on_bodies, axis=1) if rows else np.zeros((len(moved), 0, moved[0].size))
