"""What acts on the bodies of a mechanism in n states: loads, their works, contacts, and reactions.

Reactions follow from motion alone. By Newton's second law B^T lambda = M a - F, of which lambda is the
solution by least squares in the norm of M^-1: B M^-1 B^T lambda = B (a - M^-1 F).
"""

from collections.abc import Mapping

import numpy as np

from engine_models.engine import Contact, FloatArray, Trajectory, UnsupportedScene
from engine_models.mechanics.states import direction, ends_of, pin_gap, point_motion, way
from engine_models.mechanics.trajectory import ContactStates, Reactions, force_on_pin, reactions_of
from engine_models.scene.plain_words import shown
from engine_models.scene.scene import Scene
from reference_solver.mechanism.contacts import NORMAL_LAWS, dissipative, joint_of
from reference_solver.mechanism.data import GROUND, Ends, MechanismData, Motion, Pin, Ramp, Spring
from reference_solver.mechanism.loads import Constant, Force, Load, Restoring, Torque, integrated, size_of
from reference_solver.mechanism.mechanism import loads_of
from reference_solver.mechanism.motions import going_on, moved
from reference_solver.mechanism.points import State

Term = FloatArray | float
#: Singular values below this part of the largest are zero, where rows depend on each other.
ZERO = 1e-15


def load_forces(
    of: MechanismData, time_s: FloatArray, position: FloatArray, velocity: FloatArray
) -> dict[str, FloatArray]:
    """Return the force in N or torque in N m of each load by its name in ``loads_of``, (n,).

    A spring's is positive where it pulls, another force's along its line.
    """
    n, sizes = len(time_s), dict[str, FloatArray]()
    state = State(position.reshape(n, -1).T, velocity.reshape(n, -1).T, time_s)
    for name, load in loads_of(of).items():
        if isinstance(load, Spring):
            i, j = ends_of(load, position, velocity)
            d, rate = j.place_m - i.place_m, j.rate_m_s - i.rate_m_s
            length = np.hypot(*d.T)
            pull = load.damping_N_s_m * np.sum(d * rate, axis=1) / np.maximum(length, np.finfo(float).tiny)
            sizes[name] = load.stiffness_N_m * (length - load.free_length_m) + pull
        else:
            sizes[name] = np.broadcast_to(size_of(load.law, *_place(load, position, velocity), state), n)
    return sizes


def driven_speeds(of: MechanismData, time_s: FloatArray) -> FloatArray:
    """Return the speeds that a prescribed motion has at times (n,), in rad/s or along a guide in m/s."""
    assert isinstance(of.drive.law, Motion)
    motion = going_on(of.drive.law, of.drive.clock_s)
    if isinstance(motion, Ramp):  # which takes one time
        return np.array([moved(motion, t)[1] for t in time_s])
    return np.broadcast_to(moved(motion, time_s)[1], len(time_s))


def along_lines(of: MechanismData) -> list[str]:
    """Return the names of the loads that are forces along a line."""
    return [name for name, load in loads_of(of).items() if isinstance(load, Force)]


