"""The driver of rigid joints: consistent start, the automaton of ``rigid_automaton``, recording."""

import numpy as np
from numpy.typing import NDArray

from reference_solver.chunks import Tell, nobody
from reference_solver.equations import Equations
from reference_solver.errors import InconsistentStart
from reference_solver.mechanism import Mechanism
from reference_solver.rigid_automaton import Automaton
from reference_solver.rigid_joint import JointGeometry, RigidJoint
from reference_solver.rigid_solution import Energy, RigidSolution
from reference_solver.solver import START_TOLERANCE, check_start

FloatArray = NDArray[np.float64]


def solve_rigid(
    mechanism: Mechanism,
    joints: tuple[RigidJoint, ...],
    q: FloatArray,
    v: FloatArray,
    *,
    end_time_s: float,
    samples: int,
    steps_per_sample: int,
    closing_flight_fraction: float = 1e-3,
    compiled: bool = True,
    tell: Tell = nobody,
) -> RigidSolution:
    """Integrate from coordinates q and velocities v, each (3 x bodies,), and record ``samples + 1`` states.

    The step is ``end_time_s / (samples * steps_per_sample)`` where no event cuts it. The mechanism holds the
    ideal joints; ``joints`` have clearance. ``closing_flight_fraction`` of the step is the flight below which
    bounces end (see ``rigid_automaton``). ``tell`` is called with the time reached, now and then.

    Raises:
        ValueError: no joint has clearance, a joint names no body, or the mechanism has compliant contacts.
        InconsistentStart: q or v violate the constraints, or a pin is outside its bearing.
        SolverError: a step or an impact failed; it says which and when.
    """
    if not joints:
        raise ValueError("joints: expected at least one joint with clearance, got none: use solve")
    if mechanism.contacts:
        raise ValueError("mechanism.contacts: expected none beside rigid joints, got some")
    q, v = np.array(q, dtype=float), np.array(v, dtype=float)
    check_start(Equations(mechanism, q), q, v)
    geometry, energy = JointGeometry(mechanism, joints), Energy(mechanism)
    outside = np.hypot(*geometry.offsets(q).T) - geometry.clearance_m
    if not outside.max() <= START_TOLERANCE:
        raise InconsistentStart(
            f"joints[{int(outside.argmax())}]: expected the pin inside its bearing, "
            f"got it {outside.max():.3g} m past the wall"
        )
    step = end_time_s / (samples * steps_per_sample)
    run = Automaton(mechanism, joints, q, v, step, closing_flight_fraction, compiled)
    records = []
    for sample in range(samples + 1):
        if sample:
            run.advance((sample - 1) * steps_per_sample, sample * steps_per_sample, tell)
        ledger = (*energy(run.q, run.v), *run.ledger.entries())
        records.append((run.q.copy(), run.v.copy(), *run.forces(), *ledger))
    columns = [np.array(column) for column in zip(*records, strict=True)]
    qs, vs, multipliers, following, normal, friction, force, *columns = columns
    kinetic, potential, work, impulse, impact_loss, closing_loss, friction_loss = columns
    return RigidSolution(
        time_s=np.linspace(0.0, end_time_s, samples + 1),
        q=qs,
        v=vs,
        multipliers=multipliers,
        following=following,
        normal_force_N=normal,
        friction_force_N=friction,
        joint_force_N=force,
        impacts=tuple(run.impacts),
        mode_changes=tuple(run.mode_changes),
        kinetic_energy_J=kinetic,
        potential_energy_J=potential,
        constraint_work_J=work,
        normal_impulse_N_s=impulse,
        impact_loss_J=impact_loss,
        closing_loss_J=closing_loss,
        friction_loss_J=friction_loss,
    )
