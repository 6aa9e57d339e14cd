"""Masses at pins, moved from one body of a pivot to the other so that sweeps over the joints converge fast.

A point mass at an ideal pin has the same motion, weight and kinetic energy whichever of the two bodies it
belongs to, so how much of it each has is free, negative parts included. The motion is the same but for the
order of the step; the rate at which Gauss-Seidel sweeps converge is not. To leave 0.42 of an open joint set F
takes two sweeps for seven, Andrews' squeezer five for fifty.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from engine_models.engine import FloatArray
from engine_models.pymunk.joints.plan import Joint, Plan, Seat, is_exact
from engine_models.pymunk.joints.sweeps import convergence_of
from reference_solver.mechanism.data import GROUND

#: Masses keep to within these times their own, and inertias above the first.
LEAST, MOST = 0.2, 5.0
#: What is moved is changed by these parts of the lighter body, one pin at a time, as long as the rate falls
#: by more than round-off: to below this part of it.
STEPS, GAIN = (1.0, 0.5, 0.25, 0.125, 0.0625), 0.999
#: What no plan's rate comes to.
NEVER = 10.0


def balanced(plan: Plan, path: FloatArray) -> Plan:
    """Return a plan for which sweeps converge fast in positions (n, bodies, 3), or the plan itself."""
    pivots = [joint for joint in plan.joints if joint.kind == "pivot" and joint.body_i != GROUND]
    ends = [(plan.seats[joint.body_i], plan.seats[joint.body_j]) for joint in pivots]
    lighter_kg = np.array([min(i.weight_kg, j.weight_kg) for i, j in ends])

    def rate(parts: FloatArray) -> float:
        moved = _moved(plan, pivots, parts * lighter_kg)
        return NEVER if moved is None else convergence_of(moved, path).rate

    parts = np.zeros(len(pivots))
    least, ways = rate(parts), [*np.eye(len(pivots)), *-np.eye(len(pivots))]
    for step in STEPS if pivots else ():
        better = True
        while better:
            others = [parts + step * way for way in ways]
            rates = [rate(other) for other in others]
            better = min(rates) < GAIN * least
            if better:
                parts, least = others[int(np.argmin(rates))], min(rates)
    return _moved(plan, pivots, parts * lighter_kg) or plan


def _moved(plan: Plan, pivots: Sequence[Joint], moved_kg: FloatArray) -> Plan | None:
    """Return the plan with so much moved at each pivot from body i to body j.

    There is none if that is too much, or takes a centre of mass from a groove's line that led through it.
    """
    # Mass, first moment and inertia about the origins.
    weights = np.array([seat.weight_kg for seat in plan.seats])
    moments = weights[:, None] * [seat.centre for seat in plan.seats]
    inertias = np.array([seat.inertia_kg_m2 for seat in plan.seats])
    changed = set[int]()
    for joint, kg in zip(pivots, moved_kg.tolist(), strict=True):
        for body, place, part in ((joint.body_i, joint.point_i, -kg), (joint.body_j, joint.point_j, kg)):
            if part:
                at = np.array(place)
                weights[body] += part
                moments[body] += part * at
                inertias[body] += part * (at @ at)
                changed.add(body)
    seats, shifts = [*plan.seats], dict[int, FloatArray]()
    for body in changed:
        seat, mass, inertia = plan.seats[body], float(weights[body]), float(inertias[body])
        if seat.is_kinematic:
            continue
        if not LEAST * seat.weight_kg <= mass <= MOST * seat.weight_kg:
            return None
        centre = moments[body] / mass
        if seat.pivot:
            seats[body] = replace(seat, inertia_kg_m2=inertia, weight_kg=mass, centre=_point(centre))
        else:  # the origin goes to the new centre of mass
            inertia -= mass * float(centre @ centre)
            shifts[body] = centre
            seats[body] = Seat(mass, inertia, mass, origin=_point(np.array(seat.origin) + centre))
        if inertia < LEAST * seat.inertia_kg_m2 < np.inf:
            return None
    joints = [
        replace(
            joint,
            point_i=_point(np.array(joint.point_i) - shifts.get(joint.body_i, 0.0)),
            point_j=_point(np.array(joint.point_j) - shifts.get(joint.body_j, 0.0)),
        )
        for joint in plan.joints
    ]
    moved = replace(plan, seats=(*seats,), joints=(*joints,))
    return moved if all(is_exact(moved, joint) for joint in joints if joint.kind == "groove") else None


def _point(place: FloatArray) -> tuple[float, float]:
    return float(place[0]), float(place[1])