def works_J(scene: Scene, position: FloatArray, integrals: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """Return the work of each load, and "driver", since the first of positions, (n,).

    Those of ``integrals_of`` are given. The others follow from where the bodies are; what a spring between
    points or bodies stores is none.
    """
    works = dict[str, FloatArray]()
    for name, load in _named(scene).items():
        if integrated(load):
            works[name] = integrals[name]
        elif not isinstance(load, Spring):
            s, _ = _place(load, position, np.zeros_like(position))
            gone, middle = s - s[0], (s + s[0]) / 2
            match load.law:
                case Constant(size):
                    works[name] = size * gone
                case Restoring(stiffness, free) if isinstance(load, Force):
                    works[name] = -stiffness * gone * (middle - free)
    return {**works, **integrals}


def integrals_of(scene: Scene) -> dict[str, str]:
    """Return the works that are integrals over time by the names of the reference's sums."""
    names = {f"load{k}": name for k, (name, load) in enumerate(_named(scene).items()) if integrated(load)}
    return names | ({"drivers": "driver"} if scene.mechanism.drive.prescribes else {})


def powers_W(
    scene: Scene, time_s: FloatArray, position: FloatArray, velocity: FloatArray
) -> dict[str, FloatArray]:
    """Return the powers of those loads whose works are integrals over time, by their names there, (n,)."""
    sizes, powers = load_forces(scene.mechanism, time_s, position, velocity), dict[str, FloatArray]()
    for (name, load), size in zip(_named(scene).items(), sizes.values(), strict=True):
        if not integrated(load):
            continue
        if isinstance(load, Spring):
            i, j = ends_of(load, position, velocity)
            rate = np.sum(_unit(j.place_m - i.place_m) * (j.rate_m_s - i.rate_m_s), axis=1)
            powers[name] = -load.damping_N_s_m * rate**2
        else:
            powers[name] = size * _place(load, position, velocity)[1]
    return powers


def require_family(scene: Scene, engine: str) -> None:
    """Refuse laws that the reference has by functions of their own, which an engine has no form for.

    Raises:
        UnsupportedScene: a joint has one.
    """
    for name, room in scene.clearances.items():
        if room.law in NORMAL_LAWS:
            expected = "a law of a stiffness and a damping, or of the dissipative family"
            raise UnsupportedScene(
                f"{engine}: clearance.{name}.law: expected {expected}, got {shown(room.law)}"
            )


def contact_states(
    pin: Pin, position: FloatArray, velocity: FloatArray, approach_m_s: FloatArray
) -> ContactStates:
    """Return what a joint does whose law may pull, by its latest touches' speeds (n,).

    Friction is saturated linear and has the sign of the normal force.
    """
    assert pin.clearance is not None
    gap, drift = pin_gap(pin, position, velocity)
    joint, distance, n = joint_of(pin), np.hypot(*gap.T), _unit(gap)
    depth, rate = distance - joint.radial_clearance_m, np.sum(n * drift, axis=1)
    memory = joint.law.damping_factor / np.maximum(approach_m_s, joint.law.minimum_impact_speed_m_s)
    inside = np.maximum(depth, 0.0)
    elastic, damper = dissipative(joint.law, inside, memory)
    resisting, friction = np.where(depth > 0.0, damper * rate, 0.0), np.zeros_like(depth)
    normal, lost = elastic + resisting, friction
    if joint.friction is not None:
        of_bearing, of_pin = ends_of(joint, position, velocity)
        arm_i = joint.bearing_radius_m + inside / 2  # surfaces meet in the middle of the penetration
        arm_j = joint.bearing_radius_m - joint.radial_clearance_m - inside / 2
        sliding = n[:, 0] * drift[:, 1] - n[:, 1] * drift[:, 0]
        sliding += of_pin.spin_rad_s * arm_j - of_bearing.spin_rad_s * arm_i
        share = np.clip(sliding / joint.friction.regularisation_speed_m_s, -1.0, 1.0)
        friction = -joint.friction.coefficient * normal * share
        lost = -friction * sliding
    return ContactStates(gap, depth, normal, friction, rate, resisting * rate, lost)


def reactions(
    of: MechanismData,
    time_s: FloatArray,
    position: FloatArray,
    velocity: FloatArray,
    acceleration: FloatArray,
    contacts: Mapping[str, Contact | ContactStates],
) -> Reactions:
    """Return all reactions at times (n,) in states (n, bodies, 3), in which joints with clearance do so."""
    on_pin = {name: force_on_pin(contact) for name, contact in contacts.items()}
    forces = {pin.name: (-1.0 if pin.bearing_on_j else 1.0) * on_pin[pin.name] for pin in of.loose}
    missing = acceleration - _loaded(of, time_s, position, velocity, forces) / masses_of(of)
    missing = missing.reshape(len(missing), 3 * len(of.bodies))
    rows = _rows(of, position)
    B = np.ascontiguousarray(rows.reshape(len(rows), *missing.shape).swapaxes(0, 1))
    matrix, right = B / masses_of(of).ravel() @ B.swapaxes(1, 2), B @ missing[..., None]
    try:
        multipliers = np.linalg.solve(matrix, right)[..., 0]
    except np.linalg.LinAlgError:  # the shortest where one is singular
        multipliers = (np.linalg.pinv(matrix, ZERO, hermitian=True) @ right)[..., 0]
    torque = load_forces(of, time_s, position, velocity).get("drive")  # of one that is no row
    return reactions_of(of, multipliers, contacts, torque)


def accelerations(scene: Scene, run: Trajectory) -> FloatArray:
    """Return the accelerations (n, bodies, 3) that all forces of a run give to its bodies."""
    of, x = scene.mechanism, run.position
    told = run.joint_force_N, run.guide_force_N, run.guide_moment_N_m
    F = _loaded(of, run.time_s, x, run.velocity, *told)
    if of.drive.prescribes and run.driver_torque_N_m is not None:
        _drive(F, x, of, run.driver_torque_N_m)
    return np.asarray(F / masses_of(of))


def _loaded(
    of: MechanismData,
    time_s: FloatArray,
    x: FloatArray,
    v: FloatArray,
    joint_force_N: Mapping[str, FloatArray],
    guide_force_N: Mapping[str, FloatArray] = {},
    guide_moment_N_m: Mapping[str, FloatArray] = {},
) -> FloatArray:
    """Return weights, loads, and the forces of some joints and guides on the bodies, (n, bodies, 3)."""
    F = np.zeros_like(x) + masses_of(of) * [*of.gravity_m_s2, 0.0]
    for pin in (pin for pin in of.pins if pin.name in joint_force_N):
        _push(F, x, pin, joint_force_N[pin.name], reach=_to_contact(pin, x) if pin.clearance else 0.0)
    for guide in (guide for guide in of.guides if guide.name in guide_force_N):
        _, left = direction(guide, x)
        _push(F, x, guide, guide_force_N[guide.name][:, None] * left, guide_moment_N_m.get(guide.name, 0.0))
    sizes = load_forces(of, time_s, x, v)
    for name, load in loads_of(of).items():
        if isinstance(load, Torque):
            F[:, load.body, 2] += sizes[name]
            if load.against != GROUND:
                F[:, load.against, 2] -= sizes[name]
        elif isinstance(load, Spring):
            i, j = ends_of(load, x, v)
            _push(F, x, load, sizes[name][:, None] * _unit(i.place_m - j.place_m))
        else:
            _push(F, x, load, sizes[name][:, None] * direction(load, x)[0])
    return F


def _rows(of: MechanismData, x: FloatArray) -> FloatArray:
    """Return what a unit of each multiplier puts on bodies, (m, n, bodies, 3), in the order of the rows."""
    count = 2 * len(of.ideal) + sum(2 - guide.turns for guide in of.guides) + of.drive.prescribes
    B, still = np.zeros((count, *x.shape)), np.zeros((len(x), 2))
    rows = iter(B)
    for pin in of.ideal:
        i, j = ends_of(pin, x, x)
        for unit, row in zip(np.eye(2), (next(rows), next(rows)), strict=True):
            _act(row, x, pin.body_j, j.place_m, still + unit)
            _act(row, x, pin.body_i, i.place_m, still - unit)
    for guide in of.guides:
        _push(next(rows), x, guide, direction(guide, x)[1])
        if not guide.turns:
            _push(next(rows), x, guide, still, 1.0)
    if of.drive.prescribes:
        _drive(next(rows), x, of, np.ones(len(x)))
    return B


def _push(
    F: FloatArray, x: FloatArray, part: Ends, force_N: FloatArray, moment_N_m: Term = 0.0, reach: Term = 0.0
) -> None:
    """Add force and moment on body j of a part, at its point or as far from there, and their reaction."""
    place = point_motion(part.body_j, part.point_j, x, x).place_m + reach
    _act(F, x, part.body_j, place, force_N, moment_N_m)
    _act(F, x, part.body_i, place, -force_N, -moment_N_m)


def _act(
    F: FloatArray, x: FloatArray, body: int, place_m: FloatArray, force_N: FloatArray, moment_N_m: Term = 0.0
) -> None:
    """Add force and moment on a body, (n, 2) and (n,), to those on all bodies, F (n, bodies, 3)."""
    if body != GROUND:
        (lever_x, lever_y), (force_x, force_y) = (place_m - x[:, body, :2]).T, force_N.T
        F[:, body] += np.stack([force_x, force_y, lever_x * force_y - lever_y * force_x], axis=-1)
        F[:, body, 2] += moment_N_m


def _drive(F: FloatArray, x: FloatArray, of: MechanismData, torque: FloatArray) -> None:
    """Add the torque, or along a guide the force, (n,), of a drive that prescribes a motion."""
    if of.drive.guide is None:
        F[:, of.drive.body, 2] += torque
    else:
        line = of.guides[of.drive.guide]
        _push(F, x, line, torque[:, None] * direction(line, x)[0])


def on_ground(scene: Scene, run: Trajectory, acceleration: FloatArray) -> FloatArray:
    """Return force and torque about the origin (n, 3) on the ground: what weight and inertia leave."""
    own = masses_of(scene.mechanism) * ([*scene.mechanism.gravity_m_s2, 0.0] - acceleration)
    own[..., 2] += run.position[..., 0] * own[..., 1] - run.position[..., 1] * own[..., 0]
    return np.asarray(own.sum(axis=1))


def masses_of(of: MechanismData) -> FloatArray:
    """Return mass, mass and inertia of every body, (bodies, 3)."""
    return np.array([[body.mass_kg, body.mass_kg, body.inertia_kg_m2] for body in of.bodies])


def _named(scene: Scene) -> dict[str, Load]:
    """Return the loads by the names of ``Trajectory.load_work_J``, and "driver"."""
    short = "slider." if scene.is_short else ""
    loads = loads_of(scene.mechanism).items()
    return {"driver" if name == "drive" else name.removeprefix(short): load for name, load in loads}


def _place(load: Force | Torque, position: FloatArray, velocity: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return s and s' of a load's law, (n,) each."""
    if isinstance(load, Torque):
        return load.turned(State(*(states.reshape(len(states), -1).T for states in (position, velocity))))
    return way(load, position, velocity)


def _to_contact(pin: Pin, position: FloatArray) -> FloatArray:
    """Return the way (n, 2) from the point of body j to where surfaces touch: midway in the penetration."""
    assert pin.clearance is not None
    gap = pin_gap(pin, position, np.zeros_like(position))[0]
    distance = np.hypot(*gap.T)[:, None]
    depth = np.maximum(distance - pin.clearance.radial_clearance_m, 0.0)
    reach = pin.clearance.bearing_radius_m + depth / 2 - (0.0 if pin.bearing_on_j else distance)
    return np.asarray(reach * _unit(gap))


def _unit(d: FloatArray) -> FloatArray:
    """Return the unit vectors (n, 2) along vectors; 0 of 0."""
    return np.asarray(d / np.maximum(np.hypot(*d.T), np.finfo(float).tiny)[:, None])
