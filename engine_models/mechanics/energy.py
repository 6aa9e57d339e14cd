"""Energies: what a contact stores, a torque's work, and the ledger of a trajectory from it and its scene."""

import math

import numpy as np

from engine_models.engine import FloatArray, Trajectory
from engine_models.mechanics.forces import masses_of
from engine_models.mechanics.states import lever_m
from engine_models.scene.format import Clearance
from engine_models.scene.scene import Scene
from reference_solver.mechanism.contacts import exponent_of as exponent_of
from reference_solver.mechanism.contacts import stiffness_of as stiffness_of
from reference_solver.mechanism.data import GROUND
from reference_solver.mechanism.loads import distance_m, stored_J

#: What lies below these, in parts of what forces do in a radian of the crank and in J, is rounding at rest.
ROUND_OFF, LEAST_J = 1e-6, 1e-9


def elastic_energy_J(clearance: Clearance, penetration: FloatArray) -> FloatArray:
    """Return K delta^(n+1)/(n+1) where delta is positive, else 0, in its shape; 0 between rigid walls."""
    if clearance.law == "rigid":
        return np.zeros_like(penetration)
    return stored_J(stiffness_of(clearance), exponent_of(clearance), penetration)


def kinetic_energy_J(scene: Scene, trajectory: Trajectory) -> FloatArray:
    """Return the kinetic energy of the bodies, (n,)."""
    return np.asarray(np.sum(masses_of(scene.mechanism) * trajectory.velocity**2, axis=(1, 2)) / 2)


def potential_energies_J(scene: Scene, trajectory: Trajectory) -> dict[str, FloatArray]:
    """Return the parts of the potential energy that the scene has, (n,): gravitational, spring, elastic.

    Gravity's is zero at the origin; contacts are elastic.
    """
    of, x = scene.mechanism, trajectory.position
    masses, (gx, gy) = np.array([body.mass_kg for body in of.bodies]), of.gravity_m_s2
    parts = dict[str, FloatArray]()
    if gx or gy:
        parts["gravitational"] = -gy * (x[:, :, 1] @ masses) - gx * (x[:, :, 0] @ masses)
    if of.springs or of.torsions:
        beyond_m = [distance_m(it, x.reshape(len(x), -1)) - it.free_length_m for it in of.springs]
        stored = [it.stiffness_N_m / 2 * far**2 for it, far in zip(of.springs, beyond_m, strict=True)]
        for it in of.torsions:
            angle = x[:, it.body_j, 2] - (x[:, it.body_i, 2] if it.body_i != GROUND else 0.0)
            stored.append(it.stiffness_N_m_rad / 2 * (angle - it.free_angle_rad) ** 2)
        parts["spring"] = np.sum(stored, axis=0)
    if trajectory.contacts:
        parts["elastic"] = np.sum([c.elastic_energy_J for c in trajectory.contacts.values()], axis=0)
    return parts


def potential_energy_J(scene: Scene, trajectory: Trajectory) -> FloatArray:
    """Return the potential energy, (n,)."""
    parts = potential_energies_J(scene, trajectory).values()
    return np.asarray(sum(parts, start=np.zeros(len(trajectory.time_s))))


def numerical_gain_J(scene: Scene, trajectory: Trajectory) -> FloatArray:
    """Return the energy since t = 0 that no physics accounts for, (n,): positive if made, negative if lost.

    Unlike the energy balance residual it holds what stabilisation removed, which is not physics either and
    which most engines do not tell: so it is the same thing for every engine.
    """
    energy = kinetic_energy_J(scene, trajectory) + potential_energy_J(scene, trajectory)
    lost = trajectory.dissipated_energy_J
    gain = energy - energy[0] - trajectory.work_J + (0.0 if lost is None else lost)
    return np.asarray(gain - gain[0])  # an impact at t = 0 has lost energy before the first sample


def energy_balance_residual_J(scene: Scene, trajectory: Trajectory) -> FloatArray:
    """Return the energy gained since t = 0 beyond work done and energy dissipated, (n,): zero if exact."""
    gain, removed = numerical_gain_J(scene, trajectory), trajectory.stabilisation_loss_J
    return gain if removed is None else gain + removed


def unaccounted_part(scene: Scene, trajectory: Trajectory) -> FloatArray:
    """Return the size of the energy that no physics accounts for, in parts of that in play, (n,).

    Wherever an energy is told in percent it is this.
    """
    return np.abs(numerical_gain_J(scene, trajectory)) / energy_in_play_J(scene, trajectory)


def energy_in_play_J(scene: Scene, trajectory: Trajectory) -> float:
    """Return the largest energy in a run as far as it is finite, with a little more for round-off, > 0.

    It is the largest of kinetic energy, potential energy gained or spent, and the works of driver and loads.
    What contacts dissipate is no measure: it begins with nothing.
    """
    kinetic, potential = kinetic_energy_J(scene, trajectory), potential_energy_J(scene, trajectory)
    parts = [kinetic, np.abs(potential - potential[0]), *map(np.abs, trajectory.load_work_J.values())]
    if trajectory.driver_work_J is not None:
        parts.append(np.abs(trajectory.driver_work_J))
    # Of round-off is what weight, joints and driver do in a radian of the crank at most, by their medians.
    of, torque = scene.mechanism, trajectory.driver_torque_N_m
    forces_N = math.hypot(*of.gravity_m_s2) * sum(body.mass_kg for body in of.bodies)
    forces_N += sum(float(np.median(np.hypot(*force.T))) for force in trajectory.joint_force_N.values())
    torque_N_m = 0.0 if torque is None else float(np.median(np.abs(torque)))
    rounding = ROUND_OFF * (forces_N * lever_m(scene) + torque_N_m) + LEAST_J
    return float(np.max(parts, initial=0.0, where=np.isfinite(parts)) + rounding)
