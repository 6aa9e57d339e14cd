"""What acts on the bodies of a mechanism in n states: loads, their works, and accelerations by all forces."""

from collections.abc import Mapping

import numpy as np

from engine_models.engine import FloatArray, Trajectory
from engine_models.mechanics.states import direction, ends_of, pin_gap, point_motion, way
from engine_models.scene.scene import Scene
from reference_solver.mechanism.data import GROUND, Ends, MechanismData, Motion, Pin, Spring
from reference_solver.mechanism.loads import Constant, Force, Load, Restoring, Torque, integrated, size_of
from reference_solver.mechanism.mechanism import loads_of
from reference_solver.mechanism.motions import going_on, moved
from reference_solver.mechanism.points import State


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
    return np.array([moved(motion, t)[1] for t in time_s])


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


def accelerations(scene: Scene, run: Trajectory) -> FloatArray:
    """Return the accelerations (n, bodies, 3) that all forces of a run give to its bodies."""
    of, x, v = scene.mechanism, run.position, run.velocity
    masses = masses_of(of)
    F = np.tile(masses * [*of.gravity_m_s2, 0.0], (len(x), 1, 1))

    def add(body: int, place_m: FloatArray, force_N: FloatArray, moment_N_m: FloatArray | float) -> None:
        if body != GROUND:
            (lever_x, lever_y), (force_x, force_y) = (place_m - x[:, body, :2]).T, force_N.T
            F[:, body] += np.stack([force_x, force_y, lever_x * force_y - lever_y * force_x], axis=-1)
            F[:, body, 2] += moment_N_m

    def between(
        part: Ends, force_N: FloatArray, moment_N_m: FloatArray | float = 0.0, reach: FloatArray | float = 0.0
    ) -> None:
        """Add force and moment on body j of a part, at its point or as far from there, and their reaction."""
        place = point_motion(part.body_j, part.point_j, x, v).place_m + reach
        add(part.body_j, place, force_N, moment_N_m)
        add(part.body_i, place, -force_N, -moment_N_m)

    for pin in of.pins:
        between(pin, run.joint_force_N[pin.name], reach=_to_contact(pin, x) if pin.clearance else 0.0)
    for guide in of.guides:
        _, left = direction(guide, x)
        moment = run.guide_moment_N_m.get(guide.name, 0.0)
        between(guide, run.guide_force_N[guide.name][:, None] * left, moment)
    loads, sizes = loads_of(of), load_forces(of, run.time_s, x, v)
    for name, load in loads.items():
        if isinstance(load, Torque):
            F[:, load.body, 2] += sizes[name]
            if load.against != GROUND:
                F[:, load.against, 2] -= sizes[name]
        elif isinstance(load, Spring):
            i, j = ends_of(load, x, v)
            between(load, sizes[name][:, None] * _unit(i.place_m - j.place_m))
        else:
            between(load, sizes[name][:, None] * direction(load, x)[0])
    if of.drive.prescribes and run.driver_torque_N_m is not None:
        if of.drive.guide is None:
            F[:, of.drive.body, 2] += run.driver_torque_N_m
        else:
            line = of.guides[of.drive.guide]
            between(line, run.driver_torque_N_m[:, None] * direction(line, x)[0])
    return np.asarray(F / masses)


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
    gap = pin_gap(pin, position, np.zeros_like(position)).gap_m
    distance = np.hypot(*gap.T)[:, None]
    depth = np.maximum(distance - pin.clearance.radial_clearance_m, 0.0)
    reach = pin.clearance.bearing_radius_m + depth / 2 - (0.0 if pin.bearing_on_j else distance)
    return np.asarray(reach * _unit(gap))


def _unit(d: FloatArray) -> FloatArray:
    """Return the unit vectors (n, 2) along vectors; 0 of 0."""
    return np.asarray(d / np.maximum(np.hypot(*d.T), np.finfo(float).tiny)[:, None])
