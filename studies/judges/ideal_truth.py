"""The independent truth for ideal scenes: one coordinate, Eksergian's equation, closed-form reactions.

With the crank angle theta as the only coordinate every body coordinate is a function X(theta), so the
motion is  J(theta) theta'' + J'(theta) theta'^2 / 2 = Q - V'(theta)  (Eksergian 1930), and the forces follow
by Newton's law body by body, slider first. Q is the drive's torque and the slider's load times dx/dtheta.
Nothing here is shared with the solvers under test.
"""

from functools import lru_cache

import numpy as np

from engine_models.engine import FloatArray, Trajectory, require_samples
from engine_models.scene.scene import Scene
from studies.judges.horizon import a_place_off
from studies.judges.ideal_drive import drive_torque
from studies.judges.ideal_load import load_works_J, slider_force
from studies.judges.ideal_motion import configuration as configuration
from studies.judges.ideal_motion import crank_acceleration as crank_acceleration
from studies.judges.ideal_motion import crank_motion, masses, slider_slope
from studies.judges.ideal_motion import slider_position_m as slider_position_m
from studies.judges.kinds import has_closed_form

#: Least number of pieces that a run is cut into, for the truth and for its repeats: from 200 on the energy
#: integral of the library's ideal scenes holds to 5e-14, which is round-off.
PIECES, REPEAT_PIECES = 400, (500, 640)


def _reactions(
    scene: Scene, X: FloatArray, acceleration: FloatArray, load_N: FloatArray | None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return joint forces (n, 3, 2), guide force (n,) and driver torque (n,), slider first.

    ``load_N`` (n,) is the load on the slider, None without one.
    """
    inertial = masses(scene) * acceleration
    inertial[..., 1] += masses(scene)[:, 0] * scene.weight_m_s2  # every force but the joints' moved left
    if load_N is not None:
        inertial[:, 2, 0] -= load_N
    crank, rod, slider = (inertial[:, i] for i in range(3))
    _, link, _ = scene.crank_slider()
    length, d = link.length_m, link.centre_of_mass_m
    s = scene.crank.centre_of_mass_m
    cos, sin = np.cos(X[:, 1, 2]), np.sin(X[:, 1, 2])
    B_x = slider[:, 0]
    A_x = rod[:, 0] + B_x
    # Moments on the rod about its pin A: I phi'' + r x (m a) = r_B x (-F_B).
    moment = rod[:, 2] + d * (cos * rod[:, 1] - sin * rod[:, 0])
    B_y = (length * sin * B_x - moment) / (length * cos)
    A_y = rod[:, 1] + B_y
    O_x, O_y = crank[:, 0] + A_x, crank[:, 1] + A_y
    cos, sin = np.cos(X[:, 0, 2]), np.sin(X[:, 0, 2])
    torque = crank[:, 2] + s * (cos * crank[:, 1] - sin * crank[:, 0])
    torque = torque + scene.crank.length_m * (cos * A_y - sin * A_x)
    joint_force = np.stack([O_x, O_y, A_x, A_y, B_x, B_y], axis=-1).reshape(-1, 3, 2)
    return joint_force, slider[:, 1] - B_y, torque


@lru_cache(maxsize=64)
def exact(scene: Scene, samples: int, pieces: int = PIECES) -> Trajectory:
    """Return the true trajectory of an ideal scene at ``samples + 1`` equally spaced times.

    ``pieces`` is the least number of pieces in which the motion is integrated.

    Raises:
        ValueError: the scene has no closed form, or there are no samples.
        SimulationFailed: the rod folds too fast to be followed.
    """
    require_samples(samples)
    if not has_closed_form(scene):
        raise ValueError(
            f"scene {scene.name}: expected ideal joints and a rod longer than the crank, got others"
        )
    time = np.linspace(0.0, scene.end_time_s, samples + 1)
    motion = crank_motion(scene, time, pieces)
    theta, speed, theta_2 = motion.theta, motion.speed, motion.theta_2
    X, X_1, X_2 = configuration(scene, theta)
    velocity = X_1 * speed[:, None, None]
    acceleration = X_1 * theta_2[:, None, None] + X_2 * (speed**2)[:, None, None]
    x, load = X[:, 2, 0], slider_force(scene)
    load_N = None if load is None else load(theta, x, velocity[:, 2, 0])
    joint_force, guide_force, torque = _reactions(scene, X, acceleration, load_N)
    load_works = load_works_J(scene, theta, x, motion.squares, slider_slope(scene))
    work = motion.motor_work_J
    if scene.drive.kind == "torque":
        work = scene.drive.constant_N_m * (theta - theta[0])
    elif scene.drive.kind == "motor":
        torque = drive_torque(scene)(speed)
    elif scene.speed_is_prescribed:
        m, g = masses(scene), scene.weight_m_s2
        energy = np.sum(m * velocity**2, axis=(1, 2)) / 2 + g * np.sum(m[:, 0] * X[:, :, 1], axis=1)
        work = energy - energy[0] - sum(load_works.values())
    return Trajectory(
        time_s=time,
        position=X,
        velocity=velocity,
        joint_force_N=dict(zip(scene.joints, joint_force.swapaxes(0, 1), strict=True)),
        guide_force_N={"guide": guide_force},
        guide_moment_N_m={"guide": np.zeros(len(time))},
        driver_torque_N_m=None if work is None else torque,
        driver_work_J=work,
        load_work_J=load_works,
        step_s=scene.end_time_s / samples,
        steps=samples,
        solve_time_s=0.0,
    )


def exact_repeats(scene: Scene, samples: int) -> list[Trajectory]:
    """Return the same truth from starts a place off, up and down, by integrations that are cut otherwise."""
    starts = (a_place_off(scene, sign) for sign in (1.0, -1.0))
    return [exact(start, samples, pieces) for start, pieces in zip(starts, REPEAT_PIECES, strict=True)]
