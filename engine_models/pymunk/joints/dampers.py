"""Dampers of what moves a body alone: with them it is heavier, and they act on the mean velocity of a kick.

With J the impulse of all else, the joints' among it, a damper c is to give m dv = J - c h (v + dv/2), in
which J and dv are not known before the kick. A body of the mass m + c h/2 under the force -c v of the
velocity before the kick does just that, for (m + c h/2) dv = J - c h v. With m + c h it is the velocity after
the kick that is damped. The body's weight stays that of m. So it is with torques, and along a guide of the
ground on which a body does not turn, in steps of one length. All other dampers are given velocities that are
foreseen (see ``compiled.loop``), which is stable below m/c.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from engine_models.engine import SimulationFailed
from engine_models.pymunk.joints.plan import Plan
from reference_solver.mechanism.data import GROUND, Line, MechanismData, Motor
from reference_solver.mechanism.motor import motor_damping


@dataclass(frozen=True)
class Damper:
    """A damper of a body's turning, or along a line: of the load of a number, or of a motor, which has none.

    ``damping`` is in N m s or N s/m; ``own`` is one that makes its body heavier.
    """

    name: str
    load: int | None
    body: int
    turns: bool
    damping: float
    own: bool


def dampers_of(of: MechanismData, one_step: bool) -> list[Damper]:
    """Return the dampers of loads and motor; in steps of ``one_step`` alone a body can be heavier by them."""
    law, found = of.drive.law, list[Damper]()
    for number, load in enumerate(of.loads):
        name, guided = f"load.{of.bodies[load.body].name}.viscous_N", _is_along_a_guide(of, load.line)
        found.append(Damper(f"{name}_m_s", number, load.body, True, load.viscous_N_m_s, one_step))
        found.append(Damper(f"{name}_s_m", number, load.body, False, load.viscous_N_s_m, one_step and guided))
    if isinstance(law, Motor) and law.table is None:
        found.append(Damper("drive.motor", None, of.drive.body, True, motor_damping(law), one_step))
    return [damper for damper in found if damper.damping]


def _is_along_a_guide(of: MechanismData, line: Line | None) -> bool:
    """Return whether a body moves along a line of the ground without turning, and in no other way."""
    return line is not None and any(
        guide.body_i == GROUND and guide.angle_rad == line.angle_rad
        for guide in of.guides
        if (guide.body_i, guide.body_j) == (line.body_i, line.body_j)
    )


def damped(plan: Plan, dampers: Sequence[Damper], damped_s: float) -> Plan:
    """Return the plan with bodies heavier by their own dampers in so much of a step."""
    seats = [*plan.seats]
    for damper in dampers:
        if damper.own:
            what = "inertia_kg_m2" if damper.turns else "mass_kg"
            more = getattr(seats[damper.body], what) + damper.damping * damped_s
            seats[damper.body] = replace(seats[damper.body], **{what: more})
    return replace(plan, seats=(*seats,))


def require_damped(
    of: MechanismData, plan: Plan, dampers: Sequence[Damper], step_s: float, centred: bool
) -> None:
    """Refuse steps in which a damper turns the speed of a body alone round.

    Raises:
        SimulationFailed: the message has the longest step.
    """
    for damper in dampers:
        if damper.own and not centred:
            continue
        mass, inertia = of.bodies[damper.body].mass_kg, plan.seats[damper.body].inertia_kg_m2
        limit = (2 if damper.own else 1) * (inertia if damper.turns else mass) / damper.damping
        if not step_s <= limit:
            too_long = f"at t = 0 s with step {step_s:.3g} s: shorten it below {limit:.3g} s"
            raise SimulationFailed(f"{damper.name} too strong {too_long}")
